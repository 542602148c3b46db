"""Limit sets: saturation keeps every drive within its bound, at rest and in motion."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from arm.test_load import urdf
from hypothesis import given
from hypothesis import strategies as st

from mitt.core.arm.arm import Arm, difference, identity_of
from mitt.core.arm.limits import (
    HELD_BACK,
    IN_WORDS,
    LimitSet,
    bound_of,
    joint_level,
    torque_share,
    with_reserve,
)
from mitt.core.errors import InputError, MittError, ModelError, UnknownNameError
from mitt.core.signals import Array
from mitt.io.arm_file import load_arm
from mitt.io.load import build_arm
from mitt.io.wam import wam_limits

vectors = st.lists(st.floats(-500.0, 500.0), min_size=4, max_size=4).map(np.array)
speeds = st.lists(st.floats(-12.0, 12.0), min_size=4, max_size=4).map(np.array)


@pytest.mark.parametrize("name", ["paper", "wam-48v", "wam-80v"])
@given(tau=vectors, dq=speeds)
def test_saturated_torque_is_within_and_torque_within_is_untouched(
    name: str, tau: Array, dq: Array
) -> None:
    """No drive is asked for more than its bound, and what is within passes unchanged."""
    limits = wam_limits(name)
    kept = limits.saturate(tau, dq)
    drive = limits.drive_torque(kept)
    bound = limits.torque_bound(limits.drive_torque(tau), limits.drive_speed(dq))
    assert np.all(np.abs(drive) <= bound + 1e-9)
    assert np.allclose(limits.saturate(kept, dq), kept, atol=1e-9)


@pytest.mark.parametrize("name", ["paper", "wam-48v", "wam-80v"])
@given(drive=st.floats(-50.0, 50.0), speed=st.floats(-250.0, 250.0))
def test_one_drive_is_asked_for_as_much_as_all_and_its_bound_is_where_that_is_1(
    name: str, drive: float, speed: float
) -> None:
    """The kernels say what the formulas say, and the limit lies where torque meets its bound."""
    limits = wam_limits(name)
    tau = limits.transmission.T @ np.full(4, drive)
    dq = np.linalg.solve(limits.transmission, np.full(4, speed))
    shares = limits.torque_ratio(tau, dq)
    for m in range(4):
        bound = bound_of(limits.packed, m, drive, speed, 0.0)
        asked = limits.torque_bound(np.full(4, drive), np.full(4, speed))
        assert bound == pytest.approx(asked[m], abs=1e-12)
        share = torque_share(limits.packed, m, drive, speed)
        assert share == pytest.approx(shares[m], rel=1e-6, abs=1e-9)
        assert (
            share == 1.0
            or abs(drive) == pytest.approx(bound)
            or ((share < 1.0) == (abs(drive) < bound))
        )


def test_beyond_the_no_load_speed_the_share_says_how_far() -> None:
    """It grows in proportion to what the voltage would have to be, and is no more than that."""
    limits = wam_limits("wam-48v")
    tau = limits.transmission.T @ np.array([0.0, 0.0, 0.0, 0.01])
    dq = np.linalg.solve(limits.transmission, np.array([0.0, 0.0, 0.0, 1.1 * limits.dq_max[3]]))
    once, twice = (limits.torque_ratio(k * tau, k * dq)[3] for k in (1.0, 2.0))
    assert twice == pytest.approx(2.0 * once)
    assert 1.1 < once < 1.2
    assert limits.torque_ratio(-tau, dq)[3] < 0.1


def test_a_motor_gives_nothing_at_its_no_load_speed_but_brakes_fully() -> None:
    """At no-load speed the driving torque is 0 and the braking torque is the peak."""
    limits = wam_limits("wam-48v")
    speed = limits.dq_max.copy()
    assert np.allclose(limits.torque_bound(np.ones(4), speed), 0.0)
    assert np.allclose(limits.torque_bound(-np.ones(4), speed), limits.tau_peak)


def test_the_differential_shares_the_torque_of_joint_2_between_two_motors() -> None:
    """A torque at joint 2 alone loads motors 2 and 3 equally."""
    drive = wam_limits("wam-48v").drive_torque(np.array([0.0, 56.5, 0.0, 0.0]))
    assert np.allclose(drive, [0.0, 1.0, -1.0, 0.0])


def test_an_unknown_set_is_refused_by_name() -> None:
    """The message lists what there is."""
    with pytest.raises(UnknownNameError, match="paper, wam-48v, wam-80v"):
        wam_limits("strong")


@pytest.mark.parametrize("bound", ["tau", "speed", "acceleration", "jerk", "torque_rate"])
@pytest.mark.parametrize("bad", [0.0, -1.0, np.nan, -np.inf])
def test_a_bound_that_is_none_is_refused(bound: str, bad: float) -> None:
    """Bounds stand in the denominators of a tick; none but a number above 0 gets there."""
    given = {"tau": np.ones(3), "speed": np.ones(3), bound: np.array([1.0, bad, 1.0])}
    with pytest.raises(InputError, match="wanted numbers above 0"):
        joint_level("wrong", **given)
    fine = joint_level("endless", **(given | {bound: np.array([1.0, np.inf, 1.0])}))
    assert fine.name == "endless"


_NAMES = ["j1", "j2", "j4"]


def _set(joints: tuple[str, ...], **bounds: list[float]) -> LimitSet:
    """Return a set."""
    return LimitSet(name="own", joints=joints, bounds={k: np.array(x) for k, x in bounds.items()})


def test_a_set_goes_before_the_file(tmp_path: Path) -> None:
    """Torque and speed are the set's, the range is the tighter one, what is left out the file's."""
    path = urdf(tmp_path / "a.urdf")
    own = _set(
        ("1", "2", "4"),
        torque=[10.0, 20.0, 40.0],
        lower=[-9.0, -1.0, -1.5],
        upper=[9.0, 9.0, 1.5],
        acceleration=[3.0, 4.0, 5.0],
        jerk=[30.0, 40.0, 50.0],
        torque_rate=[100.0, 200.0, 300.0],
    )
    arm = build_arm(path, tip="l5", joints=_NAMES, limits=own)
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
    arm = build_arm(path, tip="l5", joints=_NAMES, limits=own)
    assert arm.dq_max.tolist() == [1.0, 2.0, 4.0]


def test_another_arms_set_is_refused(tmp_path: Path) -> None:
    """In one line that names both arms' joints; so are joints in another order."""
    path = urdf(tmp_path / "a.urdf")
    for joints in (("a", "b", "c"), ("j1", "j2", "j4", "jay", "j5")):
        with pytest.raises(ModelError, match="an arm with the joints"):
            build_arm(path, tip="l5", joints=_NAMES, limits=_set(joints, speed=[1.0] * len(joints)))
    apart = _set(("j1",), lower=[4.0], upper=[5.0])
    with pytest.raises(ModelError, match="a range that meets"):
        build_arm(path, tip="l5", joints=_NAMES, limits=apart)


def test_a_set_of_a_file_says_whose_its_bounds_are(tmp_path: Path) -> None:
    """By the names of its joints, in any order; by order, with a note, where no name fits."""
    path = urdf(tmp_path / "a.urdf")
    turned = _set(("j4", "j1", "j2"), speed=[3.0, 1.0, 2.0])
    arm = build_arm(path, tip="l5", joints=_NAMES, limits=turned)
    assert dict(zip(arm.names, arm.dq_max, strict=True)) == {"j1": 1.0, "j2": 2.0, "j4": 3.0}
    assert arm.model.notes == ()
    strange = _set(("a", "b", "c", "d", "e"), speed=[1.0, 2.0, 9.0, 3.0, 4.0])
    arm = build_arm(path, tip="l5", joints=_NAMES, limits=strange)
    assert arm.dq_max.tolist() == [1.0, 2.0, 3.0]
    assert "taken in their order" in arm.model.notes[0]


def test_a_set_that_ships_is_for_its_own_arm(tmp_path: Path) -> None:
    """By the names of joints; by order, with a note, where names tell nothing; else refused."""
    path = urdf(tmp_path / "a.urdf")
    five = LimitSet(
        name="own", joints=("a1", "b", "c", "d", "e"), shipped=True, bounds={"speed": np.ones(5)}
    )
    arm = build_arm(path, tip="l5", joints=_NAMES, limits=five)
    assert arm.dq_max.tolist() == [1.0, 1.0, 1.0]
    assert "taken in their order" in arm.model.notes[0]
    path.write_text(path.read_text().replace('name="j', 'name="robot_j'))
    names = [f"robot_{x}" for x in _NAMES]
    with pytest.raises(ModelError, match="an arm with the joints"):
        build_arm(path, tip="l5", joints=names, limits=five)
    ends = LimitSet(
        name="own", joints=("j1", "j2", "j4"), shipped=True, bounds={"speed": np.ones(3)}
    )
    assert build_arm(path, tip="l5", joints=names, limits=ends).model.notes == ()
    assert build_arm(path, tip="l5", joints=names, limits=replace(five, shipped=False)).n == 3


def test_a_set_that_allows_more_than_the_file_is_noted(tmp_path: Path) -> None:
    """By kind, with both numbers; less, and what differs by rounding, is not."""
    path = urdf(tmp_path / "a.urdf")
    own = _set(("1", "2", "4"), torque=[50.01, 60.0, 40.0], speed=[5.0, 4.0, 4.0])
    (note,) = build_arm(path, tip="l5", joints=_NAMES, limits=own).model.notes
    assert "more torque than the file states: j2 60 instead of 50" in note


def test_a_set_supplies_what_the_file_leaves_out(tmp_path: Path) -> None:
    """A file without limits and a set with them make an arm."""
    path = urdf(tmp_path / "a.urdf")
    stated = '<limit lower="-2" upper="2.5" effort="50" velocity="5"/>'
    path.write_text(path.read_text().replace(stated, ""))
    five = ("1", "2", "3", "4", "5")
    bounds = {"torque": [50.0] * 5, "speed": [5.0] * 5, "lower": [-2.0] * 5, "upper": [2.0] * 5}
    arm = build_arm(path, tip="l5", joints=_NAMES, limits=_set(five, **bounds))
    assert arm.q_max.tolist() == [2.0, 2.0, 2.0]
    assert arm.model.notes == ()


@pytest.mark.parametrize("name", IN_WORDS)
def test_each_bound_tells_arms_apart_in_its_words(name: str) -> None:
    """A map that was learned with another one is another map."""
    arm, n = load_arm("wam", limits="wam-80v"), 4
    given = vars(arm.limits)[name]
    changed: dict[str, Any] = {name: np.full(n, 5.0) if given is None else 2.0 * given}
    other = replace(arm.limits, **changed)
    said = difference(identity_of(arm), identity_of(Arm(arm.model, other)))
    assert said is not None
    assert f"its {IN_WORDS[name]}" in said


def test_a_reserve_is_a_share_of_what_drives_give() -> None:
    """Of nothing else."""
    limits = wam_limits("wam-80v")
    less = with_reserve(limits, 0.25)
    for name in IN_WORDS:
        share = 0.75 if name in HELD_BACK else 1.0
        if vars(limits)[name] is not None:
            assert np.allclose(vars(less)[name], share * vars(limits)[name])


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
