"""Laws of the envelope: inside the limits nothing changes, nothing passes from outside; jerk."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mitt.core.arm.arm import Arm
from mitt.core.control.envelope import (
    bound_acceleration,
    bounds_of,
    brake_joint,
    braked,
    check_motion,
    clamp,
    slow_down,
)
from mitt.core.errors import InputError
from mitt.core.kernels import Record
from mitt.core.signals import TICK, Array
from mitt.io.load import build_arm
from mitt.lab.trials.slow_motion import slow_motion

#: A joint may pass the emitted range [rad] and speed [share] by so much in discrete time.
OVERSHOOT = 0.02
OVERSPEED = 1e-9
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
    other = build_arm("wam", limits=limits)
    b = bounds_of(other)
    assert np.all(b["q_min"] > other.q_min)
    assert np.all(b["q_max"] < other.q_max)
    assert np.all((b["dq_max"] < other.dq_max) & (b["dq_max"] > 0.99 * other.dq_max))
    assert np.all(b["deceleration"] > 0.0)


#: Largest overshoot, as a share of the gap that was closed: that of the ticks.
OVERSHOOT_OF_GAP = 0.05

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
        way = [
            braked(start[1, k], start[2, k], rate, jerk, TICK * (i + 1.0))[0]
            for i in range(len(rows))
        ]
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
    assert np.min(gaps) > -OVERSHOOT_OF_GAP
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


def quintic(start: Array, end: Array, ticks: int) -> Array:
    """Return q, dq, ddq of a quintic each tick, shape (ticks + 1, 3, n)."""
    x = np.linspace(0.0, 1.0, ticks + 1)[:, None]
    s = 10.0 * x**3 - 15.0 * x**4 + 6.0 * x**5
    ds = (30.0 * x**2 - 60.0 * x**3 + 30.0 * x**4) / (ticks * TICK)
    dds = (60.0 * x - 180.0 * x**2 + 120.0 * x**3) / (ticks * TICK) ** 2
    return np.stack([start + s * (end - start), ds * (end - start), dds * (end - start)], axis=1)


def checked(arm: Arm, motion: Array, start: Array | None = None) -> None:
    """Check a motion from rest in a pose, the ready one where there is none."""
    q = arm.q_ready if start is None else start
    last = np.array([q, np.zeros(arm.n), np.zeros(arm.n)])
    check_motion(arm.names, bounds_of(arm), last, motion)


@given(seed=st.integers(0, 2**31), ticks=st.integers(800, 3000))
def test_a_motion_between_two_poses_is_taken(arm: Arm, seed: int, ticks: int) -> None:
    """From anywhere to anywhere within the ranges, and from beyond an end back in."""
    rng, b = np.random.default_rng(seed), bounds_of(arm)
    start, end = (
        rng.uniform(b["q_min"] - 0.5, b["q_max"] + 0.5),
        rng.uniform(b["q_min"], b["q_max"]),
    )
    slow = max(ticks, int(2000.0 * np.max(np.abs(end - start) / b["dq_max"])))
    checked(arm, quintic(start, end, slow), start)


def test_a_motion_at_full_acceleration_is_taken(arm: Arm) -> None:
    """Acceleration may step between two ticks, and in the middle of one."""
    a, ticks = 10.0, 201
    t = np.minimum(TICK * np.arange(ticks + 1), TICK * ticks)
    half = 0.5 * t[-1]
    up = t <= half
    dq = np.where(up, a * t, a * (t[-1] - t))
    q = np.where(up, 0.5 * a * t**2, a * half**2 - 0.5 * a * (t[-1] - t) ** 2)
    ddq = np.where(up, a, -a)
    rows = np.stack([q, dq, ddq], axis=1)[:, :, None] * np.array([0.3, -0.2, 0.5])
    rows[:, 0] += arm.q_ready
    rows = np.concatenate([rows, np.array([[rows[-1, 0], np.zeros(3), np.zeros(3)]])])
    checked(arm, rows)


SPOILED: dict[str, Callable[[Array], object]] = {
    "start": lambda m: m[:, 0].__iadd__(1e-3),
    "end at rest": lambda m: m[-1, 1].__iadd__(1e-2),
    "start at rest": lambda m: m[0, 1].__iadd__(1e-2),
    "positions a tick apart": lambda m: m[300:, 0].__iadd__(1e-4),
    "speeds a tick apart": lambda m: m[:, 2].__imul__(0.0),
    "positions": lambda m: m[1:-1, 1].__imul__(0.5),
}


@pytest.mark.parametrize("wanted", SPOILED)
@pytest.mark.parametrize("joint", [0, 1, 2])
def test_a_motion_that_is_none_is_refused(arm: Arm, wanted: str, joint: int) -> None:
    """One joint is enough; the line names it or says what is wrong."""
    end = arm.q_ready.copy()
    end[joint] -= 0.5
    motion = quintic(arm.q_ready, end, 700)
    checked(arm, motion)
    one = motion[:, :, joint : joint + 1]
    SPOILED[wanted](one)
    with pytest.raises(InputError, match=wanted) as refused:
        checked(arm, motion)
    assert arm.names[joint] in str(refused.value)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize("joint", [0, 1, 2])
def test_a_motion_beyond_a_limit_is_refused(arm: Arm, joint: int) -> None:
    """Too far, too fast, too hard, too sudden: the joint and the limit are named."""
    n, end = len(arm.model.links), arm.q_ready.copy()
    beyond = arm.q_ready.copy()
    beyond[joint] = arm.q_max[joint]
    most = np.full(n, 3.0)
    slower = Arm(arm.model, replace(arm.limits, acceleration=most))
    smoother = Arm(arm.model, replace(arm.limits, jerk=most))
    end[joint] += 1.0 if joint == 2 else -1.0
    for what, other, to, ticks in (
        ("positions", arm, beyond, 3000),
        ("speed", arm, end, 60),
        ("acceleration", slower, end, 800),
        ("jerk", smoother, end, 2000),
    ):
        motion = quintic(arm.q_ready, to, ticks)
        with pytest.raises(InputError, match=f"{what} of {arm.names[joint]}"):
            checked(other, motion)
        if other is not arm:
            checked(arm, motion)


@given(seed=st.integers(0, 2**31), share=st.floats(0.05, 1.0))
def test_the_motions_of_mitt_are_taken(arm: Arm, seed: int, share: float) -> None:
    """On the way to the ready pose, with slow limits of any kind, from beyond an end as well."""
    rng, n = np.random.default_rng(seed), len(arm.model.links)
    low = {
        name: None if rng.random() < 0.5 else np.full(n, size)
        for name, size in (("acceleration", 0.5), ("jerk", 4.0), ("torque_rate", 100.0))
    }
    slow = Arm(arm.model, replace(arm.limits, **low))  # type: ignore[arg-type]
    start = rng.uniform(arm.q_min - 0.3, arm.q_max + 0.3)
    motion = slow_motion(slow, start, arm.q_ready, share)
    checked(slow, motion, start)
    assert np.allclose(motion[-1, 0], arm.q_ready)
