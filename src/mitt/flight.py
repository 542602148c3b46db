"""The flight of a ball in still air: gravity and quadratic drag, ddr_o = g - k |dr_o| dr_o.

Everything that carries a ball through time uses these kernels: the filter, the verdict on a
throw and the simulated world. They write into the arrays they are given and allocate nothing.
Gravity is 9.81 m/s^2 (the standard value of ISO 80000-3, 9.80665, to three digits, as in
MuJoCo). Drag coefficients are those of facts.md, section 4: 0.036 to 0.042 per metre for a
thrown ball, 0.09 to 0.15 for a table-tennis ball.
"""

from dataclasses import replace
from math import ceil, sqrt

import numpy as np
from numba import njit

from mitt.errors import InputError
from mitt.signals import Array, BallState

GRAVITY = 9.81
"""Acceleration of free fall, towards -z [m/s^2]."""

MAX_STEP = 0.02
"""Longest Runge-Kutta step [s]; at 10 m/s and k = 0.2 its error stays below 1e-8 m."""

MAX_FORECAST = 10.0
"""Farthest instant that ``forecast`` speaks of [s]; a bound on its work."""


@njit(cache=True)
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


@njit(cache=True)
def _step(r: Array, dr: Array, k: float, h: float) -> None:
    """Advance by one classical Runge-Kutta step, in place."""
    x1, y1, z1 = dr[0], dr[1], dr[2]
    s = k * sqrt(x1 * x1 + y1 * y1 + z1 * z1)
    ax1, ay1, az1 = -s * x1, -s * y1, -s * z1 - GRAVITY
    x2, y2, z2 = x1 + 0.5 * h * ax1, y1 + 0.5 * h * ay1, z1 + 0.5 * h * az1
    s = k * sqrt(x2 * x2 + y2 * y2 + z2 * z2)
    ax2, ay2, az2 = -s * x2, -s * y2, -s * z2 - GRAVITY
    x3, y3, z3 = x1 + 0.5 * h * ax2, y1 + 0.5 * h * ay2, z1 + 0.5 * h * az2
    s = k * sqrt(x3 * x3 + y3 * y3 + z3 * z3)
    ax3, ay3, az3 = -s * x3, -s * y3, -s * z3 - GRAVITY
    x4, y4, z4 = x1 + h * ax3, y1 + h * ay3, z1 + h * az3
    s = k * sqrt(x4 * x4 + y4 * y4 + z4 * z4)
    ax4, ay4, az4 = -s * x4, -s * y4, -s * z4 - GRAVITY
    r[0] += h / 6.0 * (x1 + 2.0 * x2 + 2.0 * x3 + x4)
    r[1] += h / 6.0 * (y1 + 2.0 * y2 + 2.0 * y3 + y4)
    r[2] += h / 6.0 * (z1 + 2.0 * z2 + 2.0 * z3 + z4)
    dr[0] += h / 6.0 * (ax1 + 2.0 * ax2 + 2.0 * ax3 + ax4)
    dr[1] += h / 6.0 * (ay1 + 2.0 * ay2 + 2.0 * ay3 + ay4)
    dr[2] += h / 6.0 * (az1 + 2.0 * az2 + 2.0 * az3 + az4)


@njit(cache=True)
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
        _step(r, dr, k, dt / steps)


@njit(cache=True)
def _transition(x: Array, h: float, F: Array) -> None:
    """Write d(state after h) / d(state), shape (7, 7), with the drag of the step's middle."""
    k, half = x[6], 0.5 * h
    drag = k * sqrt(x[3] * x[3] + x[4] * x[4] + x[5] * x[5])
    vx, vy = x[3] * (1.0 - half * drag), x[4] * (1.0 - half * drag)
    vz = x[5] * (1.0 - half * drag) - half * GRAVITY
    speed = sqrt(vx * vx + vy * vy + vz * vz)
    F[:, :] = 0.0
    for i in range(7):
        F[i, i] = 1.0
    for i, v_i in enumerate((vx, vy, vz)):
        F[i, 3 + i] = h
        F[i, 6] = -half * h * speed * v_i
        F[3 + i, 6] = -h * speed * v_i * (1.0 - h * k * speed)
        for j, v_j in enumerate((vx, vy, vz)):
            slope = -k * v_i * v_j / speed if speed > 0.0 else 0.0
            if i == j:
                slope -= k * speed
            F[i, 3 + j] += half * h * slope
            F[3 + i, 3 + j] += h * slope


@njit(cache=True)
def _spread(P: Array, F: Array, work: Array) -> None:
    """Replace ``P`` by F P F', shapes (7, 7); the lower left 3 x 3 of F is zero."""
    for i in range(7):
        for j in range(7):
            total = 0.0
            for m in range(min(i, 3), 7):
                total += F[i, m] * P[m, j]
            work[i, j] = total
    for i in range(7):
        for j in range(i + 1):
            total = 0.0
            for m in range(min(j, 3), 7):
                total += work[i, m] * F[j, m]
            P[i, j] = total
            P[j, i] = total


@njit(cache=True)
def advance_uncertain(
    x: Array, P: Array, dt: float, accel_density: float, drag_density: float, work: Array
) -> None:
    """Carry an estimate and its covariance by ``dt``, in place; uncertainty grows either way.

    Args:
        x: Position [m], velocity [m/s] and drag coefficient [1/m], shape (7,).
        P: Its covariance, shape (7, 7).
        dt: Duration [s]; may be negative.
        accel_density: Spectral density of the unmodelled acceleration [m^2/s^3].
        drag_density: Spectral density of the drift of the drag coefficient [1/(m^2 s)].
        work: Scratch, overwritten, shape (2, 7, 7).
    """
    steps = max(1, ceil(abs(dt) / MAX_STEP))
    h = dt / steps
    a = abs(h)
    for _ in range(steps):
        _transition(x, h, work[0])
        _spread(P, work[0], work[1])
        for i in range(3):
            cross = 0.5 * accel_density * h * a
            P[i, i] += accel_density * a * a * a / 3.0
            P[i, 3 + i] += cross
            P[3 + i, i] += cross
            P[3 + i, 3 + i] += accel_density * a
        P[6, 6] += drag_density * a
        _step(x[0:3], x[3:6], x[6], h)


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
    if not state.tracked:
        return state
    if not abs(t - state.t) <= MAX_FORECAST:
        raise InputError("t", f"within {MAX_FORECAST} s of the estimate at {state.t} s", t)
    x = np.concatenate((state.r_o, state.dr_o, (state.drag,)))
    P = np.zeros((7, 7))
    P[:6, :6] = state.covariance
    P[6, 6] = drag_sigma**2
    advance_uncertain(x, P, t - state.t, accel_density, 0.0, np.empty((2, 7, 7)))
    ddr = np.empty(3)
    acceleration(x[3:6], state.drag, ddr)
    return replace(state, t=t, r_o=x[:3], dr_o=x[3:6], ddr_o=ddr, covariance=P[:6, :6])
