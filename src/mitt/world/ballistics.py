"""Flights of a ball from here to there, by the kernels of :mod:`mitt.ball.flight`."""

import numpy as np

from mitt.ball.flight import advance
from mitt.signals import GRAVITY, Array


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
    slope, nudge = np.empty((3, 3)), 1e-5

    def end(velocity: Array) -> Array:
        return fly(start, velocity, drag=drag, duration=duration)[0]

    for _ in range(iterations):
        for i, step in enumerate(nudge * np.eye(3)):
            slope[:, i] = (end(dr + step) - end(dr - step)) / (2.0 * nudge)
        dr = dr - np.linalg.solve(slope, end(dr) - target)
    return dr
