"""Where and when a ball will be caught, by the law of motion that its estimate speaks by.

A ball that flies goes on by gravity and drag. One that is led, by a hand or on a spring, goes on
with an acceleration that fades away within ``FADES`` s, as the filter's model of what is driven has
it (:mod:`mitt.ball.motion_models`); more than a few tenths of a second ahead that is a guess.
One that falls although it is led is in the air, but pushed, as by a gust: the push fades.

| here     | meaning                                        | unit                 | shape     |
|----------|------------------------------------------------|----------------------|-----------|
| ``state``| r_o, dr_o, ddr_o, drag coefficient or ``LED``  | m, m/s, m/s^2, 1/m   | (10,)     |
| ``path`` | r_o, dr_o, ddr_o at given times                | m, m/s, m/s^2        | (K, 3, 3) |
"""

from dataclasses import dataclass
from math import exp
from typing import TYPE_CHECKING

import numpy as np

from mitt.ball.flight import STATES, MotionModel, acceleration, advance, advance_uncertain
from mitt.kernels import kernel
from mitt.map.tangent import invert, to_go, unfold, unpack
from mitt.signals import GRAVITY, Array, BallState

if TYPE_CHECKING:  # the map asks this module for the time to its catch
    from mitt.map.mapping import DirectMap

#: How far ahead a ball is flown [s], in what steps, and halvings of the step of the catch.
HORIZON, _STRIDE, _HALVINGS = 1.0, 0.01, 12
#: Spectral density of the acceleration that the flight model does not explain [m^2/s^3].
_UNEXPLAINED = 0.005
LED = -1.0
"""Stands in the place of the drag coefficient, never negative, of what does not fly."""

FADES = 0.2
"""Time in which the acceleration of what is led fades by 1/e [s]; ``FilterConfig.driven_time``."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Foresight:
    """A predicted catch.

    Attributes:
        after: Time until q_o,i reaches q_alpha [s]; infinite where it does not.
        q_o: Virtual joints then: where the catch will be [rad], shape (n,).
        below: Whether the ball, not caught, passes over reachable ground below the shoulder.
    """

    after: float
    q_o: Array
    below: bool


def foresee(f: "DirectMap", ball: BallState) -> Foresight:
    """Fly the ball on to the catch."""
    q_o, end = f.start.copy(), np.zeros((3, 3))
    reach = float(np.linalg.norm(f.arm.position(f.start)))
    state = state_of(ball)
    after = catch_time(f.packed, state, q_o, end, f.work)
    below = after == np.inf and bool(_passes_below(state, reach))
    return Foresight(after=after, q_o=q_o, below=below)


def spread(ball: BallState, after: float) -> float:
    """Return the largest 1-sigma of the position some time ahead [m]."""
    return float(_spread(state_of(ball), ball.drag, ball.covariance, after))


def sharpness(f: "DirectMap", ball: BallState, low: Array, high: Array) -> float:
    """Return the predicted 1-sigma of the ball at the catch [m].

    Args:
        f: The map.
        ball: Estimate of the ball.
        low: Smallest virtual joints of a catch that counts [rad], shape (n,).
        high: Largest, shape (n,).

    Returns:
        Infinite without a catch within ``low`` and ``high``.
    """
    state, q_o = state_of(ball), f.start.copy()
    return float(
        sigma_at_catch(f.packed, state, ball.drag, ball.covariance, low, high, q_o, f.work)
    )


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
    fly(state_of(ball), after, path)
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
def fly(state: Array, after: Array, path: Array) -> None:
    """Write r_o, dr_o, ddr_o at rising times after a state (10,) [s], (K,), shape (K, 3, 3)."""
    last, ball = 0.0, np.empty((3, 3))
    fly_on(state, 0.0, ball)
    for k in range(len(after)):
        go_on(ball, state[9], after[k] - last)
        last = after[k]
        path[k] = ball


@kernel
def catch_time(packed: Array, state: Array, q_o: Array, ball: Array, work: Array) -> float:
    """Return the time until s = q_o,i - q_alpha changes its sign, by halving; infinity without."""
    g = unpack(packed)
    w = unfold(work, len(q_o))
    r = ball[0]
    fly_on(state, 0.0, ball)
    last, t, stride = 0.0, 0.0, _STRIDE
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
def _passes_below(state: Array, reach: float) -> bool:
    """Say whether the ball comes over ground within reach of the shoulder, but below it."""
    ball, t = np.empty((3, 3)), 0.0
    fly_on(state, 0.0, ball)
    while t < HORIZON:
        x, y = ball[0, 0], ball[0, 1]
        if np.sqrt(x * x + y * y) <= reach:
            return bool(ball[0, 2] < 0.0)
        go_on(ball, state[9], _STRIDE)
        t += _STRIDE
    return False


@kernel
def sigma_at_catch(
    packed: Array,
    state: Array,
    drag: float,
    covariance: Array,
    low: Array,
    high: Array,
    q_o: Array,
    work: Array,
) -> float:
    """Return the 1-sigma at the catch; see :func:`sharpness`."""
    after = catch_time(packed, state, q_o, np.empty((3, 3)), work)
    if after == np.inf:
        return np.inf
    for k in range(len(q_o)):
        if not low[k] <= q_o[k] <= high[k]:
            return np.inf
    return float(_spread(state, drag, covariance, after))


@kernel
def _spread(state: Array, drag: float, covariance: Array, after: float) -> float:
    """Return the largest 1-sigma of the position some time ahead; see :func:`spread`."""
    x, P = np.zeros(STATES), np.zeros((STATES, STATES))
    x[:6] = state[:6]
    x[6] = drag
    P[:6, :6] = covariance
    model = MotionModel(GRAVITY, _UNEXPLAINED, 0.0, 0.0, 1.0)
    advance_uncertain(x, P, after, model, np.empty((6, 4)), np.empty((STATES, STATES)))
    return float(np.sqrt(max(_largest(P), 0.0)))


@kernel
def _largest(P: Array) -> float:
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
