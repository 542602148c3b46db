"""Laws of the envelope: nothing changes inside the limits, nothing passes them from outside."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mitt.control.envelope import bound_acceleration, bounds_of, brake_joint, clamp
from mitt.robot.arm import Arm
from mitt.robot.load import load_arm
from mitt.signals import TICK, Array
from mitt.structs import Record

#: A joint may pass the emitted range [rad] and speed [share] by so much in discrete time.
OVERSHOOT, OVERSPEED = 0.02, 1e-9
#: Time within which a joint beyond its speed limit is back below it [s]: six time constants.
BACK = 0.036
ROUNDING = 1e-9

seeds = st.integers(0, 2**31)
wide = st.lists(st.floats(-50.0, 50.0), min_size=3, max_size=3).map(np.array)


def stoppable(b: Record, rng: np.random.Generator) -> tuple[Array, Array]:
    """Return q and dq within the limits from which every joint can still stop in its range."""
    q = rng.uniform(b["q_min"], b["q_max"])
    up, down = (np.sqrt(2.0 * b["deceleration"] * way) for way in (b["q_max"] - q, q - b["q_min"]))
    return q, rng.uniform(-np.minimum(b["dq_max"], down), np.minimum(b["dq_max"], up))


@given(seed=seeds)
def test_a_motion_within_the_limits_passes_bit_by_bit(arm: Arm, seed: int) -> None:
    """A motion that every limit allows is emitted as it was wanted, to the last bit."""
    b, rng = bounds_of(arm), np.random.default_rng(seed)
    q, dq = stoppable(b, rng)
    last = 0.9 * np.array([q, dq])
    wanted = np.array([last[0] + TICK * last[1], last[1], 0.5 * b["ddq_max"]])
    kept = wanted.copy()
    assert not clamp(b, last, kept)
    assert np.array_equal(kept, wanted)


@given(seed=seeds, q=wide, dq=wide, ddq=wide)
def test_whatever_is_wanted_the_limits_are_kept(
    arm: Arm, seed: int, q: Array, dq: Array, ddq: Array
) -> None:
    """From any allowed state: in range, below speed and acceleration, able to stop in range."""
    b, rng = bounds_of(arm), np.random.default_rng(seed)
    last = np.array(stoppable(b, rng))
    kept = np.array([q, dq, ddq])
    clamp(b, last, kept)
    assert np.all((kept[0] >= b["q_min"]) & (kept[0] <= b["q_max"]))
    assert np.all(np.abs(kept[1]) <= b["dq_max"])
    assert np.all(np.abs(kept[2]) <= b["ddq_max"])
    assert np.all(np.abs(kept[0] - last[0]) <= b["dq_max"] * TICK + ROUNDING)
    assert np.all(np.abs(kept[1] - last[1]) <= b["ddq_max"] * TICK + ROUNDING)
    end = kept[0] + 0.5 * kept[1] * np.abs(kept[1]) / b["deceleration"]
    assert np.all((end >= b["q_min"] - ROUNDING) & (end <= b["q_max"] + ROUNDING))


def test_accelerations_of_the_limit_set_bind(arm: Arm) -> None:
    """No command and no trusted deceleration is beyond them, whatever the torques could do."""
    most = np.array([15.0, 7.5, 3.0, 12.5])
    slower = Arm(arm.model, replace(arm.limits, acceleration=most))
    b, own = bounds_of(slower), most[list(arm.model.active)]
    assert np.all(b["deceleration"] <= own)
    assert np.array_equal(b["ddq_max"], np.minimum(bounds_of(arm)["ddq_max"], own))
    last = np.array([arm.q_ready, 0.0 * own, 0.0 * own])
    wanted = np.array([arm.q_max, 9.0 * own, 99.0 * own])
    clamp(b, last, wanted)
    assert np.all(np.abs(wanted[2]) <= own)


@given(seed=seeds, q=wide, dq=wide, ddq=wide)
def test_keeping_twice_is_keeping_once(
    arm: Arm, seed: int, q: Array, dq: Array, ddq: Array
) -> None:
    """What has been kept is within the limits, so it passes unchanged."""
    b, rng = bounds_of(arm), np.random.default_rng(seed)
    last = np.array(stoppable(b, rng))
    once = np.array([q, dq, ddq])
    clamp(b, last, once)
    twice = once.copy()
    clamp(b, last, twice)
    assert np.allclose(once, twice, rtol=0.0, atol=ROUNDING)


@given(seed=seeds)
def test_braking_ends_at_rest_where_viability_says(arm: Arm, seed: int) -> None:
    """A joint that brakes tick by tick comes to rest at q + dq |dq| / (2 brake)."""
    b, rng = bounds_of(arm), np.random.default_rng(seed)
    q, dq = stoppable(b, rng)
    end = q + 0.5 * dq * np.abs(dq) / b["deceleration"]
    for k in range(arm.n):
        place, speed = float(q[k]), float(dq[k])
        for _ in range(400):
            place, speed, push = brake_joint(float(b["deceleration"][k]), place, speed)
            assert abs(push) <= b["deceleration"][k] + ROUNDING
        assert speed == 0.0
        assert place == pytest.approx(end[k], abs=1e-9)


@given(seed=seeds)
def test_an_acceleration_far_from_every_limit_passes_bit_by_bit(arm: Arm, seed: int) -> None:
    """At the middle of the ranges and at rest, an acceleration of 300 rad/s^2 is not touched."""
    b, rng = bounds_of(arm), np.random.default_rng(seed)
    wish = rng.uniform(-300.0, 300.0, arm.n)
    kept = wish.copy()
    bound_acceleration(b, 0.5 * (b["q_min"] + b["q_max"]), np.zeros(arm.n), kept)
    assert np.array_equal(kept, wish)


@given(seed=seeds, hold=st.integers(1, 200), size=st.sampled_from([10.0, 1e3, 1e6]))
def test_no_wish_takes_a_double_integrator_beyond_its_limits(
    arm: Arm, seed: int, hold: int, size: float
) -> None:
    """From any state that can still stop, random wishes never pass a speed limit or a stop."""
    b, rng = bounds_of(arm), np.random.default_rng(seed)
    q, dq = stoppable(b, rng)
    for tick in range(400):
        if tick % hold == 0:
            wish = size * rng.standard_normal(arm.n)
        ddq = wish.copy()
        bound_acceleration(b, q, dq, ddq)
        q, dq = q + TICK * dq + 0.5 * TICK**2 * ddq, dq + TICK * ddq
        assert np.all(np.abs(dq) <= b["dq_max"] * (1.0 + OVERSPEED))
        assert np.all((q > b["q_min"] - OVERSHOOT) & (q < b["q_max"] + OVERSHOOT))


def test_the_overshoot_stays_before_the_true_stop(arm: Arm) -> None:
    """The gap that the envelope keeps is wider than what it may overshoot."""
    b = bounds_of(arm)
    assert np.all(b["q_min"] - OVERSHOOT > arm.q_min)
    assert np.all(b["q_max"] + OVERSHOOT < arm.q_max)
    assert np.all(b["dq_max"] < arm.dq_max)


@given(seed=seeds, beyond=st.floats(1.05, 4.0))
def test_a_joint_beyond_its_speed_limit_is_brought_back(arm: Arm, seed: int, beyond: float) -> None:
    """From up to four times a speed limit the bound itself slows down, even against the wish."""
    b, rng = bounds_of(arm), np.random.default_rng(seed)
    sign = rng.choice([-1.0, 1.0], arm.n)
    q, dq = 0.5 * (b["q_min"] + b["q_max"]), sign * b["dq_max"] * beyond
    excess = np.abs(dq) - b["dq_max"]
    for _ in range(round(BACK / TICK)):
        ddq = 1e6 * sign
        # The middle of the range again and again: only the speed limit is looked at.
        bound_acceleration(b, q, dq, ddq)
        assert np.all(ddq * sign <= 0.0)
        dq = dq + TICK * ddq
    assert np.all(np.abs(dq) - b["dq_max"] < 0.01 * excess)


@pytest.mark.parametrize("row", [0, 1, 2])
@pytest.mark.parametrize("bad", [np.inf, -np.inf, np.nan])
def test_a_wish_that_is_not_finite_is_no_wish(arm: Arm, row: int, bad: float) -> None:
    """A joint of which anything wanted is not finite slows down where it is."""
    b = bounds_of(arm)
    last, wanted = np.array([arm.q_ready, np.ones(3)]), np.array([arm.q_ready, *np.ones((2, 3))])
    wanted[row, 1] = bad
    clamp(b, last, wanted)
    assert np.all(np.isfinite(wanted))
    assert 0.0 <= wanted[1, 1] < 1.0


@pytest.mark.parametrize("limits", ["paper", "wam-48v", "wam-80v"])
def test_every_limit_set_has_its_own_bounds(limits: str) -> None:
    """Ranges shrink by a gap, speeds to just below the set's own, decelerations are positive."""
    other = load_arm("wam", limits=limits)
    b = bounds_of(other)
    assert np.all(b["q_min"] > other.q_min)
    assert np.all(b["q_max"] < other.q_max)
    assert np.all((b["dq_max"] < other.dq_max) & (b["dq_max"] > 0.99 * other.dq_max))
    assert np.all(b["deceleration"] > 0.0)
