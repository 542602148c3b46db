"""The map's value for one ball, compiled: eqs. (1), (6), (15) on packed arrays."""

import numpy as np

from mitt.generator.inverse import lift
from mitt.generator.packing import jet_rows, unfold, unpack
from mitt.generator.polynomial import jets
from mitt.generator.tangent import coordinate, to_go
from mitt.jit import kernel
from mitt.signals import PASSED, Array
from mitt.views import view

#: Time to the catch up to which the ball's present motion tells it [s].
NEAR = 0.1


@kernel
def virtual(packed: Array, ball: Array, rows: Array, work: Array) -> bool:
    """Write q_o, dq_o, ddq_o (3, n) for r_o, dr_o, ddr_o (3, 3); False outside the domain."""
    g = unpack(packed)
    return bool(lift(g, ball, rows, unfold(work, rows.shape[1])))


@kernel
def reference(
    packed: Array, powers: Array, window: Array, alpha: Array, ball: Array, rows: Array, work: Array
) -> bool:
    """Write q_d, dq_d, ddq_d, q_o, dq_o, ddq_o (6, n) for r_o, dr_o, ddr_o (3, 3).

    Args:
        packed: The tangent map.
        powers: Exponents of the monomials, shape (m, 3).
        window: Centre and scale of the polynomial's variables, shape (2, 3).
        alpha: Coefficients, shape (m, n).
        ball: r_o, dr_o, ddr_o, shape (3, 3).
        rows: Result; row 3 is where a Newton inverse starts. Outside the domain: at rest.
        work: Workspace for so many joints and monomials.
    """
    g, (m, n) = unpack(packed), alpha.shape
    if not lift(g, ball, view(rows, 3 * n, (3, n)), unfold(work, n)):
        rows[:] = 0.0
        rows[0], rows[3] = g.q_rest, g.q_rest
        return False
    motion, phi = jet_rows(work, n, m)
    for a in range(3):
        for d in range(3):
            motion[d, a] = coordinate(g, view(rows, (3 + d) * n, (n,)), a)
    centre, scale = view(window, 0, (3,)), view(window, 3, (3,))
    x, dx, ddx = view(motion, 0, (3,)), view(motion, 3, (3,)), view(motion, 6, (3,))
    jets(powers, centre, scale, x, dx, ddx, phi)
    for k in range(n):
        # Three sums at a time: each waits for its own last addition only.
        q, dq, ddq = rows[3, k], rows[4, k], rows[5, k]
        for a in range(m):
            q += phi[0, a] * alpha[a, k]
            dq += phi[1, a] * alpha[a, k]
            ddq += phi[2, a] * alpha[a, k]
        rows[0, k], rows[1, k], rows[2, k] = q, dq, ddq
    return True


@kernel
def references(
    packed: Array,
    powers: Array,
    window: Array,
    alpha: Array,
    path: Array,
    start: Array,
    rows: Array,
    out: Array,
    work: Array,
) -> None:
    """Write the first three rows of :func:`reference` for each ball of a path."""
    for k in range(len(path)):
        rows[3] = start
        reference(packed, powers, window, alpha, path[k], rows, work)
        out[k] = rows[:3]


@kernel
def root_time(s: float, ds: float, dds: float) -> float:
    """Return the time to the next zero of s + ds t + dds t^2 / 2, 0 at one; infinite without."""
    disc = ds * ds - 2.0 * s * dds
    if not 0.0 <= disc < np.inf:
        return np.inf
    if s == 0.0:
        return 0.0
    slow, after = ds + np.copysign(np.sqrt(disc), ds), np.inf
    if slow != 0.0:
        after = -2.0 * s / slow
        if after < 0.0:
            after = np.inf
    if dds != 0.0 and -slow / dds >= 0.0:
        after = min(after, -slow / dds)
    return float(after)


@kernel
def time_to_catch(packed: Array, rows: Array, foreseen: float) -> float:
    """Return the time to the catch [s], as of :class:`mitt.signals.JointReference`.

    Near the catch the ball's present motion tells it. Farther ahead it does not: gravity turns the
    way of a ball that still rises, so the catch is the one that was foreseen.

    Args:
        packed: The tangent map.
        rows: As :func:`reference` writes them, shape (6, n).
        foreseen: Time to the catch as the flight was foreseen [s]; infinite without one.
    """
    near = present_time(packed, rows)
    return near if near <= NEAR else max(foreseen, NEAR)


@kernel
def present_time(packed: Array, rows: Array) -> float:
    """Return the time to the catch as the ball's present motion tells it [s]; see above."""
    g = unpack(packed)
    s = to_go(g, rows[3])
    ds, dds = coordinate(g, rows[4], g.catch), coordinate(g, rows[5], g.catch)
    after, before = root_time(s, ds, dds), root_time(s, -ds, dds)
    along = g.plane[0] * g.plane[2] + g.plane[1] * g.plane[3]
    outside = g.planar and s * along > 0.0  # where balls come from: it has not passed
    return -before if before <= PASSED and before < after and not outside else after
