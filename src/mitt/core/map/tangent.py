"""The tangent map l_c, from virtual joints to a ball's position, and its inverse; eqs. (5), (6).

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
| ``ball``      | r_o, dr_o, ddr_o                          | m, m/s, m/s^2 | (3, 3) |
| ``virtual``   | q_o = l_c^-1(r_o) and two derivatives     | rad, rad/s .. | (3, n) |

Three joints are free, the catch joint among them, so J_c is square. Any further joint follows them,
q_o = q_rest + A (p - p_rest): the arm is one of three virtual joints p then, each of which turns
several. Where its row of A is 0 a joint stays at q_rest and takes part through b alone. J_i and w_i
are those of the virtual joint: sums over the joints that it turns.

The coordinates p of these virtual joints are the angles of the free joints, but for the catch joint
where q_alpha goes with the two others: q_alpha = q_catch + slope . (the others), and
p_i = q_i - slope . (the others), so that s = p_i - q_catch all the same. The catch joint's row of A
holds the slope.

The inverse is closed-form for a yaw, a pitch and an elbow in one plane, Newton's method for any
other arm.

Kernels take the map as one vector and their buffers as another (:func:`pack`, :func:`workspace`):
handing over a named tuple of thirty arrays costs more than the kernel's own work. Inside compiled
code :func:`unpack` and :func:`unfold` return the named tuples, whose arrays are views. What else
kernels know of a whole map is with both in :class:`MapArrays`.
"""

from typing import NamedTuple

import numpy as np
from numba.extending import register_jitable
from numpy.typing import NDArray

from mitt.core.arm.arm import Arm
from mitt.core.arm.kinematics import (
    ZERO,
    Chain,
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
    row,
    sweep,
    times,
)
from mitt.core.kernels import copy, kernel, view
from mitt.core.signals import Array

#: |det J_c| below this share of the product of its columns' lengths counts as singular.
_SINGULAR = 1e-9
#: Newton: largest step of a coordinate p [rad], largest residual [m], steps allowed; stride [m] and
#: largest residual at its end [m].
_NEWTON_STEP = 0.5
_NEWTON_RESIDUAL = 1e-11
_NEWTON_STEPS = 40
_STRIDE = 0.25
_ON_WAY = 0.02

#: Beyond these a ball counts as outside the domain [m; m/s and m/s^2]: so what the map says stays
#: finite, and the straight line of Newton's strides stays short.
_FARTHEST = 1e3
_FASTEST = 1e6


class Tangent(NamedTuple):
    """The map l_c of one arm as arrays.

    ``planar`` marks an arm whose inverse is closed-form (see :func:`plane_of`);
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
    point: Array  # (3, 3) l_c, residual, curvature
    ends: Array  # (3, 3) start of a way and the way itself
    J_c: Array  # (3, 3) rows over the coordinates p: J_c transposed
    state: Array  # (10,) a ball that flies, see mitt.core.map.prediction
    ball: Array  # (3, 3) r_o, dr_o, ddr_o
    virtual: Array  # (3, n) virtual joints
    variables: Array  # (3, 3) of the polynomial, and their two derivatives
    phi: Array  # (3, m) monomials


class MapArrays(NamedTuple):
    """A map as kernels take it; all arrays are empty where there is none."""

    packed: Array  # l_c, of :func:`pack`
    powers: NDArray[np.int64]  # exponents of the monomials, (m, 3)
    window: Array  # centre and scale of the polynomial's variables, (2, 3)
    alpha: Array  # coefficients [rad], (m, n)
    start: Array  # where the inverse starts [rad], (n,)
    trusted: Array  # lowest and highest virtual joints of a catch that counts [rad], (2, n)
    work: Array  # buffers, of :func:`workspace`


def pack(g: Tangent) -> Array:
    """Return a tangent map as one vector, in the order in which :func:`unpack` reads it."""
    numbers = [len(g.q_rest), g.catch_joint, g.catch, g.q_catch, g.kappa, g.inward, g.planar]
    arrays = (
        g.plane,
        g.q_rest,
        g.A,
        g.chain.R,
        g.chain.p,
        g.chain.axis,
        g.chain.prismatic,
        g.chain.tip,
    )
    return np.concatenate([np.array([*numbers, *g.free], float), *(x.ravel() for x in arrays)])


@register_jitable
def unpack(v: Array) -> Tangent:
    """Return the tangent map whose arrays are views of a packed vector."""
    n, free, at = int(v[0]), (int(v[7]), int(v[8]), int(v[9])), 10
    plane, at = view(v, at, (7,)), at + 7
    q_rest, at = view(v, at, (n,)), at + n
    A, at = view(v, at, (n, 3)), at + 3 * n
    R, at = view(v, at, (n, 3, 3)), at + 9 * n
    p, at = view(v, at, (n, 3)), at + 3 * n
    axis, at = view(v, at, (n, 3)), at + 3 * n
    prismatic, at = view(v, at, (n,)), at + n
    chain = Chain(R, p, axis, prismatic, view(v, at, (3,)))
    return Tangent(
        chain, free, int(v[1]), int(v[2]), v[3], v[4], v[5], q_rest, A, v[6] > 0.0, plane
    )


def workspace(n: int, m: int = 0) -> Array:
    """Return a vector that holds all buffers for ``n`` active joints and ``m`` monomials."""
    motion, *others = scratch_of(n, m)
    return np.zeros(sum(x.size for x in (*motion, *others)))


def scratch_of(n: int, m: int = 0) -> Scratch:
    """Return buffers for ``n`` active joints and ``m`` monomials."""
    shapes = ((n,), (n,), (n,), (3, 3), (3, 3), (3, 3), (10,), (3, 3), (3, n), (3, 3), (3, m))
    return Scratch(motion_of(n), *(np.zeros(shape) for shape in shapes))


@register_jitable
def unfold(v: Array, n: int) -> Scratch:
    """Return the buffers that are views of a workspace; the monomials are what is left."""
    W, at = view(v, 0, (n, 3)), 3 * n
    J, at = view(v, at, (n, 3)), at + 3 * n
    dJ, at = view(v, at, (n, 3)), at + 3 * n
    ddJ, at = view(v, at, (n, 3)), at + 3 * n
    tip, at = view(v, at, (3, 3)), at + 9
    origin, at = view(v, at, (3, n, 3)), at + 9 * n
    line, at = view(v, at, (3, n, 3)), at + 9 * n
    motion = Motion(W, J, dJ, ddJ, tip, origin, line)
    q, at = view(v, at, (n,)), at + n
    dq, at = view(v, at, (n,)), at + n
    step, at = view(v, at, (n,)), at + n
    point, at = view(v, at, (3, 3)), at + 9
    ends, at = view(v, at, (3, 3)), at + 9
    J_c, at = view(v, at, (3, 3)), at + 9
    state, at = view(v, at, (10,)), at + 10
    ball, at = view(v, at, (3, 3)), at + 9
    virtual, at = view(v, at, (3, n)), at + 3 * n
    variables, at = view(v, at, (3, 3)), at + 9
    phi = view(v, at, (3, (len(v) - at) // 3))
    return Scratch(motion, q, dq, step, point, ends, J_c, state, ball, virtual, variables, phi)


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
def follow_coupling(g: Tangent, q_o: Array) -> None:
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
    follow_coupling(g, w.q)
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
    copy(g.q_rest, q_o)
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
    copy(w.point[0], w.ends[0])
    for c in range(3):
        w.ends[1, c] = r_o[c] - w.ends[0, c]
    way = np.sqrt(w.ends[1, 0] ** 2 + w.ends[1, 1] ** 2 + w.ends[1, 2] ** 2)
    if not way <= _FARTHEST:
        return False
    parts = int(way / _STRIDE) + 1
    sign = _orientation(w.J_c)
    for part in range(1, parts + 1):
        within = _ON_WAY if part < parts else _NEWTON_RESIDUAL
        if not _newton(g, part / parts, within, q_o, w):
            return False
    return bool(_orientation(w.J_c) == sign)


@kernel
def _newton(g: Tangent, share: float, within: float, q_o: Array, w: Scratch) -> bool:
    """Solve l_c(q_o) = ends[0] + share ends[1] to a residual [m]; l_c is expanded at ``q_o``."""
    for _ in range(_NEWTON_STEPS):
        miss = 0.0
        for c in range(3):
            w.point[1, c] = w.ends[0, c] + share * w.ends[1, c] - w.point[0, c]
            miss = max(miss, abs(w.point[1, c]))
        if miss < within:
            return True
        if not solve3(w.J_c, row(w.point, 1), g.free, w.step):
            return False
        largest = 0.0
        for a in range(3):
            largest = max(largest, abs(w.step[g.free[a]]))
        turn_all(g, w.step)
        for a in range(3):
            q_o[g.free[a]] += w.step[g.free[a]] * min(1.0, _NEWTON_STEP / max(largest, 1e-300))
        expand(g, q_o, w)
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
    follow_coupling(g, q_o)
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
    turn_all(g, dq_o)
    curve(g, q_o, dq_o, w)
    left = minus(row(ball, 2), row(w.point, 2))
    inside: bool = solve3(w.J_c, left, g.free, ddq_o)
    turn_all(g, ddq_o)
    return inside


def plane_of(
    arm: Arm, catch_joint: int, *, q_catch: float, kappa: float, inward: float = 0.0
) -> Array | None:
    """Return p_x, p_z, t_x, t_z, shoulder height [m], signs of yaw and pitch, shape (7,).

    Of an arm whose joint 0 turns about the vertical through the shoulder and joint 1 about a
    horizontal axis through it, while with both at zero catch point and tangent lie in the plane
    y = 0; the Barrett WAM with joint 3 at zero is one. None for any other: the test looks at
    geometry, not at names.
    """
    if arm.n != 3 or catch_joint != 2 or bool(np.any(arm.chain.prismatic)):
        return None
    q = np.array([0.0, 0.0, q_catch])
    m = motion_of(3)
    sweep(arm.chain, q, np.zeros(3), m)
    yaw, pitch = m.W[0], m.W[1]
    base, shoulder = m.origin[0, 0], m.origin[0, 1]
    flat = (yaw[0], yaw[1], pitch[0], pitch[2], base[0], base[1], shoulder[0], shoulder[1])
    p, t = m.tip[0], kappa * m.J[2] + inward * np.cross(m.W[2], m.J[2])
    off = max(abs(x) for x in (*flat, p[1], t[1]))
    height, rounding = shoulder[2], 1e-12
    if off > rounding or abs(p[0] * t[0] + (p[2] - height) * t[2]) < rounding:
        return None
    return np.array([p[0], p[2] - height, t[0], t[2], height, yaw[2], pitch[1]])
