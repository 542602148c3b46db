"""Rival ``ik``: the hand follows the ball by inverse kinematics, f = l^-1.

What the paper sets out from: the desired position of the hand is that of the ball, resolved to
joint motion by damped least squares. Taken literally it cannot catch: the ball enters the reach
of the arm where the arm is stretched, and no arm starts at 6 m/s. What an expert makes of it:

- until the ball is near, the hand waits on the predicted line of flight, ahead of the ball and
  within the reach;
- then it sets off along the line and lets the ball catch up: the hand is where the ball will be
  a moment later, r_o(sigma(t)) with sigma -> t and d sigma / dt -> 1 at the catch;
- and it comes from behind, set back along the palm's normal (:mod:`mitt.baselines.servo`).

Of the two elbows that reach a point that of the catch is taken; the gap between the arm and that
motion is closed on the way.
"""

import numpy as np

from mitt.baselines.choice import Intercept
from mitt.baselines.pursuit import rival
from mitt.baselines.servo import Reach, Servo
from mitt.generator.generators import Generator
from mitt.generator.mapping import DirectMap
from mitt.generator.prediction import fly_on, state_of
from mitt.signals import Array, BallState

#: Time before the catch at which the hand sets off along the line [s].
_RUN = 0.13
#: Share of the time to the catch in which the hand gets onto the line.
_JOIN = 0.95
#: Smallest bandwidth of the joints [rad/s].
_SLOWEST = 15.0


def on_the_line(catch: Intercept, ball: BallState) -> Array:
    """Return the motion of the point that the hand follows, position to acceleration, (3, 3).

    With u = left / D it is at the ball's place of the time sigma = t_c - D (u - u^3 + u^4 / 2), so
    that d sigma / dt = 1 - u^2 (3 - 2 u).
    """
    left = catch.t_c - ball.t
    u = min(max(left / _RUN, 0.0), 1.0)
    ds, dds = 1.0 - u * u * (3.0 - 2.0 * u), 6.0 * u * (1.0 - u) / _RUN
    point = np.empty((3, 3))
    fly_on(state_of(ball), left - _RUN * (u - u * u * u + 0.5 * ((u * u) * (u * u))), point)
    r, dr, ddr = point
    return np.array([r, dr * ds, ddr * ds * ds + dr * dds])


def make_ik(f: DirectMap) -> Generator:
    """Return the rival for the arm of a map."""
    return rival(f, Servo(reach=Reach(f), point=on_the_line, slowest=_SLOWEST, join=_JOIN))
