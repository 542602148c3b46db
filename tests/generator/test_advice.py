"""Warnings: of what makes no sense, and of nothing else."""

from dataclasses import replace
from pathlib import Path
from sysconfig import get_paths

import numpy as np
import pytest

from mitt.generator.map_design import MapDesign, warnings_of
from mitt.robot.arm import Arm
from mitt.robot.hands import HandModel
from mitt.robot.load import load_arm

_ROBOTS = Path(get_paths()["purelib"]) / "cmeel.prefix/share/example-robot-data/robots"
_PANDA = ["panda_joint1", "panda_joint2", "panda_joint4"]


def panda(**given: object) -> Arm:
    """Return a Panda of joints 1, 2 and 4."""
    return load_arm(_ROBOTS / "panda_description/urdf/panda.urdf", tip="panda_hand_tcp",
                    joints=_PANDA, hand=HandModel(), **given)  # type: ignore[arg-type] # fmt: skip


@pytest.mark.parametrize("limits", ["paper", "wam-48v", "wam-80v"])
def test_the_wam_makes_sense(limits: str) -> None:
    """No warning."""
    assert warnings_of(load_arm("wam", limits=limits)) == ()


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
    arm = load_arm("wam")
    for angle, words in ((3.0, "near the end"), (2.5, "")):
        q_ready = np.array([0.0, np.pi / 4, angle])
        said = warnings_of(Arm(replace(arm.model, q_ready=q_ready), arm.limits))
        about = [x for x in said if "'j4'" in x]
        assert [words in x for x in about] == ([True] if words else [])


def test_notes_of_the_import_come_first() -> None:
    """As they stand on the arm."""
    arm = load_arm("wam")
    noted = Arm(replace(arm.model, notes=("a note",)), arm.limits)
    assert warnings_of(noted)[0] == "a note"
