"""Inverse kinematics of the interception: joint angles, speeds and accelerations at the ball.

Position and velocity of the catch point are those of the ball. Its acceleration is not: the ball
must enter the open hand from the front, so relative to the hand it accelerates along the palm's
normal n, ddl = ddr_o - a n with a > 0; t seconds before the catch it is a t^2 / 2 in front of the
palm. Of the accelerations ``a`` between two bounds the one with the least joint torques is taken,
each joint by itself.

| here     | meaning                                          | unit          | shape  |
|----------|--------------------------------------------------|---------------|--------|
| ``ball`` | r_o, dr_o, ddr_o                                 | m, m/s, m/s^2 | (3, 3) |
| ``rows`` | q, dq, ddq; row 0 is where the iteration starts  | rad ...       | (3, n) |
| ``hand`` | n in the last joint's frame, then M_kk / tau_max | 1, s^2/rad    | (3 + n,) |
"""

import numpy as np
from numpy.typing import NDArray

from mitt.generator.packing import unfold, unpack
from mitt.jit import kernel
from mitt.robot.arm import Arm
from mitt.robot.kinematics import (
    IDENTITY,
    ZERO,
    Chain,
    Vec,
    compose,
    cross,
    dot,
    matrix,
    minus,
    place,
    plus,
    rotate,
    row,
    sweep,
    times,
    turn,
)
from mitt.signals import Array

#: det(J J') below which steps are damped [m^6], and the damping at 0 [m^2].
_POOR, _DAMPING = 1e-3, 1e-2
#: Newton: largest step of a joint [rad], residual [m], steps allowed.
_STEP, _RESIDUAL, _STEPS = 0.4, 1e-9, 30


def hand_of(arm: Arm) -> Array:
    """Return ``hand`` of the module's table, shape (3 + n,)."""
    q = arm.q_ready
    frame = np.array([_frame(arm.chain, q, axis) for axis in np.eye(3)]).T
    normal = frame.T @ arm.orientation(q)[:, 2]
    return np.array([*normal, *np.diag(arm.mass_matrix(q)) / arm.tau_max])


@kernel
def _frame(chain: Chain, q: Array, local: Array) -> Vec:
    """Return a direction fixed in the last joint's frame in the world."""
    frame = IDENTITY
    for k in range(len(q)):
        frame = compose(frame, matrix(chain.R, k))
        if chain.prismatic[k] == 0.0:
            frame = compose(frame, turn(row(chain.axis, k), q[k]))
    out: Vec = rotate(frame, (local[0], local[1], local[2]))
    return out


@kernel
def resolve(J: Array, b: Vec, out: Array) -> None:
    """Write x with J' x = b by damped least squares, J of shape (n, 3).

    x = J (J' J + lambda I)^-1 b, damped only where det(J' J) is small (Nakamura and Hanafusa
    1986); elsewhere the solution is exact.
    """
    a, c, e = _gram(J, 0), _gram(J, 1), _gram(J, 2)
    det = dot(a, cross(c, e))
    poor = max(0.0, 1.0 - det / _POOR)
    damp = _DAMPING * poor * poor
    a, c, e = (a[0] + damp, a[1], a[2]), (c[0], c[1] + damp, c[2]), (e[0], e[1], e[2] + damp)
    normal = cross(c, e)
    det = dot(a, normal)
    y = (dot(b, normal) / det, dot(b, cross(e, a)) / det, dot(b, cross(a, c)) / det)
    for k in range(len(out)):
        out[k] = dot(row(J, k), y)


@kernel
def _gram(J: Array, i: int) -> Vec:
    """Return row i of J' J."""
    x, y, z = 0.0, 0.0, 0.0
    for k in range(J.shape[0]):
        x += J[k, i] * J[k, 0]
        y += J[k, i] * J[k, 1]
        z += J[k, i] * J[k, 2]
    return x, y, z


@kernel
def reach(packed: Array, r: Array, q: Array, work: Array) -> float:
    """Move ``q`` to where the catch point is at ``r``; return the distance that is left [m]."""
    g = unpack(packed)
    w = unfold(work, len(q))
    m, gap = w.motion, np.inf
    for _ in range(_STEPS):
        place(g.chain, q, m)
        b = minus((r[0], r[1], r[2]), row(m.tip, 0))
        gap = np.sqrt(dot(b, b))
        if not gap > _RESIDUAL:
            break
        resolve(m.J, b, w.step)
        largest = 0.0
        for k in range(len(q)):
            largest = max(largest, abs(w.step[k]))
        for k in range(len(q)):
            q[k] += w.step[k] * min(1.0, _STEP / max(largest, 1e-300))
    return float(gap)


@kernel
def lift(packed: Array, hand: Array, ahead: Vec, point: Array, rows: Array, work: Array) -> float:
    """Write q, dq, ddq at which a point in front of the palm follows a moving point.

    Args:
        packed: The arm.
        hand: As of :func:`hand_of`.
        ahead: Distance in front of the catch point along the palm's normal, and its two
            derivatives in time [m, m/s, m/s^2].
        point: Position, velocity, acceleration to be followed [m ...], shape (3, 3).
        rows: Result; row 0 is where the iteration starts and so chooses the branch, shape (3, n).
        work: Scratch.

    Returns:
        Distance that is left [m].
    """
    longer = packed.copy()  # kept by its use as an argument below: views do not keep it
    tip = unpack(longer).chain.tip
    for c in range(3):
        tip[c] += ahead[0] * hand[c]
    gap: float = _lift(longer, hand, ahead, point, rows, work)
    return gap


@kernel
def _lift(packed: Array, hand: Array, ahead: Vec, point: Array, rows: Array, work: Array) -> float:
    """As :func:`lift`, for an arm whose tip is the point in front of the palm."""
    g = unpack(packed)
    gap = reach(packed, point[0], rows[0], work)
    w = unfold(work, rows.shape[1])
    m = w.motion
    normal = _frame(g.chain, rows[0], hand[:3])
    resolve(m.J, minus(row(point, 1), times(ahead[1], normal)), rows[1])
    sweep(g.chain, rows[0], rows[1], m)
    turning = ZERO
    for k in range(rows.shape[1]):
        turning = plus(turning, times(rows[1, k], cross(row(m.W, k), normal)))
    fixed = plus(row(m.tip, 2), plus(times(2.0 * ahead[1], turning), times(ahead[2], normal)))
    resolve(m.J, minus(row(point, 2), fixed), rows[2])
    return float(gap)


@kernel
def meet(
    packed: Array, hand: Array, bounds: tuple[float, float], ball: Array, rows: Array, work: Array
) -> bool:
    """Write how the ball is met; False where the catch point cannot be where the ball is.

    Args:
        packed: The arm, as :attr:`DirectMap.packed`.
        hand: As of :func:`hand_of`.
        bounds: Smallest and largest relative acceleration a [m/s^2].
        ball: The ball, shape (3, 3).
        rows: Result, shape (3, n).
        work: Scratch.
    """
    n = rows.shape[1]
    if not _lift(packed, hand, ZERO, ball, rows, work) <= 1e3 * _RESIDUAL:
        return False
    g = unpack(packed)
    w = unfold(work, n)
    resolve(w.motion.J, _frame(g.chain, rows[0], hand[:3]), w.dq)
    along, size = 0.0, 1e-300
    for k in range(n):
        along += rows[2, k] * w.dq[k] * hand[3 + k] ** 2
        size += (w.dq[k] * hand[3 + k]) ** 2
    a = min(max(along / size, bounds[0]), bounds[1])
    for k in range(n):
        rows[2, k] -= a * w.dq[k]
    return True


@kernel
def meetings(
    packed: Array, hand: Array, bounds: tuple[float, float], balls: Array, rows: Array, work: Array
) -> NDArray[np.bool_]:
    """Write how each of several balls (K, 3, 3) is met, shape (K, 3, n); say which can be.

    Each starts from the one before it; ``rows[0, 0]`` is where the first starts.
    """
    found = np.zeros(len(balls), np.bool_)
    first = rows[0, 0].copy()
    for k in range(len(balls)):
        rows[k, 0] = rows[k - 1, 0] if k > 0 and found[k - 1] else first
        found[k] = meet(packed, hand, bounds, balls[k], rows[k], work)
    return found
