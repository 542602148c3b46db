"""The map's value for one ball, compiled: eqs. (1), (6), (15) on packed arrays."""

import numpy as np

from mitt.generator.inverse import lift
from mitt.generator.packing import flight_rows, jet_rows, unfold, unpack
from mitt.generator.polynomial import jets
from mitt.generator.prediction import HORIZON, catch_time, fly_on, go_on, lay_state
from mitt.generator.tangent import coordinate, to_go
from mitt.jit import kernel
from mitt.signals import PASSED, Array
from mitt.views import view

#: Time to the catch up to which the ball's present motion tells it [s].
NEAR = 0.1
#: Rounds in which a catch farther ahead is found, their last step, of which an error of the third
#: order is left, below 1 us, and where they begin at the latest: before the ball passes by [s].
_ROUNDS, _CLOSE, _GUESS = 5, 3e-3, 0.3


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
def time_to_catch(
    packed: Array, rows: Array, ball: Array, drag: float, led: bool, start: Array, work: Array
) -> float:
    """Return the time to the catch [s], as of :class:`mitt.signals.JointReference`.

    Near the catch the ball's present motion tells it. Farther ahead it does not: gravity turns the
    way of a ball that still rises, so the ball is flown on.

    Args:
        packed: The tangent map.
        rows: As :func:`reference` writes them, shape (6, n).
        ball: r_o, dr_o, ddr_o, shape (3, 3).
        drag: Its drag coefficient [1/m].
        led: Whether it is led.
        start: Where the inverse starts [rad], shape (n,).
        work: As for :func:`reference`.
    """
    g = unpack(packed)
    s = to_go(g, rows[3])
    ds, dds = coordinate(g, rows[4], g.catch), coordinate(g, rows[5], g.catch)
    after, before = root_time(s, ds, dds), root_time(s, -ds, dds)
    away = g.plane[0] * g.plane[2] + g.plane[1] * g.plane[3]
    outside = g.planar and s * away > 0.0  # from where balls come: it has not passed by
    if before <= PASSED and before < after and not outside:
        return float(-before)
    if after <= NEAR:
        return float(after)
    return float(max(_time_ahead(packed, s, after, (ball, drag, led), start, work), NEAR))


@kernel
def _time_ahead(
    packed: Array, s: float, t: float, of: tuple[Array, float, bool], start: Array, work: Array
) -> float:
    """Return the time to a catch that is not near [s]; infinite where none is foreseen.

    Args:
        packed: The tangent map.
        s: Distance still to go [rad].
        t: Time to the catch by the ball's present motion [s]; the search begins there.
        of: The ball: its motion, drag coefficient, whether it is led.
        start: Where the inverse starts [rad], shape (n,).
        work: Workspace of the tangent map.
    """
    g, n = unpack(packed), len(start)
    state, end, virtual = flight_rows(work, n)
    q_o, dq_o, ddq_o = view(virtual, 0, (n,)), view(virtual, n, (n,)), view(virtual, 2 * n, (n,))
    lay_state(of[0], of[1], of[2], state)
    t, step = min(t, _GUESS), 0.0
    fly_on(state, t, end)
    for _ in range(_ROUNDS):
        q_o[:] = start
        if not (abs(step) < t and lift(g, end, virtual, unfold(work, n))):
            break
        ds, dds = coordinate(g, dq_o, g.catch), coordinate(g, ddq_o, g.catch)
        if not s * ds < 0.0:  # it passes there on its way out
            break
        after, before = root_time(to_go(g, q_o), ds, dds), root_time(to_go(g, q_o), -ds, dds)
        step = after if after < before else -before
        t += step
        if abs(step) < _CLOSE and t <= HORIZON:
            return t
        if abs(step) < np.inf:
            go_on(end, state[9], step)
    q_o[:] = start
    return float(catch_time(packed, state, q_o, end, work))
