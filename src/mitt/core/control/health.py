"""In what state a tick leaves the catcher, and why.

| state    | what it says                                                                   |
|----------|--------------------------------------------------------------------------------|
| NOMINAL  | all is well                                                                    |
| PREDICT  | no usable measurement of late: the motion follows the prediction               |
| DEGRADED | one camera, a reading bridged, or a command replaced by braking                |
| ABORT    | controlled stop within all limits; latched until the caller recovers           |
| INVALID  | what came in or went out cannot be real; the result does not count             |
"""

from dataclasses import dataclass
from enum import Enum
from typing import TypeAlias

import numpy as np

from mitt.core.arm.arm import Arm
from mitt.core.control.encoders import BEYOND, BRIDGED, BRIDGED_TIME, FINE, IN_TIME, TRIFLE
from mitt.core.fields import brief
from mitt.core.kernels import Fields, Record, kernel
from mitt.core.signals import TICK, Array

Plain: TypeAlias = str | float | bool | list[float | None] | None
"""A value as JSON has it."""


class State(Enum):
    """State of a tick; the order is that of the numbers."""

    NOMINAL = "nominal"
    PREDICT = "predict"
    DEGRADED = "degraded"
    ABORT = "abort"
    INVALID = "invalid"


NOMINAL, PREDICT, DEGRADED, ABORT, INVALID = range(len(State))


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


(
    _NONE,
    _UNSEEN,
    _ONE_CAMERA,
    _LATE,
    _BRIDGED,
    _BLOCKED,
    LOST,
    _SILENT,
    _JUMPED,
    _STUCK,
    _REVERSED,
    CLOCK,
    OVERRUN,
    _TRACKING,
    REQUESTED,
    _FAST,
    FAILED,
) = range(len(Reason))

#: Reason for each state of an encoder, in the order of :mod:`mitt.core.control.encoders`.
_OF_ENCODER = (_NONE, _BRIDGED, _SILENT, _JUMPED, _STUCK, _REVERSED, _FAST)
#: Reasons that one joint's encoder gives.
ENCODER_REASONS = (Reason.SILENT, Reason.JUMPED, Reason.STUCK, Reason.REVERSED, Reason.FAST)

#: Age beyond which a reading of the encoders is none [s].
OLD_READING = IN_TIME
#: Age of the last measurement from which the ball is predicted, and from which it can be lost [s].
_FRESH = IN_TIME
_OLD = BRIDGED_TIME
#: Ticks in a row without usable time, or far from the commanded motion, after which the catcher
#: stops: as long as is bridged at all.
_MOST_TICKS = round(BRIDGED_TIME / TICK)
#: Ticks in a row without an answer of the generator after which the catcher stops.
FAILED_TICKS = 5

HEALTH = np.dtype(
    [
        ("t", float),  # time of the last tick [s]; NaN before the first
        ("passed", float),  # time since the tick before it, as far as that is known [s]
        ("begun", bool),  # whether a usable time was given since the beginning
        ("timeless", int),  # ticks in a row without usable time
        ("far", float),  # time for which the arm was far from the commanded motion, in ticks
        ("late", int),  # late ticks so far
    ],
    align=True,
)


def fresh_health() -> Record:
    """Return what a catcher that has made no tick remembers, shape (1,)."""
    health = np.zeros(1, HEALTH)
    health["t"] = np.nan
    return health


@kernel
def time_since(before: float, t: float) -> float:
    """Return the time from one tick to the next [s], in whole nanoseconds."""
    return float(np.floor(1e9 * (t - before) + 0.5) / 1e9)


@kernel
def pass_time(m: Fields, t: float) -> tuple[float, int]:
    """Take the time of a tick in, and how long ago the tick before was.

    The first usable time is right, whatever was before it: after a pause, or in place of times
    that were none. The time that has passed by then counts up to a tick that is in time.

    Args:
        m: Of type :data:`HEALTH`, overwritten.
        t: Time as given [s].

    Returns:
        Time to be used [s], which runs backwards at most once, to the first usable one; and what is
        wrong with it: 0, ``_LATE``, ``CLOCK`` or ``OVERRUN``.
    """
    before = m.t
    if not m.begun and np.isfinite(t):
        known = t > before and m.timeless == 0
        m.passed = min(time_since(before, t), IN_TIME) if known else TICK
        m.t, m.begun, m.timeless = t, True, 0
        return t, _NONE
    if not (np.isfinite(t) and t > before):
        m.timeless += 1
        m.passed, m.t = TICK, before + TICK if np.isfinite(before) else 0.0
        return m.t, CLOCK if m.timeless >= _MOST_TICKS else _LATE
    passed = time_since(before, t)
    m.timeless, m.t, m.passed = 0, t, passed
    if passed <= IN_TIME:
        return t, _NONE
    m.late += 1
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
    m: Fields, s: Fields, out: Fields, blocked: bool, near: bool, one_camera: bool, gap: float
) -> tuple[int, int]:
    """Return state and reason of a tick.

    Args:
        m: Of type :data:`HEALTH`, overwritten.
        s: Single numbers of the catcher's state.
        out: Single numbers of the tick's result.
        blocked: Whether the command was replaced by braking.
        near: Whether the catch is near: the hand then hides the ball, which is no loss.
        one_camera: Whether the last measurement came from one camera.
        gap: Largest gap between commanded and estimated joint positions [rad].
    """
    too_far = gap > s.max_tracking_error
    m.far = m.far + min(s.passed, IN_TIME) / TICK if too_far else 0.0
    if s.encoder_fault > BRIDGED:
        return ABORT, _OF_ENCODER[s.encoder_fault]
    if s.clock_fault > _LATE:
        return ABORT, s.clock_fault
    if m.far >= _MOST_TICKS - TRIFLE:
        return ABORT, _TRACKING
    if out.following and not near and is_lost(out.age, s.flight_sigma, s.tolerance):
        return ABORT, LOST
    if blocked:
        return DEGRADED, _BLOCKED
    if s.encoder_fault != FINE:
        return DEGRADED, _BRIDGED
    if s.clock_fault == _LATE:
        return DEGRADED, _LATE
    if out.following and out.age > _FRESH:
        return PREDICT, _UNSEEN
    if out.following and one_camera:
        return DEGRADED, _ONE_CAMERA
    return NOMINAL, _NONE


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class StoppedBy:
    """Why a catcher has stopped, and what it knew then.

    Attributes:
        state: State of the tick that stopped the arm: ABORT.
        reason: Why.
        joint: Name of the joint whose encoder is the reason; None for other reasons.
        hint: What may be behind it, and what to do; nothing where that is not known.
        t: Time of that tick [s].
        q: Estimated joint positions in that tick [rad], shape (n,).
        dq: Estimated joint velocities in that tick [rad/s], shape (n,).
        q_read: Encoder positions in that tick, as read [rad], shape (n,).
        dq_read: Encoder velocities in that tick, as read [rad/s], shape (n,).
        command: q, dq, ddq, tau of that tick's command [rad ..., N m], shape (4, n).
        brakes: Whether the brakes were commanded to engage.
    """

    state: State
    reason: Reason
    joint: str | None
    t: float
    q: Array
    dq: Array
    q_read: Array
    dq_read: Array
    command: Array
    brakes: bool
    hint: str = ""

    __repr__ = brief

    def plain(self) -> dict[str, Plain]:
        """Return it as JSON has it; numbers that are not finite are None."""
        names = ("q", "dq", "ddq", "tau")
        rows = {f"command_{name}": row for name, row in zip(names, self.command, strict=True)}
        read = {"q_read": self.q_read, "dq_read": self.dq_read}
        rows = {"q": self.q, "dq": self.dq, **read, **rows}
        lists = {name: _listed(row) for name, row in rows.items()}
        return {
            "state": self.state.value,
            "reason": self.reason.value,
            "joint": self.joint,
            "t": self.t,
            "brakes": self.brakes,
            "hint": self.hint,
            **lists,
        }


def hint_of(arm: Arm, reason: Reason, q_read: Array, age: float | None = None) -> str:
    """Return what may be behind a stop because of readings that are none.

    Args:
        arm: The arm.
        reason: Why it has stopped.
        q_read: Encoder positions as read [rad], shape (n,).
        age: By how much the last reading was stamped before its tick, if that made it none [s].

    Returns:
        One line, or nothing where the readings can be those of the arm.
    """
    outside = np.flatnonzero((q_read < arm.q_min - BEYOND) | (q_read > arm.q_max + BEYOND))
    if reason is not Reason.SILENT:
        return ""
    if age is not None:
        side = "before" if age >= 0.0 else "after"
        stamped = f"stamped {abs(age):.4g} s {side} its tick" if np.isfinite(age) else "not stamped"
        return (
            f"the last reading was {stamped}, wanted at most {OLD_READING:g} s before or"
            f" {TICK:g} s after, and a later stamp than the reading before: is the bus frozen,"
            " or are Senses.t and ArmState.t of two clocks?"
        )
    if not len(outside):
        return ""
    k = int(outside[0])
    return (
        f"{arm.names[k]} reads {q_read[k]:.4g}, wanted {arm.q_min[k]:.2f} to"
        f" {arm.q_max[k]:.2f} rad: readings are in radians, in the order of arm.names; are"
        " these in degrees, or of another joint?"
    )


def _listed(row: Array) -> list[float | None]:
    """Return a row as a list; numbers that are not finite are None."""
    return [float(x) if np.isfinite(x) else None for x in row]
