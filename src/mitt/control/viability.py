"""Whether the arm can come to standstill without touching itself or what stands around it.

From q, dq every joint brakes at its own trusted deceleration. The way to standstill is walked by
conservative advancement: where the smallest gap is d, no point gets closer than d minus the way
that it can still travel, and so far the arm can be moved on without looking. Nothing thin is
stepped over, and in open space one look is enough. Where joints have a jerk limit, the way is that
of :func:`mitt.control.envelope.slow_down`, tick by tick.

**Certified, and why it lasts.** After each tick the emitted motion x = (q, dq, ddq) is such that
the stop B(x), all joints braking at their trusted decelerations, stays in the ranges and keeps
``MARGIN`` from everything. By induction: an x that passes is examined itself; where it does not
pass, the arm is led along B of the tick before, and what is left of B there is B again. That holds
as long as B is the same function of x in both ticks. B depends on the decelerations, on jerk and
ranges, and on the shapes: none of them changes during a throw. The ball does, so the decelerations
and the jerk are the least of the arm with it and without it, from the first tick on, and whether
drives can make a stop is asked of both. What takes up the ball or lets it go changes the model that
the torques are computed with (``CatcherState.arm``), and nothing in :class:`Safety`. A new start,
as by ``recover``, certifies a motion at rest. A stop far from the command begins at the estimate,
which nothing has certified. The one thing that changes is ``dq_max``, kept lower where a ball will
drive a joint on: B does not depend on it. A joint that is faster than a new ``dq_max`` brakes, and
where that is blocked it is led along B like any other.

This speaks of the commanded motion, not of the arm, which may lag behind it: after a jump of the
ball's estimate the command may turn faster than the drives, and B may be harder than all drives
together. The ranges of the measured joints are guarded besides
(:func:`mitt.control.envelope.bound_acceleration`), their clearance is not.
"""

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mitt.arm.arm import Arm, Tables
from mitt.arm.shapes import MARGIN, Shapes, Surroundings, clearance, shapes_of
from mitt.control.envelope import LONGEST, bounds_of, braked, clamp, slow_down
from mitt.control.stop import StopWork, clamp_to_reserve, gentle_rates, stop_work
from mitt.kernels import Record, copy, kernel
from mitt.signals import Array

#: Room that counts as none [m] unless the arm stands: with less, every look would lead the next one
#: hardly on.
_SLIVER = 0.0005
#: Looks along the way; if they do not suffice it counts as blocked.
_LOOKS = 40
#: What the sums of a bound on the room may be off by: rounding [m].
_TRIFLE = 1e-9

#: What became of a desired motion: passed as it was, kept within the limits, replaced by braking.
PASSED = 0
KEPT = 1
BLOCKED = 2


class Safety(NamedTuple):
    """What the safety filter knows of an arm and of what stands around it.

    Attributes:
        arm: As of ``Arm.tables``, without a load.
        loaded: Its links with the load that it may take up, as of ``Arm.bodies``, shape (N,).
        bounds: Limits of type :data:`mitt.control.envelope.BOUNDS`, of which ``deceleration``,
            ``gentle`` and ``jerk`` are those that hold with the load and without it, shape (n,).
        shapes: ``Shapes.table``, shape (m,).
        pairs: Those to be kept apart, shape (p, 2).
        measured: Where room was last measured [rad], and how much there was [m], shape (n + 1,).
        ends, way, after, brakes, stop: Scratch.
    """

    arm: Tables
    loaded: Record
    bounds: Record
    shapes: Record
    pairs: NDArray[np.int64]
    measured: Array
    ends: Record
    way: Array
    after: Array
    brakes: Array
    stop: StopWork


def safety_of(arm: Arm, around: Surroundings, load: float = 0.0) -> Safety:
    """Return what the safety filter knows of an arm; nothing was measured yet.

    Args:
        arm: The arm, without a load.
        around: What stands around it.
        load: Mass that it may take up at its catch point, at any time [kg].
    """
    (shapes, bounds), n = _shapes_and_bounds(arm, around, load), arm.n
    return Safety(
        arm.tables,
        arm.holding(load).bodies,
        bounds.copy(),
        shapes.table,
        shapes.pairs,
        np.full(n + 1, -np.inf),
        shapes.ends,
        np.zeros((3, n)),
        np.zeros((3, n)),
        np.zeros(n),
        stop_work(arm),
    )


@lru_cache(maxsize=32)
def _shapes_and_bounds(arm: Arm, around: Surroundings, load: float) -> tuple[Shapes, Record]:
    """Return shapes and limits; they are worked out once, not each throw."""
    shapes, bounds, loaded = shapes_of(arm, around), bounds_of(arm), arm.holding(load)
    for name in ("deceleration", "jerk"):
        bounds[name] = np.minimum(bounds[name], bounds_of(loaded)[name])
    most = bounds["deceleration"]
    bounds["reach"] = shapes.reach
    bounds["gentle"] = np.minimum(gentle_rates(arm, most), gentle_rates(loaded, most))
    return shapes, bounds


@kernel
def safety_filter(s: Safety, last: Array, desired: Array) -> int:
    """Replace a desired motion by what is emitted, and remember it.

    A motion that the drives could not stop any more is replaced by the stop that was possible in
    the tick before (:mod:`mitt.control.stop`). A motion from which the way to standstill is
    blocked is not emitted either: the joints brake from where they are instead, along the way that
    was found clear in the tick before. Motion that was blocked from the start may only lead out.

    Args:
        s: What is known.
        last: q, dq, ddq emitted in the tick before, overwritten, shape (3, n).
        desired: q_d, dq_d, ddq_d; q, dq, ddq afterwards, shape (3, n).

    Returns:
        ``PASSED``, ``KEPT`` or ``BLOCKED``.
    """
    result = KEPT if clamp(s.bounds, last, desired) else PASSED
    if clamp_to_reserve(s.arm, s.loaded, s.bounds, last, desired, s.stop):
        result = BLOCKED
    if not stops_clear(s, desired) and not _leads_out(s, last, desired):
        result = BLOCKED
        slow_down(s.bounds, last, desired)
    for k in range(desired.shape[1]):
        last[0, k], last[1, k], last[2, k] = desired[0, k], desired[1, k], desired[2, k]
    return result


@kernel
def stops_clear(s: Safety, motion: Array) -> bool:
    """Say whether the way to standstill from q, dq, ddq keeps ``MARGIN`` from everything."""
    for k in range(motion.shape[1]):
        if not np.isinf(s.bounds[k].jerk):
            return bool(_stops_clear_smoothly(s, motion))
        s.brakes[k] = s.bounds[k].deceleration
    return bool(_stops_clear_at(s, motion, s.brakes, s.measured))


@kernel
def _stops_clear_at(s: Safety, motion: Array, rates: Array, known: Array) -> bool:
    """Say the same of joints that brake at constant rates.

    Where the room that was last measured suffices, less what the arm has moved since, it is not
    measured again.

    Args:
        s: What is known.
        motion: q, dq in the first two rows, shape (2 or more, n).
        rates: Decelerations [rad/s^2], shape (n,).
        known: As ``Safety.measured``, overwritten.
    """
    b, way, n, t = s.bounds, s.way[0], motion.shape[1], 0.0
    for look in range(_LOOKS):
        left, pace, moved = 0.0, 0.0, _TRIFLE
        for k in range(n):
            brake, speed, reach = rates[k], abs(motion[1, k]), b[k].reach
            passed = min(t, speed / brake)
            gone, then = passed * (speed - 0.5 * brake * passed), max(speed - brake * t, 0.0)
            whole = 0.5 * speed * speed / brake
            way[k] = motion[0, k] + np.copysign(gone, motion[1, k])
            left += reach * (whole - gone)
            pace += reach * then
            moved += reach * abs(motion[0, k] - known[k])
        if look == 0 and max(left, _SLIVER) < known[n] - moved:
            return True
        room = clearance(s.arm.bodies, way, s.shapes, s.pairs, s.ends) - MARGIN
        if look == 0:
            copy(motion[0], known[:n])
            known[n] = room
        if room < 0.0 or (room < _SLIVER and left > 0.0):
            return False
        if left <= room:
            return True
        t += room / pace
    return False


@kernel
def _stops_clear_smoothly(s: Safety, motion: Array) -> bool:
    """Say the same where joints have a jerk limit: the way to standstill is walked tick by tick."""
    b, row, after, known = s.bounds, s.way, s.after, s.measured
    n, left, moved = motion.shape[1], _SLIVER, _TRIFLE
    for k in range(n):
        dq, ddq, jerk = motion[1, k], motion[2, k], b[k].jerk
        whole, _ = braked(dq, ddq, b[k].deceleration, jerk, np.inf)
        turns = 0.5 * ddq * ddq / jerk > abs(dq)  # there and back
        left += b[k].reach * (2.0 * whole if turns else whole)
        moved += b[k].reach * abs(motion[0, k] - known[k])
    if left < known[n] - moved:
        return True
    room = clearance(s.arm.bodies, motion[0], s.shapes, s.pairs, s.ends) - MARGIN
    copy(motion[0], known[:n])
    known[n] = room
    copy(motion, row)
    for _ in range(LONGEST):
        if room < 0.0 or room >= left or not np.any(row[1:]):
            return bool(room >= 0.0)
        slow_down(b, row, after)
        step = 0.0
        for k in range(n):
            step += b[k].reach * abs(after[0, k] - row[0, k])
        copy(after, row)
        room -= step
        left -= step
        if room < 0.0:
            room = clearance(s.arm.bodies, row[0], s.shapes, s.pairs, s.ends) - MARGIN
    return False


@kernel
def _leads_out(s: Safety, last: Array, desired: Array) -> bool:
    """Say whether an arm that stands too close already would get no closer."""
    before = clearance(s.arm.bodies, last[0], s.shapes, s.pairs, s.ends)
    if before >= MARGIN:
        return False
    return bool(clearance(s.arm.bodies, desired[0], s.shapes, s.pairs, s.ends) > before)
