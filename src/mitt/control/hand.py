"""Closing the hand so that the fingers have closed when the ball is inside.

The map itself announces the time until the catch, when q_o,i reaches q_alpha and the ball is at the
catch point. On the way there the gap between them follows from what it is now and how it changes:
nothing at the catch, and a parabola in between. The fingers start as soon as the ball will be
inside by the time that they need; from then on they run through the hand's closing profile by the
clock: a started closing is not taken back. Where the catch has just passed they start at once; they
never do for one that is long over.

So a ball that the hand meets at its own speed is enclosed long before the catch, and one that comes
in at 5 m/s as it passes the fingertips: each hand, ball and motion has its own lead. A ball that
passes them off the palm's axis needs fingers that are farther open by then, and has a shorter one.

| here       | meaning                                                                     | unit  |
|------------|-----------------------------------------------------------------------------|-------|
| ``memory`` | time at which the closing began, infinite before; time of the catch then;   | s     |
|            | time that the closing takes, with the delay of its command                  |       |
| ``grip``   | the closing profile, as of :func:`mitt.robot.hands.closing_angle`; distance | s ... |
|            | at which the ball is inside [m]; time before the catch at which the hand    |       |
|            | has closed at the latest [s]; how far before the catch point the ball passes|       |
|            | between the fingertips [m], and how far at most it is when they first are as|       |
|            | narrow as it [m]; time from then until they hold [s]; time that the closing |       |
|            | takes, by how far from the palm's axis the ball passes (``_ASIDE``) [s]     |       |
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
#: How far from the palm's axis a ball may pass between the fingertips, beyond ``_FREE``, for each
#: of the times of ``grip`` [m]; what is within the errors of a good catch needs no other time.
_ASIDE, _FREE = np.linspace(0.0, 0.04, 9), 0.004
#: Columns of ``grip`` behind those of the profile.
INSIDE, EARLY, RING, NEAR, FIRM, _TAKES = 5, 6, 7, 8, 9, 10
GRIP = _TAKES + len(_ASIDE)


@lru_cache(maxsize=8)
def pack_grip(hand: Hand | None, ball_radius: float, restitution: float = 0.0) -> Array:
    """Return a hand's closing as numbers, shape (GRIP,), not to be written to.

    No hand is one that stays open. So is a basket: the ball is inside at the catch, and the arm
    may brake. What would be its closing begins as early as the ball can strike its net.

    Args:
        hand: The hand.
        ball_radius: Radius of the ball [m].
        restitution: Share of its speed with which the ball springs back from the palm.
    """
    if not isinstance(hand, HandModel):
        takes = np.full(len(_ASIDE), 0.0 if hand is None else ENTERS)
        return np.array([1.0, 1.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, np.inf, 0.0, *takes])
    c, hardness = hand.closing, hand.closing.hardness(restitution)
    inside, early = (1.0 - hardness) * hand.inside(ball_radius), hardness * c.early
    takes = np.array([hand.closing_time(ball_radius, x) for x in _ASIDE.tolist()])
    ring, _ = hand.ring(ball_radius)
    near = (ring + c.near) / (1.0 - hardness) if hardness < 1.0 else np.inf
    return np.array([*hand.profile(ball_radius), inside, early, ring, near, c.firm, *takes])


@kernel
def takes_of(grip: Array, aside: float) -> float:
    """Return the time that the closing on a ball takes [s].

    Args:
        grip: As in the module's table, shape (GRIP,).
        aside: How far from the palm's axis it passes between the fingertips [m].
    """
    share = max(aside - _FREE, 0.0) / (_ASIDE[1] - _ASIDE[0])
    k = min(int(share), len(_ASIDE) - 2)
    x = min(share - k, 1.0)
    return float((1.0 - x) * grip[_TAKES + k] + x * grip[_TAKES + k + 1])


@kernel
def may_begin(grip: Array, time_to_catch: float, later: float) -> bool:
    """Say whether a catch is so near, and not so long over, that the closing may begin.

    Args:
        grip: As in the module's table, shape (GRIP,).
        time_to_catch: Time until the catch [s]; infinite where none is in sight.
        later: Time from a command until the fingers answer to it [s].
    """
    return bool(-PASSED <= time_to_catch <= grip[_TAKES] + later + LONGEST_INSIDE)


@kernel
def close(
    memory: Array, grip: Array, t: float, time_to_catch: float, gap: Array, palm: Array,
    later: float,
) -> float:  # fmt: skip
    """Return the closing angle to command at ``t`` [rad].

    Args:
        memory: As in the module's table, overwritten, shape (3,).
        grip: As in the module's table, shape (GRIP,).
        t: Time of the tick [s].
        time_to_catch: Time until the catch [s]; infinite where none is in sight.
        gap: From the catch point to the ball, and its rate [m, m/s], shape (2, 3).
        palm: Direction of the palm's normal when the ball is about to be caught, shape (3,).
        later: Time from a command until the fingers answer to it [s].
    """
    if memory[0] == np.inf:
        if not may_begin(grip, time_to_catch, later):
            return 0.0
        takes = later + takes_of(grip, _passes_aside(grip[RING], time_to_catch, gap, palm))
        if time_to_catch > takes + grip[EARLY] and (
            _gap_after(takes, time_to_catch, gap) > grip[INSIDE]
        ):
            return 0.0
        touch = takes - grip[FIRM]
        if time_to_catch > touch and _gap_after(touch, time_to_catch, gap) > grip[NEAR]:
            return 0.0
        memory[0], memory[1], memory[2] = t, t + time_to_catch, takes
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
def _passes_aside(ring: float, time_to_catch: float, gap: Array, palm: Array) -> float:
    """Return how far from the palm's axis the ball will be at a distance from the catch point [m].

    0 where it is nearer by now.
    """
    if time_to_catch <= 0.0 or ring == 0.0 or _gap_after(0.0, time_to_catch, gap) <= ring:
        return 0.0
    low, high = 0.0, time_to_catch
    for _ in range(12):
        middle = 0.5 * (low + high)
        if _gap_after(middle, time_to_catch, gap) > ring:
            low = middle
        else:
            high = middle
    share, along, squared = low / time_to_catch, 0.0, 0.0
    for k in range(3):
        x = (1.0 - share) * ((1.0 + share) * gap[0, k] + low * gap[1, k])
        along += x * palm[k]
        squared += x * x
    return float(np.sqrt(max(squared - along * along, 0.0)))


@kernel
def has_closed(memory: Array, t: float, hurry: bool) -> bool:
    """Say whether the fingers have had the time to close around the ball, and it to come in.

    Args:
        memory: As in the module's table, shape (3,).
        t: Time of the tick [s].
        hurry: Whether the arm is short of room to brake; then the first touch is enough.
    """
    after = TOUCH_BEFORE if hurry else FOLLOW_ON
    return bool(t - memory[1] >= after and t - memory[0] >= memory[2] + min(after, 0.0))
