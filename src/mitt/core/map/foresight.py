"""A map's catch of a ball: when, where, and how well it is known.

Of the laws of motion by which a ball is carried on, see :mod:`mitt.core.map.prediction`.
"""

from dataclasses import dataclass

import numpy as np

from mitt.core import checks
from mitt.core.map.mapping import DirectMap
from mitt.core.map.prediction import catch_time, passes_below, sigma_at_catch, state_of
from mitt.core.signals import Array, BallState


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
    q_o, end = f.start.copy(), np.zeros((3, 3))
    reach = float(np.linalg.norm(f.arm.position(f.start)))
    state = state_of(ball)
    after = catch_time(f.arrays, state, q_o, end)
    below = after == np.inf and bool(passes_below(state, reach))
    return Foresight(after=after, q_o=q_o, below=below)


def sharpness(f: DirectMap, ball: BallState) -> float:
    """Return the predicted 1-sigma of the ball at the catch [m].

    Infinite without a catch where the map is trusted.
    """
    ball = checks.instance("ball", ball, BallState)
    return float(sigma_at_catch(f.arrays, state_of(ball), ball.drag, ball.covariance))
