"""Laws of stops: in closed form they are Ruckig's, brakes end at rest, drives can make them."""

from dataclasses import replace
from pathlib import Path
from sysconfig import get_paths

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from ruckig import ControlInterface, InputParameter, Ruckig, Synchronization, Trajectory
from stages import SafetyFilter

from mitt.core.arm.arm import Arm
from mitt.core.arm.hands import HandModel
from mitt.core.arm.shapes import Surroundings
from mitt.core.control.envelope import LONGEST as LONGEST_TICKS
from mitt.core.control.envelope import stop_in_ticks
from mitt.core.control.stop import (
    EASIEST,
    HARDEST,
    ONSET,
    SHARE,
    Brake,
    braking,
    choose_stop,
    hardest,
    lay,
    mass_work,
    plan_brake,
    sample,
    share_of_brake,
    stop_scratch,
)
from mitt.core.control.stop import short_of_room as is_short
from mitt.core.control.viability import BLOCKED, PASSED
from mitt.core.kernels import Record
from mitt.core.signals import TICK, Array
from mitt.io.load import build_arm

#: Agreement with Ruckig [rad, rad/s, rad/s^2].
EXACT = 1e-9
#: Gap to the end of a range that counts as near [rad], of :mod:`mitt.core.control.stop`.
NEAR = 0.45

seeds = st.integers(0, 2**31)


def any_state(seed: int) -> tuple[Array, Array]:
    """Return q, dq, ddq of an arm that moves anyhow, shape (3, 3), and decelerations, (3,)."""
    rng = np.random.default_rng(seed)
    speed = 10.0 ** rng.uniform(-3.0, 1.3, 3) * rng.choice([-1.0, 1.0], 3)
    motion = np.array([rng.uniform(-1.5, 1.5, 3), speed, rng.uniform(-90.0, 90.0, 3)])
    return motion, 10.0 ** rng.uniform(0.0, 2.3, 3)


def ruckigs(motion: Array, rate: Array) -> Trajectory:
    """Return Ruckig's stop at decelerations."""
    request, trajectory = InputParameter(3), Trajectory(3)
    request.control_interface = ControlInterface.Velocity
    request.synchronization = Synchronization.No
    request.current_position, request.current_velocity = motion[:2].tolist()
    request.current_acceleration = [
        braking(*x) for x in zip(motion[1], motion[2], rate, strict=True)
    ]
    request.target_velocity = [0.0] * 3
    request.max_acceleration, request.max_jerk = rate.tolist(), (rate / ONSET).tolist()
    Ruckig(3).calculate(request, trajectory)
    return trajectory


def short_of_room(arm: Arm, motion: Array) -> bool:
    """Ask the kernel with buffers of its own."""
    most = np.array([arm.tau_max, arm.q_min, arm.q_max])
    return bool(is_short(arm.tables, most, motion, mass_work(arm)))


@settings(max_examples=200)
@given(seed=seeds)
def test_a_stop_in_closed_form_is_ruckigs(arm: Arm, seed: int) -> None:
    """Q, dq and ddq agree along the way, and at rest."""
    motion, rate = any_state(seed)
    w, theirs = stop_scratch(arm), ruckigs(motion, rate)
    w.rate[:] = rate
    end = lay(motion, w)
    times, ours = np.linspace(0.0, end, 9), np.empty((9, 3, 3))
    sample(w.pieces, times, ours)
    for row, t in zip(ours, times, strict=True):
        rows = np.array(theirs.at_time(min(t, theirs.duration)))
        # In an edge of the acceleration a rounding of the time is one of the jerk times it.
        assert np.allclose(row[:2], rows[:2], atol=EXACT)
        assert np.allclose(row[2], rows[2], atol=EXACT * rate.max() / ONSET)
    assert np.allclose(ours[-1, 1:], 0.0, atol=EXACT * rate.max() / ONSET)


@settings(max_examples=50)
@given(seed=seeds)
def test_the_pieces_of_a_brake_are_ruckigs(arm: Arm, seed: int) -> None:
    """A brake, from a state that brakes harder than allowed as well, is what Ruckig says of it."""
    motion, _ = any_state(seed)
    brake = plan_brake(arm, 0.0, motion)
    rates = np.abs(brake.pieces[:, :, 4]).max(axis=1) * ONSET
    theirs = ruckigs(motion, rates)
    assert brake.duration == pytest.approx(theirs.duration, abs=EXACT)
    for t in np.linspace(0.0, brake.duration, 9)[:-1]:
        assert np.allclose(brake.at(t)[:2], theirs.at_time(t)[:2], atol=EXACT)


@settings(max_examples=50)
@given(seed=seeds, others=st.sampled_from([0.15, 0.4, 0.8, 1.2]), urgent=st.integers(0, 2))
def test_the_hardest_stop_leaves_no_room(arm: Arm, seed: int, others: float, urgent: int) -> None:
    """It keeps the share of torque, and one that is a step of the search harder does not."""
    motion, _ = any_state(seed)
    rate, w = arm.tau_max / np.diag(arm.mass_matrix(motion[0])), stop_scratch(arm)
    share = hardest(arm.tables, motion, rate, urgent, others, w)
    found = w.rate[urgent] / rate[urgent]
    if found > 0.2 + EXACT:
        assert share <= SHARE
    if found < 1.55:
        w.rate[urgent] = (found + 1.4 / 32) * rate[urgent]
        lay(motion, w)
        assert share_of_brake(arm.tables, w, np.inf) > SHARE


@settings(max_examples=100)
@given(seed=seeds)
def test_room_is_short_where_a_joint_alone_would_stop_near_its_end(arm: Arm, seed: int) -> None:
    """By Pinocchio's mass matrix, and constant deceleration at the full torque."""
    motion, _ = any_state(seed)
    way = 0.5 * motion[1] * np.abs(motion[1]) * np.diag(arm.mass_matrix(motion[0])) / arm.tau_max
    end = motion[0] + way
    near = (end > arm.q_max - NEAR) | (end < arm.q_min + NEAR)
    assert short_of_room(arm, motion) == np.any(near)


@given(seed=seeds)
def test_room_shrinks_with_speed(arm: Arm, seed: int) -> None:
    """A joint that is short of room at some speed towards a stop is so at every higher one."""
    motion, _ = any_state(seed)
    motion[0], motion[1, :2] = (0.0, np.pi / 4, 1.6), 0.0
    speeds = np.linspace(0.0, 25.0, 26)
    short = []
    for speed in speeds:
        motion[1, 2] = speed
        short.append(short_of_room(arm, motion))
    assert short == sorted(short)
    assert not short[0]
    assert short[-1]


START = 0.45
#: What the planner's looks leave between them, of the limit: it aims at 0.98.
BETWEEN = 1.0
#: Longest stop of a catch [s].
LONGEST = 1.5


def catch_state(seed: int) -> Array:
    """Return q, dq, ddq of an arm at a catch, shape (3, 3)."""
    rng = np.random.default_rng(seed)
    q = np.array([rng.uniform(-0.35, 0.35), np.pi / 4 + rng.uniform(-0.3, 0.3), 0.0])
    q[2] = rng.uniform(1.5, 1.7)
    dq = np.array([rng.uniform(-1.5, 1.5), rng.uniform(-6.0, 4.0), rng.uniform(5.0, 18.0)])
    ddq = np.array([rng.uniform(-10, 10), rng.uniform(-40, 40), rng.uniform(-60, 60)])
    return np.array([q, dq, ddq])


def torque_share(arm: Arm, brake: Brake) -> float:
    """Return the largest share of a drive's torque along the brake.

    Each millisecond, and beside the beginnings of its pieces.
    """
    starts = START + np.unique(brake.pieces[:, :, 0])
    even = np.arange(START, START + brake.duration, 1e-3)
    rows = [brake.at(t) for t in np.concatenate([even, starts, starts - 1e-6])]
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
    """Inverse dynamics all along the way agree with what is stated, which is within them."""
    brake = plan_brake(arm, START, catch_state(seed))
    found = torque_share(arm, brake)
    assert brake.torque_share <= SHARE
    assert brake.torque_share * (1.0 - 1e-9) <= found <= BETWEEN


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


PANDA = "cmeel.prefix/share/example-robot-data/robots/panda_description/urdf/panda.urdf"
#: What instants between those that are looked at may take more, and feedback has left.
BETWEEN_RATES = 1.03


@pytest.fixture(scope="module")
def panda() -> Arm:
    """A Panda that stretches out over joints 1, 2 and 4: gravity takes most of joint 2."""
    joints = [f"panda_joint{k}" for k in (1, 2, 4, 6)]
    path = Path(get_paths()["purelib"]) / PANDA
    arm = build_arm(path, tip="panda_hand_tcp", joints=joints, hand=HandModel())
    links = [replace(x, held=3.1416) if x.name == joints[3] else x for x in arm.model.links]
    ready = np.array([0.0, 0.785, -0.3])
    return Arm(replace(arm.model, links=tuple(links), q_ready=ready), arm.limits)


def stop_of(
    arm: Arm, safety_filter: SafetyFilter, motion: Array, first: int = EASIEST
) -> tuple[float, Array]:
    """Return the share of torque and the decelerations of the stop that is found."""
    s = safety_filter.safety
    share = choose_stop(arm.tables, s.loaded, s.bounds, motion, first, s.stop)
    return float(share), s.stop.rates.copy()


@pytest.mark.parametrize("speed", [5e-324, 1e-300, 1e-200, 1e-20])
def test_the_slowest_speeds_there_are_have_a_stop(arm: Arm, speed: float) -> None:
    """Their squares are 0: a stop is found all the same, and wishes at them are answered."""
    found = SafetyFilter(arm, Surroundings())
    motion = np.array([arm.q_ready, np.full(arm.n, speed), np.zeros(arm.n)])
    still = np.array([arm.q_ready, np.zeros(arm.n), np.zeros(arm.n)])
    for first in (EASIEST, HARDEST):
        share, rates = stop_of(arm, found, motion, first)
        assert share <= SHARE
        assert np.all(rates > 0.0)
    wishes = (np.full((3, arm.n), speed), motion, still)
    for wish in wishes:
        found.begin(arm.q_ready, np.full(arm.n, speed))
        found.step(wish.copy())
        assert np.all(np.isfinite(found.last))


def shares(arm: Arm, motion: Array, rates: Array) -> Array:
    """Return the torque of a stop, as shares of the drives' bounds; Pinocchio.

    At 60 instants, and just before and after each joint comes to rest.
    """
    q, dq = motion[0], motion[1]
    rests = np.abs(dq) / rates
    even = np.linspace(0.0, 0.9999 * float(np.max(rests)), 60)
    t = np.concatenate([even, rests * (1.0 - 1e-9), rests * (1.0 + 1e-9)])[:, None]
    passed = np.minimum(t, np.abs(dq) / rates)
    qs = q + np.sign(dq) * passed * (np.abs(dq) - 0.5 * rates * passed)
    dqs = np.sign(dq) * np.maximum(np.abs(dq) - rates * t, 0.0)
    ddqs = np.where(np.abs(dqs) > 0.0, -np.sign(dq) * rates, 0.0)
    out = []
    for a, b, c in zip(qs, dqs, ddqs, strict=True):
        # M(q) ddq + n(q, dq), the mass matrix by Pinocchio's composite rigid bodies
        bias = arm.torque(a, b, np.zeros(arm.n))
        tau = bias + arm.torque_derivatives(a, b, c)[2] @ c
        out.append(arm.limits.torque_ratio(tau, arm.all_joints(b)).max())
    return np.array(out)


@settings(max_examples=30)
@given(seed=seeds, hard=st.booleans())
@example(seed=10000, hard=True)  # a joint that comes to rest between two of the equal steps
@example(seed=269, hard=True)
def test_a_stop_that_is_found_takes_what_is_said_of_it(arm: Arm, seed: int, hard: bool) -> None:
    """Against another implementation, between the instants that were looked at as well."""
    safety_filter, rng = SafetyFilter(arm, Surroundings()), np.random.default_rng(seed)
    b = safety_filter.bounds
    q = rng.uniform(b["q_min"], b["q_max"])
    room = np.minimum(q - b["q_min"], b["q_max"] - q)
    dq = rng.uniform(-1.0, 1.0, arm.n) * np.minimum(b["dq_max"], np.sqrt(b["deceleration"] * room))
    motion = np.array([q, dq, np.zeros(arm.n)])
    share, rates = stop_of(arm, safety_filter, motion, HARDEST if hard else EASIEST)
    found = shares(arm, motion, rates)
    assert np.all(rates > 0.0)
    assert np.all(rates <= b["deceleration"] * (1.0 + 1e-12))
    ends = q + 0.5 * dq * np.abs(dq) / rates
    assert np.all(ends >= b["q_min"] - 1e-9)
    assert np.all(ends <= b["q_max"] + 1e-9)
    assert found.max() >= share * (1.0 - 1e-2) - 1e-9
    assert found.max() <= BETWEEN_RATES * max(share, SHARE) + 0.1 * share


@pytest.mark.thorough
def test_a_panda_is_not_let_into_a_motion_that_it_cannot_stop(panda: Arm) -> None:
    """Stretched out and driven down as fast as may be: it stops in its range, by its torques.

    With the deceleration of the ready pose alone, 21 rad/s^2, the envelope let joint 2 move on at
    full speed where 1.3 rad/s^2 were left, and the arm ran into the end of its range.
    """
    safety_filter, blocked, worst = SafetyFilter(panda, Surroundings()), 0, 0.0
    safety_filter.begin(np.array([0.0, 0.6, -0.3]), np.zeros(3))
    for _ in range(900):
        q = safety_filter.last[0] + TICK * np.array([0.0, 2.0, 0.0])
        blocked += safety_filter.step(np.array([q, [0.0, 2.0, 0.0], np.zeros(3)])) == BLOCKED
        if safety_filter.last[1].any():
            _, rates = stop_of(panda, safety_filter, safety_filter.last)
            worst = max(worst, float(shares(panda, safety_filter.last, rates).max()))
    assert blocked > 20
    assert worst < 1.0
    assert panda.q_max[1] - 0.1 < safety_filter.last[0, 1] < panda.q_max[1]


def smooth_shares(arm: Arm, b: Record, motion: Array) -> Array:
    """Return the torque of the stop of the envelope, each tick, as shares of the drives' bounds."""
    rows = np.empty((LONGEST_TICKS, 3, arm.n))
    ticks = stop_in_ticks(b, motion, rows)
    out = [0.0]
    for q, dq, ddq in rows[1 : ticks + 1]:
        out.append(arm.limits.torque_ratio(arm.torque(q, dq, ddq), arm.all_joints(dq)).max())
    return np.array(out)


@settings(max_examples=3)
@given(seed=seeds)
@example(seed=1)
def test_a_stop_with_jerk_is_one_that_the_drives_can_make(panda: Arm, seed: int) -> None:
    """Of whatever is emitted, tick by tick; a mild stop, which is not made, does not count."""
    rng = np.random.default_rng(seed)
    most = panda.all_joints(rng.uniform(5.0, 15.0, panda.n))
    limits = replace(panda.limits, acceleration=np.maximum(most, 1.0), jerk=np.full(7, 400.0))
    arm = Arm(panda.model, limits)
    safety_filter, worst = SafetyFilter(arm, Surroundings()), 0.0
    safety_filter.begin(np.array([0.0, rng.uniform(-0.5, 0.6), -0.3]), np.zeros(3))
    wish = rng.uniform(0.5, 1.0, 3) * np.array([rng.choice([-1.0, 1.0]), 1.0, 1.0])
    for k in range(300):
        dq = wish * arm.dq_max
        safety_filter.step(np.array([safety_filter.last[0] + TICK * dq, dq, np.zeros(3)]))
        if k % 15 == 0:
            rows = smooth_shares(arm, safety_filter.bounds, safety_filter.last)
            worst = max(worst, float(rows.max()))
    assert worst < 1.0


def test_where_there_is_room_a_wish_passes(panda: Arm) -> None:
    """A slow motion that the drives can stop at any time is not touched."""
    safety_filter = SafetyFilter(panda, Surroundings())
    for k in range(200):
        t = TICK * k
        q = panda.q_ready + 0.05 * (1.0 - np.cos(4.0 * t))
        wanted = np.array([q, np.full(3, 0.2 * np.sin(4.0 * t)), np.full(3, 0.8 * np.cos(4.0 * t))])
        before = wanted.copy()
        assert safety_filter.step(wanted) == PASSED
        assert np.array_equal(wanted, before)


def test_from_a_motion_that_it_should_not_have_the_arm_gets_out(panda: Arm) -> None:
    """Begun where no stop is possible, it brakes as gently as it must and comes to rest."""
    safety_filter = SafetyFilter(panda, Surroundings())
    safety_filter.begin(np.array([0.0, 1.4, -0.3]), np.array([0.0, 2.1, -1.0]))
    speeds = []
    for _ in range(2000):
        safety_filter.step(np.array([safety_filter.last[0], np.full(3, 1.0), np.zeros(3)]) + 0.0)
        speeds.append(float(np.abs(safety_filter.last[1]).max()))
    assert speeds[20] < 2.1
    assert panda.q_max[1] >= safety_filter.last[0, 1]
