"""The last stage before the arm: whatever is desired, what is emitted keeps the limits.

Each emitted motion q, dq, ddq is finite and, tick after tick,

* q stays in its range and moves by no more than dq_max in a tick;
* dq stays below dq_max and changes by no more than ddq_max in a tick; ddq stays below ddq_max;
* every joint can still stop before the end of its range, braking at its trusted deceleration
  (viability: a clamp alone would let a joint arrive at its stop at full speed);
* where the limit set has jerk, the acceleration changes by no more than jerk T in a tick, and the
  way to standstill knows it; where it has none, the acceleration may step by up to twice ddq_max in
  a tick; torque rates bound the jerk, too (:func:`_jerk_of_rates`);
* and, where there are bodies to keep clear of, the way to standstill is clear of them
  (:mod:`mitt.core.control.viability`).

A motion inside these limits passes bit by bit (with jerk: to rounding). From outside them it
returns monotonically. The acceleration that the controller wants of the measured joint is bounded
likewise; torques are cut in :mod:`mitt.core.control.tracking`, all joints together.

A joint with a jerk limit is emitted as a chain of ticks of constant acceleration a:

    dq' = dq + T a,    q' = q + T (dq + dq') / 2,    |a - a before| <= jerk T.

It can stop if the ticks that :func:`calm` would make from here end at rest within its range and
below its speed. That is checked tick by tick, so there is nothing that a formula forgets; a bound
that is quickly worked out spares the walk where there is room. The wish is followed as far as the
next state can still stop, else the joint brakes, which by induction it can. A joint that lags
behind its motion comes back to it without overshoot: the speed at which it closes in, and the
acceleration that it takes for that, are such that a share of the jerk suffices to end both in time.

| here      | meaning                                                        | unit     | shape  |
|-----------|----------------------------------------------------------------|----------|--------|
| ``desired``| q_d, dq_d, ddq_d before, q, dq, ddq after                     | rad ...  | (3, n) |
| ``last``  | q, dq, ddq emitted in the tick before; ddq counts for jerk     | rad ...  | (3, n) |
| ``b``     | limits of the joints, records of type ``BOUNDS``               | rad ...  | (n,)   |
"""

from collections.abc import Sequence
from functools import lru_cache
from typing import TypeAlias

import numpy as np

from mitt.core.arm.arm import Arm
from mitt.core.arm.description import STOP_GAP
from mitt.core.errors import InputError
from mitt.core.kernels import Fields, Record, kernel
from mitt.core.signals import TICK, Array

Motion: TypeAlias = tuple[float, float, float]
"""q, dq, ddq of a joint [rad, rad/s, rad/s^2]."""

BOUNDS = np.dtype(
    [
        ("q_min", float),  # ends of the range [rad], with their gaps
        ("q_max", float),
        ("dq_max", float),  # [rad/s]
        ("deceleration", float),  # that is to be trusted, at most ddq_max [rad/s^2]
        ("ddq_max", float),  # [rad/s^2]
        ("jerk", float),  # infinite where the limit set has none [rad/s^3]
        ("gentle", float),  # of :func:`mitt.core.control.stop.gentle_rates` [rad/s^2]
    ],
    align=True,
)

#: Share of a speed limit that the emitted motion keeps, and the same where torque rates let
#: feedback come late.
_SPEED_SHARE = 0.995
_SLOW_SHARE = 0.96
#: Time in which a joint may close in on a speed limit [s]; a few ticks.
_APPROACH = 0.006
#: Poses over which the largest of something is looked for.
_POSES = 256
#: Rate at which a gap to the wished position is closed [1/s].
_CLOSING = 50.0
#: Share of the jerk that ends an acceleration, and shares of jerk and acceleration that close a gap
#: of position: they leave room for the former.
_ENDING = 0.5
_CLOSING_JERK = 0.1
_CLOSING_DDQ = 0.3
#: How far into its range a joint that is beyond an end is led at least [rad].
_WITHIN = 0.001
#: Ticks in which a joint has to come to rest.
LONGEST = 5000
#: Halvings between wish and brake, and rounding of a speed [rad/s].
_HALVINGS = 10
_ROUNDING = 1e-12
#: What positions [rad] and speeds [rad/s] of a caller's motion may be off by, as numbers of a file
#: are; by the former as a share, a limit may be exceeded.
_ROUNDED = 1e-6
_ROUNDED_SPEED = 1e-4


def bounds_of(arm: Arm, *, commanded: bool = True) -> Record:
    """Return the limits of the active joints with their gaps, shape (n,).

    The trusted deceleration is that of the joint alone in the ready pose; ``ddq_max`` is what the
    torques of all joints together can cause in any of many poses, so that it binds nothing that
    an arm within its torques can do. Where the limit set has accelerations, both are at most those,
    and where it has no jerk besides, the acceleration may swing from one end to the other in a
    tick: then position, speed and acceleration of a command are one motion.

    Args:
        arm: The arm.
        commanded: Whether commands are bounded, which keep the accelerations of the limit set;
            else what the arm itself can do by its torques.
    """
    return _bounds(arm, commanded).copy()


def speeds_of(arm: Arm) -> Array:
    """Return the largest speeds that are emitted [rad/s], shape (n,)."""
    share = _SPEED_SHARE if arm.limits.torque_rate is None else _SLOW_SHARE
    speeds: Array = share * arm.dq_max
    return speeds


@lru_cache(maxsize=32)
def _bounds(arm: Arm, commanded: bool) -> Record:
    """Return the limits of an arm, worked out once: 256 poses take longer than a tick."""
    limits, none = arm.limits, np.full(arm.n, np.inf)
    jerk = none if limits.jerk is None else arm.active(limits.jerk)
    most = none
    if commanded and limits.acceleration is not None:
        most = arm.active(limits.acceleration)
        jerk = np.minimum(jerk, 2.0 * most / TICK)
    brake = np.minimum(arm.tau_max / np.diag(arm.mass_matrix(arm.q_ready)), most)
    if limits.torque_rate is not None:
        jerk = np.minimum(jerk, _jerk_of_rates(arm, arm.active(limits.torque_rate)))
    b = np.zeros(arm.n, BOUNDS)
    b["q_min"], b["q_max"] = arm.q_min + STOP_GAP, arm.q_max - STOP_GAP
    b["dq_max"], b["deceleration"], b["jerk"] = speeds_of(arm), brake, jerk
    b["ddq_max"] = np.minimum(np.maximum(_largest_acceleration(arm), brake), most)
    return b


def _jerk_of_rates(arm: Arm, rate: Array) -> Array:
    """Return the jerk of each joint that leaves 30 % of the torque rates to the others, (n,).

    In the pose where it takes most.

    Args:
        arm: The arm.
        rate: Largest rates of the torques [N m/s], shape (n,).
    """
    jerk: Array = 0.7 / np.max(np.abs(masses_of(arm)) / rate[:, None], axis=(0, 1))
    return jerk


def _largest_acceleration(arm: Arm) -> Array:
    """Return the largest acceleration by the torques in any pose [rad/s^2], (n,)."""
    reached = np.abs(np.linalg.inv(masses_of(arm))) @ arm.tau_max
    out: Array = np.max(reached, axis=0)
    return out


def sampled_poses(arm: Arm) -> Array:
    """Return the poses over which the worst of something is looked for [rad], shape (k, n)."""
    poses = np.random.default_rng(1).uniform(arm.q_min, arm.q_max, (_POSES, arm.n))
    return np.asarray(poses)


@lru_cache(maxsize=32)
def masses_of(arm: Arm) -> Array:
    """Return the mass matrices in :func:`sampled_poses` [kg m^2], shape (k, n, n).

    Worked out once, not to be written to.
    """
    return np.array([arm.mass_matrix(q) for q in sampled_poses(arm)])


@kernel
def clamp(b: Record, last: Array, desired: Array) -> bool:
    """Replace a desired motion by what is emitted, joint by joint; say whether anything changed."""
    changed = False
    for k in range(desired.shape[1]):
        before, wish = (
            (last[0, k], last[1, k], last[2, k]),
            (desired[0, k], desired[1, k], desired[2, k]),
        )
        if np.isinf(b[k].jerk):
            q, dq, ddq = clamp_joint(b[k], before, wish)
        else:
            q, dq, ddq = clamp_smooth(b[k], before, wish)
        changed |= q != wish[0] or dq != wish[1] or ddq != wish[2]
        desired[0, k], desired[1, k], desired[2, k] = q, dq, ddq
    return changed


@kernel
def clamp_joint(b: Fields, last: Motion, desired: Motion) -> Motion:
    """Return the command of a joint without a jerk limit for which a motion is desired.

    Args:
        b: Limits of the joint.
        last: What was emitted in the tick before, finite.
        desired: The wish; of one with anything not finite nothing is taken.
    """
    (last_q, last_dq, _), (q, dq, ddq) = last, desired
    brake, ddq_max, dq_max = b.deceleration, b.ddq_max, b.dq_max
    if not (np.isfinite(q) and np.isfinite(dq) and np.isfinite(ddq)):
        q, dq, ddq = last_q, 0.0, 0.0
    least, most = last_dq - ddq_max * TICK, last_dq + ddq_max * TICK
    speed = min(max(min(max(dq, -dq_max), dq_max), least), most)
    step = dq_max * TICK
    place = min(max(min(max(q, b.q_min), b.q_max), last_q - step), last_q + step)
    if speed > 0.0:
        room = 2.0 * brake * max(b.q_max - place, 0.0)
        if speed * speed > room:
            speed = max(np.sqrt(room), least)
            if speed > 0.0 and speed * speed > room:
                back = min(place, max(last_q - step, b.q_min))
                place = max(min(place, b.q_max - 0.5 * speed * speed / brake), back)
    elif speed < 0.0:
        room = 2.0 * brake * max(place - b.q_min, 0.0)
        if speed * speed > room:
            speed = min(-np.sqrt(room), most)
            if speed < 0.0 and speed * speed > room:
                back = max(place, min(last_q + step, b.q_max))
                place = min(max(place, b.q_min + 0.5 * speed * speed / brake), back)
    if speed != dq:
        ddq = (speed - last_dq) / TICK
    return place, speed, min(max(ddq, -ddq_max), ddq_max)


@kernel
def clamp_smooth(b: Fields, last: Motion, desired: Motion) -> Motion:
    """Return the command of a joint with a jerk limit for which a motion is desired.

    Beyond its speed it brakes, and beyond an end of its range it is led back in, whatever is
    desired. Arguments as of :func:`clamp_joint`.
    """
    (q0, dq0, ddq0), (q, dq, ddq), low, high = last, desired, b.q_min, b.q_max
    dq_max, brake, ddq_max, jerk = b.dq_max, b.deceleration, b.ddq_max, b.jerk
    near = calm(dq0, ddq0, brake, jerk)
    if abs(dq0) > dq_max + _ROUNDING:
        q1, dq1, _ = onwards(q0, dq0, near)
        return q1, dq1, near
    if not (np.isfinite(q) and np.isfinite(dq) and np.isfinite(ddq)):
        q, dq, ddq = q0, 0.0, 0.0
    within = min(_WITHIN, 0.25 * (high - low))
    if q0 > high:
        q, dq, ddq, high = min(q, high - within), min(dq, 0.0), min(ddq, 0.0), q0
    elif q0 < low:
        q, dq, ddq, low = max(q, low + within), max(dq, 0.0), max(ddq, 0.0), q0
    dq, ddq = min(max(dq, -2.0 * dq_max), 2.0 * dq_max), min(max(ddq, -ddq_max), ddq_max)
    gap = min(max(q - q0 - 0.5 * TICK * (dq + dq0), -1e3), 1e3)
    lacking = dq - dq0 - TICK * ddq
    lacking += closing_speed(gap, _CLOSING, ddq_max, jerk)
    most = releasable(lacking, jerk)
    wish = min(max(ddq + min(max(lacking / TICK, -most), most), -ddq_max), ddq_max)
    wish = min(max(wish, ddq0 - jerk * TICK), ddq0 + jerk * TICK)
    q1, dq1, _ = onwards(q0, dq0, wish)
    if can_stop(b, low, high, q1, dq1, wish):
        return q1, dq1, wish
    far = wish
    for _ in range(_HALVINGS):
        middle = 0.5 * (near + far)
        q1, dq1, _ = onwards(q0, dq0, middle)
        if can_stop(b, low, high, q1, dq1, middle):
            near = middle
        else:
            far = middle
    q1, dq1, _ = onwards(q0, dq0, near)
    return q1, dq1, near


@kernel
def can_stop(b: Fields, low: float, high: float, q: float, dq: float, ddq: float) -> bool:
    """Say whether a joint comes to rest between two ends [rad] and below its speed.

    ``ddq`` is the acceleration in the tick that led to ``q`` and ``dq``.
    """
    dq_max, brake, jerk = b.dq_max, b.deceleration, b.jerk
    if not (low <= q <= high and abs(dq) <= dq_max + _ROUNDING):
        return False
    rise = abs(ddq) / jerk + TICK
    top = abs(dq) + abs(ddq) * rise
    way = top * (rise + 0.5 * top / brake + brake / jerk + 2.0 * TICK)
    if top <= dq_max and way <= min(high - q, q - low):
        return True
    for _ in range(LONGEST):
        if dq == 0.0 and ddq == 0.0:
            return True
        ddq = calm(dq, ddq, brake, jerk)
        before = dq
        dq += TICK * ddq
        if abs(dq) <= _ROUNDING and abs(ddq) <= jerk * TICK:
            dq = 0.0
        q += 0.5 * TICK * (before + dq)
        if not (low <= q <= high and abs(dq) <= dq_max + _ROUNDING):
            return False
    return False


@kernel
def calm(dq: float, ddq: float, brake: float, jerk: float) -> float:
    """Return the acceleration of the next tick of a joint that comes to rest.

    Args:
        dq: Speed now [rad/s].
        ddq: Acceleration in the tick before [rad/s^2].
        brake: Largest deceleration [rad/s^2].
        jerk: Largest change of the acceleration [rad/s^3].
    """
    speed = abs(dq)
    # With steps of jerk T back to none, a deceleration x takes x^2 / (2 jerk) + x T / 2 of speed.
    rate = jerk * (np.sqrt(0.25 * TICK * TICK + 2.0 * speed / jerk) - 0.5 * TICK)
    wish = -np.copysign(min(rate, speed / TICK, brake), dq)
    return float(min(max(wish, ddq - jerk * TICK), ddq + jerk * TICK))


@kernel
def onwards(q: float, dq: float, ddq: float) -> Motion:
    """Return q, dq, ddq after a tick of constant acceleration."""
    after = dq + TICK * ddq
    if abs(after) <= _ROUNDING:
        after = 0.0
    return q + 0.5 * TICK * (dq + after), after, ddq


@kernel
def releasable(gap: float, jerk: float) -> float:
    """Return the largest acceleration that can be ended before a gap of speed is closed.

    Args:
        gap: Speed that is lacking [rad/s].
        jerk: Largest jerk [rad/s^3]; infinite where there is no bound.

    Returns:
        Acceleration a with a^2 / (2 j) = |gap| [rad/s^2], j half the jerk; infinite where there is
        no bound.
    """
    return np.inf if np.isinf(jerk) else np.sqrt(2.0 * _ENDING * jerk * abs(gap))


@kernel
def closing_speed(gap: float, gain: float, ddq_max: float, jerk: float) -> float:
    """Return the speed at which a gap of position is closed [rad/s].

    At v = (4.5 j)^(1/3) gap^(2/3) closing in takes a constant jerk j, at v = (2 a gap)^(1/2) a
    constant acceleration a.

    Args:
        gap: Way that is lacking [rad].
        gain: Speed for each unit of it, where the limits allow that [1/s].
        ddq_max: Largest acceleration, of which a share is a [rad/s^2].
        jerk: Largest jerk, of which a share is j [rad/s^3].
    """
    smooth = (4.5 * _CLOSING_JERK * jerk * gap * gap) ** (1.0 / 3.0)
    strong = np.sqrt(2.0 * _CLOSING_DDQ * ddq_max * abs(gap))
    return float(np.copysign(min(gain * abs(gap), smooth, strong), gap))


@kernel
def slow_down(b: Record, last: Array, desired: Array) -> None:
    """Let every joint brake; q, dq, ddq for the next tick, shape (3, n)."""
    for k in range(desired.shape[1]):
        if np.isinf(b[k].jerk):
            q, dq, ddq = brake_joint(b[k].deceleration, last[0, k], last[1, k])
        else:
            ddq = calm(last[1, k], last[2, k], b[k].deceleration, b[k].jerk)
            q, dq, ddq = onwards(last[0, k], last[1, k], ddq)
        desired[0, k], desired[1, k], desired[2, k] = q, dq, ddq


@kernel
def brake_joint(brake: float, last_q: float, last_dq: float) -> Motion:
    """Return the next motion of a joint that brakes at its trusted deceleration."""
    speed = abs(last_dq)
    if speed <= brake * TICK:
        return last_q + 0.5 * last_dq * speed / brake, 0.0, -last_dq / TICK
    slower = -np.copysign(brake, last_dq)
    return last_q + TICK * (last_dq + 0.5 * TICK * slower), last_dq + TICK * slower, slower


@kernel
def braked(dq: float, ddq: float, brake: float, jerk: float, t: float) -> tuple[float, float]:
    """Return how far a joint that comes to rest has moved after a time at most, and its speed then.

    An upper bound of the motion of :func:`calm`, in its first direction: the acceleration stays
    until it would be turned to braking and then lets go of nothing early.

    Args:
        dq: Speed now [rad/s].
        ddq: Acceleration in the tick before [rad/s^2].
        brake: Largest deceleration [rad/s^2].
        jerk: Largest jerk [rad/s^3].
        t: Time [s].
    """
    delay = (abs(ddq) + 2.0 * brake) / jerk + 2.0 * TICK
    top = abs(dq) + 0.5 * ddq * ddq / jerk + abs(ddq) * TICK
    slow = max(t - delay, 0.0)
    slow = min(slow, top / brake)
    return top * min(t, delay) + slow * (top - 0.5 * brake * slow), top - brake * slow


@kernel
def stop_in_ticks(b: Record, motion: Array, rows: Array) -> int:
    """Write the motion from a state to rest, and return how many ticks it takes.

    Args:
        b: As in the module's table.
        motion: q, dq, ddq at the start, shape (3, n).
        rows: q, dq, ddq at the start and after each tick, shape (K, 3, n); K - 1 ticks at most.
    """
    rows[0] = motion
    for k in range(len(rows) - 1):
        if not np.any(rows[k, 1:]):
            return k
        slow_down(b, rows[k], rows[k + 1])
    return len(rows) - 1


@kernel
def bound_acceleration(b: Record, q: Array, dq: Array, ddq: Array) -> None:
    """Bound accelerations in place by the speed limits and by the way left to the stops."""
    for k in range(len(q)):
        dq_max, brake = b[k].dq_max, b[k].deceleration
        up = np.sqrt(2.0 * brake * max(b[k].q_max - q[k], 0.0))
        down = np.sqrt(2.0 * brake * max(q[k] - b[k].q_min, 0.0))
        highest = _closing(min(dq_max, up) - dq[k], b[k].jerk)
        lowest = _closing(-min(dq_max, down) - dq[k], b[k].jerk)
        ddq[k] = min(max(ddq[k], lowest), highest)


@kernel
def _closing(gap: float, jerk: float) -> float:
    """Return the acceleration at which a gap of speed is closed [rad/s^2]."""
    most = releasable(gap, jerk)
    return float(min(max(gap / _APPROACH, -most), most))


def check_motion(names: Sequence[str], b: Record, last: Array, motion: Array) -> None:
    """Refuse a motion that does not lead from a command to rest within the limits.

    Args:
        names: Names of the joints.
        b: Limits, as in the module's table.
        last: q, dq, ddq of the command before, at rest, shape (3, n).
        motion: q, dq, ddq of that tick and each one after it, shape (k, 3, n).

    Raises:
        InputError: It is another one; the joint is named, and the first tick at fault.
    """
    q, dq, ddq = motion[:, 0], motion[:, 1], motion[:, 2]
    if not len(motion):
        raise InputError("motion", "one row or more", "none")
    if (k := _worst(np.abs(q[:1] - last[0]), _ROUNDED)) is not None:
        raise InputError(
            "motion",
            f"a start at the last command, {names[k[1]]} at {last[0, k[1]]:.6g}",
            f"{q[k]:.6g}",
            do="begin at command.q of the last tick",
        )
    speeds = np.abs(dq[[0, -1]])
    if (k := _worst(speeds, _ROUNDED_SPEED)) is not None:
        where = "an end" if k[0] else "a start"
        raise InputError("motion", f"{where} at rest", f"{names[k[1]]} at {speeds[k]:.4g} rad/s")
    _check_steps(names, q, dq, ddq)
    low, high = np.minimum(b["q_min"], q[0]), np.maximum(b["q_max"], q[0])
    far = np.maximum(low - q, q - high)
    if (k := _worst(far, _ROUNDED)) is not None:
        joint = k[1]
        raise InputError(
            "motion",
            f"positions of {names[joint]} in {low[joint]:.4g}..{high[joint]:.4g} rad",
            f"{q[k]:.4g} at tick {k[0]}",
            do="commands keep a gap to the ends of the range",
        )
    for name, value, most, unit in (
        ("speed", np.abs(dq), b["dq_max"], "rad/s"),
        ("acceleration", np.abs(ddq), b["ddq_max"], "rad/s^2"),
        ("jerk", np.abs(np.diff(ddq, axis=0, prepend=ddq[:1])) / TICK, b["jerk"], "rad/s^3"),
    ):
        if (k := _worst(value - most * (1.0 + _ROUNDED), _ROUNDED)) is not None:
            given = f"{value[k]:.4g} {unit} at tick {k[0]}"
            raise InputError(
                "motion",
                f"a {name} of {names[k[1]]} of at most {most[k[1]]:.4g}",
                given,
                do="plan one within the limits",
            )


def _check_steps(names: Sequence[str], q: Array, dq: Array, ddq: Array) -> None:
    """Refuse rows of which positions, speeds and accelerations are not those of one motion.

    In a tick the acceleration may be anything between those at its ends.
    """
    jump = np.abs(np.diff(ddq, axis=0))
    for what, x, rate, slack in (
        ("positions", q, dq, 0.25 * TICK**2 * jump + _ROUNDED),
        ("speeds", dq, ddq, 0.5 * TICK * jump + _ROUNDED_SPEED),
    ):
        off = np.abs(np.diff(x, axis=0) - 0.5 * TICK * (rate[1:] + rate[:-1])) - slack
        if (k := _worst(off, 0.0)) is not None:
            step = np.diff(x, axis=0)[k]
            wanted = f"{what} a tick apart that change as their rates say"
            raise InputError(
                "motion",
                wanted,
                f"a step of {step:.4g} of {names[k[1]]} after tick"
                f" {k[0]}, at a rate of {rate[k]:.4g}",
                do="give q, dq, ddq each millisecond",
            )


def _worst(excess: Array, slack: float) -> tuple[int, int] | None:
    """Return tick and joint of the largest excess; None where none is above ``slack``."""
    if not excess.size or excess.max() <= slack:
        return None
    k, joint = np.unravel_index(int(np.argmax(excess)), excess.shape)
    return int(k), int(joint)
