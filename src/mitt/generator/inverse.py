"""The inverse of the tangent map l_c: from a ball's motion to virtual joints, eq. (10).

| here        | paper / equations                        | unit             | shape  |
|-------------|------------------------------------------|------------------|--------|
| ``r_o``     | position of the ball                     | m                | (3,)   |
| ``q_o``     | l_c^-1(r_o)                              | rad              | (n,)   |
| ``ball``    | r_o, dr_o, ddr_o                         | m, m/s, m/s^2    | (3, 3) |
| ``virtual`` | q_o, dq_o, ddq_o                         | rad, rad/s ...   | (3, n) |

Closed-form for a yaw, a pitch and an elbow in one plane (:mod:`mitt.generator.planar`), Newton's
method for any other arm.
"""

import numpy as np

from mitt.generator.tangent import Scratch, Tangent, curve, expand, follow, turn_all
from mitt.jit import kernel
from mitt.robot.kinematics import Vec, cross, dot, minus, row
from mitt.signals import Array
from mitt.views import view

#: |det J_c| below this share of the product of its columns' lengths counts as singular.
_SINGULAR = 1e-9
#: Newton: largest step of a coordinate p [rad], largest residual [m], steps allowed, stride [m].
_NEWTON_STEP, _NEWTON_RESIDUAL, _NEWTON_STEPS, _STRIDE = 0.5, 1e-11, 40, 0.25

#: Beyond these a ball counts as outside the domain [m; m/s and m/s^2]: so what the map says stays
#: finite, and the straight line of Newton's strides stays short.
_FARTHEST, _FASTEST = 1e3, 1e6


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
        turn_all(g, w.step)
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
    turn_all(g, dq_o)
    curve(g, q_o, dq_o, w)
    left = minus(row(ball, 2), row(w.point, 2))
    inside: bool = solve3(w.J_c, left, g.free, ddq_o)
    turn_all(g, ddq_o)
    return inside
