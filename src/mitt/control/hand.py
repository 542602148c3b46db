"""Closing the hand by time to contact.

The fingers start a fixed lead before the catch, which the map itself announces as the time until
q_o,i reaches q_alpha, and from then on run through the hand's closing profile by the clock: a
started closing is not taken back. A ball that springs back from the palm is met earlier. Where the
catch has just passed they start at once; they never do for one that is long over.

| here       | meaning                                                                     | unit  |
|------------|-----------------------------------------------------------------------------|-------|
| ``memory`` | time at which the closing began, infinite before                            | s     |
| ``grip``   | lead, touch angle, acceleration, speed and margin at the touch, hold angle, | s ... |
|            | time from the start to the first touch and to the grip                      |       |
"""

from functools import lru_cache
from math import inf
from typing import final

import numpy as np

from mitt import checks
from mitt.jit import kernel
from mitt.robot.basket import Basket, Hand, checked_hand
from mitt.robot.hands import closing_angle
from mitt.signals import PASSED, Array

#: Following after the catch, while the fingers close on the ball [s]. Each millisecond costs
#: 15 mrad of the room that joint 4 has for braking; by then the fingers have touched.
FOLLOW_ON = 0.001
#: When the fingers first touch the ball, after the catch [s]: the palm lies one radius behind it.
TOUCH_BEFORE = -0.004
#: From the first time that a ball can strike a basket's net to the catch [s].
ENTERS = 0.010


@lru_cache(maxsize=8)
def pack_grip(hand: Hand | None, ball_radius: float, restitution: float = 0.0) -> Array:
    """Return a hand's closing as numbers, shape (8,), not to be written to.

    No hand is one that stays open. So is a basket: the ball is inside at the catch, and the arm
    may brake. What would be its closing begins as early as the ball can strike its net.

    Args:
        hand: The hand.
        ball_radius: Radius of the ball [m].
        restitution: Share of its speed with which the ball springs back from the palm.
    """
    if hand is None:
        return np.array([0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 0.0, 0.0])
    if isinstance(hand, Basket):
        times = (ENTERS + TOUCH_BEFORE, ENTERS + FOLLOW_ON)
        return np.array([ENTERS, 0.0, 1.0, 1.0, 0.0, 0.0, *times])
    c = hand.closing
    touch, hold = hand.touch_angle(ball_radius), hand.hold_angle(ball_radius)
    lead = c.lead_for(restitution)
    times = (lead + TOUCH_BEFORE, lead + FOLLOW_ON)
    return np.array([lead, touch, c.acceleration, c.touch_speed, c.margin, hold, *times])


@kernel
def close(memory: Array, grip: Array, t: float, time_to_catch: float) -> float:
    """Return the closing angle to command at ``t`` [rad].

    Args:
        memory: As in the module's table, overwritten, shape (1,).
        grip: As in the module's table, shape (8,).
        t: Time of the tick [s].
        time_to_catch: Time until the catch [s]; infinite where none is in sight.
    """
    if memory[0] == np.inf:
        if not -PASSED <= time_to_catch <= grip[0]:  # later, long over, or no number
            return 0.0
        memory[0] = t
    elapsed = t - memory[0]
    return float(closing_angle(elapsed, grip[1], grip[2], grip[3], grip[4], grip[5]))


@kernel
def has_closed(memory: Array, grip: Array, t: float, hurry: bool) -> bool:
    """Say whether the fingers have had the time to close around the ball.

    Args:
        memory: As in the module's table, shape (1,).
        grip: As in the module's table, shape (8,).
        t: Time of the tick [s].
        hurry: Whether the arm is short of room to brake; then the first touch is enough.
    """
    return bool(t - memory[0] >= (grip[6] if hurry else grip[7]))


@final
class Closing:
    """The fingers of one throw.

    Attributes:
        memory: As in the module's table, shape (1,).
        grip: As in the module's table, shape (8,).
    """

    def __init__(self, hand: Hand | None, *, ball_radius: float, restitution: float = 0.0) -> None:
        """Take the hand (None leaves a hand that does not exist open) and what the ball is like.

        Args:
            hand: The hand.
            ball_radius: Radius of the ball [m].
            restitution: Share of its speed with which the ball springs back from the palm.
        """
        if hand is not None:
            checked_hand(hand)
        ball_radius = checks.number("ball_radius", ball_radius, least=1e-3, most=1.0)
        restitution = checks.number("restitution", restitution, least=0.0, finite=True)
        self.memory = np.array([inf])
        self.grip = pack_grip(hand, ball_radius, restitution)

    @property
    def t_start(self) -> float:
        """Time at which the fingers began to close [s]; infinite before."""
        return float(self.memory[0])

    @property
    def started(self) -> bool:
        """Whether the fingers are closing."""
        return self.t_start < inf

    def step(self, t: float, time_to_catch: float) -> float:
        """Return the closing angle to command at ``t`` [rad].

        Args:
            t: Time of the tick [s].
            time_to_catch: Time until the catch [s]; infinite where none is in sight.
        """
        t = checks.number("t", t, finite=True)
        ahead = checks.number("time_to_catch", time_to_catch)
        return float(close(self.memory, self.grip, t, ahead))

    def closed(self, t: float, *, hurry: bool) -> bool:
        """Say whether the fingers have had the time to close around the ball.

        Args:
            t: Time of the tick [s].
            hurry: Whether the arm is short of room to brake; then the first touch is enough.
        """
        t, hurry = checks.number("t", t, finite=True), checks.flag("hurry", hurry)
        return bool(has_closed(self.memory, self.grip, t, hurry))
