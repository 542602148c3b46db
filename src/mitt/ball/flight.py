"""The flight of a ball in still air: gravity and quadratic drag, ddr_o = g - k |dr_o| dr_o.

Everything that carries a ball through time uses these kernels: the filter, the verdict on a
throw and the simulated world. They write into the arrays they are given.
Gravity is 9.81 m/s^2 (the standard value of ISO 80000-3, 9.80665, to three digits, as in
MuJoCo). Drag coefficients are fitted to recorded flights: 0.036 to 0.042 per metre for a
thrown ball, 0.09 to 0.15 for a table-tennis ball.
"""

from dataclasses import replace
from math import ceil, exp, sqrt

import numpy as np
from numba.extending import register_jitable

from mitt import checks
from mitt.errors import InputError
from mitt.jit import kernel
from mitt.signals import GRAVITY, Array, BallState
from mitt.views import view

MAX_STEP = 0.02
"""Longest Runge-Kutta step [s]; at 10 m/s and k = 0.2 its error stays below 1e-8 m."""

STATES = 10
"""Numbers that an estimate consists of: position, velocity, drag coefficient, push."""

TRACK = STATES + STATES * STATES
"""Numbers of an estimate with its covariance."""

MAX_FORECAST = 10.0
"""Farthest instant that ``forecast`` speaks of [s]; a bound on its work."""


@kernel
def acceleration(dr: Array, k: float, ddr: Array) -> None:
    """Write the acceleration of a ball that flies at ``dr``.

    Args:
        dr: Velocity [m/s], shape (3,).
        k: Drag coefficient [1/m].
        ddr: Result, acceleration [m/s^2], shape (3,).
    """
    drag = k * sqrt(dr[0] * dr[0] + dr[1] * dr[1] + dr[2] * dr[2])
    ddr[0] = -drag * dr[0]
    ddr[1] = -drag * dr[1]
    ddr[2] = -drag * dr[2] - GRAVITY


@kernel
def _pull(
    v: tuple[float, float, float], k: float, push: tuple[float, float, float]
) -> tuple[float, float, float]:
    """Return the acceleration [m/s^2] at velocity ``v``: ``push`` less drag."""
    s = k * sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2])
    return push[0] - s * v[0], push[1] - s * v[1], push[2] - s * v[2]


@kernel
def _along(
    v: tuple[float, float, float], a: tuple[float, float, float], h: float
) -> tuple[float, float, float]:
    """Return the velocity [m/s] after ``h`` [s] of constant acceleration ``a``."""
    return v[0] + h * a[0], v[1] + h * a[1], v[2] + h * a[2]


@kernel
def _step(r: Array, dr: Array, k: float, push: tuple[float, float, float], h: float) -> None:
    """Make one classical Runge-Kutta step of ``h`` [s], in place.

    ``push`` is the acceleration besides drag, gravity included [m/s^2].
    """
    v1 = (dr[0], dr[1], dr[2])
    a1 = _pull(v1, k, push)
    v2 = _along(v1, a1, 0.5 * h)
    a2 = _pull(v2, k, push)
    v3 = _along(v1, a2, 0.5 * h)
    a3 = _pull(v3, k, push)
    v4 = _along(v1, a3, h)
    a4 = _pull(v4, k, push)
    for i in range(3):
        r[i] += h / 6.0 * (v1[i] + 2.0 * v2[i] + 2.0 * v3[i] + v4[i])
        dr[i] += h / 6.0 * (a1[i] + 2.0 * a2[i] + 2.0 * a3[i] + a4[i])


@kernel
def advance(r: Array, dr: Array, k: float, dt: float) -> None:
    """Carry position and velocity on by ``dt``, in place, in steps of at most ``MAX_STEP``.

    Args:
        r: Position, overwritten [m], shape (3,).
        dr: Velocity, overwritten [m/s], shape (3,).
        k: Drag coefficient [1/m].
        dt: Duration [s]; negative goes back in time.
    """
    steps = max(1, ceil(abs(dt) / MAX_STEP))
    for _ in range(steps):
        _step(r, dr, k, (0.0, 0.0, -GRAVITY), dt / steps)


@register_jitable
def track_at(m: Array, at: int) -> tuple[Array, Array]:
    """Return the estimate, shape (10,), and its covariance, (10, 10), that begin at an index."""
    return view(m, at, (STATES,)), view(m, at + STATES, (STATES, STATES))


@kernel
def _differentiate(x: Array, gravity: float, h: float, A: Array) -> None:
    """Write d(position, velocity after h) / d(velocity, drag), taken at the step's middle.

    Rows of ``A``: 0 to 2 position, 3 to 5 velocity; columns: 0 to 2 velocity, 3 drag.
    """
    k, half = x[6], 0.5 * h
    drag = k * sqrt(x[3] * x[3] + x[4] * x[4] + x[5] * x[5])
    middle = (
        x[3] + half * (x[7] - drag * x[3]),
        x[4] + half * (x[8] - drag * x[4]),
        x[5] + half * (x[9] - drag * x[5] - gravity),
    )
    speed = sqrt(middle[0] * middle[0] + middle[1] * middle[1] + middle[2] * middle[2])
    slope = k / speed if speed > 0.0 else 0.0
    for i in range(3):
        A[i, 3] = -half * h * speed * middle[i]
        A[3 + i, 3] = -h * speed * middle[i] * (1.0 - h * k * speed)
        for j in range(3):
            bend = -slope * middle[i] * middle[j]
            if i == j:
                bend -= k * speed
            A[i, j] = half * h * bend
            A[3 + i, j] = h * bend
        A[i, i] += h
        A[3 + i, i] += 1.0


@kernel
def _transition(A: Array, h: float, mean: float, left: float, P: Array, out: Array) -> None:
    """Write F P, with F = d(state after h) / d(state) and A of :func:`_differentiate`.

    Of the push, the share ``mean`` acts on average over the step, and ``left`` is left after it.
    """
    by_r, by_v = 0.5 * h * h * mean, h * mean
    for j in range(STATES):
        x, y, z, k = P[3, j], P[4, j], P[5, j], P[6, j]
        for i in range(3):
            push, v = P[7 + i, j], 3 + i
            out[i, j] = P[i, j] + A[i, 0] * x + A[i, 1] * y + A[i, 2] * z + A[i, 3] * k
            out[i, j] += by_r * push
            out[v, j] = A[v, 0] * x + A[v, 1] * y + A[v, 2] * z + A[v, 3] * k + by_v * push
            out[7 + i, j] = left * push
        out[6, j] = k


@kernel
def _add_noise(P: Array, model: Array, h: float, left: float) -> None:
    """Add what the unmodelled acceleration and the drift of drag and push do in ``abs(h)``."""
    a, sign = abs(h), 1.0 if h > 0.0 else -1.0
    white, jerk = model[1], model[3] ** 2 * (1.0 - left * left) / a if a > 0.0 else 0.0
    rr = white * a**3 / 3.0 + jerk * a**5 / 20.0
    rv = sign * (white * a**2 / 2.0 + jerk * a**4 / 8.0)
    vv = white * a + jerk * a**3 / 3.0
    ra, va, aa = jerk * a**3 / 6.0, sign * jerk * a**2 / 2.0, jerk * a
    for r in range(3):
        v, push = r + 3, r + 7
        P[r, r] += rr
        P[v, v] += vv
        P[push, push] += aa
        P[r, v] += rv
        P[v, r] += rv
        P[r, push] += ra
        P[push, r] += ra
        P[v, push] += va
        P[push, v] += va
    P[6, 6] += model[2] * a


@kernel
def advance_uncertain(m: Array, at: int, dt: float, models: Array, row: int, work: Array) -> None:
    """Carry an estimate and its covariance by ``dt``, in place; uncertainty grows either way.

    The estimate holds position [m], velocity [m/s], drag coefficient [1/m] and *push*, a slowly
    varying acceleration [m/s^2] that gravity and drag do not explain (the lift of a spinning
    ball, a hand): 10 numbers, and then their covariance, shape (10, 10), row by row.

    A motion model holds gravity [m/s^2], the spectral densities of the unmodelled acceleration
    [m^2/s^3] and of the drift of the drag coefficient [1/(m^2 s)], and standard deviation
    [m/s^2] and correlation time [s] of the push (a Gauss-Markov process of first order).

    Args:
        m: Memory that holds the estimate.
        at: Index of the estimate in it.
        dt: Duration [s]; may be negative.
        models: Motion models, shape (n, >= 5).
        row: Which of them holds.
        work: Scratch, overwritten, shape (2, 10, 10).
    """
    x, P = track_at(m, at)
    A, FP = view(work, 0, (STATES, STATES)), view(work, STATES * STATES, (STATES, STATES))
    model = models[row]
    steps = max(1, ceil(abs(dt) / MAX_STEP))
    h = dt / steps
    left = exp(-abs(h) / model[4])
    mean = 0.5 * (1.0 + left)
    for _ in range(steps):
        _differentiate(x, model[0], h, A)
        _transition(A, h, mean, left, P, FP)
        _transition(A, h, mean, left, FP.T, P.T)
        _add_noise(P, model, h, left)
        push = (mean * x[7], mean * x[8], mean * x[9] - model[0])
        _step(x[:3], x[3:6], x[6], push, h)
        for i in range(7, STATES):
            x[i] *= left


def forecast(
    state: BallState, t: float, *, accel_density: float = 0.005, drag_sigma: float = 0.0
) -> BallState:
    """Carry an estimate by the flight model to a far instant; a pure function.

    The covariance of a ``BallState`` does not know how its drag coefficient correlates with its
    velocity: ``drag_sigma`` enters as independent. ``BallFilter.state`` knows and is sharper.

    Args:
        state: Where and how fast the ball is; returned unchanged if it is not tracked.
        t: Instant to speak of [s].
        accel_density: Spectral density of the unmodelled acceleration [m^2/s^3].
        drag_sigma: Standard deviation of the drag coefficient [1/m].

    Raises:
        InputError: ``t`` is not within ``MAX_FORECAST`` of the estimate.
    """
    if not checks.instance("state", state, BallState).tracked:
        return state
    t, accel_density = checks.number("t", t), checks.number("accel_density", accel_density)
    drag_sigma = checks.number("drag_sigma", drag_sigma)
    if not abs(t - state.t) <= MAX_FORECAST:
        raise InputError("t", f"within {MAX_FORECAST} s of the estimate at {state.t} s", t)
    track = np.zeros(TRACK)
    track[:STATES] = (*state.r_o, *state.dr_o, state.drag, 0.0, 0.0, 0.0)
    P = track[STATES:].reshape(STATES, STATES)
    P[:6, :6] = state.covariance
    P[6, 6] = drag_sigma * drag_sigma
    flight = np.array([[GRAVITY, accel_density, 0.0, 0.0, 1.0]])
    advance_uncertain(track, 0, t - state.t, flight, 0, np.empty((2, STATES, STATES)))
    ddr = np.empty(3)
    acceleration(track[3:6], state.drag, ddr)
    covariance = 0.5 * (P + P.T)[:6, :6]
    return replace(state, t=t, r_o=track[:3], dr_o=track[3:6], ddr_o=ddr, covariance=covariance)
