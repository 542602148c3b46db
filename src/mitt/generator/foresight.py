"""Where and when a ball will be caught, if nothing but gravity and drag acts on it.

| here     | meaning                                    | unit            | shape     |
|----------|--------------------------------------------|-----------------|-----------|
| ``state``| position, velocity, drag coefficient       | m, m/s, 1/m     | (7,)      |
| ``path`` | r_o, dr_o, ddr_o at given times            | m, m/s, m/s^2   | (K, 3, 3) |
"""

from dataclasses import dataclass

import numpy as np
from numba import njit

from mitt.flight import (
    GRAVITY,
    STATES,
    TRACK,
    acceleration,
    advance,
    advance_uncertain,
)
from mitt.generator.mapping import DirectMap
from mitt.generator.packing import unfold, unpack
from mitt.generator.tangent import invert_newton, invert_planar
from mitt.signals import Array, BallState

#: How far ahead a ball is flown [s], in what steps, and halvings of the step of the catch.
_HORIZON, _STRIDE, _HALVINGS = 1.0, 0.01, 12
#: Spectral density of the acceleration that the flight model does not explain [m^2/s^3].
_UNEXPLAINED = 0.005
#: Answers of the kernel besides a time.
_NO_CATCH = -1.0


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


def foresee(f: DirectMap, ball: BallState) -> Foresight:
    """Fly the ball on to the catch."""
    q_o, end = f.start.copy(), np.zeros(6)
    reach = float(np.linalg.norm(f.arm.position(f.start)))
    state = np.array([*ball.r_o, *ball.dr_o, ball.drag])
    after = _catch_time(f.packed, state, q_o, end, f.work)
    if after == _NO_CATCH:
        return Foresight(after=np.inf, q_o=q_o, below=bool(_passes_below(state, reach)))
    return Foresight(after=after, q_o=q_o, below=False)


def spread(ball: BallState, after: float) -> float:
    """Return the largest 1-sigma of the position some time ahead [m]."""
    state = np.array([*ball.r_o, *ball.dr_o, ball.drag])
    return float(_spread(state, ball.covariance, after))


def sharpness(f: DirectMap, ball: BallState, low: Array, high: Array) -> float:
    """Return the predicted 1-sigma of the ball at the catch [m].

    Args:
        f: The map.
        ball: Estimate of the ball.
        low: Smallest virtual joints of a catch that counts [rad], shape (n,).
        high: Largest, shape (n,).

    Returns:
        Infinite without a catch within ``low`` and ``high``.
    """
    state = np.array([*ball.r_o, *ball.dr_o, ball.drag])
    return float(_sharpness(f.packed, state, ball.covariance, low, high, f.start.copy(), f.work))


def flown(ball: BallState, after: Array) -> Array:
    """Return r_o, dr_o, ddr_o some times after the estimate [s], (K,), shape (K, 3, 3)."""
    path = np.empty((len(after), 3, 3))
    _fly(np.array([*ball.r_o, *ball.dr_o, ball.drag]), after, path)
    return path


@njit(cache=True)
def _fly(state: Array, after: Array, path: Array) -> None:
    """Write the flight at rising times."""
    r, dr, last = state[:3].copy(), state[3:6].copy(), 0.0
    for k in range(len(after)):
        advance(r, dr, state[6], after[k] - last)
        last = after[k]
        path[k, 0], path[k, 1] = r, dr
        acceleration(dr, state[6], path[k, 2])


@njit(cache=True)
def _catch_time(packed: Array, state: Array, q_o: Array, end: Array, work: Array) -> float:
    """Return the time until s = q_o,i - q_alpha changes its sign, by halving; -1 without."""
    g = unpack(packed)
    w = unfold(work, len(q_o))
    r, dr = end[:3], end[3:]
    r[:], dr[:] = state[:3], state[3:6]
    last, t, stride = 0.0, 0.0, _STRIDE
    while t < _HORIZON:
        inside = invert_planar(g, r, q_o) if g.planar else invert_newton(g, r, q_o, w)
        if not inside:
            return _NO_CATCH
        s = q_o[g.catch_joint] - g.q_catch
        if last != 0.0 and s * last <= 0.0:
            break
        last = s
        advance(r, dr, state[6], stride)
        t += stride
    else:
        return _NO_CATCH
    for _ in range(_HALVINGS):
        stride *= 0.5
        back = -stride if s * last <= 0.0 else stride
        advance(r, dr, state[6], back)
        t += back
        inside = invert_planar(g, r, q_o) if g.planar else invert_newton(g, r, q_o, w)
        if not inside:
            return _NO_CATCH
        s = q_o[g.catch_joint] - g.q_catch
    return t


@njit(cache=True)
def _passes_below(state: Array, reach: float) -> bool:
    """Say whether the ball comes over ground within reach of the shoulder, but below it."""
    r, dr, t = state[:3].copy(), state[3:6].copy(), 0.0
    while t < _HORIZON:
        if np.sqrt(r[0] * r[0] + r[1] * r[1]) <= reach:
            return bool(r[2] < 0.0)
        advance(r, dr, state[6], _STRIDE)
        t += _STRIDE
    return False


@njit(cache=True)
def _sharpness(
    packed: Array, state: Array, covariance: Array, low: Array, high: Array, q_o: Array, work: Array
) -> float:
    """Return the 1-sigma at the catch; see :func:`sharpness`."""
    after = _catch_time(packed, state, q_o, np.zeros(6), work)
    if after == _NO_CATCH:
        return np.inf
    for k in range(len(q_o)):
        if not low[k] <= q_o[k] <= high[k]:
            return np.inf
    return float(_spread(state, covariance, after))


@njit(cache=True)
def _spread(state: Array, covariance: Array, after: float) -> float:
    """Return the largest 1-sigma of the position some time ahead; see :func:`spread`."""
    track, work = np.zeros(TRACK), np.empty((2, STATES, STATES))
    track[:7] = state
    P = track[STATES:].reshape(STATES, STATES)
    P[:6, :6] = covariance
    law = np.array([[GRAVITY, _UNEXPLAINED, 0.0, 0.0, 1.0]])
    advance_uncertain(track, 0, after, law, 0, work)
    return float(np.sqrt(_largest(P)))


@njit(cache=True)
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
