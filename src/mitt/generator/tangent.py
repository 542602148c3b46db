"""The tangent map l_c and its inverse: from a ball's position to virtual joints and back.

Eq. (5): l_c(q) = l(qbar) + T(qbar) s with s = q_i - q_alpha and qbar = q with q_i := q_alpha.
The paper's T is J_i = dl/dq_i; here T = kappa J_i + inward (w_i x J_i), w_i the axis of joint i,
because an arm that cannot be as fast as the ball has to be met from a chosen side: the ball comes
with relative velocity (T - J_i) dq_i. kappa slows joint i and lets the ball in along the tangent;
inward lets it in along the line to joint i's axis, for an elbow down the forearm, into the palm.

| here          | paper / equations                         | unit        | shape  |
|---------------|-------------------------------------------|-------------|--------|
| ``T``         | the line along which the ball comes       | m/rad       | (3,)   |
| ``q_o``       | l_c^-1(r_o), eq. (10)                     | rad         | (n,)   |
| ``A``         | dq_o over the three free joints           | 1           | (n, 3) |
| ``J_c``       | dl_c/dq over the three free joints        | m/rad       | (3, 3) |
| ``curvature`` | J_c-dot dq_o, second derivative along dq_o| m/s^2       | (3,)   |

Three joints are free, the catch joint among them, so J_c is square. Any further joint follows them,
q_o = q_rest + A (p - p_rest) with p the free joints: the arm is one of three virtual joints
then, each of which turns several. Where its row of A is 0 a joint stays at q_rest and takes part
through b alone. J_i and w_i are those of the virtual joint: sums over the joints that it turns.
"""

from typing import NamedTuple

import numpy as np

from mitt.jit import kernel
from mitt.robot.chain import Chain, Motion, motion_of, move, place
from mitt.robot.vectors import ZERO, Vec, cross, dot, minus, plus, put, row, times
from mitt.signals import Array
from mitt.views import view

#: |det J_c| below this share of the product of its columns' lengths counts as singular.
_SINGULAR = 1e-9
#: Newton: largest step of a joint [rad], largest residual [m], steps allowed, stride [m].
_NEWTON_STEP, _NEWTON_RESIDUAL, _NEWTON_STEPS, _STRIDE = 0.5, 1e-11, 40, 0.25

#: Beyond these a ball counts as outside the domain [m; m/s and m/s^2]: so what the map says stays
#: finite, and the straight line of Newton's strides stays short.
_FARTHEST, _FASTEST = 1e3, 1e6


class Tangent(NamedTuple):
    """The map l_c of one arm as arrays.

    ``planar`` marks an arm whose inverse is closed-form (see :mod:`mitt.generator.planar`);
    its figures are catch point and tangent in that plane, the shoulder's height, two signs.
    """

    chain: Chain
    free: tuple[int, int, int]  # the free joints, from the base outwards
    catch_joint: int  # index i among the active joints
    catch: int  # its place among the free ones
    q_catch: float  # q_alpha [rad]
    kappa: float  # velocity-match ratio
    inward: float  # share of the ball's line that leads towards the catch joint's axis
    q_rest: Array  # (n,) pose from which the joints that are not free follow [rad]
    A: Array  # (n, 3) how far each joint turns per free joint
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
    J_c: Array  # (3, 3) rows over the free joints: J_c transposed


def scratch_of(n: int) -> Scratch:
    """Return buffers for ``n`` active joints."""
    rows = [np.zeros(n) for _ in range(4)]
    return Scratch(motion_of(n), *rows, *(np.zeros((3, 3)) for _ in range(3)))


@kernel
def follow(g: Tangent, q_o: Array) -> None:
    """Write the angles of the joints that are not free, of a pose whose free joints are there."""
    follow_rate(g, q_o)
    for k in range(len(q_o)):
        if k != g.free[0] and k != g.free[1] and k != g.free[2]:
            rest = g.q_rest[k]
            for a in range(3):
                rest -= g.A[k, a] * g.q_rest[g.free[a]]
            q_o[k] += rest


@kernel
def follow_rate(g: Tangent, dq_o: Array) -> None:
    """Write the speeds of the joints that are not free, from those that are."""
    for k in range(len(dq_o)):
        if k != g.free[0] and k != g.free[1] and k != g.free[2]:
            dq_o[k] = 0.0
            for a in range(3):
                dq_o[k] += g.A[k, a] * dq_o[g.free[a]]


@kernel
def expand(g: Tangent, q_o: Array, w: Scratch) -> None:
    """Write l_c and J_c at the virtual joints ``q_o``, of which the free ones are read."""
    c, m = g.catch, w.motion
    for k in range(len(q_o)):
        w.q[k] = q_o[k]
    w.q[g.catch_joint] = g.q_catch
    follow(g, w.q)
    s = q_o[g.catch_joint] - g.q_catch
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
    """Return what free joint ``a`` turns of a vector a joint: J or w of that virtual joint."""
    total: Vec = ZERO
    for k in range(len(A)):
        if A[k, a] != 0.0:
            total = plus(total, times(A[k, a], row(rows, k)))
    return total


@kernel
def _line_slope(g: Tangent, m: Motion, a: int) -> Vec:
    """Return dT/dp of a free joint, by dJ_l/dq_k = w_k x J_l for k <= l and w_l x J_k beyond."""
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
    i, m = g.catch_joint, w.motion
    for k in range(len(q_o)):
        w.dq[k] = dq_o[k]
    w.dq[i] = 0.0
    follow_rate(g, w.dq)
    s, ds = q_o[i] - g.q_catch, dq_o[i]
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


@kernel
def solve3(rows: Array, b: Vec, free: tuple[int, int, int], out: Array) -> bool:
    """Write the free entries of x with x_0 rows_0 + x_1 rows_1 + x_2 rows_2 = b (Cramer).

    False where the rows are dependent; then nothing is written.
    """
    a0, a1, a2 = row(rows, 0), row(rows, 1), row(rows, 2)
    normal = cross(a1, a2)
    det = dot(a0, normal)
    size = np.sqrt(dot(a0, a0) * dot(a1, a1) * dot(a2, a2))
    if not abs(det) > _SINGULAR * size:
        return False
    out[free[0]] = dot(b, normal) / det
    out[free[1]] = dot(b, cross(a2, a0)) / det
    out[free[2]] = dot(b, cross(a0, a1)) / det
    return True


@kernel
def invert_planar(g: Tangent, r_o: Array, q_o: Array) -> bool:
    """Write l_c^-1(r_o) in closed form; False outside its domain.

    Turning about the shoulder keeps |r|, so |r_o| alone fixes s through
    |p + s t|^2 = |r_o|^2; of the two roots the one that is zero at the catch.
    """
    px, pz, tx, tz, height, yaw, pitch = g.plane
    x, y, z = r_o[0], r_o[1], r_o[2] - height
    tt, pt = tx * tx + tz * tz, px * tx + pz * tz
    root = pt * pt - tt * (px * px + pz * pz - (x * x + y * y + z * z))
    rho = np.sqrt(x * x + y * y)
    if not (root > _SINGULAR * pt * pt and rho > _SINGULAR and np.isfinite(root)):
        return False
    s = (-pt + np.sign(pt) * np.sqrt(root)) / tt
    q_o[:] = g.q_rest
    q_o[g.free[0]] = yaw * np.arctan2(y, x)
    q_o[g.free[1]] = pitch * (np.arctan2(rho, z) - np.arctan2(px + s * tx, pz + s * tz))
    q_o[g.free[2]] = g.q_catch + s
    return True


@kernel
def invert_newton(g: Tangent, r_o: Array, q_o: Array, w: Scratch) -> bool:
    """Improve ``q_o`` to l_c^-1(r_o); False outside the domain.

    The way from l_c(q_o) to r_o is gone in steps of Newton's method along the straight line;
    where det J_c changes its sign on the way, the branch of the catch has ended.
    """
    expand(g, q_o, w)
    w.ends[0] = w.point[0]
    for c in range(3):
        w.ends[1, c] = r_o[c] - w.ends[0, c]
    way = np.sqrt(w.ends[1, 0] ** 2 + w.ends[1, 1] ** 2 + w.ends[1, 2] ** 2)
    if not way <= _FARTHEST:
        return False
    parts = int(way / _STRIDE) + 1
    sign = _orientation(w.J_c)
    for part in range(1, parts + 1):
        if not _newton(g, part / parts, q_o, w):
            return False
    return bool(_orientation(w.J_c) == sign)


@kernel
def _newton(g: Tangent, share: float, q_o: Array, w: Scratch) -> bool:
    """Solve l_c(q_o) = ends[0] + share ends[1]."""
    for _ in range(_NEWTON_STEPS):
        expand(g, q_o, w)
        miss = 0.0
        for c in range(3):
            w.point[1, c] = w.ends[0, c] + share * w.ends[1, c] - w.point[0, c]
            miss = max(miss, abs(w.point[1, c]))
        if miss < _NEWTON_RESIDUAL:
            return True
        if not solve3(w.J_c, row(w.point, 1), g.free, w.step):
            return False
        largest = 0.0
        for a in range(3):
            largest = max(largest, abs(w.step[g.free[a]]))
        for a in range(3):
            q_o[g.free[a]] += w.step[g.free[a]] * min(1.0, _NEWTON_STEP / max(largest, 1e-300))
    return False


@kernel
def _orientation(A: Array) -> float:
    """Return the sign of det A."""
    return float(np.sign(dot(row(A, 0), cross(row(A, 1), row(A, 2)))))


@kernel
def invert(g: Tangent, r_o: Array, q_o: Array, w: Scratch) -> bool:
    """Write l_c^-1(r_o), the joints that follow included; False outside the domain.

    Args:
        g: The map l_c.
        r_o: Position of the ball [m], shape (3,).
        q_o: Result [rad], shape (n,); where the inverse starts, if it is not closed-form.
        w: Scratch.
    """
    inside = invert_planar(g, r_o, q_o) if g.planar else invert_newton(g, r_o, q_o, w)
    follow(g, q_o)
    return bool(inside)


@kernel
def lift(g: Tangent, ball: Array, virtual: Array, w: Scratch) -> bool:
    """Write virtual joints, velocities, accelerations (3, n) of a ball's r_o, dr_o, ddr_o (3, 3).

    Row 0 of ``virtual`` is the starting point where the inverse is not closed-form.
    """
    for c in range(9):
        if not abs(ball[c // 3, c % 3]) <= (_FARTHEST if c < 3 else _FASTEST):
            return False
    n = virtual.shape[1]
    q_o, r_o = view(virtual, 0, (n,)), view(ball, 0, (3,))
    dq_o, ddq_o = view(virtual, n, (n,)), view(virtual, 2 * n, (n,))
    if not invert(g, r_o, q_o, w):
        return False
    dq_o[:] = 0.0
    ddq_o[:] = 0.0
    expand(g, q_o, w)
    if not solve3(w.J_c, row(ball, 1), g.free, dq_o):
        return False
    follow_rate(g, dq_o)
    curve(g, q_o, dq_o, w)
    left = minus(row(ball, 2), row(w.point, 2))
    inside: bool = solve3(w.J_c, left, g.free, ddq_o)
    follow_rate(g, ddq_o)
    return inside
