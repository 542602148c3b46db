"""The flight of a ball in still air: gravity and quadratic drag, ddr_o = g - k |dr_o| dr_o.

Everything that carries a ball through time uses these kernels: the filter, the verdict on a
throw and the simulated world. They write into the arrays they are given and allocate nothing.
Gravity is 9.81 m/s^2 (the standard value of ISO 80000-3, 9.80665, to three digits, as in
MuJoCo). Drag coefficients are fitted to recorded flights: 0.036 to 0.042 per metre for a
thrown ball, 0.09 to 0.15 for a table-tennis ball.
"""

from dataclasses import replace
from math import ceil, exp, sqrt

import numpy as np

from mitt import checks
from mitt.errors import InputError
from mitt.jit import kernel
from mitt.signals import Array, BallState
from mitt.views import lent, view

GRAVITY = 9.81
"""Acceleration of free fall, towards -z [m/s^2]."""

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
def _step(
    v: tuple[float, float, float], k: float, push: tuple[float, float, float], h: float
) -> tuple[float, float, float, float, float, float]:
    """Return by how much position and velocity change in one classical Runge-Kutta step.

    Args:
        v: Velocity [m/s].
        k: Drag coefficient [1/m].
        push: Acceleration besides drag, gravity included [m/s^2].
        h: Duration [s].
    """
    px, py, pz = push
    x1, y1, z1 = v
    s = k * sqrt(x1 * x1 + y1 * y1 + z1 * z1)
    ax1, ay1, az1 = px - s * x1, py - s * y1, pz - s * z1
    x2, y2, z2 = x1 + 0.5 * h * ax1, y1 + 0.5 * h * ay1, z1 + 0.5 * h * az1
    s = k * sqrt(x2 * x2 + y2 * y2 + z2 * z2)
    ax2, ay2, az2 = px - s * x2, py - s * y2, pz - s * z2
    x3, y3, z3 = x1 + 0.5 * h * ax2, y1 + 0.5 * h * ay2, z1 + 0.5 * h * az2
    s = k * sqrt(x3 * x3 + y3 * y3 + z3 * z3)
    ax3, ay3, az3 = px - s * x3, py - s * y3, pz - s * z3
    x4, y4, z4 = x1 + h * ax3, y1 + h * ay3, z1 + h * az3
    s = k * sqrt(x4 * x4 + y4 * y4 + z4 * z4)
    ax4, ay4, az4 = px - s * x4, py - s * y4, pz - s * z4
    return (
        h / 6.0 * (x1 + 2.0 * x2 + 2.0 * x3 + x4),
        h / 6.0 * (y1 + 2.0 * y2 + 2.0 * y3 + y4),
        h / 6.0 * (z1 + 2.0 * z2 + 2.0 * z3 + z4),
        h / 6.0 * (ax1 + 2.0 * ax2 + 2.0 * ax3 + ax4),
        h / 6.0 * (ay1 + 2.0 * ay2 + 2.0 * ay3 + ay4),
        h / 6.0 * (az1 + 2.0 * az2 + 2.0 * az3 + az4),
    )


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
        way = _step((dr[0], dr[1], dr[2]), k, (0.0, 0.0, -GRAVITY), dt / steps)
        for i in range(3):
            r[i] += way[i]
            dr[i] += way[3 + i]


@kernel
def _slopes(m: Array, at: int, law: Array, row: int, h: float, work: Array) -> None:
    """Write d(position, velocity after h) / d(velocity, drag, push), with the step's middle.

    Rows of ``work[0]``: 0 to 2 position, 3 to 5 velocity; columns: 0 to 2 velocity, 3 drag.
    """
    k, half = m[at + 6], 0.5 * h
    x, y, z = m[at + 3], m[at + 4], m[at + 5]
    drag = k * sqrt(x * x + y * y + z * z)
    x += half * (m[at + 7] - drag * x)
    y += half * (m[at + 8] - drag * y)
    z += half * (m[at + 9] - drag * z - law[row, 0])
    speed = sqrt(x * x + y * y + z * z)
    slope = k / speed if speed > 0.0 else 0.0
    for i, v_i in enumerate((x, y, z)):
        work[0, i, 3] = -half * h * speed * v_i
        work[0, 3 + i, 3] = -h * speed * v_i * (1.0 - h * k * speed)
        for j, v_j in enumerate((x, y, z)):
            bend = -slope * v_i * v_j
            if i == j:
                bend -= k * speed
            work[0, i, j] = half * h * bend
            work[0, 3 + i, j] = h * bend
        work[0, i, i] += h
        work[0, 3 + i, i] += 1.0


@kernel
def _spread(m: Array, at: int, h: float, mean: float, left: float, work: Array) -> None:
    """Replace P by F P F', F = d(state after h) / d(state) made of :func:`_slopes`.

    Args:
        m: Holds P, shape (10, 10), from ``at + 10`` on.
        at: Index of the estimate.
        h: Duration [s].
        mean: Share of the push that acts, on average over the step.
        left: Share of it that is left after the step.
        work: Scratch, shape (2, 10, 10); the slopes in its first matrix.
    """
    square = (STATES, STATES)
    P, M, A = (
        view(m, at + STATES, square),
        view(work, STATES * STATES, square),
        view(work, 0, square),
    )
    r_a, v_a = 0.5 * h * h * mean, h * mean
    for i in range(3):
        x, y, z, k = A[i, 0], A[i, 1], A[i, 2], A[i, 3]
        for j in range(STATES):
            M[i, j] = P[i, j] + x * P[3, j] + y * P[4, j] + z * P[5, j] + k * P[6, j]
            M[i, j] += r_a * P[7 + i, j]
        x, y, z, k = A[3 + i, 0], A[3 + i, 1], A[3 + i, 2], A[3 + i, 3]
        for j in range(STATES):
            M[3 + i, j] = x * P[3, j] + y * P[4, j] + z * P[5, j] + k * P[6, j]
            M[3 + i, j] += v_a * P[7 + i, j]
            M[7 + i, j] = left * P[7 + i, j]
    for j in range(STATES):
        M[6, j] = P[6, j]
    for i in range(STATES):
        x, y, z, k = M[i, 3], M[i, 4], M[i, 5], M[i, 6]
        for j in range(3):
            P[i, j] = M[i, j] + A[j, 0] * x + A[j, 1] * y + A[j, 2] * z + A[j, 3] * k
            P[i, j] += r_a * M[i, 7 + j]
            P[i, 3 + j] = A[3 + j, 0] * x + A[3 + j, 1] * y + A[3 + j, 2] * z + A[3 + j, 3] * k
            P[i, 3 + j] += v_a * M[i, 7 + j]
            P[i, 7 + j] = left * M[i, 7 + j]
        P[i, 6] = k


@kernel
def _stir(m: Array, at: int, law: Array, row: int, h: float, left: float) -> None:
    """Add what the unmodelled acceleration and the drift of drag and push do in ``abs(h)``."""
    P, a, sign = at + STATES, abs(h), 1.0 if h > 0.0 else -1.0
    white, jerk = law[row, 1], law[row, 3] ** 2 * (1.0 - left * left) / a if a > 0.0 else 0.0
    rr = white * a**3 / 3.0 + jerk * a**5 / 20.0
    rv = sign * (white * a**2 / 2.0 + jerk * a**4 / 8.0)
    vv = white * a + jerk * a**3 / 3.0
    ra, va, aa = jerk * a**3 / 6.0, sign * jerk * a**2 / 2.0, jerk * a
    for i in range(3):
        r, v, b = 10 * i, 30 + 10 * i, 70 + 10 * i
        m[P + r + i] += rr
        m[P + v + 3 + i] += vv
        m[P + b + 7 + i] += aa
        m[P + r + 3 + i] += rv
        m[P + v + i] += rv
        m[P + r + 7 + i] += ra
        m[P + b + i] += ra
        m[P + v + 7 + i] += va
        m[P + b + 3 + i] += va
    m[P + 66] += law[row, 2] * a


@kernel
def advance_uncertain(m: Array, at: int, dt: float, law: Array, row: int, work: Array) -> None:
    """Carry an estimate and its covariance by ``dt``, in place; uncertainty grows either way.

    The estimate holds position [m], velocity [m/s], drag coefficient [1/m] and *push*, a slowly
    varying acceleration [m/s^2] that gravity and drag do not explain (the lift of a spinning
    ball, a hand): 10 numbers, and then their covariance, shape (10, 10), row by row.

    A law of motion holds gravity [m/s^2], the spectral densities of the unmodelled acceleration
    [m^2/s^3] and of the drift of the drag coefficient [1/(m^2 s)], and standard deviation
    [m/s^2] and correlation time [s] of the push (a Gauss-Markov process of first order).

    Args:
        m: Memory that holds the estimate.
        at: Index of the estimate in it.
        dt: Duration [s]; may be negative.
        law: Laws of motion, shape (n, >= 5).
        row: Which of them holds.
        work: Scratch, overwritten, shape (2, 10, 10).
    """
    m, law, work = lent((m, law, work))
    steps = max(1, ceil(abs(dt) / MAX_STEP))
    h = dt / steps
    left = exp(-abs(h) / law[row, 4])
    mean = 0.5 * (1.0 + left)
    for _ in range(steps):
        _slopes(m, at, law, row, h, work)
        _spread(m, at, h, mean, left, work)
        _stir(m, at, law, row, h, left)
        push = (mean * m[at + 7], mean * m[at + 8], mean * m[at + 9] - law[row, 0])
        way = _step((m[at + 3], m[at + 4], m[at + 5]), m[at + 6], push, h)
        for i in range(6):
            m[at + i] += way[i]
        for i in range(7, 10):
            m[at + i] *= left


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
    law = np.array([[GRAVITY, accel_density, 0.0, 0.0, 1.0]])
    advance_uncertain(track, 0, t - state.t, law, 0, np.empty((2, STATES, STATES)))
    ddr = np.empty(3)
    acceleration(track[3:6], state.drag, ddr)
    covariance = 0.5 * (P + P.T)[:6, :6]
    return replace(state, t=t, r_o=track[:3], dr_o=track[3:6], ddr_o=ddr, covariance=covariance)
