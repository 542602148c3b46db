"""Whether the arm can come to standstill without touching itself or what stands around it.

From q, dq every joint brakes at its own trusted deceleration. The way to standstill is walked by
conservative advancement: where the smallest gap is d, no point gets closer than d minus the way
that it can still travel, and so far the arm can be moved on without looking. Nothing thin is
stepped over, and in open space one look is enough.
"""

from typing import final

import numpy as np
from numba import njit

from mitt.control.envelope import bounds_of, brake_joint, keep
from mitt.robot.arm import Arm
from mitt.robot.bodies import Bodies, Surroundings, bodies_of, clearance
from mitt.robot.chain import Chain
from mitt.signals import Array

#: Gap that is kept [m], and what a look may leave open before the way counts as blocked [m].
MARGIN, _SLIVER = 0.01, 0.0005
#: Looks along the way; if they do not suffice it counts as blocked.
_LOOKS = 40


#: What became of a wish: passed as it was, kept within the limits, replaced by braking.
PASSED, KEPT, BLOCKED = 0, 1, 2


@njit(cache=True)
def stops_clear(chain: Chain, bodies: Bodies, b: Array, q: Array, dq: Array, work: Array) -> bool:
    """Say whether the way to standstill from ``q``, ``dq`` keeps ``MARGIN`` from everything.

    Args:
        chain: Kinematics of the arm.
        bodies: Shapes, as a tuple of the arrays of :class:`mitt.robot.bodies.Bodies`.
        b: Limits, as of :mod:`mitt.control.envelope`.
        q: Positions [rad], shape (n,).
        dq: Speeds [rad/s], shape (n,).
        work: Scratch, shape (n,).
    """
    shapes, pairs, floor, reach, ends = bodies
    t = 0.0
    for _ in range(_LOOKS):
        left, pace = 0.0, 0.0
        for k in range(len(q)):
            brake, speed = b[3, k], abs(dq[k])
            passed = min(t, speed / brake)
            way = passed * (speed - 0.5 * brake * passed)
            work[k] = q[k] + np.copysign(way, dq[k])
            left += reach[k] * (0.5 * speed * speed / brake - way)
            pace += reach[k] * max(speed - brake * t, 0.0)
        gap = clearance(chain, work, shapes, pairs, floor, ends) - MARGIN
        if gap < _SLIVER and left > 0.0 or gap < 0.0:
            return False
        if left <= gap:
            return True
        t += gap / pace
    return False


@njit(cache=True)
def guard(chain: Chain, bodies: Bodies, b: Array, last: Array, wanted: Array, work: Array) -> int:
    """Replace a wanted motion by what is emitted, and remember it.

    A motion from which the way to standstill is blocked is not emitted: the joints brake from
    where they are instead, along the way that was found clear in the tick before. Motion that
    was blocked from the start may only lead out.

    Args:
        chain: Kinematics of the arm.
        bodies: Its shapes and what stands around it.
        b: Limits, shape (5, n).
        last: q, dq emitted in the tick before, overwritten, shape (2, n).
        wanted: q_d, dq_d, ddq_d; q, dq, ddq afterwards, shape (3, n).
        work: Scratch, shape (n,).

    Returns:
        ``PASSED``, ``KEPT`` or ``BLOCKED``.
    """
    result = KEPT if keep(b, last, wanted) else PASSED
    if not stops_clear(chain, bodies, b, wanted[0], wanted[1], work):
        if not _leads_out(chain, bodies, last, wanted):
            result = BLOCKED
            for k in range(wanted.shape[1]):
                wanted[0, k], wanted[1, k], wanted[2, k] = brake_joint(b[3, k], *_pair(last, k))
    for k in range(wanted.shape[1]):
        last[0, k], last[1, k] = wanted[0, k], wanted[1, k]
    return result


@njit(cache=True)
def _pair(last: Array, k: int) -> tuple[float, float]:
    """Return position and speed of a joint."""
    return last[0, k], last[1, k]


@njit(cache=True)
def _leads_out(chain: Chain, bodies: Bodies, last: Array, wanted: Array) -> bool:
    """Say whether an arm that stands too close already would get no closer."""
    shapes, pairs, floor, _, ends = bodies
    before = clearance(chain, last[0], shapes, pairs, floor, ends)
    if before >= MARGIN:
        return False
    return bool(clearance(chain, wanted[0], shapes, pairs, floor, ends) > before)


@final
class Guard:
    """The envelope of one arm: what is emitted passes through here and nowhere else."""

    def __init__(self, arm: Arm, surroundings: Surroundings) -> None:
        """Take the arm and what stands around it; the arm is taken to rest in its ready pose."""
        self.bounds = bounds_of(arm)
        self.bodies = bodies_of(arm, surroundings)
        self._chain, self._work = arm.chain, np.zeros(arm.n)
        self.last = np.array([arm.q_ready, np.zeros(arm.n)])

    def begin(self, q: Array, dq: Array) -> None:
        """Start from where the arm is, [rad, rad/s], shapes (n,); what is not finite is left."""
        if np.all(np.isfinite(q)) and np.all(np.isfinite(dq)):
            self.last[0], self.last[1] = q, dq

    def step(self, wanted: Array) -> int:
        """Replace a wanted motion, shape (3, n), by what is emitted; see :func:`guard`."""
        return int(guard(self._chain, self.bodies, self.bounds, self.last, wanted, self._work))

    def clear(self, q: Array, dq: Array) -> bool:
        """Say whether an arm that moves so can come to standstill without touching anything."""
        return bool(stops_clear(self._chain, self.bodies, self.bounds, q, dq, self._work))
