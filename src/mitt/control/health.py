"""In what state a tick leaves the catcher, and why.

| state    | what it says                                                                   |
|----------|--------------------------------------------------------------------------------|
| NOMINAL  | all is well                                                                    |
| PREDICT  | no usable measurement of late: the motion follows the prediction               |
| DEGRADED | one camera, a reading bridged, or a command replaced by braking                |
| ABORT    | controlled stop within all limits; latched until the caller recovers           |
| INVALID  | what came in or went out cannot be real; the result does not count             |

Memory, in this order: time of the last tick [s] (NaN: none), ticks in a row without usable time,
time for which the arm was far from the commanded motion, in ticks, late ticks so far.
"""

from enum import Enum

import numpy as np

from mitt.control.encoder_memory import BRIDGED, FINE
from mitt.jit import kernel
from mitt.signals import TICK, Array

NOMINAL, PREDICT, DEGRADED, ABORT, INVALID = range(5)


class State(Enum):
    """State of a tick; the order is that of the numbers."""

    NOMINAL = "nominal"
    PREDICT = "predict"
    DEGRADED = "degraded"
    ABORT = "abort"
    INVALID = "invalid"


class Reason(Enum):
    """Why a tick is not nominal; the order is that of the numbers."""

    NONE = "none"
    UNSEEN = "no measurement"
    ONE_CAMERA = "one camera"
    LATE = "late tick"
    BRIDGED = "encoder reading bridged"
    BLOCKED = "command replaced: the way to standstill is blocked"
    LOST = "ball lost"
    SILENT = "encoder silent"
    JUMPED = "encoder jumped"
    STUCK = "encoder stuck"
    REVERSED = "encoder reversed"
    CLOCK = "clock"
    OVERRUN = "overrun"
    TRACKING = "far from the told motion"
    REQUESTED = "stop asked for"
    FAST = "joint beyond its speed"
    FAILED = "generator or planning failed"


(_NONE, _UNSEEN, _ONE_CAMERA, _LATE, _BRIDGED, _BLOCKED, LOST, _SILENT, _JUMPED, _STUCK, _REVERSED,
 CLOCK, OVERRUN, _TRACKING, REQUESTED, _FAST, FAILED) = range(17)  # fmt: skip

#: Reason for each state of an encoder, in the order of :mod:`mitt.control.encoder_memory`.
_OF_ENCODER = (_NONE, _BRIDGED, _SILENT, _JUMPED, _STUCK, _REVERSED, _FAST)
#: Reasons that one joint's encoder gives.
ENCODER_REASONS = (Reason.SILENT, Reason.JUMPED, Reason.STUCK, Reason.REVERSED, Reason.FAST)

_T, _TIMELESS, _FAR, _LATES = range(4)
MEMORY = 4

#: Longest tick that counts as in time, and longest that is bridged at all [s].
IN_TIME, BRIDGED_TIME = 0.005, 0.020
#: Age beyond which a reading of the encoders is none [s].
OLD_READING = IN_TIME
#: Ticks without usable time after which the catcher stops.
_TIMELESS_TICKS = 20
#: Age of the last measurement from which the ball is predicted, and from which it can be lost [s].
_FRESH, _OLD = 0.005, 0.020
#: Ticks in a row without an answer of the generator after which the catcher stops.
FAILED_TICKS = 5
#: Time for which a joint may be far from the commanded motion, in ticks.
_FAR_TICKS = 20


def memory() -> Array:
    """Return the memory of a catcher that has made no tick, shape (MEMORY,)."""
    return np.array([np.nan, 0.0, 0.0, 0.0])


@kernel
def time_since(before: float, t: float) -> float:
    """Return the time from one tick to the next [s], in whole nanoseconds.

    Args:
        before: Time of the tick before [s]; NaN where there was none: a tick has passed then.
        t: Time of the tick [s].
    """
    return TICK if np.isnan(before) else np.floor(1e9 * (t - before) + 0.5) / 1e9


@kernel
def pass_time(m: Array, t: float) -> tuple[float, int]:
    """Take the time of a tick in.

    Args:
        m: Memory, overwritten, shape (MEMORY,).
        t: Time as given [s].

    Returns:
        Time to be used [s], which never runs backwards, and what is wrong with it: 0, ``_LATE``,
        ``CLOCK`` or ``OVERRUN``.
    """
    before = m[_T]
    if np.isnan(before) and np.isfinite(t):
        m[_T] = t
        return t, _NONE
    if not (np.isfinite(t) and t > before):
        m[_TIMELESS] += 1.0
        m[_T] = before + TICK if np.isfinite(before) else 0.0
        return m[_T], CLOCK if m[_TIMELESS] >= _TIMELESS_TICKS else _LATE
    m[_TIMELESS], m[_T], passed = 0.0, t, time_since(before, t)
    if passed <= IN_TIME:
        return t, _NONE
    m[_LATES] += 1.0
    return t, OVERRUN if passed > BRIDGED_TIME else _LATE


@kernel
def age_of_reading(stamp: float, told: float, t: float, newest: float) -> float:
    """Return how old a reading of the encoders is [s]; NaN where it is none.

    It is none where it is no newer than the one before, older than ``OLD_READING``, of a time to
    come, or of no time at all. Where the time of the tick had to be replaced nothing can be said of
    its age, and it counts as read in that tick.

    Args:
        stamp: Its time, by the clock of the tick [s].
        told: Time of the tick as it was told [s].
        t: Time of the tick as it is used [s].
        newest: Time of the newest reading so far, as it is used [s].
    """
    age = 0.0 if told != t else time_since(stamp, t)
    if told == t and np.isnan(stamp):
        return np.nan
    good = -TICK <= age <= OLD_READING and t - age > newest + 1e-8
    return age if good else np.nan


@kernel
def is_lost(age: float, sigma: float, tolerance: float) -> bool:
    """Say whether the ball is lost: not seen of late, and not known as well as it has to be.

    Args:
        age: Age of the last good measurement [s].
        sigma: 1-sigma of the ball's predicted position [m].
        tolerance: What the hand tolerates of it [m].
    """
    return bool(age > _OLD and sigma > tolerance)


@kernel
def assess(
    m: Array,
    clock: int,
    encoders: int,
    blocked: bool,
    following: bool,
    near: bool,
    age: float,
    sigma: float,
    tolerance: float,
    one_camera: bool,
    gap: float,
    max_gap: float,
    passed: float,
) -> tuple[int, int]:
    """Return state and reason of a tick.

    Args:
        m: Memory, overwritten, shape (MEMORY,).
        clock: What is wrong with the time, of :func:`pass_time`.
        encoders: What is wrong with the worst encoder, of :mod:`mitt.control.encoder_memory`.
        blocked: Whether the command was replaced by braking.
        following: Whether the arm follows a ball.
        near: Whether the catch is near: the hand then hides the ball, which is no loss.
        age: Age of the last good measurement [s]; infinite without a track.
        sigma: 1-sigma of the ball's predicted position [m].
        tolerance: What the hand tolerates of it [m].
        one_camera: Whether the last measurement came from one camera.
        gap: Largest gap between commanded and estimated joint positions [rad].
        max_gap: Gap that is too large, if it lasts [rad].
        passed: Time since the tick before [s].
    """
    m[_FAR] = m[_FAR] + min(passed, IN_TIME) / TICK if gap > max_gap else 0.0
    if encoders > BRIDGED:
        return ABORT, _OF_ENCODER[encoders]
    if clock > _LATE:
        return ABORT, clock
    if m[_FAR] >= _FAR_TICKS - 1e-6:
        return ABORT, _TRACKING
    if following and not near and is_lost(age, sigma, tolerance):
        return ABORT, LOST
    if blocked:
        return DEGRADED, _BLOCKED
    if encoders != FINE:
        return DEGRADED, _BRIDGED
    if clock == _LATE:
        return DEGRADED, _LATE
    if following and age > _FRESH:
        return PREDICT, _UNSEEN
    if following and one_camera:
        return DEGRADED, _ONE_CAMERA
    return NOMINAL, _NONE
