"""Closing the hand so that the fingers have closed when the ball is inside.

The map itself announces the time until the catch, when q_o,i reaches q_alpha and the ball is at the
catch point. On the way there the gap between them follows from what it is now and how it changes:
nothing at the catch, and a parabola in between. The fingers start as soon as the ball will be
inside by the time that they need; from then on they run through the hand's closing profile by the
clock: a started closing is not taken back. Where the catch has just passed they start at once; they
never do for one that is long over.

So a ball that the hand meets at its own speed is enclosed long before the catch, and one that comes
in at 5 m/s as it passes the fingertips: each hand, ball and motion has its own lead.

| here       | meaning                                                                     | unit  |
|------------|-----------------------------------------------------------------------------|-------|
| ``memory`` | time at which the closing began, infinite before; time of the catch then    | s     |
| ``grip``   | the closing profile, as of :func:`mitt.robot.hands.closing_angle`; time that| s ... |
|            | the closing takes; distance at which the ball is inside [m]; time before    |       |
|            | the catch at which the hand has closed at the latest [s]                    |       |
"""

from functools import lru_cache

import numpy as np

from mitt.jit import kernel
from mitt.robot.basket import Hand
from mitt.robot.hands import HandModel, closing_angle
from mitt.signals import PASSED, Array

#: Following after the catch, while the fingers close on the ball [s]. Each millisecond costs
#: 15 mrad of the room that joint 4 has for braking; by then the fingers have touched.
FOLLOW_ON = 0.001
#: When an arm that is short of room may brake, after the catch [s]: the palm lies one radius behind
#: it.
TOUCH_BEFORE = -0.004
#: From the first time that a ball can strike a basket's net to the catch [s].
ENTERS = 0.010
#: Longest time from when the ball is inside to the catch [s]: the gap is no parabola for longer.
LONGEST_INSIDE = 0.03
#: Columns of ``grip`` behind those of the profile.
_TAKES, _INSIDE, _EARLY = 6, 7, 8


@lru_cache(maxsize=8)
def pack_grip(hand: Hand | None, ball_radius: float, restitution: float = 0.0) -> Array:
    """Return a hand's closing as numbers, shape (9,), not to be written to.

    No hand is one that stays open. So is a basket: the ball is inside at the catch, and the arm
    may brake. What would be its closing begins as early as the ball can strike its net.

    Args:
        hand: The hand.
        ball_radius: Radius of the ball [m].
        restitution: Share of its speed with which the ball springs back from the palm.
    """
    if not isinstance(hand, HandModel):
        takes = 0.0 if hand is None else ENTERS
        return np.array([1.0, 1.0, 1.0, 0.0, 0.0, 0.0, takes, 0.0, 0.0])
    c, hardness = hand.closing, hand.closing.hardness(restitution)
    inside, early = (1.0 - hardness) * c.inside, hardness * c.early
    return np.array([*hand.profile(ball_radius), hand.closing_time(ball_radius), inside, early])


@kernel
def close(
    memory: Array, grip: Array, t: float, time_to_catch: float, gap: Array, later: float
) -> float:
    """Return the closing angle to command at ``t`` [rad].

    Args:
        memory: As in the module's table, overwritten, shape (2,).
        grip: As in the module's table, shape (9,).
        t: Time of the tick [s].
        time_to_catch: Time until the catch [s]; infinite where none is in sight.
        gap: From the catch point to the ball, and its rate [m, m/s], shape (2, 3).
        later: Time from a command until the fingers answer to it [s].
    """
    if memory[0] == np.inf:
        takes = grip[_TAKES] + later
        if not -PASSED <= time_to_catch <= takes + LONGEST_INSIDE:  # later, long over, no number
            return 0.0
        if (
            time_to_catch > takes + grip[_EARLY]
            and _gap_after(takes, time_to_catch, gap) > grip[_INSIDE]
        ):
            return 0.0
        memory[0], memory[1] = t, t + time_to_catch
    return float(closing_angle(t - memory[0], grip))


@kernel
def _gap_after(time: float, time_to_catch: float, gap: Array) -> float:
    """Return how far the ball will be from the catch point after a time before the catch [m]."""
    share, squared = time / time_to_catch, 0.0
    for k in range(3):
        x = (1.0 - share) * ((1.0 + share) * gap[0, k] + time * gap[1, k])
        squared += x * x
    return float(np.sqrt(squared))


@kernel
def has_closed(memory: Array, grip: Array, t: float, later: float, hurry: bool) -> bool:
    """Say whether the fingers have had the time to close around the ball, and it to come in.

    Args:
        memory: As in the module's table, shape (2,).
        grip: As in the module's table, shape (9,).
        t: Time of the tick [s].
        later: As of :func:`close`.
        hurry: Whether the arm is short of room to brake; then the first touch is enough.
    """
    after = TOUCH_BEFORE if hurry else FOLLOW_ON
    return bool(t - memory[1] >= after and t - memory[0] >= grip[_TAKES] + later + after)
