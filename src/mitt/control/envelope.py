"""The last stage before the arm: whatever is desired, what is emitted keeps the limits.

Each emitted motion q, dq, ddq is finite and, tick after tick,

* q stays in its range and moves by no more than dq_max in a tick;
* dq stays below dq_max and changes by no more than ddq_max in a tick; ddq stays below ddq_max;
* every joint can still stop before the end of its range, braking at its trusted deceleration
  (viability: a clamp alone would let a joint arrive at its stop at full speed);
* where the limit set has jerk, the acceleration changes by no more than jerk T in a tick, and the
  way to standstill knows it (:mod:`mitt.control.jerk`); where it has none, the acceleration may
  step by up to twice ddq_max in a tick; torque rates bound the jerk, too (:func:`_jerk_of_rates`);
* and, where there are bodies to keep clear of, the way to standstill is clear of them
  (:mod:`mitt.control.viability`).

A motion inside these limits passes bit by bit (with jerk: to rounding). From outside them it
returns monotonically. The acceleration that the controller wants of the measured joint is bounded
likewise; torques are cut in :mod:`mitt.control.tracking`, all joints together.

| here      | meaning                                                        | unit     | shape  |
|-----------|----------------------------------------------------------------|----------|--------|
| ``desired``| q_d, dq_d, ddq_d before, q, dq, ddq after                     | rad ...  | (3, n) |
| ``last``  | q, dq, ddq emitted in the tick before; ddq counts for jerk     | rad ...  | (3, n) |
| ``b``     | q_min, q_max, dq_max, deceleration to be trusted, ddq_max,     | rad ...  | (6, n) |
|           | jerk, infinite where the limit set has none                    |          |        |
"""

from functools import lru_cache

import numpy as np

from mitt.control.jerk import calm, clamp_smooth, onwards, releasable
from mitt.control.rows import DDQ_MAX, DECELERATION, DQ_MAX, JERK, Q_MAX, Q_MIN
from mitt.jit import kernel
from mitt.robot.arm import Arm
from mitt.robot.description import STOP_GAP
from mitt.signals import TICK, Array

#: Share of a speed limit that the emitted motion keeps, and the same where torque rates let
#: feedback come late.
_SPEED_SHARE, _SLOW_SHARE = 0.995, 0.96
#: Time in which a joint may close in on a speed limit [s]; a few ticks.
_APPROACH = 0.006
#: Share of a torque rate that the jerk of one joint takes in the pose where it takes most.
_RATE_SHARE = 0.7
#: Poses over which the largest of something is looked for, and their seed.
_POSES, _SEED = 256, 1


def bounds_of(arm: Arm, *, commanded: bool = True) -> Array:
    """Return the limits of the active joints with their gaps, shape (6, n).

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
def _bounds(arm: Arm, commanded: bool) -> Array:
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
    return np.array(
        [
            arm.q_min + STOP_GAP,
            arm.q_max - STOP_GAP,
            speeds_of(arm),
            brake,
            np.minimum(np.maximum(_largest_acceleration(arm), brake), most),
            jerk,
        ]
    )


def _jerk_of_rates(arm: Arm, rate: Array) -> Array:
    """Return the jerk of each joint that leaves torque rates to the others in any pose, (n,).

    Args:
        arm: The arm.
        rate: Largest rates of the torques [N m/s], shape (n,).
    """
    jerk: Array = _RATE_SHARE / np.max(np.abs(masses_of(arm)) / rate[:, None], axis=(0, 1))
    return jerk


def _largest_acceleration(arm: Arm) -> Array:
    """Return the largest acceleration by the torques in any pose [rad/s^2], (n,)."""
    reached = np.abs(np.linalg.inv(masses_of(arm))) @ arm.tau_max
    out: Array = np.max(reached, axis=0)
    return out


def poses_of(arm: Arm) -> Array:
    """Return the poses over which the worst of something is looked for [rad], shape (k, n)."""
    poses = np.random.default_rng(_SEED).uniform(arm.q_min, arm.q_max, (_POSES, arm.n))
    return np.asarray(poses)


@lru_cache(maxsize=32)
def masses_of(arm: Arm) -> Array:
    """Return the mass matrices in :func:`poses_of` [kg m^2], shape (k, n, n).

    Worked out once, not to be written to.
    """
    return np.array([arm.mass_matrix(q) for q in poses_of(arm)])


@kernel
def clamp_joint(
    low: float,
    high: float,
    dq_max: float,
    brake: float,
    ddq_max: float,
    last_q: float,
    last_dq: float,
    q: float,
    dq: float,
    ddq: float,
) -> tuple[float, float, float]:
    """Return the command of a joint for which ``q``, ``dq``, ``ddq`` is desired.

    Args:
        low: Lower end of the range [rad].
        high: Upper end of the range [rad].
        dq_max: Largest speed [rad/s].
        brake: Deceleration to be trusted [rad/s^2], at most ``ddq_max``.
        ddq_max: Largest acceleration [rad/s^2].
        last_q: Position emitted in the tick before [rad], finite.
        last_dq: Speed emitted in the tick before [rad/s], finite.
        q: Wanted position [rad]; of a wish with anything not finite nothing is taken.
        dq: Wanted speed [rad/s].
        ddq: Wanted acceleration [rad/s^2].
    """
    if not (np.isfinite(q) and np.isfinite(dq) and np.isfinite(ddq)):
        q, dq, ddq = last_q, 0.0, 0.0
    least, most = last_dq - ddq_max * TICK, last_dq + ddq_max * TICK
    speed = min(max(min(max(dq, -dq_max), dq_max), least), most)
    step = dq_max * TICK
    place = min(max(min(max(q, low), high), last_q - step), last_q + step)
    if speed > 0.0:
        room = 2.0 * brake * max(high - place, 0.0)
        if speed * speed > room:
            speed = max(np.sqrt(room), least)
            if speed > 0.0 and speed * speed > room:
                back = min(place, max(last_q - step, low))
                place = max(min(place, high - 0.5 * speed * speed / brake), back)
    elif speed < 0.0:
        room = 2.0 * brake * max(place - low, 0.0)
        if speed * speed > room:
            speed = min(-np.sqrt(room), most)
            if speed < 0.0 and speed * speed > room:
                back = max(place, min(last_q + step, high))
                place = min(max(place, low + 0.5 * speed * speed / brake), back)
    if speed != dq:
        ddq = (speed - last_dq) / TICK
    return place, speed, min(max(ddq, -ddq_max), ddq_max)


@kernel
def clamp(b: Array, last: Array, desired: Array) -> bool:
    """Replace a desired motion by what is emitted, joint by joint; say whether anything changed."""
    changed = False
    for k in range(desired.shape[1]):
        if np.isinf(b[JERK, k]):
            q, dq, ddq = clamp_joint(
                b[Q_MIN, k], b[Q_MAX, k], b[DQ_MAX, k], b[DECELERATION, k], b[DDQ_MAX, k],
                last[0, k], last[1, k], desired[0, k], desired[1, k], desired[2, k],
            )  # fmt: skip
        else:
            q, dq, ddq = clamp_smooth(
                b[Q_MIN, k], b[Q_MAX, k], b[DQ_MAX, k], b[DECELERATION, k], b[DDQ_MAX, k],
                b[JERK, k], (last[0, k], last[1, k], last[2, k]),
                (desired[0, k], desired[1, k], desired[2, k]),
            )  # fmt: skip
        changed |= q != desired[0, k] or dq != desired[1, k] or ddq != desired[2, k]
        desired[0, k], desired[1, k], desired[2, k] = q, dq, ddq
    return changed


@kernel
def brake_joint(brake: float, last_q: float, last_dq: float) -> tuple[float, float, float]:
    """Return the next motion of a joint that brakes at its trusted deceleration."""
    speed = abs(last_dq)
    if speed <= brake * TICK:
        return last_q + 0.5 * last_dq * speed / brake, 0.0, -last_dq / TICK
    slower = -np.copysign(brake, last_dq)
    return last_q + TICK * (last_dq + 0.5 * TICK * slower), last_dq + TICK * slower, slower


@kernel
def slow_down(b: Array, last: Array, desired: Array) -> None:
    """Let every joint brake; q, dq, ddq for the next tick, shape (3, n)."""
    for k in range(desired.shape[1]):
        if np.isinf(b[JERK, k]):
            q, dq, ddq = brake_joint(b[DECELERATION, k], last[0, k], last[1, k])
        else:
            ddq = calm(last[1, k], last[2, k], b[DECELERATION, k], b[JERK, k])
            q, dq, ddq = onwards(last[0, k], last[1, k], ddq)
        desired[0, k], desired[1, k], desired[2, k] = q, dq, ddq


@kernel
def stop_in_ticks(b: Array, motion: Array, rows: Array) -> int:
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
def bound_acceleration(b: Array, q: Array, dq: Array, ddq: Array) -> None:
    """Bound accelerations in place by the speed limits and by the way left to the stops."""
    for k in range(len(q)):
        q_min, q_max, dq_max, brake = b[Q_MIN, k], b[Q_MAX, k], b[DQ_MAX, k], b[DECELERATION, k]
        up = np.sqrt(2.0 * brake * max(q_max - q[k], 0.0))
        down = np.sqrt(2.0 * brake * max(q[k] - q_min, 0.0))
        highest = _closing(min(dq_max, up) - dq[k], b[JERK, k])
        lowest = _closing(-min(dq_max, down) - dq[k], b[JERK, k])
        ddq[k] = min(max(ddq[k], lowest), highest)


@kernel
def _closing(gap: float, jerk: float) -> float:
    """Return the acceleration at which a gap of speed is closed [rad/s^2]."""
    most = releasable(gap, jerk)
    return float(min(max(gap / _APPROACH, -most), most))
