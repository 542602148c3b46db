"""Laws of the guard: whatever is asked, the arm can stop clear of everything, tick after tick."""

from dataclasses import replace

import numpy as np
import pytest
from exact_plant import ExactPlant
from hypothesis import example, given, settings
from hypothesis import strategies as st
from stages import SafetyFilter, Tracker
from support import thorough

from mitt.core.arm.arm import Arm
from mitt.core.arm.description import Capsule
from mitt.core.arm.shapes import MARGIN, Surroundings, clearance
from mitt.core.control.envelope import slow_down
from mitt.core.control.stop import SHARE
from mitt.core.control.viability import BLOCKED, PASSED
from mitt.core.signals import TICK, ArmState, Array

ROUNDING = 1e-9
#: What a stop may take of a drive: between the instants that are looked at a little more.
BETWEEN = 1.06 * SHARE
#: A pillar that the arm runs into when it turns from its ready pose.
PILLAR = Capsule(start=(0.5, 0.75, -0.5), end=(0.5, 0.75, 1.2), radius=0.1)
AROUND = Surroundings(floor=-0.5, zones=(PILLAR,))

seeds = st.integers(0, 2**31)


@pytest.fixture
def safety_filter(arm: Arm) -> SafetyFilter:
    """A guard over an arm beside a pillar, over a high floor."""
    return SafetyFilter(arm, AROUND)


def gap(arm: Arm, safety_filter: SafetyFilter, q: Array) -> float:
    """Return the clearance in a pose."""
    s = safety_filter.safety
    return float(clearance(arm.bodies, q, s.shapes, s.pairs, s.ends))


def remembered(safety_filter: SafetyFilter) -> Array:
    """Return the room of each pair that is remembered [m], shape (p,), to be overwritten."""
    s = safety_filter.safety
    return s.measured[len(s.bounds) :]


def path(safety_filter: SafetyFilter, q: Array, dq: Array) -> Array:
    """Return q, dq, ddq on the way to standstill that is remembered, finely, shape (m, 3, n)."""
    brake = safety_filter.safety.certified[3]
    assert np.all(brake > 0.0)
    assert np.all(brake <= safety_filter.bounds["deceleration"] + ROUNDING)
    t = np.linspace(0.0, np.max(np.abs(dq) / brake), 60)[:, None]
    passed = np.minimum(t, np.abs(dq) / brake)
    way = q + np.sign(dq) * (np.abs(dq) * passed - 0.5 * brake * passed**2)
    slower = np.sign(dq) * (np.abs(dq) - brake * passed)
    return np.stack([way, slower, np.where(brake * t < np.abs(dq), -np.sign(dq) * brake, 0.0)], 1)


@given(seed=seeds, size=st.sampled_from([0.3, 3.0, 1e3]), hold=st.integers(1, 150))
def test_whatever_is_asked_the_arm_can_stop_clear_of_everything(
    arm: Arm, seed: int, size: float, hold: int
) -> None:
    """After every tick the way to standstill keeps clear of pillar, floor and itself, in range.

    It is the stop that is remembered, and the drives can make it.
    """
    safety_filter, rng = SafetyFilter(arm, AROUND), np.random.default_rng(seed)
    wish = np.zeros((3, arm.n))
    for tick in range(300):
        if tick % hold == 0:
            wish = size * rng.standard_normal((3, arm.n)) + np.array(
                [safety_filter.last[0], safety_filter.last[1], np.zeros(arm.n)]
            )
        before, wanted = safety_filter.last.copy(), wish.copy()
        safety_filter.step(wanted)
        q, dq, ddq = wanted
        assert np.all(np.abs(q - before[0]) <= safety_filter.bounds["dq_max"] * TICK + ROUNDING)
        assert np.all(np.abs(dq - before[1]) <= safety_filter.bounds["ddq_max"] * TICK + ROUNDING)
        assert np.all(np.abs(ddq) <= safety_filter.bounds["ddq_max"] + ROUNDING)
        if tick % 20 == 0:
            way = path(safety_filter, q, dq)
            assert min(gap(arm, safety_filter, x) for x in way[:, 0]) >= MARGIN - 1e-6
            assert np.all(way[:, 0] >= safety_filter.bounds["q_min"] - 1e-6)
            assert np.all(way[:, 0] <= safety_filter.bounds["q_max"] + 1e-6)
            shares = [
                arm.limits.torque_ratio(arm.torque(*x), arm.all_joints(x[1])) for x in way[::3]
            ]
            assert np.max(shares) <= BETWEEN


@settings(max_examples=15)
@given(seed=seeds)
@example(seed=62)  # joint 1 lags, and its feedback asks for more than its drive has
def test_an_arm_that_is_stopped_stays_as_clear_as_its_command(arm: Arm, seed: int) -> None:
    """Its drives can make the stop: it keeps the margin too, whatever speeds were wished."""
    rng, plant = np.random.default_rng(seed), ExactPlant(arm)
    tracker = Tracker(arm, bandwidth=80.0, around=AROUND)
    guard, speed = tracker.safety_filter, np.zeros(arm.n)
    for tick in range(600):
        if tick % 150 == 0:
            speed = guard.bounds["dq_max"] * rng.choice([-1.0, 1.0, 0.5, 0.0], arm.n)
        dq = guard.last[1] + np.clip(speed - guard.last[1], -0.03, 0.03)
        q, dq_arm = plant.state
        wish = np.array([guard.last[0] + TICK * dq, dq, np.zeros(arm.n)])
        state = ArmState(t=tick * TICK, q=q.copy(), dq=dq_arm.copy())
        plant.move(tracker.step(state, wish, hand=0.0).command, TICK)
        assert gap(arm, guard, guard.last[0]) >= MARGIN - 1e-6
        assert gap(arm, guard, plant.state[0]) >= MARGIN - 1e-6


@given(seed=seeds, size=st.sampled_from([0.3, 3.0, 1e3]), hold=st.integers(1, 150))
def test_a_guard_that_remembers_the_room_says_what_one_does_that_measures_it(
    arm: Arm, seed: int, size: float, hold: int
) -> None:
    """Tick after tick the same verdict and the same motion, to the bit."""
    safety_filter, plain, rng = (
        SafetyFilter(arm, AROUND),
        SafetyFilter(arm, AROUND),
        np.random.default_rng(seed),
    )
    wish, measured = np.zeros((3, arm.n)), 0
    for tick in range(300):
        if tick % hold == 0:
            wish = size * rng.standard_normal((3, arm.n)) + np.array(
                [safety_filter.last[0], safety_filter.last[1], np.zeros(arm.n)]
            )
        mine, other, known = wish.copy(), wish.copy(), remembered(safety_filter).copy()
        remembered(plain)[:] = -np.inf
        assert safety_filter.step(mine) == plain.step(other)
        assert np.array_equal(mine, other)
        measured += bool(np.any(remembered(safety_filter) > known))
    assert measured > 0


@pytest.mark.parametrize("speed", [0.02, 0.05, 0.2])
def test_a_guard_that_creeps_up_to_a_pillar_remembers_what_one_measures(
    arm: Arm, speed: float
) -> None:
    """Down to the last sliver of room, where a guard that measures is stricter than the bound."""
    safety_filter, plain, blocked = SafetyFilter(arm, AROUND), SafetyFilter(arm, AROUND), False
    wish = np.zeros((3, arm.n))
    for tick in range(4000):
        wish[0], wish[1, 0] = safety_filter.last[0], speed if tick > 1500 else 2.0
        wish[0, 0] += TICK * wish[1, 0]
        mine, other = wish.copy(), wish.copy()
        remembered(plain)[:] = -np.inf
        said = safety_filter.step(mine)
        assert said == plain.step(other)
        assert np.array_equal(mine, other)
        blocked |= tick > 1500 and said == BLOCKED
    assert blocked


def test_room_is_measured_again_only_where_the_arm_has_used_it_up(
    arm: Arm, safety_filter: SafetyFilter
) -> None:
    """At rest once; on a way of 0.6 rad in open space a few times, not in each tick."""
    still, measured = np.array([arm.q_ready, np.zeros(arm.n), np.zeros(arm.n)]), []
    for k in range(600):
        wanted = still.copy()
        if k >= 300:
            wanted[0, 1] += 0.002 * (k - 300)
        before = remembered(safety_filter).copy()
        assert safety_filter.step(wanted) == PASSED
        measured.append(bool(np.any(remembered(safety_filter) > before)))
    assert sum(measured[:301]) == 1
    assert 0 < sum(measured[301:]) < 30


def test_in_open_space_a_wish_passes_bit_by_bit(arm: Arm, safety_filter: SafetyFilter) -> None:
    """A slow motion near the ready pose is not touched."""
    for k in range(200):
        t = TICK * k
        wanted = np.array(
            [
                arm.q_ready + 0.05 * (1.0 - np.cos(4.0 * t)),
                np.full(3, 0.2 * np.sin(4.0 * t)),
                np.full(3, 0.8 * np.cos(4.0 * t)),
            ]
        )
        given_ = wanted.copy()
        assert safety_filter.step(wanted) == PASSED
        assert np.array_equal(wanted, given_)


def test_what_is_always_near_holds_nothing_up(arm: Arm) -> None:
    """A ball on the base and one on the second link, 12 mm apart in every pose: all passes.

    Each lies by the axis of a joint between, so that no motion changes the gap by much.
    """
    base = Capsule(start=(2e-4, 0.0, -0.1), end=(2e-4, 0.0, -0.1), radius=0.04)
    ball = Capsule(start=(0.0, 0.0, 0.03), end=(0.0, 0.0, 0.03), radius=0.0524)
    links = list(arm.model.links)
    links[1] = replace(links[1], capsules=(ball,))
    model = replace(arm.model, links=tuple(links), base_capsules=(*arm.model.base_capsules, base))
    whole = Arm(model, arm.limits)
    near = SafetyFilter(whole, Surroundings())
    assert gap(whole, near, arm.q_ready) == pytest.approx(0.012, abs=1e-4)
    for k in range(300):
        t = TICK * k
        swing = np.array([0.6, 0.3, 0.3])
        wanted = np.array(
            [
                arm.q_ready + swing * (1.0 - np.cos(5.0 * t)),
                5.0 * swing * np.sin(5.0 * t),
                25.0 * swing * np.cos(5.0 * t),
            ]
        )
        given_ = wanted.copy()
        assert near.step(wanted) == PASSED
        assert np.array_equal(wanted, given_)


def test_an_arm_that_is_driven_at_a_pillar_stops_before_it(
    arm: Arm, safety_filter: SafetyFilter
) -> None:
    """Turning towards the pillar at 3 rad/s ends at rest, short of it, within the margin."""
    blocked = 0
    for _ in range(1500):
        q = safety_filter.last[0] + np.array([3.0 * TICK, 0.0, 0.0])
        wanted = np.array([q, [3.0, 0.0, 0.0], np.zeros(3)])
        blocked += safety_filter.step(wanted) == BLOCKED
    assert blocked > 100
    assert abs(safety_filter.last[1, 0]) < 0.5
    assert MARGIN - 1e-6 <= gap(arm, safety_filter, safety_filter.last[0]) < MARGIN + 0.05


def test_an_arm_that_stands_in_a_zone_may_only_move_out(arm: Arm) -> None:
    """Started inside, it passes a wish that leads away and brakes one that leads deeper."""
    safety_filter = SafetyFilter(arm, AROUND)
    inside = arm.q_ready + np.array([0.72, 0.0, 0.6])
    while gap(arm, safety_filter, inside) > 0.0:
        inside[0] += 0.01
    for sign, deeper in ((1.0, True), (-1.0, False)):
        safety_filter.begin(inside, np.zeros(3))
        way = np.array([[sign * 1e-3, 0.0, 0.0], [sign * 0.1, 0.0, 0.0], np.zeros(3)])
        wanted = np.array([inside, np.zeros(3), np.zeros(3)]) + way
        assert (safety_filter.step(wanted) == BLOCKED) == deeper


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("row", [0, 1, 2])
def test_a_wish_that_is_not_finite_ends_in_standing_still(
    arm: Arm, safety_filter: SafetyFilter, bad: float, row: int
) -> None:
    """NaN and infinity in any row are answered by finite motion that comes to rest."""
    for _ in range(200):
        wanted = np.array([arm.q_ready, np.zeros(3), np.zeros(3)])
        wanted[row, 1] = bad
        safety_filter.step(wanted)
        assert np.all(np.isfinite(wanted))
    assert safety_filter.last[1, 1] == pytest.approx(0.0, abs=1e-9)


def with_jerk(arm: Arm, seconds: float) -> Arm:
    """Return an arm whose accelerations build up within a time [s]."""
    most = np.full(len(arm.model.links), 20.0)
    return Arm(arm.model, replace(arm.limits, acceleration=most, jerk=most / seconds))


@pytest.mark.parametrize("seconds", thorough([0.002], [0.06]))
@given(seed=seeds, size=st.sampled_from([0.3, 3.0, 1e3]), hold=st.integers(1, 150))
def test_an_arm_with_jerk_can_stop_clear_of_everything(
    arm: Arm, seconds: float, seed: int, size: float, hold: int
) -> None:
    """After every tick its own way to standstill, tick by tick, keeps clear."""
    safety_filter = SafetyFilter(with_jerk(arm, seconds), AROUND)
    rng, wish = np.random.default_rng(seed), np.zeros((3, arm.n))
    for tick in range(200):
        if tick % hold == 0:
            wish = size * rng.standard_normal((3, arm.n)) + np.array(
                [safety_filter.last[0], safety_filter.last[1], np.zeros(arm.n)]
            )
        safety_filter.step(wish.copy())
        if tick % 40 == 0:
            row, after = safety_filter.last.copy(), safety_filter.last.copy()
            while np.any(row[1:]):
                slow_down(safety_filter.bounds, row, after)
                row[:] = after
                assert gap(arm, safety_filter, row[0]) >= MARGIN - 1e-6


@pytest.mark.parametrize("seconds", [0.002, 0.06])
def test_jerk_lets_an_arm_move_beside_what_it_moves_along(arm: Arm, seconds: float) -> None:
    """A motion that has room on its whole way to standstill passes, and is blocked in front of it.

    A bound of that way by the largest delay of a brake forbade motions with centimetres of room.
    """
    safety_filter = SafetyFilter(with_jerk(arm, seconds), AROUND)
    wish, free, said = np.zeros((3, arm.n)), np.inf, PASSED
    for _ in range(4000):
        wish[0], wish[1, 0] = safety_filter.last[0], 0.5
        wish[0, 0] += TICK * 0.5
        said = safety_filter.step(wish.copy())
        if said == BLOCKED:
            break
        free = gap(arm, safety_filter, safety_filter.last[0])
    assert said == BLOCKED
    way = 0.5 * (0.5 / 20.0 + 2.0 * seconds + 2.0 * TICK) * safety_filter.safety.slopes[:, 0].max()
    assert MARGIN < free < MARGIN + way
