"""Arms by name: each description says what its vendor publishes, and is one that mitt can use."""

from dataclasses import dataclass
from itertools import combinations
from pathlib import Path
from sysconfig import get_paths

import numpy as np
import pinocchio as pin
import pytest
from defusedxml import ElementTree

import mitt
from mitt.core.arm.arm import Arm
from mitt.core.arm.hands import HandModel
from mitt.core.arm.shapes import Surroundings, gap, place_shapes, shapes_of
from mitt.core.errors import ModelError, UnknownNameError
from mitt.core.signals import Array
from mitt.io.arm_file import ArmFile, load_arm, read_arm_file, read_limits, write_arm_file
from mitt.io.load import arm_names, build_arm, described, read_described
from mitt.io.reading import shipped
from mitt.lab.design.driven_arm import whole_arm

NAMES = shipped("arms")
_ROBOTS = Path(get_paths()["purelib"]) / "cmeel.prefix/share/example-robot-data/robots"
#: Largest distance between two descriptions of one arm [m].
_SAME = 1e-6
#: The same where the other description rounds right angles to 1.5708 [m].
_ROUNDED = 1e-5
#: Most of random poses in which two links that are no neighbours may touch.
_OFTEN = 0.2
_HALF = np.pi / 2.0


@dataclass(frozen=True, slots=True, kw_only=True)
class _Published:
    """What a vendor publishes of an arm.

    Attributes:
        mass: Weight by the data sheet [kg].
        beside: Links that the data sheet does not weigh.
        craig: Whether the rows are Craig's (alpha and a before the joint) or the classical ones.
        rows: Denavit-Hartenberg rows a [m], alpha [rad], d [m], theta at 0 [rad].
        base: Frame of the first row in the base, by its alpha and theta [rad].
        flange: Frame of the flange behind the last row, by its alpha and theta [rad].
    """

    mass: float
    rows: tuple[tuple[float, float, float, float], ...]
    beside: tuple[str, ...] = ()
    craig: bool = False
    base: tuple[float, float] = (0.0, 0.0)
    flange: tuple[float, float] = (0.0, 0.0)


# Franka: "Control Interface Specification and Robot Limits", Denavit-Hartenberg parameters.
_FRANKA = (
    (0.0, 0.0, 0.333, 0.0),
    (0.0, -_HALF, 0.0, 0.0),
    (0.0, _HALF, 0.316, 0.0),
    (0.0825, _HALF, 0.0, 0.0),
    (-0.0825, -_HALF, 0.384, 0.0),
    (0.0, _HALF, 0.0, 0.0),
    (0.088, _HALF, 0.107, 0.0),
)


def _ur(
    d_1: float, a_2: float, a_3: float, d_4: float, d_5: float, d_6: float, mass: float
) -> _Published:
    """Return an arm of Universal Robots: the article "DH Parameters for calculations of ..."."""
    rows = (
        (0.0, _HALF, d_1, 0.0),
        (a_2, 0.0, 0.0, 0.0),
        (a_3, 0.0, 0.0, 0.0),
        (0.0, _HALF, d_4, 0.0),
        (0.0, -_HALF, d_5, 0.0),
        (0.0, 0.0, d_6, 0.0),
    )
    return _Published(mass=mass, rows=rows, base=(0.0, np.pi))


def _kuka(d_1: float, d_3: float, mass: float) -> _Published:
    """Return an iiwa: distances of the axes by the data sheet; the twists as in its frames."""
    alpha = (-_HALF, _HALF, _HALF, -_HALF, -_HALF, _HALF, 0.0)
    d = (d_1, 0.0, d_3, 0.0, 0.4, 0.0, 0.126)
    return _Published(
        mass=mass, rows=tuple((0.0, x, y, 0.0) for x, y in zip(alpha, d, strict=True))
    )


PUBLISHED = {
    "franka-panda": _Published(mass=18.0, rows=_FRANKA, craig=True),
    "franka-fr3": _Published(mass=17.8, rows=_FRANKA, craig=True),
    "ur5e": _ur(0.1625, -0.425, -0.3922, 0.1333, 0.0997, 0.0996, mass=20.6),
    "ur10e": _ur(0.1807, -0.6127, -0.57155, 0.17415, 0.11985, 0.11655, mass=33.5),
    "kuka-iiwa7": _kuka(0.34, 0.4, mass=23.9),
    "kuka-iiwa14": _kuka(0.36, 0.42, mass=29.9),
    # Gen3 user guide, classical parameters of the arm with 7 joints; lengths with the digits of the
    # description: the guide rounds to 0.1 mm, and the offset of joint 6 to 0.
    "kinova-gen3": _Published(
        mass=8.2,
        rows=(
            (0.0, _HALF, -(0.15643 + 0.12838), 0.0), (0.0, _HALF, -(0.005375 + 0.006375), np.pi),
            (0.0, _HALF, -2.0 * 0.21038, np.pi), (0.0, _HALF, -2.0 * 0.006375, np.pi),
            (0.0, _HALF, -(0.20843 + 0.10593), np.pi), (0.0, _HALF, -2.0 * 0.00017505, np.pi),
            (0.0, np.pi, -(0.10593 + 0.061525), np.pi),
        ),
        base=(np.pi, 0.0),
    ),
    # UFACTORY: "Kinematic and Dynamic Parameters of UFACTORY xArm Series", modified parameters.
    "xarm7": _Published(
        mass=13.7,
        rows=(
            (0.0, 0.0, 0.267, 0.0), (0.0, -_HALF, 0.0, 0.0), (0.0, _HALF, 0.293, 0.0),
            (0.0525, _HALF, 0.0, 0.0), (0.0775, _HALF, 0.3425, 0.0), (0.0, _HALF, 0.0, 0.0),
            (0.076, -_HALF, 0.097, 0.0),
        ),
        craig=True,
    ),
    # Sawyer: link lengths 81, 192.5, 400, 168.5, 400 and 136.3 mm, the last one to the flange of
    # sawyer_description; its joint 6 has its 0 turned by 10 degrees.
    "sawyer": _Published(
        mass=19.0,
        beside=("head",),
        rows=(
            (0.081, -_HALF, 0.317, 0.0), (0.0, _HALF, 0.1925, _HALF), (0.0, _HALF, 0.4, np.pi),
            (0.0, _HALF, -0.1685, np.pi), (0.0, _HALF, 0.4, np.pi), (0.0, _HALF, 0.1363, np.pi),
            (0.0, 0.0, 0.1345, -0.17453),
        ),
        flange=(0.0, -_HALF),
    ),
}  # fmt: skip


def _about_z(angle: float, d: float) -> Array:
    """Return the frame turned by an angle [rad] about z and moved along it [m], shape (4, 4)."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s, 0.0, 0.0], [s, c, 0.0, 0.0], [0.0, 0.0, 1.0, d], [0.0, 0.0, 0.0, 1.0]])


def _about_x(angle: float, a: float) -> Array:
    """Return the frame turned by an angle [rad] about x and moved along it [m], shape (4, 4)."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[1.0, 0.0, 0.0, a], [0.0, c, -s, 0.0], [0.0, s, c, 0.0], [0.0, 0.0, 0.0, 1.0]])


def _by_rows(of: _Published, q: Array) -> Array:
    """Return the flange by Denavit-Hartenberg rows, shape (4, 4)."""
    T = _about_z(of.base[1], 0.0) @ _about_x(of.base[0], 0.0)
    for (a, alpha, d, theta), angle in zip(of.rows, q, strict=True):
        x, z = _about_x(alpha, a), _about_z(theta + angle, d)
        T = T @ (x @ z if of.craig else z @ x)
    return np.asarray(T @ _about_x(of.flange[0], 0.0) @ _about_z(of.flange[1], 0.0))


def _poses(arm: Arm, count: int = 50) -> Array:
    """Return random poses within the ranges [rad], shape (count, n)."""
    return np.random.default_rng(1).uniform(arm.q_min, arm.q_max, (count, arm.n))


def _flange(arm: Arm, q: Array) -> Array:
    """Return the flange at a pose, shape (4, 4), by the links of the model."""
    T = arm.model.mount
    for link, angle in zip(arm.model.links, q, strict=True):
        turned = np.eye(4)
        turned[:3, :3] = pin.exp3(link.axis * angle)
        T = T @ link.placement @ turned
    return np.asarray(T @ arm.model.tool)


def test_what_ships_is_what_is_published_here() -> None:
    """Nine arms and the WAM; each names its sources and what is estimated, and has limits."""
    assert set(NAMES) == set(PUBLISHED)
    assert arm_names() == ("wam", *NAMES)
    assert set(NAMES) <= set(shipped("limits"))
    for name in NAMES:
        head = described(name).read_text().partition("-->")[0]
        for word in ("Flange: ", "Frames", "Collision: ", "Estimated: ", "Left out: "):
            assert word in head, (name, word)


@pytest.mark.parametrize("name", NAMES)
def test_the_flange_is_where_the_published_rows_put_it(name: str) -> None:
    """Place and orientation, by parameters that the vendor gives beside its description."""
    arm = load_arm(name, hand="none")
    for q in _poses(arm):
        assert np.allclose(_flange(arm, q), _by_rows(PUBLISHED[name], q), atol=_SAME)
        assert np.allclose(arm.position(q), _flange(arm, q)[:3, 3], atol=1e-12)


@pytest.mark.parametrize(
    ("name", "other", "tip", "within"),
    [
        ("franka-panda", "panda_description/urdf/panda.urdf", "panda_link8", _SAME),
        ("xarm7", "xarm_description/urdf/xarm7.urdf", "link7", _ROUNDED),
    ],
)
def test_the_flange_is_where_another_description_puts_it(
    name: str, other: str, tip: str, within: float
) -> None:
    """That of example-robot-data, by Pinocchio."""
    arm = load_arm(name, hand="none")
    model = pin.buildModelFromUrdf(str(_ROBOTS / other))
    data, at = model.createData(), model.getFrameId(tip, pin.FrameType.BODY)
    for q in _poses(arm):
        values = pin.neutral(model)
        values[: arm.n] = q
        pin.framesForwardKinematics(model, data, values)
        assert np.allclose(arm.position(q), data.oMf[at].translation, atol=within)


@pytest.mark.parametrize("name", NAMES)
def test_links_are_bodies_that_weigh_what_the_data_sheet_says(name: str) -> None:
    """Within 2 %; each has the principal moments of a body, none mended."""
    arm, of = load_arm(name, hand="none"), PUBLISHED[name]
    parts = read_described(described(name)).tree.parts
    weighed = [x for x in parts if x.kind == "link" and x.name not in of.beside]
    assert sum(x.mass for x in weighed) == pytest.approx(of.mass, rel=0.02)
    for part in (x for x in parts if x.mass):
        moments = np.linalg.eigvalsh(part.inertia)
        assert moments[0] > 0.0, part.name
        assert moments[2] < moments[0] + moments[1], part.name
    assert arm.model.notes == ()


@pytest.mark.parametrize("name", NAMES)
def test_file_and_limit_set_agree(name: str) -> None:
    """In ranges, efforts and velocities; the set is that of the arm's name, `model` is the file."""
    own, stated = (load_arm(name, hand="none", limits=x) for x in (None, "model"))
    assert own.limits.name == name
    assert np.array_equal(own.q_min, stated.q_min)
    bounds = read_limits(name).fitted(own.names)
    for k, joint in enumerate(own.names):
        assert own.q_min[k] < own.q_max[k]
        assert bounds["lower"][joint] == pytest.approx(stated.q_min[k], abs=1e-6)
        assert bounds["upper"][joint] == pytest.approx(stated.q_max[k], abs=1e-6)
        assert bounds["torque"][joint] == pytest.approx(stated.limits.tau_peak[k])
        assert bounds["speed"][joint] == pytest.approx(stated.limits.dq_max[k], abs=1e-6)
    assert own.limits.force == read_limits(name).force


@pytest.mark.parametrize("name", NAMES)
def test_shapes_are_capsules_as_they_are_written(name: str) -> None:
    """One to four a link, balls among them, each with radius and length of the file."""
    arm = load_arm(name, hand="none")
    root = ElementTree.parse(described(name)).getroot()
    solids = root.findall("link/collision/geometry/*")
    assert {x.tag for x in solids} <= {"capsule", "sphere"}
    shapes = [*arm.model.base_capsules, *(x for link in arm.model.links for x in link.capsules)]
    written = sorted((float(x.get("radius", "")), float(x.get("length", "0"))) for x in solids)
    read = sorted((x.radius, float(np.linalg.norm(np.subtract(x.end, x.start)))) for x in shapes)
    assert np.allclose(read, written, atol=1e-8)
    assert len(arm.model.base_capsules) == 1
    assert all(1 <= len(link.capsules) <= 4 for link in arm.model.links)


@pytest.mark.parametrize("name", NAMES)
def test_links_that_are_no_neighbours_keep_apart_in_most_poses(name: str) -> None:
    """In at least 80 % of 200 poses within the ranges, each pair of them."""
    arm = load_arm(name, hand="none")
    shapes = shapes_of(arm, Surroundings())
    table, ends = shapes.table, shapes.ends
    link = table["link"]
    pairs = [(a, b) for a, b in combinations(range(1, len(table)), 2) if link[b] - link[a] > 1]
    touching = np.zeros(len(pairs))
    for q in _poses(arm, 200):
        place_shapes(arm.bodies, q, table, ends)
        touching += [gap(table, ends, a, b) <= 0.0 for a, b in pairs]
    assert touching.max() <= _OFTEN * 200
    assert len(shapes.pairs) > 0.8 * len(pairs)


def test_an_arm_by_name_is_taken_wherever_a_file_is() -> None:
    """All joints and the flange, a hand by its plate; tip, joints and limits may be said."""
    arm = mitt.load_arm("ur5e", hand="none")
    assert arm.model.name == "ur5e"
    assert arm.names[-1] == "wrist_3_joint"
    palm = mitt.load_arm("ur5e", hand="three-finger")
    hand = palm.model.hand
    assert hand is not None
    q = palm.q_ready
    away = palm.position(q) - arm.position(q)
    assert np.linalg.norm(away) == pytest.approx(hand.catch_offset, abs=1e-9)
    some = mitt.load_arm(
        "ur5e",
        joints=["shoulder_pan_joint", "elbow_joint", "wrist_1_joint"],
        tip="wrist_3_link",
        limits="ur10e",
    )
    assert some.n == 3
    assert some.limits.name == "ur10e"


def test_a_design_takes_an_arm_by_name() -> None:
    """Its driven joints, flange and limits are those of the name."""
    whole = whole_arm("franka-fr3", tip=None, limits=None, hand=HandModel())
    assert whole.n == 7
    assert whole.limits.name == "franka-fr3"
    assert whole.limits.acceleration is not None


def test_an_arm_file_takes_an_arm_by_name(tmp_path: Path) -> None:
    """It is read as it was written; the plate of its hand is at the flange."""
    path = tmp_path / "mine.toml"
    joints = ("shoulder_lift_joint", "elbow_joint", "wrist_1_joint")
    write_arm_file(path, ArmFile(arm="ur5e", joints=joints, held={"wrist_2_joint": 1.5}))
    file = read_arm_file(path)
    assert file.arm == "ur5e"
    assert file.hand_mount is None
    arm = file.load()
    assert arm.names == joints
    assert arm.limits.name == "ur5e"
    by_name = load_arm("ur5e", joints=joints, held={"wrist_2_joint": 1.5}, hand="three-finger")
    assert np.allclose(arm.position(arm.q_ready), by_name.position(by_name.q_ready), atol=1e-12)


def test_a_name_that_is_none_says_which_there_are() -> None:
    """And which may be meant."""
    with pytest.raises(UnknownNameError, match="did you mean 'ur5e'") as caught:
        load_arm("ur5")
    assert set(arm_names()) <= set(caught.value.available)
    with pytest.raises(ModelError, match="no tip: it is fixed"):
        build_arm("wam", tip="palm")
