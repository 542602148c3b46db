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
"""

from functools import lru_cache

import numpy as np

from mitt.core.arm.description import Hand
from mitt.core.arm.hands import closing_angle
from mitt.core.kernels import Fields, Record, kernel
from mitt.core.signals import PASSED, Array

#: Following after the catch, while the fingers close on the ball [s]. Each millisecond costs
#: 15 mrad of the room that joint 4 has for braking; by then the fingers have touched.
FOLLOW_ON = 0.001
#: When an arm that is short of room may brake, after the catch [s]: the palm lies one radius behind
#: it.
TOUCH_BEFORE = -0.004
#: Longest time from when the ball is inside to the catch [s]: the gap is no parabola for longer.
LONGEST_INSIDE = 0.03
#: How far from the palm's axis a ball may pass between the fingertips, beyond ``_FREE``, for each
#: of the times ``takes`` [m]; what is within the errors of a good catch needs no other time.
_ASIDE = np.linspace(0.0, 0.04, 9)
_FREE = 0.004

FINGERS = np.dtype(
    [
        # As of :class:`mitt.core.arm.catch.ClosingPlan`; ``takes`` for distances of _ASIDE.
        ("profile", float, (5,)),
        ("inside", float),
        ("early", float),
        ("ring", float),
        ("near", float),
        ("firm", float),
        ("takes", float, (len(_ASIDE),)),
        ("t_begun", float),  # when the closing began, infinite before [s]
        ("t_catch", float),  # when the catch was to be then [s]
        ("duration", float),  # how long the closing takes, with the delay of its command [s]
    ],
    align=True,
)


@lru_cache(maxsize=8)
def fingers_of(hand: Hand | None, ball_radius: float, restitution: float = 0.0) -> Record:
    """Return an open hand and how it closes on a ball, shape (1,), not to be written to.

    No hand is one that stays open. So is one without fingers: the ball is inside at the catch, and
    the arm may brake. What would be its closing begins as early as the ball can strike it.

    Args:
        hand: The hand.
        ball_radius: Radius of the ball [m].
        restitution: Share of its speed with which the ball springs back from the palm.
    """
    fingers = np.zeros(1, FINGERS)
    f = fingers[0]
    f["t_begun"] = f["t_catch"] = f["duration"] = f["near"] = np.inf
    on = None if hand is None else hand.closing_on(ball_radius, restitution, _ASIDE)
    if on is None:
        f["profile"][:3], f["takes"] = 1.0, 0.0 if hand is None else hand.enters
        return fingers
    for name, value in on._asdict().items():
        f[name] = value
    return fingers


@kernel
def takes_of(f: Fields, aside: float) -> float:
    """Return the time that the closing takes on a ball that passes so far from the axis [s, m]."""
    share = max(aside - _FREE, 0.0) / (_ASIDE[1] - _ASIDE[0])
    k = min(int(share), len(_ASIDE) - 2)
    x = min(share - k, 1.0)
    return float((1.0 - x) * f.takes[k] + x * f.takes[k + 1])


@kernel
def may_begin(f: Fields, time_to_catch: float, later: float) -> bool:
    """Say whether a catch is so near, and not so long over, that the closing may begin.

    Args:
        f: Of type :data:`FINGERS`.
        time_to_catch: Time until the catch [s]; infinite where none is in sight.
        later: Time from a command until the fingers answer to it [s].
    """
    return bool(-PASSED <= time_to_catch <= f.takes[0] + later + LONGEST_INSIDE)


@kernel
def close(
    f: Fields, t: float, time_to_catch: float, gap: Array, palm: Array, later: float
) -> float:
    """Return the closing angle to command at ``t`` [rad].

    Args:
        f: Of type :data:`FINGERS`, overwritten.
        t: Time of the tick [s].
        time_to_catch: Time until the catch [s]; infinite where none is in sight.
        gap: From the catch point to the ball, and its rate [m, m/s], shape (2, 3).
        palm: Direction of the palm's normal when the ball is about to be caught, shape (3,).
        later: Time from a command until the fingers answer to it [s].
    """
    if f.t_begun == np.inf:
        if not may_begin(f, time_to_catch, later):
            return 0.0
        takes = later + takes_of(f, _passes_aside(f.ring, time_to_catch, gap, palm))
        if not in_time(f, time_to_catch, takes, gap):
            return 0.0
        f.t_begun, f.t_catch, f.duration = t, t + time_to_catch, takes
    return float(closing_angle(t - f.t_begun, f.profile))


@kernel
def in_time(f: Fields, time_to_catch: float, takes: float, gap: Array) -> bool:
    """Say whether fingers that begin now have not closed too early on a ball.

    Args:
        f: Of type :data:`FINGERS`.
        time_to_catch: Time until the catch [s].
        takes: Time that the closing takes [s].
        gap: From the catch point to the ball, and its rate [m, m/s], shape (2, 3).
    """
    if time_to_catch > takes + f.early and _gap_after(takes, time_to_catch, gap) > f.inside:
        return False
    touch = takes - f.firm
    return not (time_to_catch > touch and _gap_after(touch, time_to_catch, gap) > f.near)


@kernel
def lead_of(f: Fields, speed: float, aslant: float) -> float:
    """Return the time from the start of a closing to the catch, drives and delays apart [s].

    Args:
        f: Of type :data:`FINGERS`.
        speed: Steady speed of the ball relative to the catch point [m/s].
        aslant: Sine of the angle between its way and the palm's normal.
    """
    takes, gap = takes_of(f, aslant * f.ring), np.zeros((2, 3))
    low, high = 0.0, takes + LONGEST_INSIDE
    for _ in range(50):
        middle = 0.5 * (low + high)
        gap[0, 0], gap[1, 0] = speed * middle, -speed
        if in_time(f, middle, takes, gap):
            low = middle
        else:
            high = middle
    return low


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
def has_closed(f: Fields, t: float, hurry: bool) -> bool:
    """Say whether the fingers have had the time to close around the ball, and it to come in.

    Args:
        f: Of type :data:`FINGERS`.
        t: Time of the tick [s].
        hurry: Whether the arm is short of room to brake; then the first touch is enough.
    """
    after = TOUCH_BEFORE if hurry else FOLLOW_ON
    return bool(t - f.t_catch >= after and t - f.t_begun >= f.duration + min(after, 0.0))
