"""The inverse for targets within reach: joint angles that bring the tool to a place, eqs. (2), (6).

A ball that flies is out of reach until the catch, so l_c continues the arm along a line
(:mod:`mitt.core.map.tangent`). A part on a belt or a thing in a hand is within reach, and l itself
can be inverted: q_o = l^-1(r_o), with its velocity and its acceleration.

The tool's direction is held as far as there are joints for it. With k free joints the arm obeys k
rows: three bring the tool to the target; with five its z axis is that of a given frame as well;
with six so is its x axis. Any further joint follows the free ones, q_o = q_rest + A (p - p_rest), p
their angles: a wrist whose row of A is minus the sum of parallel joints keeps the tool's pitch.

| here        | meaning                                                | unit   | shape      |
|-------------|--------------------------------------------------------|--------|------------|
| ``target``  | r_o, dr_o, ddr_o                                       | m ..   | (3, 3)     |
| ``frame``   | columns: where the tool's x, y and z axis are to point | 1      | (3, 3)     |
| ``virtual`` | q_o = l^-1(r_o) and two derivatives                    | rad .. | (3, n)     |
| ``p``       | angles of the free joints                              | rad    | (k,)       |
| ``rows``    | slope of the k rows in p, and what is left of them     | m, 1   | (k, k + 1) |

The rows of direction are the components of the tool's axes that should be nought: z along the
frame's x and y, and x along the frame's y. They say the same of an axis and of its opposite; the
branch is that of the pose from which the inverse starts.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mitt.core.arm.arm import Arm
from mitt.core.arm.kinematics import (
    ZERO,
    Chain,
    Mat,
    Motion,
    Vec,
    cross,
    dot,
    minus,
    motion_of,
    move,
    place,
    plus,
    put,
    rotate,
    row,
    times,
)
from mitt.core.errors import ModelError
from mitt.core.kernels import kernel
from mitt.core.signals import Array

#: Newton's method: largest step of a joint [rad], largest residual [m and 1], steps, stride [m].
_STEP = 0.3
_RESIDUAL = 1e-12
_STEPS = 40
_STRIDE = 0.1
#: A pivot below this share of the largest entry counts as a singular pose.
_SINGULAR = 1e-6
#: Beyond these a target counts as outside the domain [m; m/s and m/s^2].
_FARTHEST = 1e2
_FASTEST = 1e4


class Reach(NamedTuple):
    """The inverse of one arm as arrays."""

    chain: Chain
    tool: Array  # (2, 3) the tool's z and x axis in the last joint's frame
    free: NDArray[np.int64]  # (k,) the free joints, from the base outwards
    A: Array  # (n, k) how far each joint turns per free joint
    q_rest: Array  # (n,) pose from which the joints that are not free follow [rad]


class ReachScratch(NamedTuple):
    """Buffers of the kernels."""

    motion: Motion
    frame: Array  # (3, 3) columns: where the tool's axes are to point
    way: Array  # (2, 3) where the tool is at first, and the way from there to the target [m]
    axes: Array  # (2, 3) the tool's z and x axis in the world
    rows: Array  # (k, k + 1) slope of the rows in p, and right side
    curved: Array  # (k,) what the rows accelerate by at constant joint velocities
    p: Array  # (k,) a solution


def reach_of(arm: Arm, free: tuple[int, ...], coupling: Array | None = None) -> Reach:
    """Return the inverse of an arm.

    Args:
        arm: The arm.
        free: Three, five or six of its joints, rising indices; they obey the rows.
        coupling: How far each other joint turns per free one, shape (n - k, k); they rest without.

    Raises:
        ModelError: There are not as many such joints, or no such rows.
    """
    n, k = arm.n, len(free)
    if k not in (3, 5, 6):
        raise ModelError("free", "three, five or six joints", f"{k}")
    if sorted(set(free)) != list(free) or not 0 <= free[0] <= free[-1] < n:
        raise ModelError("free", f"rising indices in 0..{n - 1}", free)
    A, further = np.zeros((n, k)), [j for j in range(n) if j not in free]
    A[list(free)] = np.eye(k)
    if coupling is not None:
        if np.shape(coupling) != (n - k, k):
            raise ModelError("coupling", f"shape ({n - k}, {k})", np.shape(coupling))
        A[further] = coupling
    plate = arm.orientation(arm.q_ready)
    last = np.reshape(place(arm.chain, arm.q_ready, motion_of(n)), (3, 3))
    tool = last.T @ plate
    axes = np.ascontiguousarray(np.array([tool[:, 2], tool[:, 0]]))
    return Reach(arm.chain, axes, np.array(free), A, arm.q_ready.copy())


def reach_scratch(reach: Reach) -> ReachScratch:
    """Return buffers."""
    n, k = reach.A.shape
    return ReachScratch(
        motion_of(n),
        np.eye(3),
        np.zeros((2, 3)),
        np.zeros((2, 3)),
        np.zeros((k, k + 1)),
        np.zeros(k),
        np.zeros(k),
    )


@kernel
def _set(reach: Reach, q: Array, w: ReachScratch) -> None:
    """Write the joints that follow, and place the arm and its tool's axes."""
    for j in range(len(q)):
        q_j, is_free = reach.q_rest[j], False
        for a in range(len(reach.free)):
            is_free = is_free or reach.free[a] == j
            at = reach.free[a]
            q_j += reach.A[j, a] * (q[at] - reach.q_rest[at])
        if not is_free:
            q[j] = q_j
    last: Mat = place(reach.chain, q, w.motion)
    for a in range(2):
        put(w.axes, a, rotate(last, row(reach.tool, a)))


@kernel
def _aim(a: int) -> tuple[int, int]:
    """Return which of the tool's axes, and which column of the frame, row 3 + a is about."""
    return (0, a) if a < 2 else (1, 1)


@kernel
def _expand(reach: Reach, target: Vec, w: ReachScratch) -> float:
    """Write the rows at a placed arm, and what is left to their targets; return the largest."""
    k = len(reach.free)
    miss = minus(target, row(w.motion.tip, 0))
    worst = 0.0
    for r in range(k):
        axis, column = _aim(r - 3)
        way: Vec = (w.frame[0, column], w.frame[1, column], w.frame[2, column])
        for a in range(k):
            slope = 0.0
            for j in range(len(reach.A)):
                if reach.A[j, a] != 0.0:
                    if r < 3:
                        slope += reach.A[j, a] * w.motion.J[j, r]
                    else:
                        turned = cross(row(w.motion.W, j), row(w.axes, axis))
                        slope += reach.A[j, a] * dot(way, turned)
            w.rows[r, a] = slope
        w.rows[r, k] = miss[r] if r < 3 else -dot(way, row(w.axes, axis))
        worst = max(worst, abs(w.rows[r, k]))
    return worst


@kernel
def _curve(reach: Reach, q: Array, dq: Array, w: ReachScratch) -> None:
    """Write what the rows accelerate by at a placed arm and constant joint velocities."""
    m = w.motion
    move(reach.chain, q, dq, m)
    omega: Vec = ZERO
    domega: Vec = ZERO
    for j in range(len(q)):
        if reach.chain.prismatic[j] == 0.0:
            omega = plus(omega, times(dq[j], row(m.line[0], j)))
            domega = plus(domega, times(dq[j], row(m.line[1], j)))
    for r in range(len(reach.free)):
        if r < 3:
            w.curved[r] = m.tip[2, r]
        else:
            axis, column = _aim(r - 3)
            way: Vec = (w.frame[0, column], w.frame[1, column], w.frame[2, column])
            u = row(w.axes, axis)
            w.curved[r] = dot(way, plus(cross(domega, u), cross(omega, cross(omega, u))))


@kernel
def _solve(rows: Array, x: Array) -> float:
    """Write x of the rows (k, k + 1), right side last, which are spent; return the sign of det.

    Gauss's elimination with row pivots; 0 where the rows are dependent, and nothing is written.
    """
    k, sign, largest = len(rows), 1.0, 0.0
    for r in range(k):
        for a in range(k):
            largest = max(largest, abs(rows[r, a]))
    for a in range(k):
        best = a
        for r in range(a + 1, k):
            if abs(rows[r, a]) > abs(rows[best, a]):
                best = r
        if not abs(rows[best, a]) > _SINGULAR * largest:
            return 0.0
        if best != a:
            sign = -sign
            for c in range(k + 1):
                rows[a, c], rows[best, c] = rows[best, c], rows[a, c]
        sign = sign if rows[a, a] > 0.0 else -sign
        for r in range(a + 1, k):
            share = rows[r, a] / rows[a, a]
            for c in range(a, k + 1):
                rows[r, c] -= share * rows[a, c]
    for back in range(k):
        a = k - 1 - back
        x[a] = rows[a, k]
        for c in range(a + 1, k):
            x[a] -= rows[a, c] * x[c]
        x[a] /= rows[a, a]
    return sign


@kernel
def _turn_all(reach: Reach, p: Array, out: Array) -> None:
    """Write what all joints turn by where the free ones turn by p."""
    for j in range(len(out)):
        out[j] = 0.0
        for a in range(len(p)):
            out[j] += reach.A[j, a] * p[a]


@kernel
def _newton(reach: Reach, share: float, q: Array, w: ReachScratch) -> float:
    """Bring the tool a share of the way on; return the sign of det there, 0 where it fails."""
    sign = 0.0
    target = plus(row(w.way, 0), times(share, row(w.way, 1)))
    for _ in range(_STEPS):
        _set(reach, q, w)
        worst = _expand(reach, target, w)
        sign = float(_solve(w.rows, w.p))
        if worst < _RESIDUAL or sign == 0.0:
            return sign
        largest = 0.0
        for a in range(len(w.p)):
            largest = max(largest, abs(w.p[a]))
        for a in range(len(w.p)):
            q[reach.free[a]] += w.p[a] * min(1.0, _STEP / max(largest, 1e-300))
    return 0.0


@kernel
def reach_target(reach: Reach, target: Array, virtual: Array, w: ReachScratch) -> bool:
    """Write q_o, dq_o, ddq_o (3, n) of a target's r_o, dr_o, ddr_o (3, 3).

    The way from where the tool is in ``virtual[0]``, the starting point, is gone in strides; where
    the determinant changes its sign on the way, the branch has ended.

    Args:
        reach: The inverse.
        target: Motion of the target [m ...].
        virtual: Result [rad ...]; row 0 is where Newton's method starts.
        w: Scratch; its ``frame`` says where the tool's axes are to point.

    Returns:
        False outside the domain: too far, or at the end of the branch.
    """
    for c in range(9):
        if not abs(target[c // 3, c % 3]) <= (_FARTHEST if c < 3 else _FASTEST):
            return False
    q, dq, ddq = virtual[0], virtual[1], virtual[2]
    _set(reach, q, w)
    put(w.way, 0, row(w.motion.tip, 0))
    put(w.way, 1, minus(row(target, 0), row(w.way, 0)))
    parts = int(np.sqrt(dot(row(w.way, 1), row(w.way, 1))) / _STRIDE) + 1
    first = _newton(reach, 0.0, q, w)  # turns the tool where it is
    for part in range(1, parts + 1):
        if first == 0.0 or _newton(reach, part / parts, q, w) != first:
            return False
    k = len(reach.free)
    _expand(reach, row(target, 0), w)
    for r in range(k):
        w.rows[r, k] = target[1, r] if r < 3 else 0.0
    _solve(w.rows, w.p)
    _turn_all(reach, w.p, dq)
    _curve(reach, q, dq, w)
    _expand(reach, row(target, 0), w)
    for r in range(k):
        w.rows[r, k] = (target[2, r] if r < 3 else 0.0) - w.curved[r]
    _solve(w.rows, w.p)
    _turn_all(reach, w.p, ddq)
    return True
