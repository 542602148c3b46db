"""The flight of a ball in still air: gravity, quadratic drag, and the lift of a spin.

    ddr_o = g - k |dr_o| dr_o + c w x dr_o,   c = |dr_o|^2 / (|dr_o|^2 + weak |w x dr_o|)

The last term is none without spin; :mod:`mitt.core.ball.spin` says what w and ``weak`` are.

Everything that carries a ball through time uses these kernels: the filter, the verdict on a
throw and the simulated world. They write into the arrays they are given.
Gravity is 9.81 m/s^2 (the standard value of ISO 80000-3, 9.80665, to three digits, as in
MuJoCo). Drag coefficients are fitted to recorded flights: 0.036 to 0.042 per metre for a
thrown ball, 0.09 to 0.15 for a table-tennis ball. The end of the module says what a bounce does to
a ball where nobody knows of a table: it may be at any height.
"""

from dataclasses import replace
from math import ceil, exp, sqrt
from typing import NamedTuple

import numpy as np

from mitt.core import checks
from mitt.core.errors import InputError
from mitt.core.kernels import kernel
from mitt.core.signals import GRAVITY, Array, BallState

MAX_STEP = 0.02
"""Longest Runge-Kutta step [s]; at 10 m/s and k = 0.2 its error stays below 1e-8 m."""

STATES = 10
"""Numbers that an estimate consists of: position, velocity, drag coefficient, push."""

MAX_FORECAST = 10.0
"""Farthest instant that ``forecast`` speaks of [s]; a bound on its work."""

REBOUND = 0.8
GRIP = 0.25
"""Shares of its speed that a bounce gives back across a surface, and takes along it: about those of
balls in use, 0.5 to 0.9 and 0.1 to 0.4."""

SEEMS_GONE = 2.0
"""Frames that should show the ball and do not, after which it has bounced as likely as not."""


Lift = tuple[float, float, float, float]
"""What a spin does in flight: w [1/s], three numbers, and ``weak`` [m]."""

STILL: Lift = (0.0, 0.0, 0.0, 0.0)
"""The lift of a ball without spin."""


class MotionModel(NamedTuple):
    """What moves a target besides drag.

    The *push* is a slowly varying acceleration that gravity and drag do not explain (the lift of a
    spinning ball, a hand): a Gauss-Markov process of first order. Of a ball that
    ``spins`` it is w x dr_o, and w varies so.

    Attributes:
        gravity: Acceleration downwards [m/s^2].
        accel_density: Spectral density of the unmodelled acceleration [m^2/s^3].
        drag_density: The same of the drift of the drag coefficient [1/(m^2 s)].
        push_sigma: Standard deviation of each component of the push [m/s^2], or of w [1/s].
        push_time: Its correlation time [s].
        spins: Whether the push is the lift of a spin: above 0 it is.
    """

    gravity: float
    accel_density: float
    drag_density: float = 0.0
    push_sigma: float = 0.0
    push_time: float = 1.0
    spins: float = 0.0


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
    v: tuple[float, float, float], k: float, push: tuple[float, float, float], lift: Lift
) -> tuple[float, float, float]:
    """Return the acceleration [m/s^2] at velocity ``v``: ``push`` less drag, and the lift."""
    square = v[0] * v[0] + v[1] * v[1] + v[2] * v[2]
    s, c = k * sqrt(square), 1.0
    x = lift[1] * v[2] - lift[2] * v[1]
    y = lift[2] * v[0] - lift[0] * v[2]
    z = lift[0] * v[1] - lift[1] * v[0]
    if lift[3] > 0.0:
        less = lift[3] * sqrt(x * x + y * y + z * z)
        c = square / (square + less) if less > 0.0 else 1.0
    return push[0] - s * v[0] + c * x, push[1] - s * v[1] + c * y, push[2] - s * v[2] + c * z


@kernel
def _along(
    v: tuple[float, float, float], a: tuple[float, float, float], h: float
) -> tuple[float, float, float]:
    """Return the velocity [m/s] after ``h`` [s] of constant acceleration ``a``."""
    return v[0] + h * a[0], v[1] + h * a[1], v[2] + h * a[2]


@kernel
def _step(
    r: Array, dr: Array, k: float, push: tuple[float, float, float], lift: Lift, h: float
) -> None:
    """Make one classical Runge-Kutta step of ``h`` [s], in place.

    ``push`` is the acceleration besides drag and lift, gravity included [m/s^2].
    """
    v1 = (dr[0], dr[1], dr[2])
    a1 = _pull(v1, k, push, lift)
    v2 = _along(v1, a1, 0.5 * h)
    a2 = _pull(v2, k, push, lift)
    v3 = _along(v1, a2, 0.5 * h)
    a3 = _pull(v3, k, push, lift)
    v4 = _along(v1, a3, h)
    a4 = _pull(v4, k, push, lift)
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
    advance_spinning(r, dr, k, STILL, dt)


@kernel
def advance_spinning(r: Array, dr: Array, k: float, lift: Lift, dt: float) -> None:
    """Carry position and velocity of a ball that spins on by ``dt``, as :func:`advance` does.

    Args:
        r: Position, overwritten [m], shape (3,).
        dr: Velocity, overwritten [m/s], shape (3,).
        k: Drag coefficient [1/m].
        lift: What its spin does.
        dt: Duration [s]; negative goes back in time.
    """
    steps = max(1, ceil(abs(dt) / MAX_STEP))
    for _ in range(steps):
        _step(r, dr, k, (0.0, 0.0, -GRAVITY), lift, dt / steps)


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
def _add_noise(P: Array, model: MotionModel, h: float, left: float) -> None:
    """Add what the unmodelled acceleration and the drift of drag and push do in ``abs(h)``."""
    a, sign = abs(h), 1.0 if h > 0.0 else -1.0
    white = model.accel_density
    jerk = model.push_sigma**2 * (1.0 - left * left) / a if a > 0.0 else 0.0
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
    P[6, 6] += model.drag_density * a


@kernel
def advance_uncertain(
    x: Array, P: Array, dt: float, model: MotionModel, A: Array, FP: Array
) -> None:
    """Carry an estimate and its covariance by ``dt``, in place; uncertainty grows either way.

    Args:
        x: Position [m], velocity [m/s], drag coefficient [1/m] and push [m/s^2], shape (10,).
        P: Covariance, shape (10, 10).
        dt: Duration [s]; may be negative.
        model: A record with the fields of :class:`MotionModel`.
        A: Scratch, shape (6, 4).
        FP: Scratch, shape (10, 10).
    """
    steps = max(1, ceil(abs(dt) / MAX_STEP))
    h = dt / steps
    left = exp(-abs(h) / model.push_time)
    mean = 0.5 * (1.0 + left)
    for _ in range(steps):
        if model.spins > 0.0:
            _spin_on(x, P, h, model, A, FP)
            continue
        _differentiate(x, model.gravity, h, A)
        _transition(A, h, mean, left, P, FP)
        _transition(A, h, mean, left, FP.T, P.T)
        _add_noise(P, model, h, left)
        push = (mean * x[7], mean * x[8], mean * x[9] - model.gravity)
        _step(x[:3], x[3:6], x[6], push, STILL, h)
        for i in range(7, STATES):
            x[i] *= left


@kernel
def _spin_on(x: Array, P: Array, h: float, model: MotionModel, A: Array, FP: Array) -> None:
    """Carry an estimate whose last states are the w of a lift by a step of ``h`` [s], in place."""
    left = exp(-abs(h) / model.push_time)
    mean, half = 0.5 * (1.0 + left), 0.5 * h
    _differentiate(x, model.gravity, h, A)
    w, v = (x[7], x[8], x[9]), (x[3], x[4], x[5])
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        A[3 + i, k] += h * w[j]
        A[3 + i, j] -= h * w[k]
        A[i, k] += half * h * w[j]
        A[i, j] -= half * h * w[k]
    _transition_spinning(A, (h, mean, left), v, P, FP)
    _transition_spinning(A, (h, mean, left), v, FP.T, P.T)
    _add_white_noise(P, model, h)
    for i in range(7, STATES):
        P[i, i] += model.push_sigma**2 * (1.0 - left * left)
    lift = (mean * w[0], mean * w[1], mean * w[2], 0.0)
    _step(x[:3], x[3:6], x[6], (0.0, 0.0, -model.gravity), lift, h)
    for i in range(7, STATES):
        x[i] *= left


@kernel
def _transition_spinning(
    A: Array,
    of: tuple[float, float, float],
    v: tuple[float, float, float],
    P: Array,
    out: Array,
) -> None:
    """Write F P as :func:`_transition`, where a change of w acts as that of w x v.

    ``of`` is h, mean and left of there, ``v`` the velocity [m/s].
    """
    h, mean, left = of
    by_r, by_v = 0.5 * h * h * mean, h * mean
    for j in range(STATES):
        x, y, z, drag = P[3, j], P[4, j], P[5, j], P[6, j]
        for i in range(3):
            a, b, speed = (i + 1) % 3, (i + 2) % 3, 3 + i
            push = P[7 + a, j] * v[b] - P[7 + b, j] * v[a]
            out[i, j] = P[i, j] + A[i, 0] * x + A[i, 1] * y + A[i, 2] * z + A[i, 3] * drag
            out[i, j] += by_r * push
            out[speed, j] = A[speed, 0] * x + A[speed, 1] * y + A[speed, 2] * z
            out[speed, j] += A[speed, 3] * drag + by_v * push
            out[7 + i, j] = left * P[7 + i, j]
        out[6, j] = drag


@kernel
def _add_white_noise(P: Array, model: MotionModel, h: float) -> None:
    """Add what the unmodelled acceleration and the drift of the drag do in ``abs(h)``."""
    a, sign, white = abs(h), 1.0 if h > 0.0 else -1.0, model.accel_density
    for r in range(3):
        v = r + 3
        P[r, r] += white * a**3 / 3.0
        P[v, v] += white * a
        P[r, v] += sign * white * a**2 / 2.0
        P[v, r] += sign * white * a**2 / 2.0
    P[6, 6] += model.drag_density * a


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
    x, P = np.zeros(STATES), np.zeros((STATES, STATES))
    x[:7] = (*state.r_o, *state.dr_o, state.drag)
    P[:6, :6] = state.covariance
    P[6, 6] = drag_sigma * drag_sigma
    flight = MotionModel(GRAVITY, accel_density)
    advance_uncertain(x, P, t - state.t, flight, np.empty((6, 4)), np.empty(P.shape))
    ddr = np.empty(3)
    acceleration(x[3:6], state.drag, ddr)
    covariance = 0.5 * (P + P.T)[:6, :6]
    return replace(state, t=t, r_o=x[:3], dr_o=x[3:6], ddr_o=ddr, covariance=covariance)


@kernel
def change_by_bounce(dr: Array, ago: float, change: Array) -> bool:
    """Write by how much a bounce on a level surface would have changed a ball's velocity.

    Args:
        dr: Its velocity if it flies on [m/s], shape (3,).
        ago: How long ago it would have bounced [s].
        change: Result [m/s], shape (3,).

    Returns:
        Whether it could: a ball that rose does not bounce, and nothing is written.
    """
    falling = -(dr[2] + GRAVITY * ago)
    if not falling > 0.0:
        return False
    change[0], change[1], change[2] = -GRIP * dr[0], -GRIP * dr[1], (1.0 + REBOUND) * falling
    return True


@kernel
def doubt_flight(
    dr: Array, silence: float, missed: float, change: Array, covariance: Array
) -> None:
    """Add to a covariance what a bounce may have done to a ball that frames do not show any more.

    It bounced at any instant of the silence, or something hides it and it flies on. The more frames
    should have shown it and did not, the likelier is the bounce.

    Args:
        dr: Velocity if it flies on [m/s], shape (3,).
        silence: Time since it was seen [s].
        missed: Frames since then that should have shown it.
        change: Scratch, shape (3,).
        covariance: Of position and velocity, overwritten, shape (6, 6).
    """
    if not (missed > 0.0 and silence > 0.0 and change_by_bounce(dr, silence, change)):
        return
    likely = missed / (missed + SEEMS_GONE)
    for i in range(3):
        for j in range(3):
            both = likely * change[i] * change[j]
            covariance[i, j] += both * silence * silence / 3.0
            covariance[i, 3 + j] += both * silence / 2.0
            covariance[3 + i, j] += both * silence / 2.0
            covariance[3 + i, 3 + j] += both
