"""Whether the arm can come to standstill without touching itself or what stands around it.

From q, dq every joint brakes at its own trusted deceleration. The way to standstill is walked by
conservative advancement: where the smallest gap is d, no point gets closer than d minus the way
that it can still travel, and so far the arm can be moved on without looking. Nothing thin is
stepped over, and in open space one look is enough. Where joints have a jerk limit, the way is that
of :func:`mitt.control.envelope.slow_down`, tick by tick.
"""

from functools import lru_cache
from typing import final

import numpy as np
from numpy.typing import NDArray

from mitt import checks
from mitt.control.envelope import bounds_of, clamp, slow_down
from mitt.control.jerk import braked
from mitt.control.reserve import clamp_to_reserve, gentle_rates, reserve_work
from mitt.control.rows import DECELERATION, JERK, REACH
from mitt.errors import InputError
from mitt.jit import kernel
from mitt.robot.arm import Arm
from mitt.robot.shapes import Shapes, Surroundings, clearance, shapes_of
from mitt.signals import Array
from mitt.views import view

#: Gap that is kept [m], and what a look may leave open before the way counts as blocked [m].
MARGIN, _SLIVER = 0.01, 0.0005
#: Looks along the way; if they do not suffice it counts as blocked.
_LOOKS = 40
#: Ticks of a smooth way to standstill; if they do not suffice it counts as blocked.
_LONGEST = 5000
#: What the sums of a bound on the room may be off by [m].
_TRIFLE = 1e-9


#: What became of a desired motion: passed as it was, kept within the limits, replaced by braking.
PASSED, KEPT, BLOCKED = 0, 1, 2


@kernel
def stops_clear(
    bodies: Array,
    table: Array,
    pairs: NDArray[np.int64],
    b: Array,
    motion: Array,
    known: Array,
    work: Array,
) -> bool:
    """Say whether the way to standstill from a motion keeps ``MARGIN`` from everything.

    Where the room that was last measured suffices, less what the arm has moved since, it is not
    measured again.

    Args:
        bodies: Table of :mod:`mitt.robot.dynamics`, shape (N, 31).
        table: Shapes, shape (m, 8).
        pairs: Those to be kept apart, shape (p, 2).
        b: Limits, as of :mod:`mitt.control.envelope`, then the reach of each joint and its gentle
            deceleration (:mod:`mitt.control.reserve`), shape (8, n).
        motion: q, dq, ddq, shape (3, n).
        known: Where room was last measured [rad], and how much there was [m], overwritten,
            shape (n + 1,).
        work: Scratch, shape (2 m + 2 n, 3).
    """
    n, t = motion.shape[1], 0.0
    for k in range(n):
        if not np.isinf(b[JERK, k]):
            return bool(_stops_clear_smoothly(bodies, table, pairs, b, motion, known, work))
    ends, way = view(work, 6 * n, (len(work) - 2 * n, 3)), view(work, 0, (n,))
    for look in range(_LOOKS):
        left, pace, moved = 0.0, 0.0, _TRIFLE
        for k in range(n):
            brake, speed, reach = b[DECELERATION, k], abs(motion[1, k]), b[REACH, k]
            passed = min(t, speed / brake)
            gone, then = passed * (speed - 0.5 * brake * passed), max(speed - brake * t, 0.0)
            whole = 0.5 * speed * speed / brake
            way[k] = motion[0, k] + np.copysign(gone, motion[1, k])
            left += reach * (whole - gone)
            pace += reach * then
            moved += reach * abs(motion[0, k] - known[k])
        if look == 0 and max(left, _SLIVER) < known[n] - moved:
            return True
        room = clearance(bodies, way, table, pairs, ends) - MARGIN
        if look == 0:
            known[:n], known[n] = motion[0], room
        if room < 0.0 or (room < _SLIVER and left > 0.0):
            return False
        if left <= room:
            return True
        t += room / pace
    return False


@kernel
def _stops_clear_smoothly(
    bodies: Array,
    table: Array,
    pairs: NDArray[np.int64],
    b: Array,
    motion: Array,
    known: Array,
    work: Array,
) -> bool:
    """Say the same where joints have a jerk limit: the way to standstill is walked tick by tick."""
    n, left, moved = motion.shape[1], _SLIVER, _TRIFLE
    ends = view(work, 6 * n, (len(work) - 2 * n, 3))
    row, after = view(work, 0, (3, n)), view(work, 3 * n, (3, n))
    for k in range(n):
        dq, ddq, jerk = motion[1, k], motion[2, k], b[JERK, k]
        whole, _ = braked(dq, ddq, b[DECELERATION, k], jerk, np.inf)
        turns = 0.5 * ddq * ddq / jerk > abs(dq)  # there and back
        left += b[REACH, k] * (2.0 * whole if turns else whole)
        moved += b[REACH, k] * abs(motion[0, k] - known[k])
    if left < known[n] - moved:
        return True
    room = clearance(bodies, motion[0], table, pairs, ends) - MARGIN
    known[:n], known[n] = motion[0], room
    row[:] = motion
    for _ in range(_LONGEST):
        if room < 0.0 or room >= left or not np.any(row[1:]):
            return bool(room >= 0.0)
        slow_down(b, row, after)
        step = 0.0
        for k in range(n):
            step += b[REACH, k] * abs(after[0, k] - row[0, k])
        row[:] = after
        room -= step
        left -= step
        if room < 0.0:
            room = clearance(bodies, row[0], table, pairs, ends) - MARGIN
    return False


@kernel
def safety_filter(
    bodies: Array,
    table: Array,
    pairs: NDArray[np.int64],
    b: Array,
    drives: Array,
    index: NDArray[np.int64],
    last: Array,
    desired: Array,
    known: Array,
    work: Array,
    reserve: Array,
) -> int:
    """Replace a desired motion by what is emitted, and remember it.

    A motion that the drives could not stop any more is replaced by the stop that was possible in
    the tick before (:mod:`mitt.control.reserve`). A motion from which the way to standstill is
    blocked is not emitted either: the joints brake from where they are instead, along the way that
    was found clear in the tick before. Motion that was blocked from the start may only lead out.

    Args:
        bodies: Table of :mod:`mitt.robot.dynamics`, shape (N, 31).
        table: Shapes, shape (m, 8).
        pairs: Those to be kept apart, shape (p, 2).
        b: As for :func:`stops_clear`, shape (8, n).
        drives: ``Limits.packed``, shape (2 N + 3, N).
        index: Active joints among the links, shape (n,).
        last: q, dq, ddq emitted in the tick before, overwritten, shape (3, n).
        desired: q_d, dq_d, ddq_d; q, dq, ddq afterwards, shape (3, n).
        known: As for :func:`stops_clear`.
        work: Scratch, shape (2 m + 2 n, 3).
        reserve: Scratch, of :func:`mitt.control.reserve.reserve_work`.

    Returns:
        ``PASSED``, ``KEPT`` or ``BLOCKED``.
    """
    result = KEPT if clamp(b, last, desired) else PASSED
    if clamp_to_reserve(bodies, drives, index, b, last, desired, reserve):
        result = BLOCKED
    blocked = not stops_clear(bodies, table, pairs, b, desired, known, work)
    if blocked and not _leads_out(bodies, table, pairs, last, desired, work):
        result = BLOCKED
        slow_down(b, last, desired)
    for k in range(desired.shape[1]):
        last[0, k], last[1, k], last[2, k] = desired[0, k], desired[1, k], desired[2, k]
    return result


@kernel
def _leads_out(
    bodies: Array,
    table: Array,
    pairs: NDArray[np.int64],
    last: Array,
    desired: Array,
    work: Array,
) -> bool:
    """Say whether an arm that stands too close already would get no closer."""
    ends = work[2 * desired.shape[1] :]
    before = clearance(bodies, last[0], table, pairs, ends)
    if before >= MARGIN:
        return False
    return bool(clearance(bodies, desired[0], table, pairs, ends) > before)


@final
class SafetyFilter:
    """The envelope of one arm: what is emitted passes through here and nowhere else.

    Attributes:
        bounds: As for :func:`stops_clear`, shape (8, n).
        shapes: Shapes of the arm and of what stands around it.
        last: q, dq, ddq emitted in the tick before, shape (3, n).
        known: As for :func:`stops_clear`.
        work: Scratch.
        reserve: Scratch, of :func:`mitt.control.reserve.reserve_work`.
    """

    def __init__(self, arm: Arm, around: Surroundings) -> None:
        """Take the arm and what stands around it; the arm is taken to rest in its ready pose."""
        checks.instance("arm", arm, Arm)
        checks.instance("around", around, Surroundings)
        self.shapes, self.bounds = _numbers(arm, around)
        self.last = np.array([arm.q_ready, np.zeros(arm.n), np.zeros(arm.n)])
        self.known = np.full(arm.n + 1, -np.inf)
        self.work = np.zeros((2 * arm.n + 2 * len(self.shapes.table), 3))
        self.reserve = reserve_work(arm)
        self._packed = arm.bodies, self.shapes.table, self.shapes.pairs, self.bounds
        self._drives = arm.limits.packed, np.array(arm.model.active)

    def begin(self, q: Array, dq: Array) -> None:
        """Start from where the arm is, [rad, rad/s], shapes (n,); what is not finite is left."""
        n = self.last.shape[1]
        q, dq = checks.vector("q", q, n), checks.vector("dq", dq, n)
        if np.all(np.isfinite(q)) and np.all(np.isfinite(dq)):
            self.last[0], self.last[1], self.last[2] = q, dq, 0.0

    def step(self, desired: Array) -> int:
        """Replace a desired motion, shape (3, n), by what is emitted; see :func:`safety_filter`."""
        if checks.array("desired", desired, self.last.shape) is not desired:
            raise InputError("desired", "an array of float64, which is overwritten",
                             checks.shown(desired))  # fmt: skip
        return int(
            safety_filter(*self._packed, *self._drives, self.last, desired, self.known, self.work,
                  self.reserve)
        )  # fmt: skip

    def clear(self, q: Array, dq: Array) -> bool:
        """Say whether an arm that moves so can come to standstill without touching anything."""
        n = self.last.shape[1]
        q = checks.vector("q", q, n, finite=True)
        motion = np.array([q, checks.vector("dq", dq, n, finite=True), np.zeros(n)])
        return bool(stops_clear(*self._packed, motion, self.known, self.work))


@lru_cache(maxsize=32)
def _numbers(arm: Arm, around: Surroundings) -> tuple[Shapes, Array]:
    """Return shapes and limits; they are worked out once, not each throw."""
    shapes, bounds = shapes_of(arm, around), bounds_of(arm)
    return shapes, np.array([*bounds, shapes.reach, gentle_rates(arm, bounds[DECELERATION])])
