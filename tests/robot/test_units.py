"""Degrees where radians are wanted: a limit set is refused, a file's speed is doubted."""

from pathlib import Path

import numpy as np
import pytest
from robot.test_load import urdf

from mitt.errors import ModelError
from mitt.robot.limit_sets import LimitSet
from mitt.robot.load import load_arm

_NAMES = ["j1", "j2", "j4"]


def _set(**bounds: float) -> LimitSet:
    """Return a set with the same bounds for all five joints of test_load's arm."""
    joints = tuple(f"j{k}" for k in range(1, 6))
    return LimitSet(name="own", joints=joints,
                    bounds={k: np.full(5, x) for k, x in bounds.items()})  # fmt: skip


@pytest.mark.parametrize(
    ("bounds", "wanted"),
    [
        ({"lower": -170.0, "upper": 170.0}, "within"),
        ({"lower": 10.0, "upper": 170.0}, "within"),  # and not "a range that meets the file's"
        ({"speed": 180.0}, r"write radians, 3\.142"),
    ],
)
def test_a_limit_set_in_degrees_is_refused(
    tmp_path: Path, bounds: dict[str, float], wanted: str
) -> None:
    """One line that names set, joint and degrees, though the file has ranges and speeds itself."""
    path = urdf(tmp_path / "a.urdf")
    with pytest.raises(ModelError, match=wanted) as caught:
        load_arm(path, tip="l5", joints=_NAMES, limits=_set(**bounds))
    text = str(caught.value)
    assert "limits own of joint 'j1'" in text
    assert "degrees" in text
    assert "\n" not in text


def test_a_sliding_joint_has_metres(tmp_path: Path) -> None:
    """Its numbers say nothing of degrees."""
    path = urdf(tmp_path / "a.urdf", kind="prismatic")
    own = LimitSet(name="own", joints=("j2",), bounds={"speed": np.array([180.0])})
    arm = load_arm(path, tip="l5", joints=_NAMES, limits=own)
    assert arm.dq_max.tolist() == [5.0, 180.0, 5.0]
    assert not any("degrees" in x for x in arm.model.notes)


@pytest.mark.parametrize(("speed", "doubted"), [("19", False), ("30", True), ("180", True)])
def test_a_large_speed_of_a_file_is_doubted(tmp_path: Path, speed: str, doubted: bool) -> None:
    """The note names the joints that move, two of them at most, and says what it would be."""
    path = urdf(tmp_path / "a.urdf")
    path.write_text(path.read_text().replace('velocity="5"', f'velocity="{speed}"'))
    notes = load_arm(path, tip="l5", joints=_NAMES).model.notes
    assert len(notes) == doubted
    for note in notes:
        assert f"j1 {speed} rad/s, j2 {speed} rad/s and 1 more" in note
        assert f"degrees, write radians (j1 {np.radians(float(speed)):.4g})" in note


def test_a_set_settles_the_doubt(tmp_path: Path) -> None:
    """It goes before the speeds of the file."""
    path = urdf(tmp_path / "a.urdf")
    path.write_text(path.read_text().replace('velocity="5"', 'velocity="180"'))
    arm = load_arm(path, tip="l5", joints=_NAMES, limits=_set(speed=3.0))
    assert arm.model.notes == ()
