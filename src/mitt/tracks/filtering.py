"""The ball filter on recorded positions: each row of the track uses only rows up to itself."""

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from mitt.ball.filter import FilterConfig, doubt, fresh_filter, predict, update
from mitt.ball.measurement_noise import fresh_noise, learn
from mitt.jit import kernel
from mitt.signals import Array
from mitt.structs import Record

UNKNOWN_BALL = FilterConfig(
    drag_mean=0.08,
    drag_sigma=0.05,
    accel_density=0.005,
    push_sigma=1.0,
    push_time=1.0,
    other_motion=0.3,
    watchful=True,
    speaks_after=1,
)
"""Any ball, and whatever else moves: the other laws of motion count from the first position."""


class Track(NamedTuple):
    """Estimates at the times of the positions, shape (n, 3) each.

    Attributes:
        r: Position [m].
        dr: Velocity [m/s].
        ddr: Acceleration [m/s^2].
        sigma: Standard deviation of the position [m].
        ahead: Predicted position, a while later [m].
    """

    r: Array
    dr: Array
    ddr: Array
    sigma: Array
    ahead: Array


def follow(
    t: Array,
    points: Array,
    *,
    ahead: float = 0.0,
    sigma: float | None = None,
    config: FilterConfig = UNKNOWN_BALL,
) -> Track:
    """Filter one flight.

    Args:
        t: Times, rising [s], shape (n,).
        points: Positions [m], shape (n, 3).
        ahead: How far to look ahead [s].
        sigma: Standard deviation of each coordinate [m]; learned from the positions if None.
        config: What is assumed of the ball.
    """
    rows = np.zeros((len(t), 5, 3))
    _follow(t, points, ahead, sigma or 0.0, fresh_filter(config), fresh_noise(), rows)
    return Track(*rows.transpose(1, 0, 2))


def follow_all(
    samples: Array, flights: Iterable[list[int]], *, ahead: float = 0.0, sigma: float | None = None
) -> Track:
    """Filter several flights, each on its own; see :func:`follow`.

    Args:
        samples: Times and positions [s, m], shape (n, 4).
        flights: Indices of the rows of each flight.
        ahead: How far to look ahead [s].
        sigma: Standard deviation of each coordinate [m]; learned from the positions if None.

    Returns:
        The track, its rows in the order of the samples.
    """
    rows = np.zeros((5, len(samples), 3))
    for flight in flights:
        t, points = samples[flight, 0], samples[flight, 1:]
        rows[:, flight] = follow(t - t[0], points, ahead=ahead, sigma=sigma)
    return Track(*rows)


@kernel
def _follow(
    t: Array, points: Array, ahead: float, sigma: float, ball: Record, noise: Record, rows: Array
) -> None:
    """Fill the rows of a track, shape (n, 5, 3); the noise is learned if ``sigma`` is 0."""
    R, motion, covariance = np.zeros((3, 3)), np.zeros((3, 3)), np.zeros((6, 6))
    for n in range(len(t)):
        learn(noise, t[n], points[n])
        for i in range(3):
            R[i, i] = sigma * sigma if sigma > 0.0 else noise[0].variance[i]
        update(ball, t[n], points[n], R)
        predict(ball, t[n] + ahead, motion, covariance)
        rows[n, 4] = motion[0]
        if predict(ball, t[n], motion, covariance):
            doubt(ball, t[n], covariance)
        rows[n, 0:3] = motion
        for i in range(3):
            rows[n, 3, i] = np.sqrt(covariance[i, i])
