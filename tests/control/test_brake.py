"""Laws of the brake: it starts where the arm is, stays within torque and range, ends at rest."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mitt.control.stop import Brake, plan_brake
from mitt.robot.arm import Arm
from mitt.signals import TICK, Array

START = 0.45
#: Agreement of the start with the state handed in, and of the end with rest.
EXACT = 1e-9
#: Torque on a grid of 1 ms: the planner looks at seven instants, and between them up to 1.07
#: of the limit was measured (300 random states, set ``paper``).
BETWEEN = 1.10
#: Longest stop of a catch [s].
LONGEST = 1.5

seeds = st.integers(0, 2**31)


def catch_state(seed: int) -> Array:
    """Return q, dq, ddq of an arm at a catch, shape (3, 3)."""
    rng = np.random.default_rng(seed)
    q = np.array([rng.uniform(-0.35, 0.35), np.pi / 4 + rng.uniform(-0.3, 0.3), 0.0])
    q[2] = rng.uniform(1.5, 1.7)
    dq = np.array([rng.uniform(-1.5, 1.5), rng.uniform(-6.0, 4.0), rng.uniform(5.0, 18.0)])
    ddq = np.array([rng.uniform(-10, 10), rng.uniform(-40, 40), rng.uniform(-60, 60)])
    return np.array([q, dq, ddq])


def torque_share(arm: Arm, brake: Brake) -> float:
    """Return the largest share of a drive's torque along the brake, each millisecond."""
    rows = [brake.at(t) for t in np.arange(START, START + brake.duration, 1e-3)]
    speeds = [arm.all_joints(row[1]) for row in rows]
    return max(
        float(arm.limits.torque_ratio(arm.torque(*row), dq).max())
        for row, dq in zip(rows, speeds, strict=True)
    )


@settings(max_examples=30)
@given(seed=seeds)
def test_a_brake_takes_over_smoothly_and_ends_at_rest(arm: Arm, seed: int) -> None:
    """Q and dq at the start are the arm's, at the end and ever after the arm rests."""
    motion = catch_state(seed)
    brake = plan_brake(arm, START, motion)
    assert 0.0 < brake.duration < LONGEST
    assert np.allclose(brake.at(START)[:2], motion[:2], atol=EXACT)
    assert np.array_equal(brake.at(START - 1.0), brake.at(START))
    end = brake.at(START + brake.duration)
    assert np.allclose(end[1:], 0.0, atol=1e-6)
    assert np.allclose(brake.at(START + 10.0), end, atol=EXACT)
    assert np.allclose(brake.q_end, end[0], atol=EXACT)


@settings(max_examples=30)
@given(seed=seeds)
def test_a_brake_is_the_integral_of_its_own_rates(arm: Arm, seed: int) -> None:
    """Along the way q changes by dq and dq by ddq: nothing jumps."""
    brake = plan_brake(arm, START, catch_state(seed))
    h = 1e-5
    for share in (0.1, 0.37, 0.62, 0.9):
        t = START + share * brake.duration
        before, now, after = brake.at(t - h), brake.at(t), brake.at(t + h)
        slope = (after - before) / (2.0 * h)
        assert np.allclose(slope[0], now[1], atol=1e-3)
        assert np.allclose(slope[1], now[2], atol=0.02 * (1.0 + np.abs(now[2]).max()))


@settings(max_examples=30)
@given(seed=seeds)
def test_a_brake_stays_within_the_torque_limits(arm: Arm, seed: int) -> None:
    """The stated share is at most 1, and inverse dynamics each millisecond agrees to 10 %."""
    brake = plan_brake(arm, START, catch_state(seed))
    assert brake.torque_share <= 1.0
    assert torque_share(arm, brake) <= BETWEEN


@settings(max_examples=30)
@given(seed=seeds)
def test_a_brake_that_has_room_ends_inside_the_ranges(arm: Arm, seed: int) -> None:
    """Up to 15 rad/s at joint 4 every joint comes to rest before its stop."""
    motion = catch_state(seed)
    motion[1, 2] = min(motion[1, 2], 15.0)
    brake = plan_brake(arm, START, motion)
    assert np.all((brake.q_end >= arm.q_min) & (brake.q_end <= arm.q_max))


@given(seed=seeds)
def test_an_arm_at_rest_brakes_in_no_time(arm: Arm, seed: int) -> None:
    """Without speed there is nothing to do: the arm stays where it is."""
    motion = catch_state(seed)
    motion[1:] = 0.0
    brake = plan_brake(arm, START, motion)
    assert np.allclose(brake.q_end, motion[0], atol=1e-6)


def test_over_comes_after_the_end(arm: Arm) -> None:
    """The brake is over a tick after the arm should rest, not before."""
    brake = plan_brake(arm, START, catch_state(1))
    assert not brake.over(START)
    assert not brake.over(START + brake.duration)
    assert brake.over(START + brake.duration + 0.002)


def test_the_table_of_a_brake_is_the_brake_tick_by_tick(arm: Arm) -> None:
    """Row k is where the brake is k ticks after its start, and the last row is at rest."""
    brake = plan_brake(arm, START, catch_state(3))
    table = brake.table(1e-3)
    for k, row in enumerate(table):
        assert np.array_equal(row, brake.at(START + 1e-3 * k))
    assert np.allclose(table[-1, 1:], 0.0, atol=1e-6)


@settings(max_examples=30)
@given(seed=seeds)
def test_the_planner_reckons_the_share_that_the_limits_say(arm: Arm, seed: int) -> None:
    """Its torque share is that of the arm's limits at the instants it looks at."""
    brake = plan_brake(arm, START, catch_state(seed))
    after = np.linspace(0.0, brake.duration, 7, endpoint=False) + 0.002
    rows = [brake.at(START + min(x, brake.duration)) for x in after]
    shares = [arm.limits.torque_ratio(arm.torque(*row), arm.all_joints(row[1])) for row in rows]
    assert brake.torque_share == pytest.approx(np.max(shares), rel=1e-9)


@pytest.mark.parametrize("seconds", [0.002, 0.05])
@given(seed=seeds)
def test_a_brake_keeps_acceleration_and_jerk(arm: Arm, seconds: float, seed: int) -> None:
    """Tick by tick, from the acceleration of the moment; the end is at rest."""
    most = np.array([15.0, 7.5, 10.0, 12.5])
    limits = replace(arm.limits, acceleration=most, jerk=most / seconds)
    slow = Arm(arm.model, limits)
    rng, active = np.random.default_rng(seed), list(arm.model.active)
    motion = np.array([arm.q_ready, rng.uniform(-1.0, 1.0, 3), rng.uniform(-1.0, 1.0, 3)])
    motion[2] *= most[active]
    rows = plan_brake(slow, START, motion).table(TICK)
    assert np.allclose(rows[0, :2], motion[:2])
    ddq = np.diff(rows[:, 1], axis=0) / TICK
    assert np.all(np.abs(ddq) <= most[active] * (1.0 + 1e-6))
    jerk = np.diff(np.concatenate([motion[2:], ddq]), axis=0) / TICK
    assert np.all(np.abs(jerk) <= most[active] / seconds * (1.0 + 1e-6))
    assert np.array_equal(rows[-1, 1:], np.zeros((2, 3)))
