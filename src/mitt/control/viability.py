"""Whether the arm can come to standstill without touching itself or what stands around it.

From q, dq every joint brakes at its own trusted deceleration. The way to standstill is walked by
conservative advancement: where the smallest gap is d, no point gets closer than d minus the way
that it can still travel, and so far the arm can be moved on without looking. Nothing thin is
stepped over, and in open space one look is enough.
"""

from functools import lru_cache
from typing import final

import numpy as np
from numpy.typing import NDArray

from mitt.control.envelope import bounds_of, keep, slow_down
from mitt.jit import kernel
from mitt.robot.arm import Arm
from mitt.robot.shapes import Shapes, Surroundings, clearance, shapes_of
from mitt.signals import Array
from mitt.views import lent, view

#: Gap that is kept [m], and what a look may leave open before the way counts as blocked [m].
MARGIN, _SLIVER = 0.01, 0.0005
#: Looks along the way; if they do not suffice it counts as blocked.
_LOOKS = 40
#: What the sums of a bound on the room may be off by [m].
_TRIFLE = 1e-9


#: What became of a wish: passed as it was, kept within the limits, replaced by braking.
PASSED, KEPT, BLOCKED = 0, 1, 2


@kernel
def stops_clear(
    bodies: Array,
    table: Array,
    pairs: NDArray[np.int64],
    b: Array,
    q: Array,
    dq: Array,
    known: Array,
    work: Array,
) -> bool:
    """Say whether the way to standstill from ``q``, ``dq`` keeps ``MARGIN`` from everything.

    Where the room that was last measured suffices, less what the arm has moved since, it is not
    measured again.

    Args:
        bodies: Table of :mod:`mitt.robot.dynamics`, shape (N, 31).
        table: Shapes, shape (m, 8).
        pairs: Those to be kept apart, shape (p, 2).
        b: Limits, as of :mod:`mitt.control.envelope`, shape (6, n).
        q: Positions [rad], shape (n,).
        dq: Speeds [rad/s], shape (n,).
        known: Where room was last measured [rad], and how much there was [m], overwritten,
            shape (n + 1,).
        work: Scratch, shape (2 m + n, 3).
    """
    bodies, table, pairs, known, work = lent((bodies, table, pairs, known, work))
    n, t = len(q), 0.0
    ends, way = view(work, 3 * n, (len(work) - n, 3)), view(work, 0, (n,))
    for look in range(_LOOKS):
        left, pace, moved = 0.0, 0.0, _TRIFLE
        for k in range(n):
            brake, speed, reach = b[3, k], abs(dq[k]), b[5, k]
            passed = min(t, speed / brake)
            gone = passed * (speed - 0.5 * brake * passed)
            way[k] = q[k] + np.copysign(gone, dq[k])
            left += reach * (0.5 * speed * speed / brake - gone)
            pace += reach * max(speed - brake * t, 0.0)
            moved += reach * abs(q[k] - known[k])
        if look == 0 and max(left, _SLIVER) < known[n] - moved:
            return True
        room = clearance(bodies, way, table, pairs, ends) - MARGIN
        if look == 0:
            known[:n], known[n] = q, room
        if room < 0.0 or (room < _SLIVER and left > 0.0):
            return False
        if left <= room:
            return True
        t += room / pace
    return False


@kernel
def guard(
    bodies: Array,
    table: Array,
    pairs: NDArray[np.int64],
    b: Array,
    last: Array,
    wanted: Array,
    known: Array,
    work: Array,
) -> int:
    """Replace a wanted motion by what is emitted, and remember it.

    A motion from which the way to standstill is blocked is not emitted: the joints brake from
    where they are instead, along the way that was found clear in the tick before. Motion that
    was blocked from the start may only lead out.

    Args:
        bodies: Table of :mod:`mitt.robot.dynamics`, shape (N, 31).
        table: Shapes, shape (m, 8).
        pairs: Those to be kept apart, shape (p, 2).
        b: Limits, as of :mod:`mitt.control.envelope`, shape (6, n).
        last: q, dq emitted in the tick before, overwritten, shape (2, n).
        wanted: q_d, dq_d, ddq_d; q, dq, ddq afterwards, shape (3, n).
        known: As for :func:`stops_clear`.
        work: Scratch, shape (2 m + n, 3).

    Returns:
        ``PASSED``, ``KEPT`` or ``BLOCKED``.
    """
    b, last, wanted = lent((b, last, wanted))
    result = KEPT if keep(b, last, wanted) else PASSED
    blocked = not stops_clear(bodies, table, pairs, b, wanted[0], wanted[1], known, work)
    if blocked and not _leads_out(bodies, table, pairs, last, wanted, work):
        result = BLOCKED
        slow_down(b, last, wanted)
    for k in range(wanted.shape[1]):
        last[0, k], last[1, k] = wanted[0, k], wanted[1, k]
    return result


@kernel
def _leads_out(
    bodies: Array,
    table: Array,
    pairs: NDArray[np.int64],
    last: Array,
    wanted: Array,
    work: Array,
) -> bool:
    """Say whether an arm that stands too close already would get no closer."""
    ends = work[wanted.shape[1] :]
    before = clearance(bodies, last[0], table, pairs, ends)
    if before >= MARGIN:
        return False
    return bool(clearance(bodies, wanted[0], table, pairs, ends) > before)


@final
class Guard:
    """The envelope of one arm: what is emitted passes through here and nowhere else.

    Attributes:
        bounds: Limits, as of :mod:`mitt.control.envelope`, shape (6, n).
        shapes: Shapes of the arm and of what stands around it.
        last: q, dq emitted in the tick before, shape (2, n).
        known: As for :func:`stops_clear`.
        work: Scratch.
    """

    def __init__(self, arm: Arm, around: Surroundings) -> None:
        """Take the arm and what stands around it; the arm is taken to rest in its ready pose."""
        self.shapes, self.bounds = _numbers(arm, around)
        self.last = np.array([arm.q_ready, np.zeros(arm.n)])
        self.known = np.full(arm.n + 1, -np.inf)
        self.work = np.zeros((arm.n + 2 * len(self.shapes.table), 3))
        self._packed = arm.bodies, self.shapes.table, self.shapes.pairs, self.bounds

    def begin(self, q: Array, dq: Array) -> None:
        """Start from where the arm is, [rad, rad/s], shapes (n,); what is not finite is left."""
        if np.all(np.isfinite(q)) and np.all(np.isfinite(dq)):
            self.last[0], self.last[1] = q, dq

    def step(self, wanted: Array) -> int:
        """Replace a wanted motion, shape (3, n), by what is emitted; see :func:`guard`."""
        return int(guard(*self._packed, self.last, wanted, self.known, self.work))

    def clear(self, q: Array, dq: Array) -> bool:
        """Say whether an arm that moves so can come to standstill without touching anything."""
        return bool(stops_clear(*self._packed, q, dq, self.known, self.work))


@lru_cache(maxsize=32)
def _numbers(arm: Arm, around: Surroundings) -> tuple[Shapes, Array]:
    """Return shapes and limits; they are worked out once, not each throw."""
    shapes = shapes_of(arm, around)
    return shapes, np.array([*bounds_of(arm), shapes.reach])
