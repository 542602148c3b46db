"""Limit sets: fitted to an arm by name or order, or refused in one line."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from robot.test_load import urdf

from mitt.errors import MittError, ModelError
from mitt.robot.limit_sets import LimitSet
from mitt.robot.load import load_arm

_NAMES = ["j1", "j2", "j4"]


def _set(joints: tuple[str, ...], **bounds: list[float]) -> LimitSet:
    """Return a set."""
    return LimitSet(name="own", joints=joints, bounds={k: np.array(x) for k, x in bounds.items()})


def test_a_set_goes_before_the_file(tmp_path: Path) -> None:
    """Torque and speed are the set's, the range is the tighter one, what is left out the file's."""
    path = urdf(tmp_path / "a.urdf")
    own = _set(("1", "2", "4"), torque=[10.0, 20.0, 40.0], lower=[-9.0, -1.0, -1.5],
               upper=[9.0, 9.0, 1.5], acceleration=[3.0, 4.0, 5.0], jerk=[30.0, 40.0, 50.0],
               torque_rate=[100.0, 200.0, 300.0])  # fmt: skip
    arm = load_arm(path, tip="l5", joints=_NAMES, limits=own)
    assert arm.limits.name == "own"
    assert arm.tau_max.tolist() == [10.0, 20.0, 40.0]
    assert arm.dq_max.tolist() == [5.0, 5.0, 5.0]
    assert arm.q_min.tolist() == [-2.0, -1.0, -1.5]
    assert arm.q_max.tolist() == [2.5, 2.5, 1.5]
    for bound, wanted in (
        (arm.limits.acceleration, [3.0, 4.0, 5.0]),
        (arm.limits.jerk, [30.0, 40.0, 50.0]),
        (arm.limits.torque_rate, [100.0, 200.0, 300.0]),
    ):
        assert bound is not None
        assert arm.active(bound).tolist() == wanted
        assert np.isinf(bound[[2, 4]]).all()  # joints that the set does not name


def test_a_set_fits_by_order_too(tmp_path: Path) -> None:
    """As many joints as between base and tip, whatever they are called."""
    path = urdf(tmp_path / "a.urdf")
    own = _set(("a", "b", "c", "d", "e"), speed=[1.0, 2.0, 3.0, 4.0, 5.0])
    arm = load_arm(path, tip="l5", joints=_NAMES, limits=own)
    assert arm.dq_max.tolist() == [1.0, 2.0, 4.0]


def test_another_arms_set_is_refused(tmp_path: Path) -> None:
    """In one line that names both arms' joints; so are joints in another order."""
    path = urdf(tmp_path / "a.urdf")
    for joints in (("a", "b", "c"), ("j1", "j2", "j4", "jay", "j5")):
        with pytest.raises(ModelError, match="an arm with the joints"):
            load_arm(path, tip="l5", joints=_NAMES, limits=_set(joints, speed=[1.0] * len(joints)))
    apart = _set(("j1",), lower=[4.0], upper=[5.0])
    with pytest.raises(ModelError, match="a range that meets"):
        load_arm(path, tip="l5", joints=_NAMES, limits=apart)


def test_a_set_of_a_file_says_whose_its_bounds_are(tmp_path: Path) -> None:
    """By the names of its joints, in any order; by order, with a note, where no name fits."""
    path = urdf(tmp_path / "a.urdf")
    turned = _set(("j4", "j1", "j2"), speed=[3.0, 1.0, 2.0])
    arm = load_arm(path, tip="l5", joints=_NAMES, limits=turned)
    assert dict(zip(arm.names, arm.dq_max, strict=True)) == {"j1": 1.0, "j2": 2.0, "j4": 3.0}
    assert arm.model.notes == ()
    strange = _set(("a", "b", "c", "d", "e"), speed=[1.0, 2.0, 9.0, 3.0, 4.0])
    arm = load_arm(path, tip="l5", joints=_NAMES, limits=strange)
    assert arm.dq_max.tolist() == [1.0, 2.0, 3.0]
    assert "taken in their order" in arm.model.notes[0]


def test_a_set_that_ships_is_for_its_own_arm(tmp_path: Path) -> None:
    """By the names of joints; by order, with a note, where names tell nothing; else refused."""
    path = urdf(tmp_path / "a.urdf")
    five = LimitSet(name="own", joints=("a1", "b", "c", "d", "e"), shipped=True,
                    bounds={"speed": np.ones(5)})  # fmt: skip
    arm = load_arm(path, tip="l5", joints=_NAMES, limits=five)
    assert arm.dq_max.tolist() == [1.0, 1.0, 1.0]
    assert "taken in their order" in arm.model.notes[0]
    path.write_text(path.read_text().replace('name="j', 'name="robot_j'))
    names = [f"robot_{x}" for x in _NAMES]
    with pytest.raises(ModelError, match="an arm with the joints"):
        load_arm(path, tip="l5", joints=names, limits=five)
    ends = LimitSet(name="own", joints=("j1", "j2", "j4"), shipped=True,
                    bounds={"speed": np.ones(3)})  # fmt: skip
    assert load_arm(path, tip="l5", joints=names, limits=ends).model.notes == ()
    assert load_arm(path, tip="l5", joints=names, limits=replace(five, shipped=False)).n == 3


def test_a_set_that_allows_more_than_the_file_is_noted(tmp_path: Path) -> None:
    """By kind, with both numbers; less, and what differs by rounding, is not."""
    path = urdf(tmp_path / "a.urdf")
    own = _set(("1", "2", "4"), torque=[50.01, 60.0, 40.0], speed=[5.0, 4.0, 4.0])
    (note,) = load_arm(path, tip="l5", joints=_NAMES, limits=own).model.notes
    assert "more torque than the file states: j2 60 instead of 50" in note


def test_a_set_supplies_what_the_file_leaves_out(tmp_path: Path) -> None:
    """A file without limits and a set with them make an arm."""
    path = urdf(tmp_path / "a.urdf")
    stated = '<limit lower="-2" upper="2.5" effort="50" velocity="5"/>'
    path.write_text(path.read_text().replace(stated, ""))
    five = ("1", "2", "3", "4", "5")
    bounds = {"torque": [50.0] * 5, "speed": [5.0] * 5, "lower": [-2.0] * 5, "upper": [2.0] * 5}
    arm = load_arm(path, tip="l5", joints=_NAMES, limits=_set(five, **bounds))
    assert arm.q_max.tolist() == [2.0, 2.0, 2.0]
    assert arm.model.notes == ()


@pytest.mark.parametrize(
    "bounds",
    [
        {"speed": [1.0, -1.0]},
        {"speed": [1.0]},
        {"speed": [1.0, float("nan")]},
        {"lower": [0.0, 0.0]},
        {"lower": [0.0, 1.0], "upper": [1.0, 0.0]},
        {"power": [1.0, 1.0]},
    ],
)
def test_bounds_that_no_joint_has_are_refused(bounds: dict[str, list[float]]) -> None:
    """Each in one line."""
    with pytest.raises(MittError):
        _set(("a", "b"), **bounds)
