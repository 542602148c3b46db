"""Where and when a ball will be caught, by the law of motion that its estimate speaks by.

A ball that flies goes on by gravity and drag. One that is led, by a hand or on a spring, goes on
with an acceleration that fades away within ``FADES`` s, as the filter's model of what is driven has
it (:mod:`mitt.core.ball.motion_models`); more than a few tenths of a second ahead that is a guess.
One that falls although it is led is in the air, but pushed, as by a gust: the push fades.

| here     | meaning                                        | unit                 | shape     |
|----------|------------------------------------------------|----------------------|-----------|
| ``state``| r_o, dr_o, ddr_o, drag coefficient or ``LED``  | m, m/s, m/s^2, 1/m   | (10,)     |
| ``path`` | r_o, dr_o, ddr_o at given times                | m, m/s, m/s^2        | (K, 3, 3) |
"""

from math import exp

import numpy as np

from mitt.core.ball.flight import STATES, MotionModel, acceleration, advance, advance_uncertain
from mitt.core.kernels import big_kernel, copy, kernel, view
from mitt.core.map.tangent import MapArrays, coordinate, invert, lift, to_go, unfold, unpack
from mitt.core.signals import GRAVITY, PASSED, Array, BallState

#: How far ahead a ball is flown [s], in what steps, and halvings of the step of the catch.
HORIZON = 1.0
STRIDE = 0.01
_HALVINGS = 12
#: Time to the catch up to which the ball's present motion tells it [s].
NEAR = 0.1
#: Rounds in which a catch farther ahead is found, their last step, of which an error of the third
#: order is left, below 1 us, and where they begin at the latest: before the ball passes by [s].
_ROUNDS = 5
_CLOSE = 3e-3
_GUESS = 0.3
#: Spectral density of the acceleration that the flight model does not explain [m^2/s^3].
_UNEXPLAINED = 0.005
LED = -1.0
"""Stands in the place of the drag coefficient, never negative, of what does not fly."""

FADES = 0.2
"""Time in which the acceleration of what is led fades by 1/e [s]; ``FilterConfig.driven_time``."""


def spread(ball: BallState, after: float) -> float:
    """Return the largest 1-sigma of the position some time ahead [m]."""
    return float(_spread(state_of(ball), ball.drag, ball.covariance, after))


def state_of(ball: BallState) -> Array:
    """Return what the kernels carry on, shape (10,)."""
    state = np.empty(10)
    lay_state(np.array([ball.r_o, ball.dr_o, ball.ddr_o]), ball.drag, ball.led, state)
    return state


@kernel
def lay_state(motion: Array, drag: float, led: bool, state: Array) -> None:
    """Write what the kernels carry on.

    Args:
        motion: r_o, dr_o, ddr_o as estimated, shape (3, 3).
        drag: Drag coefficient [1/m].
        led: Whether the ball is led.
        state: Result, as in the module's table.
    """
    ddr = state[6:9]
    acceleration(motion[1], drag, ddr)
    falls = motion[2, 2] - ddr[2] < 0.5 * GRAVITY
    for i in range(3):
        state[i], state[3 + i] = motion[0, i], motion[1, i]
        if led:
            ddr[i] = motion[2, i]
    state[9] = LED if led and not falls else drag


def flown(ball: BallState, after: Array) -> Array:
    """Return r_o, dr_o, ddr_o some times after the estimate [s], (K,), shape (K, 3, 3)."""
    path = np.empty((len(after), 3, 3))
    foreseen_flight(state_of(ball), after, path)
    return path


@kernel
def fly_on(state: Array, after: float, ball: Array) -> None:
    """Write r_o, dr_o, ddr_o, shape (3, 3), some time after a state (10,) [s]."""
    for d in range(3):
        for a in range(3):
            ball[d, a] = state[3 * d + a]
    go_on(ball, state[9], after)


@kernel
def go_on(ball: Array, drag: float, dt: float) -> None:
    """Carry r_o, dr_o, ddr_o, shape (3, 3), on by ``dt`` [s], in place."""
    push, left = ball[2], exp(-dt / FADES)
    px, py, pz = push[0], push[1], push[2]
    if drag == LED:
        for a in range(3):
            ball[0, a] += dt * ball[1, a]
    else:
        acceleration(ball[1], drag, push)
        px, py, pz = px - push[0], py - push[1], pz - push[2]
        advance(ball[0], ball[1], drag, dt)
    way, gain = FADES * (dt - FADES * (1.0 - left)), FADES * (1.0 - left)
    for a, p in enumerate((px, py, pz)):
        ball[0, a] += way * p
        ball[1, a] += gain * p
    if drag == LED:
        push[:] = 0.0
    else:
        acceleration(ball[1], drag, push)
    for a, p in enumerate((px, py, pz)):
        push[a] += left * p


@kernel
def foreseen_flight(state: Array, after: Array, path: Array) -> None:
    """Write r_o, dr_o, ddr_o at rising times after a state (10,) [s], (K,), shape (K, 3, 3)."""
    last, ball = 0.0, np.empty((3, 3))
    fly_on(state, 0.0, ball)
    for k in range(len(after)):
        go_on(ball, state[9], after[k] - last)
        last = after[k]
        path[k] = ball


@big_kernel
def catch_time(f: MapArrays, state: Array, q_o: Array, ball: Array) -> float:
    """Return the time until s = q_o,i - q_alpha changes its sign, by halving; infinity without."""
    g = unpack(f.packed)
    w = unfold(f.work, len(q_o))
    r = ball[0]
    fly_on(state, 0.0, ball)
    last, t, stride = 0.0, 0.0, STRIDE
    while t < HORIZON:
        if not invert(g, r, q_o, w):
            return np.inf
        s = to_go(g, q_o)
        if last != 0.0 and s * last <= 0.0:
            break
        last = s
        go_on(ball, state[9], stride)
        t += stride
    else:
        return np.inf
    for _ in range(_HALVINGS):
        stride *= 0.5
        back = -stride if s * last <= 0.0 else stride
        go_on(ball, state[9], back)
        t += back
        if not invert(g, r, q_o, w):
            return np.inf
        s = to_go(g, q_o)
    return t


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
def time_to_catch(f: MapArrays, rows: Array, ball: Array, drag: float, led: bool) -> float:
    """Return the time to the catch [s], as of :class:`mitt.core.signals.JointReference`.

    Near the catch the ball's present motion tells it. Farther ahead it does not: gravity turns the
    way of a ball that still rises, so the ball is flown on.

    Args:
        f: The map.
        rows: As :func:`mitt.core.map.mapping.reference` writes them, shape (6, n).
        ball: r_o, dr_o, ddr_o, shape (3, 3).
        drag: Its drag coefficient [1/m].
        led: Whether it is led.
    """
    g = unpack(f.packed)
    s = to_go(g, rows[3])
    ds, dds = coordinate(g, rows[4], g.catch), coordinate(g, rows[5], g.catch)
    after, before = root_time(s, ds, dds), root_time(s, -ds, dds)
    away = g.plane[0] * g.plane[2] + g.plane[1] * g.plane[3]
    outside = g.planar and s * away > 0.0  # from where balls come: it has not passed by
    if before <= PASSED and before < after and not outside:
        return float(-before)
    if after <= NEAR:
        return float(after)
    return float(max(_time_ahead(f, s, after, (ball, drag, led)), NEAR))


@kernel
def _time_ahead(f: MapArrays, s: float, t: float, of: tuple[Array, float, bool]) -> float:
    """Return the time to a catch that is not near [s]; infinite where none is foreseen.

    Args:
        f: The map.
        s: Distance still to go [rad].
        t: Time to the catch by the ball's present motion [s]; the search begins there.
        of: The ball: its motion, drag coefficient, whether it is led.
    """
    g, n = unpack(f.packed), len(f.start)
    w = unfold(f.work, n)
    state, end, virtual = w.state, w.ball, w.virtual
    q_o, dq_o, ddq_o = view(virtual, 0, (n,)), view(virtual, n, (n,)), view(virtual, 2 * n, (n,))
    lay_state(of[0], of[1], of[2], state)
    t, step = min(t, _GUESS), 0.0
    fly_on(state, t, end)
    for _ in range(_ROUNDS):
        copy(f.start, q_o)
        if not (abs(step) < t and lift(g, end, virtual, w)):
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
    copy(f.start, q_o)
    return float(catch_time(f, state, q_o, end))


@kernel
def passes_below(state: Array, reach: float) -> bool:
    """Say whether the ball comes over ground within reach of the shoulder, but below it."""
    ball, t = np.empty((3, 3)), 0.0
    fly_on(state, 0.0, ball)
    while t < HORIZON:
        x, y = ball[0, 0], ball[0, 1]
        if np.sqrt(x * x + y * y) <= reach:
            return bool(ball[0, 2] < 0.0)
        go_on(ball, state[9], STRIDE)
        t += STRIDE
    return False


@big_kernel
def sigma_at_catch(f: MapArrays, state: Array, drag: float, covariance: Array) -> float:
    """Return the 1-sigma at the catch; see :func:`sharpness`."""
    q_o = f.start.copy()
    after = catch_time(f, state, q_o, np.empty((3, 3)))
    if after == np.inf:
        return np.inf
    for k in range(len(q_o)):
        if not f.trusted[0, k] <= q_o[k] <= f.trusted[1, k]:
            return np.inf
    return float(_spread(state, drag, covariance, after))


@kernel
def _spread(state: Array, drag: float, covariance: Array, after: float) -> float:
    """Return the largest 1-sigma of the position some time ahead; see :func:`spread`."""
    x, P = np.zeros(STATES), np.zeros((STATES, STATES))
    x[:6] = state[:6]
    x[6] = drag
    P[:6, :6] = covariance
    model = MotionModel(GRAVITY, _UNEXPLAINED, 0.0, 0.0, 1.0, 0.0)
    advance_uncertain(x, P, after, model, np.empty((6, 4)), np.empty((STATES, STATES)))
    return float(np.sqrt(max(_largest_eigenvalue(P), 0.0)))


@kernel
def _largest_eigenvalue(P: Array) -> float:
    """Return the largest eigenvalue of the symmetric first three rows and columns (Smith 1961)."""
    a, b, c = 0.5 * (P[0, 1] + P[1, 0]), 0.5 * (P[0, 2] + P[2, 0]), 0.5 * (P[1, 2] + P[2, 1])
    middle = (P[0, 0] + P[1, 1] + P[2, 2]) / 3.0
    x, y, z = P[0, 0] - middle, P[1, 1] - middle, P[2, 2] - middle
    size = np.sqrt((x * x + y * y + z * z + 2.0 * (a * a + b * b + c * c)) / 6.0)
    if not size > 0.0:
        return float(middle)
    det = x * (y * z - c * c) - a * (a * z - b * c) + b * (a * c - b * y)
    turn = np.arccos(min(max(0.5 * det / size**3, -1.0), 1.0)) / 3.0
    return float(middle + 2.0 * size * np.cos(turn))
