"""URDF files as they come: what has no meaning is mended, what cannot be is refused in one line."""

from functools import cache
from itertools import pairwise
from pathlib import Path
from sysconfig import get_paths
from xml.etree.ElementTree import Element

import numpy as np
import pinocchio as pin
import pytest
from arm.test_load import urdf
from defusedxml import ElementTree
from support import thorough

from mitt.core.arm.hands import HandModel
from mitt.core.errors import FileError, MittError, ModelError
from mitt.core.signals import Array
from mitt.io import load
from mitt.io.load import build_arm
from mitt.io.urdf import read_urdf

_ROBOTS = Path(get_paths()["purelib"]) / "cmeel.prefix/share/example-robot-data/robots"
_NAMES = ["j1", "j2", "j4"]

#: Files whose longest chain cannot be used, and what the one line says.
_REFUSED = {
    "double_pendulum.urdf": "effort limit",
    "double_pendulum_continuous.urdf": "effort limit",
    "double_pendulum_simple.urdf": "effort limit",
    "human.urdf": "a mass above 0",  # three hinges at the shoulder, no body between them
    "iris.urdf": "effort limit",
    "iris_simple.urdf": "tip and joints",  # no joint that moves
    "quadrotor_base.urdf": "tip and joints",
    "quadruped.urdf": "a range",
    "romeo_small.urdf": "principal moments",
    "ur3.urdf": "a URDF arm",  # an empty file
}
#: Files of robots of which another file is here: less of it, other hands or limits, or boxes.
_AGAIN = {
    "alex_nub_hands.urdf",
    "alex_sake_hands.urdf",
    "allegro_left_hand.urdf",
    "double_pendulum_simple.urdf",
    "g1_29dof_rev_1_0.urdf",
    "icub_reduced.urdf",
    "panda_collision.urdf",
    "simple_humanoid_classical.urdf",
    "talos_full_v2_box.urdf",
    "talos_reduced.urdf",
    "talos_reduced_box.urdf",
    "talos_reduced_corrected.urdf",
    "tiago.urdf",
    "ur3_joint_limited_robot.urdf",
    "ur3_robot.urdf",
    "ur5_joint_limited_robot.urdf",
    "ur5_robot.urdf",
    "ur10_joint_limited_robot.urdf",
}
_FILES = sorted(path for path in _ROBOTS.rglob("*.urdf") if path.name not in _AGAIN)


def _longest(root: Element) -> tuple[str, list[str]]:
    """Return the link behind the most joints that move, and these joints."""
    above: dict[str, tuple[Element, str]] = {}
    for joint in root.findall("joint"):
        parent, child = joint.find("parent"), joint.find("child")
        if parent is not None and child is not None:
            above[child.get("link", "")] = joint, parent.get("link", "")
    best: tuple[str, list[str]] = ("", [])
    for name in [link.get("name", "") for link in root.findall("link")]:
        at, chain = name, list[str]()
        while at in above:
            joint, at = above[at]
            if joint.get("type") != "fixed" and joint.find("mimic") is None:
                chain.append(joint.get("name", ""))
        best = (name, chain[::-1]) if len(chain) >= len(best[1]) else best
    return best


def _by_pinocchio(path: Path, q: dict[str, float], tip: str) -> Array:
    """Return where Pinocchio puts a link of a file [m], shape (3,)."""
    model = pin.buildModelFromUrdf(str(path))
    values = pin.neutral(model)
    for name, joint in list(zip(model.names, model.joints, strict=True))[1:]:
        if joint.nv == 1:  # a continuous joint by cosine and sine
            both = [np.cos(q[name]), np.sin(q[name])]
            values[joint.idx_q : joint.idx_q + joint.nq] = q[name] if joint.nq == 1 else both
    data = model.createData()
    pin.framesForwardKinematics(model, data, values)
    at = model.getFrameId(tip, pin.FrameType.BODY)
    return np.array(data.oMf[at].translation)


@pytest.mark.parametrize(
    "path", thorough(_FILES[::4], [x for k, x in enumerate(_FILES) if k % 4]), ids=lambda p: p.name
)
def test_every_arm_of_example_robot_data_loads(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Its longest chain is an arm whose catch point is where Pinocchio puts the tip."""
    read = cache(read_urdf)  # its meshes once
    monkeypatch.setitem(load._READERS, ".urdf", read)
    tip, chain = _longest(ElementTree.parse(path).getroot())
    joints = chain[:3] if len(chain) < 7 else chain[-6:-3]
    if path.name in _REFUSED:
        with pytest.raises(MittError, match=_REFUSED[path.name]) as caught:
            build_arm(path, tip=tip or "tip", joints=joints)
        assert "\n" not in str(caught.value)
        return
    arm = build_arm(path, tip=tip, joints=joints, hand=HandModel())
    held = {x.name: x.held for x in arm.model.links if x.held is not None}
    q = read(path).neutral(held | dict(zip(arm.names, arm.q_ready.tolist(), strict=True)))
    assert np.allclose(arm.position(arm.q_ready), _by_pinocchio(path, q, tip), atol=1e-9)
    for link in arm.model.links:
        if link.held is not None:
            assert link.q_min <= link.held <= link.q_max
    assert np.isfinite(arm.torque(arm.q_ready, np.zeros(arm.n), np.zeros(arm.n))).all()


def _changed(path: Path, *changes: tuple[str, str]) -> Path:
    """Write the five-joint arm of test_load with changes."""
    text = urdf(path).read_text()
    for before, after in changes:
        assert before in text
        text = text.replace(before, after)
    path.write_text(text)
    return path


def test_an_axis_of_a_fixed_joint_has_no_meaning(tmp_path: Path) -> None:
    """Zeros there are what some exporters write."""
    path = _changed(
        tmp_path / "a.urdf",
        ('name="j5" type="revolute"', 'name="j5" type="fixed"'),
        ("0.6 0 0.8", "0 0 0"),
    )
    assert build_arm(path, tip="l5", joints=_NAMES).names == ("j1", "j2", "j4")


def test_a_continuous_joint_turns_once_about_zero(tmp_path: Path) -> None:
    """Its range is -pi to pi, whatever ends the file writes beside it."""
    arm = build_arm(urdf(tmp_path / "a.urdf", kind="continuous"), tip="l5", joints=_NAMES)
    assert arm.q_min[1] == -np.pi
    assert arm.q_max[1] == np.pi


def test_a_mimic_joint_stays_where_the_other_takes_it(tmp_path: Path) -> None:
    """It is no active joint, and follows none; it is held at twice the held one's angle."""
    mimic = '<mimic joint="j5" multiplier="2.0" offset="0.1"/></joint><joint name="j4"'
    path = _changed(tmp_path / "a.urdf", ('</joint><joint name="j4"', mimic))
    arm = build_arm(path, tip="l5", joints=_NAMES, held={"j5": 0.3})
    assert {x.name: x.held for x in arm.model.links}["j3"] == pytest.approx(0.7)
    with pytest.raises(ModelError, match="mimics 'j5'"):
        build_arm(path, tip="l5", joints=["j1", "j3", "j4"])
    with pytest.raises(ModelError, match="do not follow"):
        build_arm(path, tip="l5", joints=["j1", "j4", "j5"])


def test_a_joint_called_like_a_link_is_told_apart(tmp_path: Path) -> None:
    """The tip is the link."""
    plain = build_arm(urdf(tmp_path / "a.urdf"), tip="l5", joints=_NAMES)
    path = _changed(tmp_path / "b.urdf", ('name="j3"', 'name="l5"'))
    named = build_arm(path, tip="l5", joints=_NAMES)
    q = np.array([0.3, -0.2, 0.5])
    assert np.allclose(named.position(q), plain.position(q), atol=1e-12)


@pytest.mark.parametrize(
    ("before", "after", "wanted"),
    [
        ('<child link="l3"/>', '<child link="l9"/>', "a link of the file as its child"),
        ('<child link="l3"/>', '<child link="l2"/>', "without closed chains"),
        ('<link name="l0">', '<link name="other"/><link name="l0">', "one root link"),
        ('name="j3" type="revolute"', 'name="j3" type="planar"', "one axis"),
        ('name="j1" type="revolute"', 'name="j1" type="floating"', "one axis"),
        ('lower="-2" upper="2.5"', 'lower="-115" upper="143"', "degrees"),
        ('lower="-2" upper="2.5"', 'lower="low" upper="2.5"', "a number for lower"),
        ('lower="-2" upper="2.5" ', "", "a range"),
        (' velocity="5"', "", "velocity limit.*<limit> velocity of 'j1' .*speed in a limits file"),
        ('velocity="5"', 'velocity="0"', "velocity limit.*<limit> velocity of 'j1'"),
        (' effort="50"', "", "effort limit.*<limit> effort of 'j1' .*torque in a limits file"),
        (' effort="50" velocity="5"', "", "effort limit above 0 and a velocity limit"),
        ('<limit lower="-2" upper="2.5" effort="50" velocity="5"/>', "", "a range"),
    ],
)
def test_what_cannot_be_is_refused_with_the_remedy(
    tmp_path: Path, before: str, after: str, wanted: str
) -> None:
    """Two roots, closed chains, other joints, degrees, missing limits: one line each."""
    path = _changed(tmp_path / "a.urdf", (before, after))
    with pytest.raises(MittError, match=wanted) as caught:
        build_arm(path, tip="l5", joints=_NAMES)
    assert "\n" not in str(caught.value)
    assert ";" in str(caught.value) or isinstance(caught.value, FileError)


def test_limits_are_asked_for_where_they_are_needed(tmp_path: Path) -> None:
    """A held joint without a torque is locked, and the notes name it."""
    text = urdf(tmp_path / "a.urdf").read_text()
    joints = text.split("<joint ")
    joints[3] = joints[3].replace(' effort="50"', "")
    path = tmp_path / "b.urdf"
    path.write_text("<joint ".join(joints))
    arm = build_arm(path, tip="l5", joints=_NAMES)
    assert [x.name for x in arm.model.links] == ["j1", "j2", "j4", "j5"]
    assert len(arm.model.notes) == 1
    assert "held joint 'j3': no torque known" in arm.model.notes[0]
    assert "<limit> effort of 'j3' in the file, or torque in a limits file" in arm.model.notes[0]
    whole = build_arm(urdf(tmp_path / "a.urdf"), tip="l5", joints=_NAMES)
    for q in np.random.default_rng(1).uniform(-1.0, 1.0, (5, 3)):
        zero = np.zeros(3)
        assert np.allclose(arm.inverse_dynamics(q, zero, q), whole.inverse_dynamics(q, zero, q))
    with pytest.raises(ModelError, match="'j3'"):
        build_arm(path, tip="l5", joints=["j1", "j2", "j3"])


def test_held_angles_and_ready_pose(tmp_path: Path) -> None:
    """Joints stay where they are held; the ready pose goes by name, in any order."""
    path = urdf(tmp_path / "a.urdf")
    held = {"j3": 0.4, "j5": -0.7}
    arm = build_arm(path, tip="l5", joints=["j4", "j1", "j2"], held=held, ready=[0.3, 0.1, 0.2])
    assert arm.names == ("j1", "j2", "j4")
    assert arm.q_ready.tolist() == [0.1, 0.2, 0.3]
    full = pin.buildModelFromUrdf(str(path))
    data = full.createData()
    pin.framesForwardKinematics(full, data, np.array([0.1, 0.2, 0.4, 0.3, -0.7]))
    expected = data.oMf[full.getFrameId("l5")].translation
    assert np.allclose(arm.position(arm.q_ready), expected, atol=1e-12)
    for wrong in ({"j1": 0.1}, {"j3": 9.0}, {"jx": 0.0}, {"j3": float("nan")}):
        with pytest.raises(MittError):
            build_arm(path, tip="l5", joints=_NAMES, held=wrong)
    for ready in ([0.1, 0.2], [0.1, 0.2, float("inf")]):
        with pytest.raises(MittError):
            build_arm(path, tip="l5", joints=_NAMES, ready=ready)


def test_a_held_joint_is_moved_into_its_range(tmp_path: Path) -> None:
    """Zero outside the range becomes the end that is nearest."""
    text = urdf(tmp_path / "a.urdf").read_text().split("<joint ")
    text[5] = text[5].replace('lower="-2"', 'lower="0.5"')
    path = tmp_path / "b.urdf"
    path.write_text("<joint ".join(text))
    arm = build_arm(path, tip="l5", joints=_NAMES)
    assert [x.held for x in arm.model.links] == [None, None, 0.0, None, 0.5]


def test_the_hand_turns_about_the_palm(tmp_path: Path) -> None:
    """Catch point and palm stay where they are; the fingers turn."""
    path = urdf(tmp_path / "a.urdf")
    turns = (0.0, 0.4, 1.0)
    arms = [build_arm(path, tip="l5", joints=_NAMES, hand=HandModel(), hand_turn=x) for x in turns]
    q = np.array([0.2, 0.3, -0.4])
    for first, second in pairwise(arms):
        assert np.allclose(first.position(q), second.position(q), atol=1e-12)
        R, S = first.orientation(q), second.orientation(q)
        assert np.allclose(R[:, 2], S[:, 2], atol=1e-12)
    angle = arms[0].orientation(q).T @ arms[1].orientation(q)
    assert np.arctan2(angle[1, 0], angle[0, 0]) == pytest.approx(0.4)


_DRIVE = """<transmission name="t"><joint name="j2"/><actuator name="m">
<drake:gear_ratio value="50"/><drake:rotor_inertia value="2e-5"/></actuator></transmission>
</robot>"""


def test_a_rotor_is_read_as_drake_reads_it(tmp_path: Path) -> None:
    """Its inertia by the square of the gear ratio is the joint's armature; others have none."""
    path = _changed(
        tmp_path / "a.urdf",
        ("</robot>", _DRIVE),
        ("<robot ", '<robot xmlns:drake="http://drake.mit.edu" '),
    )
    arm, bare = build_arm(path, tip="l5", joints=_NAMES), read_urdf(urdf(tmp_path / "b.urdf"))
    assert [x.armature for x in arm.model.links] == [0.0, pytest.approx(0.05), 0.0, 0.0, 0.0]
    assert all(part.armature == 0.0 for part in bare.tree.parts)


@pytest.mark.parametrize("value", ["", "two", "nan", "-1e-5"])
def test_a_rotor_that_cannot_be_is_refused(tmp_path: Path, value: str) -> None:
    """In one line that says which number is wrong."""
    path = _changed(
        tmp_path / "a.urdf",
        ("</robot>", _DRIVE.replace("2e-5", value)),
        ("<robot ", '<robot xmlns:drake="http://drake.mit.edu" '),
    )
    with pytest.raises(MittError, match=r"rotor_inertia|armature"):
        build_arm(path, tip="l5", joints=_NAMES)


@pytest.mark.parametrize(
    ("value", "said"),
    [("two", "gear_ratio"), ("nan", "gear_ratio"), ("inf", "gear_ratio"), ("1e300", "larger ones")],
)
def test_a_gear_that_cannot_be_is_refused(tmp_path: Path, value: str, said: str) -> None:
    """Also one whose square is no number any more."""
    path = _changed(
        tmp_path / "a.urdf",
        ("</robot>", _DRIVE.replace('"50"', f'"{value}"')),
        ("<robot ", '<robot xmlns:drake="http://drake.mit.edu" '),
    )
    with pytest.raises(MittError, match=said):
        build_arm(path, tip="l5", joints=_NAMES)
