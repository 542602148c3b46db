"""What a robot sends, and whether it can be used: stamps, positions of the ball, first readings.

**Stamps.** A robot's stamps say when its encoders were read, whatever the way to here took. So they
are the time of the catcher. But a clock of the day can be set: then stamps jump, while the messages
come as before. Stamps that jump are a fault, after which time goes on from tick to tick, for the
stop. Readings that wait in a queue on their way come later and later, and so do those of a clock
that runs slow: the lag, arrival minus stamp, grows. It is compared with the least lag so far, of
three readings in a row the middle one, so that one wrong stamp decides nothing. How long the
readings were on their way then is not known; a queue that was full from the start is not found.
What was found late stays late until it comes as before, the robot's clock is set, or the robot was
away.

**Positions of the ball.** One belongs to the first reading that is not older than it. What comes
ahead of the readings waits for them: after a stall of ours all come at once. What no stamp, no unit
or no number makes usable only blinds the catcher, which waits for a ball then; so it is said.

**First readings** show whether they can be those of the arm, at rest.
"""

from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from math import inf, isfinite
from statistics import median_low
from typing import final

import numpy as np

from mitt.core.arm.arm import Arm
from mitt.core.catcher.sightings import FAR
from mitt.core.errors import InputError
from mitt.core.signals import TICK, ArmState, Array, Sighting
from mitt.robot.cell.robot import Robot

#: By how much stamps may run ahead of the time between two messages [s]; what waits here longer
#: than this is late anyway.
_AHEAD = 0.02
#: By how much messages may come in the wrong order [s].
_SWAPPED = 0.01
#: By how much readings may come later than the least late ones [s]: at the catcher's bandwidth of
#: 80 rad/s a delay of 10 ms takes 46 degrees of the phase margin.
LATER = 0.01
#: How fast the least lag is let grow [s/s]: clocks are slewed by up to 500 ppm (``adjtime``). A lag
#: that grows more slowly cannot be told from a drift.
DRIFT = 5e-4
#: Age, or time in the future, from which a position or an image has an impossible stamp [s].
STRAY = 0.4
#: How long a position that repeats itself may be one that its source has not replaced yet [s]: the
#: slowest that is of use sends 30 a second. What repeats for longer stands still, or its source
#: does, and the ball filter tells which.
_STANDS = 0.05
#: Positions that are looked at together: a flight has 30 of a camera with 60 images a second.
WINDOW = 25
#: By how much all may be stamped ahead of the joint states before it is said, and before it is a
#: fault [s]; and by how much behind before it is said: 3 ms of flight are 15 mm.
_ODD = 0.0015
_FAULT = 0.005
_LATE = 0.008
_CLOCKS = "the joint states: both need one clock, or synchronised ones"
#: How far outside its range a joint may be read before a unit is doubted [rad].
_OUTSIDE = 0.5
#: Speed of a joint from which an arm is not at rest [rad/s]: more than a count of an encoder.
_MOVES = 0.5
#: For how long readings are looked at [s].
WATCHED = 0.05


@final
@dataclass(slots=True)
class Counts:
    """What happened so far in a live loop.

    Attributes:
        ticks: Ticks made.
        late: Readings that had to wait for the loop.
        lost: Readings that never came.
        throws: Balls that flew past, caught or not.
        refused: Those that the catcher refused.
        stopped: Those in which it stopped.
        stray: Positions of the ball, and images, with impossible stamps.
        repeated: Readings of a moving arm, and for 50 ms positions of the ball, that repeat the
            ones before to the last digit: their source is slower than its publisher.
        stops: Why the arm was stopped and stayed so, each time.
        empty: Parts that the tool closed on and did not take, as they are seen afterwards.
    """

    ticks: int = 0
    late: int = 0
    lost: int = 0
    throws: int = 0
    refused: int = 0
    stopped: int = 0
    stray: int = 0
    repeated: int = 0
    stops: list[str] = field(default_factory=list)
    empty: int = 0


@final
class Lag:
    """Knows by how much readings come later than the least late ones so far, drift allowed for.

    Attributes:
        later: By how much the newest came later [s].
    """

    def __init__(self) -> None:
        """Know nothing yet."""
        self.later = 0.0
        self._least, self._stamp, self._known, self._since = inf, -inf, 0.0, inf
        self._late = False
        self._newest: deque[float] = deque(maxlen=3)

    def fault(self, stamp: float, arrived: float) -> str:
        """Return how late readings come, in words; nothing where they come as they did.

        Args:
            stamp: Of the newest of those that came at once [s]; the others waited for us.
            arrived: When they came, by the steady clock here [s].
        """
        lag = arrived - stamp
        if not isfinite(lag):
            return ""
        # What came before says nothing of a clock that was set back, or a robot that was away for
        # a second, and may have been started anew.
        if not -_SWAPPED < stamp - self._stamp < 1.0:
            self._least = lag
            self._newest.clear()
        self._newest.append(lag)
        drift = 0.0 if self._late else DRIFT
        least = self._least + drift * max(arrived - self._known, 0.0)
        few = len(self._newest) < 3
        least = max(self._newest) if few else min(least, median_low(self._newest))
        self._least, self._stamp, self._known = least, stamp, arrived
        self.later = later = lag - self._least
        self._since = min(self._since, arrived) if later > LATER else inf
        self._late = arrived - self._since >= 0.02  # after a stall of ours a few are old
        return f"readings come {1e3 * later:.0f} ms later than they did" if self._late else ""


@final
class Stamps:
    """Turns stamps into the catcher's time.

    Attributes:
        t: Time of the newest reading [s], from 0 at the first.
        stamp: Its stamp [s].
        fault: What was found wrong with the stamps, in words; nothing so far.
    """

    def __init__(self) -> None:
        """Know nothing yet."""
        self.t, self.fault = 0.0, ""
        self._zero: float | None = None
        self.stamp = self._arrived = 0.0
        self._repeats = 0

    def take(self, stamp: float, arrived: float) -> float | None:
        """Return the time of a reading [s], later than that before; None where it is to be left.

        Raises:
            InputError: The stamp is no number.
        """
        if not isfinite(stamp):
            raise InputError("the stamp of a reading", "a finite time [s]", stamp)
        if self._zero is None:
            self._zero = stamp
        else:
            step, passed = stamp - self.stamp, arrived - self._arrived
            if step < 0.1 * TICK:
                self._repeats += 1
                if step > -_SWAPPED and self._repeats <= 3:  # repeated, or in the wrong order
                    return None
                self._jump(f"its clock was set back by {-step:.3g} s", stamp)
            elif step - passed > _AHEAD:
                self._jump(f"its clock was set forward by {step - passed:.3g} s", stamp)
        self._repeats, self.stamp, self._arrived = 0, stamp, arrived
        self.t = stamp - self._zero
        return self.t

    def at(self, stamp: float) -> float:
        """Return the catcher's time of another stamp of the same clock [s]."""
        return stamp - (0.0 if self._zero is None else self._zero)

    def _jump(self, fault: str, stamp: float) -> None:
        """Note a fault and let time go on by a tick."""
        self.fault = self.fault or fault
        self._zero = stamp - (self.t + TICK)


@dataclass(slots=True)
class _Window:
    """Positions that are looked at together.

    Attributes:
        gaps: Their stamps before the newest reading's [s], negative where they are behind it.
        squares: Squares of their distances from the arm's base [m^2].
        none: Those between them that tell no place.
        same: Those that repeat the one before.
    """

    gaps: list[float] = field(default_factory=list)
    squares: list[float] = field(default_factory=list)
    none: int = 0
    same: int = 0


@final
class Positions:
    """Keeps positions of the ball until the reading that they belong to.

    Attributes:
        fault: Why none of the last of them can be used, in words; nothing if they can.
        note: What else is odd in the last of them, in words.
        absent: What none are that come, where none was of use for long, in words.
    """

    def __init__(self, counts: Counts) -> None:
        """Take where stray and repeated ones are counted."""
        self._counts, self._waiting, self._used = counts, deque[Sighting](), -inf
        self.restart()

    def restart(self) -> None:
        """Forget what came so far."""
        self._waiting.clear()
        self.fault, self.note, self._judged = "", "", -inf
        self._last: Array | None = None
        self._since = inf
        self._window, self._away, self.absent = _Window(), 0, ""

    def take(self, points: Sequence[Sighting], newest: float) -> None:
        """Take what has come since the last time, as stamped by the robot's clock.

        ``newest`` is the stamp that the newest reading has, or would have, were it not late [s].
        """
        for point in points:
            self._take(point, newest)
            if len(self._window.gaps) + self._window.none >= WINDOW:
                self._judge(newest)
        if not abs(newest - self._judged) < 1.0:  # a fault is said for a second
            self.fault = ""
        while self._waiting and not self._waiting[-1].t - newest < STRAY:  # a clock was set back
            self._waiting.pop()
            self._counts.stray += 1

    def upto(self, stamp: float) -> list[Sighting]:
        """Return those that a reading of this stamp can know, oldest first; once each."""
        waiting, last = self._waiting, stamp + TICK - 1e-6  # a time of the day is 2.4e-7 s off
        known = [point for point in waiting if point.t <= last]
        if len(known) == len(waiting):
            waiting.clear()
        elif known:
            self._waiting = deque(point for point in waiting if point.t > last)
        return known

    def _take(self, point: Sighting, newest: float) -> None:
        """Keep a position, unless it is none, is stray, or just repeats the one before."""
        r_o = _checked(point)
        seen = point.found and bool(np.all(np.isfinite(r_o))) and bool(np.any(r_o))
        if not seen or not isfinite(point.t):  # nothing is seen: no number, or all zero
            self._counts.stray += seen
            self._away += 1
            if self._away % WINDOW == 0:
                self._miss(newest, "stamps" if seen else "positions")
            return
        window = self._window
        if self._away < WINDOW:  # not seen in between; for longer it is away
            window.none += self._away
        self._away, self._used, self.absent = 0, newest, ""
        gap = point.t - newest
        window.gaps.append(gap)
        window.squares.append(float(r_o @ r_o))
        same = self._last is not None and np.array_equal(self._last, r_o)
        if not same:
            self._last, self._since = r_o, point.t
        window.same += same
        if not abs(gap) < STRAY:
            self._counts.stray += 1
        elif same and not point.t - self._since > _STANDS:  # no measurement of its own
            self._counts.repeated += 1
        else:
            self._waiting.append(point)

    def _miss(self, newest: float, what: str) -> None:
        """Say that none can be used, and begin anew; for 30 s not: many a tracker sends zeros."""
        if not newest - self._used < 30.0:
            self.absent = f"the {what} are no numbers, or all zero"
        self.note, self._window = "", _Window()

    def _judge(self, newest: float) -> None:
        """Say what is wrong with as many as are looked at together, and begin anew."""
        of, self._window = self._window, _Window()
        gaps, none, same = of.gaps, of.none, of.same
        self.fault, self.note, self._judged = "", "", newest
        if (nearest := min(of.squares)) > FAR**2:
            far = nearest**0.5
            self.fault = (
                f"the positions are {far:.3g} m away or more:"
                " they are in metres (REP 103); are these millimetres?"
            )
        elif (least := min(gaps)) > _FAULT:
            self.fault = f"the positions are stamped {_long(least)} ahead of {_CLOCKS}"
        elif least > _ODD:
            self.note = f"the positions are stamped {_long(least)} ahead of {_CLOCKS}"
        elif (most := max(gaps)) < -STRAY:
            self.fault = f"the positions are stamped {_long(-most)} behind {_CLOCKS}"
        elif most < -_LATE:
            self.note = (
                f"the positions come {-1e3 * most:.0f} ms after their stamps: where"
                " that is not how long they take, their clock is behind"
            )
        elif same == len(gaps):
            self.note = (
                "the positions are one and the same: their source is stuck, or the ball rests"
            )
        elif 3 * same > WINDOW:
            self.note = "the positions repeat: their source is slower than its publisher"
        elif 2 * none > WINDOW:
            self.note = f"{none} of {WINDOW} positions are no numbers, or all zero"


def _long(t: float) -> str:
    """Return a time in words [s]."""
    return f"{1e3 * t:.0f} ms" if t < 10.0 else f"{t:.3g} s"


def _checked(point: Sighting) -> Array:
    """Return the place of a position; refuse what has another shape."""
    if not isinstance(point, Sighting) or np.shape(point.r_o) != (3,):
        raise InputError("a position of the ball", "a Sighting of three numbers", repr(point)[:80])
    if np.shape(point.covariance) != (3, 3) or not isinstance(point.t, float | int):
        raise InputError(
            "a position of the ball", "a time, a covariance of shape (3, 3)", repr(point)[:80]
        )
    return np.asarray(point.r_o, dtype=np.float64)


def wrong_with(arm: Arm, readings: Sequence[ArmState]) -> tuple[str, bool]:
    """Return why an arm cannot be moved from the newest reading, nothing if it can.

    It moves where its speeds or its positions say so: not every robot sends speeds. The readings
    are those of the last 50 to 100 ms, oldest first, one at least.

    Returns:
        Why, and whether a person has to see to the arm itself, not to what reads it.
    """
    rows = np.array([x.q for x in readings])
    _check_range(arm, rows[-1])
    if not np.all(np.isfinite(rows)):
        return "joint positions that are no numbers", False
    beyond = np.maximum(arm.q_min - rows[-1], rows[-1] - arm.q_max)
    if np.any(beyond > 0.02):  # [rad]
        k = int(np.argmax(beyond))
        return (
            f"{arm.names[k]} is {beyond[k]:.2f} rad outside its range: move it back by hand",
            True,
        )
    span = readings[-1].t - readings[0].t
    if not span >= 0.02:
        passed = f"{1e3 * span:.3g} ms in {1e3 * WATCHED:.0f}"
        return f"joint states whose stamps go on by {passed}", False
    by_position = np.ptp(rows, axis=0) > _MOVES * span
    if np.any(by_position) or np.any(np.abs(readings[-1].dq) > _MOVES):
        return "the arm moves already", True
    return "", False


def _check_range(arm: Arm, q: Array) -> None:
    """Refuse a position that cannot be one of this joint [rad], shape (n,)."""
    outside = np.flatnonzero((q < arm.q_min - _OUTSIDE) | (q > arm.q_max + _OUTSIDE))
    if len(outside):
        k = int(outside[0])
        wanted = f"{arm.q_min[k]:.2f} to {arm.q_max[k]:.2f} rad"
        do = "joint states are in radians (REP 103); is it in degrees, or another joint?"
        raise InputError(f"position of {arm.names[k]}", wanted, f"{q[k]:.4g}", do=do)


def check_reading(reading: ArmState, n: int) -> None:
    """Refuse a reading of another shape; what is no number is the catcher's matter."""
    if not isinstance(reading, ArmState) or not isinstance(reading.t, float | int):
        raise InputError("a reading", "an ArmState with its stamp [s]", repr(reading)[:80])
    if np.shape(reading.q) != (n,) or np.shape(reading.dq) != (n,):
        raise InputError("a reading", f"{n} angles and {n} speeds", repr(reading)[:80])


@final
class Watch:
    """Reads a robot that waits, and says why its arm cannot be moved.

    Attributes:
        disturbed: Whether the last look found the arm in a state that a person has to see to: it
            moves, is outside its range, is stopped, or others have a hand in it.
    """

    def __init__(
        self,
        arm: Arm,
        robot: Robot,
        lag: Lag,
        positions: Positions,
        *,
        clock: Callable[[], float],
        silence: float,
    ) -> None:
        """Take what it reads and tells, and the steady clock by which readings arrive [s].

        ``silence`` is the time without a reading after which the robot is lost [s].
        """
        self._arm, self._robot, self._lag, self._positions = arm, robot, lag, positions
        self._clock, self._silence = clock, silence
        self._seen, self._looked = deque[tuple[float, ArmState]](), -inf
        self.disturbed = False

    def look(self) -> str:
        """Read, at first for 50 ms; return what is wrong, nothing if all is well."""
        if self._clock() > self._looked + 0.1:  # what was read before says nothing
            self._seen.clear()
        late, full = "", False
        while not full:
            new = self._robot.read(self._silence)
            self._looked = now = self._clock()
            if not new:
                self._seen.clear()
                return self._found("no joint states", disturbed=False)
            for reading in new:
                check_reading(reading, self._arm.n)
                self._seen.append((now, reading))
            late = self._lag.fault(new[-1].t, now)
            full = now - self._seen[0][0] >= WATCHED
        while now - self._seen[0][0] > 2.0 * WATCHED:
            self._seen.popleft()
        newest = self._seen[-1][1].t + self._lag.later
        self._positions.take(self._robot.points(), newest)
        self._positions.upto(inf)
        wrong, disturbed = wrong_with(self._arm, [x for _, x in self._seen])
        return self._found(wrong, late, self._positions.fault, disturbed=disturbed)

    def _found(self, *wrong: str, disturbed: bool) -> str:
        """Return what is wrong in one line; note whether a person has to see to it."""
        robot = self._robot
        conflict, trouble = robot.conflict(), robot.trouble()
        self.disturbed = disturbed or bool(conflict or trouble)
        return "; ".join(x for x in (*wrong[:1], conflict, robot.waits(), trouble, *wrong[1:]) if x)
