"""What is left out of a design follows from the arm and its limits; the throws do not."""

from dataclasses import replace
from pathlib import Path
from sysconfig import get_paths

import numpy as np
import pytest

from mitt.core.arm.arm import Arm
from mitt.core.arm.hands import HandModel
from mitt.core.errors import MittError
from mitt.core.map.map_design import (
    MapDesign,
    default_design,
    nominal_catch,
    tangent_of,
    warnings_of,
)
from mitt.io.load import build_arm


def test_the_paper_s_arm_has_the_paper_s_design(arm: Arm) -> None:
    """Elbow at 90 degrees, the ball's velocity matched, degree 4."""
    assert default_design(arm) == MapDesign()


@pytest.mark.parametrize("limits", ["wam-48v", "wam-80v"])
def test_an_arm_slower_than_the_ball_lets_it_in_along_the_palm_s_normal(limits: str) -> None:
    """A chosen design has an inward line, what is stated replaces it, another joint drops it."""
    arm = build_arm("wam", limits=limits)
    chosen = default_design(arm)
    assert chosen.inward > 0.0
    stated = default_design(arm, q_catch=1.1, inward=0.0, kappa=3.0, order=3)
    assert stated == MapDesign(q_catch=1.1, inward=0.0, kappa=3.0, order=3)
    assert default_design(arm, catch_joint=1).inward == 0.0


def test_a_catch_angle_that_is_stated_goes_with_no_other_joint(arm: Arm) -> None:
    """Beside a design with a slope: the angle that a user names is the angle at the catch."""
    base = MapDesign(q_catch=0.4, slope=(0.0, 1.0), match_weight=2.0)
    arm = Arm(replace(arm.model, design=base), arm.limits)
    assert default_design(arm).slope == (0.0, 1.0)
    stated = default_design(arm, q_catch=1.2)
    assert (stated.q_catch, stated.slope, stated.match_weight) == (1.2, (0.0, 0.0), 2.0)


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("slope", (1.0,)),
        ("slope", (np.nan, 0.0)),
        ("slope", "ab"),
        ("slope", (1e308, 1e308)),
        ("slope", (1e3, 0.0)),
        ("match_weight", -1.0),
        ("match_weight", np.inf),
        ("match_weight", "much"),
        ("q_catch", 9.0),
    ],
)
def test_a_slope_or_a_weight_that_cannot_be_is_named(arm: Arm, field: str, value: object) -> None:
    """In one line, when the design is made or when an arm is to have it."""
    with pytest.raises(MittError, match=field):
        tangent_of(arm, MapDesign(**{"slope": (0.1, 0.2), field: value}))  # type: ignore[arg-type]


def test_throws_are_the_same_for_every_limit_set(arm: Arm) -> None:
    """The nominal catch depends on the arm alone."""
    for limits in ("wam-48v", "wam-80v"):
        other = build_arm("wam", limits=limits)
        assert np.array_equal(nominal_catch(other), nominal_catch(arm))


LINK = """<link name="l{k}"><inertial><origin xyz="0 0 0.2"/><mass value="2"/>
<inertia ixx="0.02" iyy="0.02" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial></link>"""
JOINT = """<joint name="j{k}" type="revolute"><parent link="l{p}"/><child link="l{k}"/>
<origin xyz="0 0 {up}"/><axis xyz="{axis}"/>
<limit lower="-2" upper="2" effort="80" velocity="5"/></joint>"""


@pytest.mark.parametrize("elbow", ["0 1 0", "0 -1 0"])
def test_an_elbow_is_bent_towards_the_thrower_whichever_way_it_turns(
    tmp_path: Path, elbow: str
) -> None:
    """An arm whose elbow turns the other way is thrown at in front of its base all the same."""
    parts = [LINK.format(k=k) for k in range(5)]
    axes = ("0 0 1", "0 1 0", elbow)
    parts += [JOINT.format(k=k, p=k - 1, up=0.4, axis=a) for k, a in enumerate(axes, start=1)]
    tip = '<joint name="j4" type="fixed"><parent link="l3"/><child link="l4"/>'
    parts.append(tip + '<origin xyz="0 0 0.4"/></joint>')
    path = tmp_path / "arm.urdf"
    path.write_text(f'<robot name="three">{"".join(parts)}</robot>')
    arm = build_arm(path, tip="l4", joints=["j1", "j2", "j3"])
    q = nominal_catch(arm)
    assert abs(q[2]) == pytest.approx(np.pi / 2)
    assert arm.position(q)[0] > 0.3
    assert default_design(arm).q_catch == q[2]


_ROBOTS = Path(get_paths()["purelib"]) / "cmeel.prefix/share/example-robot-data/robots"
_PANDA = ["panda_joint1", "panda_joint2", "panda_joint4"]


def panda(**given: object) -> Arm:
    """Return a Panda of joints 1, 2 and 4."""
    return build_arm(
        _ROBOTS / "panda_description/urdf/panda.urdf",
        tip="panda_hand_tcp",
        joints=_PANDA,
        hand=HandModel(),
        **given,  # type: ignore[arg-type]
    )


@pytest.mark.parametrize("limits", ["paper", "wam-48v", "wam-80v"])
def test_the_wam_makes_sense(limits: str) -> None:
    """No warning."""
    assert warnings_of(build_arm("wam", limits=limits)) == ()


def test_a_palm_that_faces_away_is_told() -> None:
    """A Panda as it comes; with joint 6 held at half a turn its palm faces the balls."""
    assert any("palm faces away" in x for x in warnings_of(panda()))
    turned = panda(held={"panda_joint6": 3.1416}, ready=(0.0, 0.5, -0.9))
    design = MapDesign(q_catch=-0.8, inward=-8.0)
    assert not any("palm" in x for x in warnings_of(turned, design))


def test_a_heavy_ready_pose_is_told() -> None:
    """With its share, that of the torque that gravity takes."""
    arm = panda(ready=(0.0, 1.5, -0.3))
    still = np.zeros(3)
    share = np.abs(arm.inverse_dynamics(arm.q_ready, still, still)[1]) / arm.tau_max[1]
    assert share > 0.5
    said = [x for x in warnings_of(arm) if "panda_joint2" in x and "at rest" in x]
    assert len(said) == 1
    assert f"{100.0 * share:.0f} %" in said[0]


def test_a_ready_pose_without_room_is_told() -> None:
    """Within a twentieth of the end of a range; outside it is refused."""
    arm = build_arm("wam")
    for angle, words in ((3.0, "near the end"), (2.5, "")):
        q_ready = np.array([0.0, np.pi / 4, angle])
        said = warnings_of(Arm(replace(arm.model, q_ready=q_ready), arm.limits))
        about = [x for x in said if "'j4'" in x]
        assert [words in x for x in about] == ([True] if words else [])
