"""Flights of a ball from here to there, by the kernels of :mod:`mitt.flight`."""

import numpy as np

from mitt.flight import GRAVITY, advance
from mitt.jit import kernel
from mitt.signals import Array


def fly(r: Array, dr: Array, *, drag: float, duration: float) -> tuple[Array, Array]:
    """Fly freely for a while.

    Args:
        r: Position at the start [m], shape (3,).
        dr: Velocity at the start [m/s], shape (3,).
        drag: Quadratic drag coefficient k [1/m].
        duration: Time of flight [s], not negative.

    Returns:
        Position [m], shape (3,), and velocity [m/s], shape (3,), at the end.
    """
    r, dr = np.array(r, float), np.array(dr, float)
    advance(r, dr, drag, duration)
    return r, dr


def release_velocity(
    start: Array, target: Array, *, drag: float, duration: float, iterations: int = 6
) -> Array:
    """Find the velocity at ``start`` that carries the ball to ``target`` (shooting, Newton).

    Args:
        start: Point of release [m], shape (3,).
        target: Point to be passed after ``duration`` [m], shape (3,).
        drag: Quadratic drag coefficient k [1/m].
        duration: Time of flight [s], positive.
        iterations: Newton steps; four reach rounding error on any throw of the default range.

    Returns:
        Velocity at release [m/s], shape (3,).
    """
    dr = (target - start) / duration
    dr[2] += 0.5 * GRAVITY * duration
    miss, slope = np.empty(3), np.empty((3, 3))
    for _ in range(iterations):
        _shoot(start, dr, target, drag, duration, miss, slope)
        dr = dr - np.linalg.solve(slope, miss)
    return dr


@kernel
def _shoot(
    start: Array, dr: Array, target: Array, drag: float, duration: float, miss: Array, slope: Array
) -> None:
    """Write by how much a release misses, and how that answers to its velocity.

    Args:
        start: As for :func:`release_velocity`.
        dr: Velocity at release [m/s], shape (3,).
        target: As for :func:`release_velocity`.
        drag: As for :func:`release_velocity`.
        duration: As for :func:`release_velocity`.
        miss: Result [m], shape (3,).
        slope: Result [s], shape (3, 3), by central differences.
    """
    nudge, r, v = 1e-5, np.empty((2, 3)), np.empty(3)
    r[0], v[:] = start, dr
    advance(r[0], v, drag, duration)
    miss[:] = r[0] - target
    for i in range(3):
        for side in range(2):
            r[side], v[:] = start, dr
            v[i] += nudge if side == 0 else -nudge
            advance(r[side], v, drag, duration)
        for k in range(3):
            slope[k, i] = (r[0, k] - r[1, k]) / (2.0 * nudge)
