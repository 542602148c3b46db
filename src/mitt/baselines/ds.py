"""Rival ``ds``: a dynamical system that is softly coupled to the ball.

After Salehian, Khoramshahi and Billard, "A Dynamical System Approach for Softly Catching a Flying
Object: Theory and Experiment", IEEE Transactions on Robotics 32 (2016): the hand is attracted not
by the ball but by a virtual one, seen from the predicted intercept r_c as
x = r_c + gamma (r_o - r_c). The softness gamma goes from 0, where the hand is attracted by the
intercept alone, to 1, where it moves with the ball, and depends on the state. Here
gamma = (1 - s)^3 with s = |r_o - r_c|^2 / R^2 (0 beyond R), and the system is of second order in
the joints, critically damped, its rate rising towards the catch.
"""

import numpy as np

from mitt.baselines.choice import Intercept
from mitt.baselines.pursuit import rival
from mitt.baselines.servo import Reach, Servo
from mitt.generator.generators import Generator
from mitt.generator.mapping import DirectMap
from mitt.signals import Array, BallState

#: Distance R of the ball from the intercept at which the coupling begins [m].
_RADIUS = 1.6
#: Smallest rate of the system [rad/s].
_SLOWEST = 6.0


def virtual_ball(catch: Intercept, ball: BallState) -> Array:
    """Return position, velocity and acceleration of the virtual ball, shape (3, 3)."""
    o, do, ddo = ball.r_o - catch.r_c, ball.dr_o, ball.ddr_o
    size = _RADIUS * _RADIUS
    left = max(1.0 - float(np.sum(o * o)) / size, 0.0)
    ds = float(np.sum(2.0 * o * do)) / size
    dds = float(np.sum(2.0 * (do * do + o * ddo))) / size
    soft, dsoft = left * left * left, -3.0 * left * left * ds
    ddsoft = 6.0 * left * ds * ds - 3.0 * left * left * dds
    return np.array([
        catch.r_c + soft * o,
        soft * do + dsoft * o,
        soft * ddo + 2.0 * dsoft * do + ddsoft * o,
    ])  # fmt: skip


def make_ds(f: DirectMap) -> Generator:
    """Return the rival for the arm of a map."""
    return rival(f, Servo(reach=Reach(f), point=virtual_ball, slowest=_SLOWEST))
