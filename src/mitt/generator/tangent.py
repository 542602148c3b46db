"""The tangent map l_c: from virtual joints to a ball's position (its inverse: inverse.py).

Eq. (5): l_c(q) = l(qbar) + T(qbar) s with s = q_i - q_alpha and qbar = q with q_i := q_alpha.
The paper's T is J_i = dl/dq_i; here T = kappa J_i + inward (w_i x J_i), w_i the axis of joint i,
because an arm that cannot be as fast as the ball has to be met from a chosen side: the ball comes
with relative velocity (T - J_i) dq_i. kappa slows joint i and lets the ball in along the tangent;
inward lets it in along the line to joint i's axis, for an elbow down the forearm, into the palm.

| here          | paper / equations                         | unit        | shape  |
|---------------|-------------------------------------------|-------------|--------|
| ``T``         | the line along which the ball comes       | m/rad       | (3,)   |
| ``q_o``       | joint angles of l_c^-1                    | rad         | (n,)   |
| ``A``         | dq_o/dp                                   | 1           | (n, 3) |
| ``J_c``       | dl_c/dp                                   | m/rad       | (3, 3) |
| ``curvature`` | J_c-dot dq_o, second derivative along dq_o| m/s^2       | (3,)   |

Three joints are free, the catch joint among them, so J_c is square. Any further joint follows them,
q_o = q_rest + A (p - p_rest): the arm is one of three virtual joints p then, each of which turns
several. Where its row of A is 0 a joint stays at q_rest and takes part through b alone. J_i and w_i
are those of the virtual joint: sums over the joints that it turns.

The coordinates p of these virtual joints are the angles of the free joints, but for the catch joint
where q_alpha goes with the two others: q_alpha = q_catch + slope . (the others), and
p_i = q_i - slope . (the others), so that s = p_i - q_catch all the same. The catch joint's row of A
holds the slope.
"""

from typing import NamedTuple

import numpy as np

from mitt.jit import kernel
from mitt.robot.kinematics import (
    ZERO,
    Chain,
    Motion,
    Vec,
    cross,
    motion_of,
    move,
    place,
    plus,
    put,
    row,
    times,
)
from mitt.signals import Array


class Tangent(NamedTuple):
    """The map l_c of one arm as arrays.

    ``planar`` marks an arm whose inverse is closed-form (see :mod:`mitt.generator.planar`);
    its figures are catch point and tangent in that plane, the shoulder's height, two signs.
    """

    chain: Chain
    free: tuple[int, int, int]  # the free joints, from the base outwards
    catch_joint: int  # index i among the active joints
    catch: int  # its place among the free ones
    q_catch: float  # q_alpha [rad], where the slope is 0 or the two other free joints are at 0
    kappa: float  # velocity-match ratio
    inward: float  # share of the ball's line that leads towards the catch joint's axis
    q_rest: Array  # (n,) pose from which the joints that are not free follow [rad]
    A: Array  # (n, 3) how far each joint turns per coordinate p
    planar: bool
    plane: Array  # (7,) p_x, p_z, t_x, t_z, shoulder height, sign of yaw, sign of pitch


class Scratch(NamedTuple):
    """Buffers of the kernels."""

    motion: Motion
    q: Array  # (n,) qbar
    dq: Array  # (n,) velocity of qbar
    step: Array  # (n,) one step of Newton's method
    still: Array  # (n,) zeros
    point: Array  # (3, 3) l_c, residual, curvature
    ends: Array  # (3, 3) start of a way and the way itself
    J_c: Array  # (3, 3) rows over the coordinates p: J_c transposed


def scratch_of(n: int) -> Scratch:
    """Return buffers for ``n`` active joints."""
    rows = [np.zeros(n) for _ in range(4)]
    return Scratch(motion_of(n), *rows, *(np.zeros((3, 3)) for _ in range(3)))


@kernel
def coordinate(g: Tangent, q_o: Array, a: int) -> float:
    """Return coordinate ``a`` of p, of a pose of all joints or of a rate of it."""
    p = q_o[g.free[a]]
    if a == g.catch:
        for b in range(3):
            if b != a:
                p -= g.A[g.catch_joint, b] * q_o[g.free[b]]
    return float(p)


@kernel
def catch_angle(g: Tangent, q_o: Array) -> float:
    """Return q_alpha for a pose, of which the two other free joints are read [rad]."""
    angle = g.q_catch
    for a in range(3):
        if a != g.catch:
            angle += g.A[g.catch_joint, a] * q_o[g.free[a]]
    return float(angle)


@kernel
def to_go(g: Tangent, q_o: Array) -> float:
    """Return s = q_i - q_alpha, the signed distance still to go [rad]."""
    return float(q_o[g.catch_joint] - catch_angle(g, q_o))


@kernel
def follow(g: Tangent, q_o: Array) -> None:
    """Write the angles of the joints that are not free, of a pose whose free joints are there."""
    for k in range(len(q_o)):
        if k != g.free[0] and k != g.free[1] and k != g.free[2]:
            q_o[k] = g.q_rest[k]
            for a in range(3):
                q_o[k] += g.A[k, a] * (coordinate(g, q_o, a) - coordinate(g, g.q_rest, a))


@kernel
def turn_all(g: Tangent, dq: Array) -> None:
    """Write dq = A dp of all joints, where the entries of the free joints hold dp."""
    dp = dq[g.free[0]], dq[g.free[1]], dq[g.free[2]]
    for k in range(len(dq)):
        dq[k] = g.A[k, 0] * dp[0] + g.A[k, 1] * dp[1] + g.A[k, 2] * dp[2]


@kernel
def expand(g: Tangent, q_o: Array, w: Scratch) -> None:
    """Write l_c and J_c at a pose ``q_o``, of which the free joints are read."""
    c, m = g.catch, w.motion
    s = to_go(g, q_o)
    for k in range(len(q_o)):
        w.q[k] = q_o[k]
    w.q[g.catch_joint] = catch_angle(g, q_o)
    follow(g, w.q)
    place(g.chain, w.q, m)
    J = _turned(g.A, c, m.J)
    T = plus(times(g.kappa, J), times(g.inward, cross(_turned(g.A, c, m.W), J)))
    put(w.point, 0, plus(row(m.tip, 0), times(s, T)))
    for a in range(3):
        if a == c:
            put(w.J_c, a, T)
        else:
            put(w.J_c, a, plus(_turned(g.A, a, m.J), times(s, _line_slope(g, m, a))))


@kernel
def _turned(A: Array, a: int, rows: Array) -> Vec:
    """Return what coordinate ``a`` turns of a vector a joint: J or w of that virtual joint."""
    total: Vec = ZERO
    for k in range(len(A)):
        if A[k, a] != 0.0:
            total = plus(total, times(A[k, a], row(rows, k)))
    return total


@kernel
def _line_slope(g: Tangent, m: Motion, a: int) -> Vec:
    """Return dT/dp of a coordinate, by dJ_l/dq_k = w_k x J_l for k <= l and w_l x J_k beyond."""
    c = g.catch
    dJ: Vec = ZERO
    dw: Vec = ZERO
    for k in range(len(g.A)):
        if g.A[k, a] == 0.0:
            continue
        for at in range(len(g.A)):
            share = g.A[k, a] * g.A[at, c]
            if share == 0.0:
                continue
            if k <= at:
                dJ = plus(dJ, times(share, cross(row(m.W, k), row(m.J, at))))
                dw = plus(dw, times(share, cross(row(m.W, k), row(m.W, at))))
            else:
                dJ = plus(dJ, times(share, cross(row(m.W, at), row(m.J, k))))
    bent = plus(cross(dw, _turned(g.A, c, m.J)), cross(_turned(g.A, c, m.W), dJ))
    slope: Vec = plus(times(g.kappa, dJ), times(g.inward, bent))
    return slope


@kernel
def curve(g: Tangent, q_o: Array, dq_o: Array, w: Scratch) -> None:
    """Write the curvature of l_c along ``dq_o`` at the virtual joints that were expanded last."""
    m = w.motion
    s, ds = to_go(g, q_o), coordinate(g, dq_o, g.catch)
    for k in range(len(q_o)):
        w.dq[k] = dq_o[k]
    w.dq[g.catch_joint] = 0.0
    turn_all(g, w.dq)
    move(g.chain, w.q, w.dq, m)
    dT, ddT = _line(g, m)
    put(w.point, 2, plus(row(m.tip, 2), plus(times(2.0 * ds, dT), times(s, ddT))))


@kernel
def _line(g: Tangent, m: Motion) -> tuple[Vec, Vec]:
    """Return both derivatives of T = kappa J_i + inward (w_i x J_i) along dq of qbar."""
    c = g.catch
    dJ, ddJ = _turned(g.A, c, m.dJ), _turned(g.A, c, m.ddJ)
    dT, ddT = times(g.kappa, dJ), times(g.kappa, ddJ)
    if g.inward != 0.0:
        J, w, dw, ddw = _turned(g.A, c, m.J), ZERO, ZERO, ZERO
        for k in range(len(g.A)):
            share = 0.0 if g.chain.prismatic[k] > 0.0 else g.A[k, c]
            w = plus(w, times(share, row(m.line[0], k)))
            dw = plus(dw, times(share, row(m.line[1], k)))
            ddw = plus(ddw, times(share, row(m.line[2], k)))
        turned = plus(cross(ddw, J), plus(times(2.0, cross(dw, dJ)), cross(w, ddJ)))
        dT = plus(dT, times(g.inward, plus(cross(dw, J), cross(w, dJ))))
        ddT = plus(ddT, times(g.inward, turned))
    return dT, ddT
