"""Closing the hand by time to contact.

The fingers start a fixed lead before the catch, which the map itself announces as the time until
q_o,i reaches q_alpha, and from then on run through the hand's closing profile by the clock: a
started closing is not taken back.
"""

from math import inf
from typing import final

from mitt.robot.hands import HandModel

#: Following after the catch, while the fingers close on the ball [s]. Each millisecond costs
#: 15 mrad of the room that joint 4 has for braking; by then the fingers have touched.
FOLLOW_ON = 0.001
#: When the fingers first touch the ball, after the catch [s]: the palm lies one radius behind it.
TOUCH_BEFORE = -0.004


@final
class Closing:
    """The fingers of one throw."""

    def __init__(self, hand: HandModel | None, *, ball_radius: float) -> None:
        """Take the hand (None leaves a hand that does not exist open) and the ball's radius [m]."""
        self._hand = hand
        self._touch = 0.0 if hand is None else hand.touch_angle(ball_radius)
        self.t_start = inf

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
        if self._hand is None:
            self.t_start = t if time_to_catch <= 0.0 and self.t_start == inf else self.t_start
            return 0.0
        if self.t_start == inf:
            if time_to_catch > self._hand.closing.lead:
                return 0.0
            self.t_start = t
        return self._hand.closing_angle_towards(t - self.t_start, self._touch)

    def closed(self, t: float, *, hurry: bool) -> bool:
        """Say whether the fingers have had the time to close around the ball.

        Args:
            t: Time of the tick [s].
            hurry: Whether the arm is short of room to brake; then the first touch is enough.
        """
        if self._hand is None:
            return t - self.t_start >= 0.0
        after = TOUCH_BEFORE if hurry else FOLLOW_ON
        return t - self.t_start >= self._hand.closing.lead + after
