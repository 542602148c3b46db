"""Laws of the envelope with jerk: no step of acceleration beyond it, and standstill in range."""

from dataclasses import replace

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from mitt.control.envelope import bounds_of, braked, clamp, slow_down
from mitt.robot.arm import Arm
from mitt.signals import TICK, Array
from mitt.structs import Record

ROUNDING = 1e-9
#: Largest overshoot, as a share of the gap that was closed: that of the ticks.
OVERSHOOT = 0.05

seeds = st.integers(0, 2**31)
rates = st.floats(10.0, 1000.0)


def smooth(arm: Arm, rate: float) -> Record:
    """Return the bounds of an arm whose jerk is so many times its trusted deceleration a second."""
    b = bounds_of(arm)
    b["jerk"] = rate * b["deceleration"]
    return b


def settle(b: Record, last: Array) -> Array:
    """Brake to rest; return all motions on the way, shape (k, 3, n)."""
    rows, wanted = [], last.copy()
    for _ in range(5000):
        slow_down(b, last, wanted)
        clamp(b, last, wanted)
        last[:] = wanted
        rows.append(wanted.copy())
        if not wanted[1:].any():
            return np.array(rows)
    raise AssertionError(f"no rest: {wanted.tolist()}")


def test_bounds_have_the_jerk_of_the_limit_set(arm: Arm) -> None:
    """Infinite where the set has none."""
    assert np.all(np.isinf(bounds_of(arm)["jerk"]))
    jerk = np.arange(1.0, len(arm.model.links) + 1.0)
    other = Arm(arm.model, replace(arm.limits, jerk=jerk))
    assert np.array_equal(bounds_of(other)["jerk"], jerk[list(arm.model.active)])


@given(seed=seeds, rate=rates, hold=st.integers(1, 200), size=st.sampled_from([0.1, 3.0, 1e6]))
def test_no_wish_takes_a_joint_beyond_its_jerk(
    arm: Arm, seed: int, rate: float, hold: int, size: float
) -> None:
    """Range, speed, acceleration and its step hold for any wish, and the arm can always stop."""
    b, rng = smooth(arm, rate), np.random.default_rng(seed)
    last, wish = np.array([arm.q_ready, np.zeros(arm.n), np.zeros(arm.n)]), np.zeros((3, arm.n))
    for tick in range(200):
        if tick % hold == 0:
            wish = last + size * rng.standard_normal((3, arm.n))
            wish[0, 0] = np.nan if rng.random() < 0.1 else wish[0, 0]
        kept = wish.copy()
        clamp(b, last, kept)
        q, dq, ddq = kept
        assert np.all((q >= b["q_min"]) & (q <= b["q_max"]))
        assert np.all(np.abs(dq) <= b["dq_max"] + ROUNDING)
        assert np.all(np.abs(ddq) <= b["ddq_max"] + ROUNDING)
        assert np.all(np.abs(ddq - last[2]) <= b["jerk"] * TICK * (1.0 + ROUNDING) + ROUNDING)
        assert np.allclose(dq, last[1] + TICK * ddq, rtol=0.0, atol=ROUNDING)
        assert np.allclose(q, last[0] + 0.5 * TICK * (dq + last[1]), rtol=0.0, atol=ROUNDING)
        last = kept
    start = last.copy()
    rows = settle(b, last)
    assert np.all((rows[:, 0] >= b["q_min"] - ROUNDING) & (rows[:, 0] <= b["q_max"] + ROUNDING))
    for k in range(arm.n):
        rate, jerk = b["deceleration"][k], b["jerk"][k]
        way = [braked(start[1, k], start[2, k], rate, jerk, TICK * (i + 1.0))[0]
               for i in range(len(rows))]  # fmt: skip
        assert np.all(np.abs(rows[:, 0, k] - start[0, k]) <= np.array(way) + ROUNDING)


@given(seed=seeds)
def test_a_motion_within_the_jerk_is_followed(arm: Arm, seed: int) -> None:
    """A motion of constant jerk is emitted as it was wanted, to a microradian."""
    b, rng = smooth(arm, 300.0), np.random.default_rng(seed)
    jerk = 0.5 * rng.uniform(-1.0, 1.0, arm.n)
    last = np.array([arm.q_ready, np.zeros(arm.n), np.zeros(arm.n)])
    for k in range(1, 500):
        t = k * TICK
        wanted = np.array([arm.q_ready + jerk * t**3 / 6.0, jerk * t**2 / 2.0, jerk * t])
        kept = wanted.copy()
        clamp(b, last, kept)
        last = kept
        assert np.abs(kept[0] - wanted[0]).max() < 1e-6


@given(seed=seeds, rate=rates)
def test_a_joint_that_lags_comes_back_without_overshoot(arm: Arm, seed: int, rate: float) -> None:
    """From off a moving reference it closes in from one side, and then is on it."""
    b, rng = smooth(arm, rate), np.random.default_rng(seed)
    off = rng.uniform(0.02, 0.2, arm.n) * rng.choice([-1.0, 1.0], arm.n)
    q, dq = arm.q_ready.copy(), 0.05 * rng.uniform(-1.0, 1.0, arm.n)
    last, gaps = np.array([q + off, dq, np.zeros(arm.n)]), []
    for _ in range(3000):
        q = q + TICK * dq
        wanted = np.array([q, dq, np.zeros(arm.n)])
        clamp(b, last, wanted)
        last = wanted
        gaps.append((last[0] - q) / off)
    assert np.min(gaps) > -OVERSHOOT
    assert np.abs(gaps[-1]).max() < 1e-6


def test_torque_rates_bound_the_jerk(arm: Arm) -> None:
    """In no pose a joint's jerk alone takes more than about its share of any torque's rate."""
    rate = np.array([300.0, 200.0, 150.0])
    whole = np.full(len(arm.model.links), 1e9)
    whole[list(arm.model.active)] = rate
    b = bounds_of(Arm(arm.model, replace(arm.limits, torque_rate=whole)))
    poses = np.random.default_rng(7).uniform(arm.q_min, arm.q_max, (300, arm.n))
    share = [np.abs(arm.mass_matrix(q)) * b["jerk"] / rate[:, None] for q in poses]
    most = np.max(share, axis=(0, 1))
    assert np.all((most > 0.6) & (most < 0.75))
