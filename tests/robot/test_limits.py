"""Limit sets: saturation keeps every drive within its bound, at rest and in motion."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mitt.errors import InputError, UnknownNameError
from mitt.robot.limits import bound_of, joint_level, torque_share
from mitt.robot.wam import wam_limits
from mitt.signals import Array

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
