"""Laws of a motion that begins beyond a limit: back in, never farther out, within all others."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from stages import SafetyFilter

from mitt.core.arm.arm import Arm
from mitt.core.arm.description import STOP_GAP, ArmModel
from mitt.core.arm.shapes import Surroundings
from mitt.core.catcher.catcher import Catcher
from mitt.core.control.envelope import BOUNDS, bounds_of, clamp, clamp_joint, clamp_smooth
from mitt.core.errors import ModelError
from mitt.core.signals import TICK, Array

ROUNDING = 1e-9
#: Longest time in which a joint at rest half a radian beyond its range is back in it [s].
BACK = 3.0

seeds = st.integers(0, 2**31)
Wish = tuple[float, float, float]


def wish(rng: np.random.Generator, kind: int, now: Wish) -> Wish:
    """Return what an adversary wants of a joint: garbage, farther out, as far in, to stay."""
    x, y, z = rng.random(3) - 0.5
    return (
        (8.0 * x, 60.0 * y, 4000.0 * z),
        (1e9 * x, 1e200 * y, -1e300 * z),
        (9.0, 30.0, 4000.0),
        (-9.0, -30.0, -4000.0),
        (np.nan, np.inf, 0.0),
        now,
    )[kind]


def limits(rng: np.random.Generator) -> tuple[float, float, float, float, float, float]:
    """Draw low, high, dq_max, brake, ddq_max, jerk; of a third jerk is that of the acceleration."""
    brake = 5.0 + 200.0 * rng.random()
    ddq_max = brake * (1.0 + 5.0 * rng.random() ** 2)
    largest = 2.0 * ddq_max / TICK
    jerk = largest if rng.random() < 0.3 else min(brake * 10.0 ** rng.uniform(0.5, 3.3), largest)
    low, high = -0.05 - 3.0 * rng.random(), 0.05 + 3.0 * rng.random()
    return low, high, 0.2 + 20.0 * rng.random() ** 2, brake, ddq_max, jerk


def record(b: tuple[float, ...]) -> np.void:
    """Return limits as the envelope takes them."""
    joint = np.zeros(1, BOUNDS)
    joint[0] = (*b, 0.0)
    limits: np.void = joint[0]
    return limits


def beyond(low: float, high: float, q: float) -> float:
    """Return how far a position is beyond a range."""
    return max(q - high, low - q, 0.0)


@settings(max_examples=25)
@given(seed=seeds, mixed=st.booleans())
def test_a_smooth_joint_comes_back_in(seed: int, mixed: bool) -> None:
    """From rest beyond an end, whatever is wanted: monotone, smooth, in time, and in for good."""
    rng = np.random.default_rng(seed)
    b, kind = limits(rng), int(rng.integers(6))
    low, high, dq_max, _, ddq_max, jerk = b
    now = (float(rng.choice([low - 0.5 * rng.random(), high + 0.5 * rng.random()])), 0.0, 0.0)
    out, came = beyond(low, high, now[0]), 0
    for _ in range(round(BACK / TICK)):
        kind = int(rng.integers(6)) if mixed and rng.random() < 0.01 else kind
        new = clamp_smooth(record(b), now, wish(rng, kind, now))
        assert np.all(np.isfinite(new))
        assert abs(new[1]) <= dq_max + ROUNDING
        assert abs(new[2]) <= ddq_max + ROUNDING
        assert abs(new[2] - now[2]) <= jerk * TICK * (1.0 + ROUNDING) + ROUNDING
        assert new[1] == pytest.approx(now[1] + TICK * new[2], abs=ROUNDING)
        assert new[0] == pytest.approx(now[0] + 0.5 * TICK * (now[1] + new[1]), abs=ROUNDING)
        before, out = out, beyond(low, high, new[0])
        assert out <= before + 1e-12
        assert out == 0.0 or not came
        came += out == 0.0
        now = new
        if came > 200:
            return
    assert came


@settings(max_examples=60)
@given(seed=seeds)
def test_a_smooth_joint_at_any_speed_stops_and_comes_back_in(seed: int) -> None:
    """Too fast, outwards or both: it brakes within its jerk, then it is as one at rest."""
    rng = np.random.default_rng(seed)
    b, kind = limits(rng), int(rng.integers(6))
    low, high, dq_max, brake, _, jerk = b
    dq = float(rng.uniform(-2.0, 2.0)) * dq_max
    now = (float(rng.uniform(low - 0.5, high + 0.5)), dq, 0.0)
    stops = abs(dq) / brake + 2.0 * brake / jerk + 2.0 * np.sqrt(abs(dq) / jerk) + 4.0 * TICK
    way = beyond(low, high, now[0]) + abs(dq) * stops
    for tick in range(round((stops + BACK * max(1.0, 2.0 * way)) / TICK)):
        new = clamp_smooth(record(b), now, wish(rng, kind, now))
        assert abs(new[2] - now[2]) <= jerk * TICK * (1.0 + ROUNDING) + ROUNDING
        assert abs(new[1]) <= max(abs(now[1]), dq_max) + ROUNDING
        now = new
        if tick * TICK > stops and beyond(low, high, now[0]) == 0.0 and abs(now[1]) <= dq_max:
            return
    raise AssertionError(f"{now} of {b}")


@given(seed=seeds)
def test_a_joint_without_jerk_comes_back_in(seed: int) -> None:
    """At any speed, whatever is wanted: the excess of place and speed falls in each tick."""
    rng = np.random.default_rng(seed)
    low, high, dq_max, brake, ddq_max, _ = limits(rng)
    b, kind = record((low, high, dq_max, brake, ddq_max, np.inf)), int(rng.integers(6))
    q, dq = float(rng.uniform(low - 1.0, high + 1.0)), float(rng.uniform(-2.5, 2.5)) * dq_max
    for _ in range(round((1.0 / dq_max + 2.5 * dq_max / ddq_max) / TICK) + 2):
        new_q, new_dq, _ = clamp_joint(b, (q, dq, 0.0), wish(rng, kind, (q, dq, 0.0)))
        out = max(beyond(low, high, q) - dq_max * TICK, 0.0)
        assert beyond(low, high, new_q) <= out + ROUNDING
        fast = max(abs(dq) - dq_max - ddq_max * TICK, 0.0)
        assert abs(new_dq) - dq_max <= fast + ROUNDING
        assert abs(new_dq - dq) <= ddq_max * TICK + ROUNDING
        q, dq = new_q, new_dq
    assert beyond(low, high, q) == 0.0
    assert abs(dq) <= dq_max + ROUNDING


def kinds(arm: Arm) -> dict[str, Arm]:
    """Return an arm with each kind of limits that a motion may have."""
    n = len(arm.model.links)
    most = np.full(n, 20.0)
    return {
        "plain": arm,
        "acceleration": Arm(arm.model, replace(arm.limits, acceleration=most)),
        "jerk": Arm(arm.model, replace(arm.limits, acceleration=most, jerk=most / 0.06)),
        "torque rate": Arm(arm.model, replace(arm.limits, torque_rate=np.full(n, 1000.0))),
    }


@pytest.mark.parametrize("kind", ["plain", "acceleration", "jerk", "torque rate"])
@pytest.mark.parametrize("off", [0.1, 0.01, -0.03])
def test_an_arm_comes_back_in(arm: Arm, kind: str, off: float) -> None:
    """Each joint, beyond either end or in the gap before it, through all stages of the envelope."""
    slower = kinds(arm)[kind]
    for k in range(arm.n):
        for sign, end in ((-1.0, arm.q_min[k]), (1.0, arm.q_max[k])):
            envelope, q = SafetyFilter(slower, Surroundings()), arm.q_ready.copy()
            b, q[k] = envelope.bounds, end + sign * off
            envelope.begin(q, np.zeros(arm.n))
            out = beyond(b["q_min"][k], b["q_max"][k], q[k])
            for _ in range(round(BACK / TICK)):
                told = np.array([arm.q_ready, np.zeros(arm.n), np.zeros(arm.n)])
                envelope.step(told)
                before, out = out, beyond(b["q_min"][k], b["q_max"][k], told[0, k])
                assert out <= before + ROUNDING
                if out == 0.0:
                    break
            assert out == 0.0, (k, sign)


def test_what_no_joint_wants_to_leave_is_not_touched(arm: Arm) -> None:
    """Joints inside go on as they are wanted while another one is led in."""
    slower = kinds(arm)["jerk"]
    b, last = bounds_of(slower), np.array([arm.q_ready, np.zeros(arm.n), np.zeros(arm.n)])
    last[0, 0] = arm.q_max[0]
    told: Array = np.array([arm.q_ready, np.zeros(arm.n), np.zeros(arm.n)])
    clamp(b, last, told)
    assert np.array_equal(told[:, 1:], [arm.q_ready[1:], np.zeros(2), np.zeros(2)])
    assert told[0, 0] < last[0, 0]


@pytest.mark.parametrize("slides", [False, True])
@pytest.mark.parametrize("span", [0.5 * STOP_GAP, 2.0 * STOP_GAP])
def test_a_range_without_room_for_both_gaps_is_refused(arm: Arm, span: float, slides: bool) -> None:
    """By name, in one line; a little more is taken, and a held joint may have any range."""

    def ranged(span: float, held: float | None = None) -> ArmModel:
        joint = replace(arm.model.links[0], q_min=0.0, q_max=span, prismatic=slides, held=held)
        links, ready = (joint, *arm.model.links[1:]), arm.q_ready.copy()
        ready[0] = 0.5 * span
        return replace(arm.model, links=links, q_ready=ready[1:] if held is not None else ready)

    with pytest.raises(ModelError, match="'j1'.*0.12 m" if slides else "'j1'.*0.12 rad"):
        Catcher(Arm(ranged(span), arm.limits), None)  # type: ignore[arg-type]
    with pytest.raises(ModelError, match="'j1'"):
        ranged(span).check_ranges()
    ranged(2.0 * STOP_GAP + 0.01).check_ranges()
    ranged(span, held=0.0).check_ranges()
