"""Positions of the ball on their way to the catcher: each to its reading, and what is odd in them.

A position belongs to the first reading that is not older than it. What comes ahead of the readings
waits for them: after a stall of ours all come at once. What no stamp, no unit or no number makes
usable only blinds the catcher, which waits for a ball then; so it is said.
"""

from collections import deque
from collections.abc import Sequence
from math import inf, isfinite
from typing import final

import numpy as np

from mitt.catcher.sightings import FAR
from mitt.errors import InputError
from mitt.link.modes import Counts
from mitt.signals import TICK, Array, Sighting

#: Age, or time in the future, from which a position or an image has an impossible stamp [s].
STRAY = 0.4
#: Positions that are looked at together: a flight has 30 of a camera with 60 images a second.
WINDOW = 25
#: By how much all may be stamped ahead of the joint states before it is said, and before it is a
#: fault [s]; and by how much behind before it is said: 3 ms of flight are 15 mm.
_AHEAD, _FAULT, _LATE = 0.0015, 0.005, 0.008
#: Rounding of a stamp [s]: a time of the day has 2.4e-7.
_ROUNDING = 1e-6
_CLOCKS = "the joint states: both need one clock, or synchronised ones"
#: For how long a fault is said after the positions that showed it [s].
_SAID = 1.0
#: Time without one that can be used after which it is said [s]: between throws many a tracker
#: sends zeros.
_ABSENT = 30.0


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
        self._gaps, self._sizes, self._none, self._same = list[float](), list[float](), 0, 0
        self._away, self.absent = 0, ""

    def take(self, points: Sequence[Sighting], newest: float) -> None:
        """Take what has come since the last time.

        Args:
            points: As stamped by the robot's clock.
            newest: Stamp that the newest reading has, or would have, were it not late [s].

        Raises:
            InputError: One is no position at all.
        """
        for point in points:
            self._take(point, newest)
            if len(self._gaps) + self._none >= WINDOW:
                self._judge(newest)
        if not abs(newest - self._judged) < _SAID:
            self.fault = ""
        while self._waiting and not self._waiting[-1].t - newest < STRAY:  # a clock was set back
            self._waiting.pop()
            self._counts.stray += 1

    def upto(self, stamp: float) -> list[Sighting]:
        """Return those that a reading of this stamp can know, oldest first; once each."""
        waiting, last = self._waiting, stamp + TICK - _ROUNDING
        known = [point for point in waiting if point.t <= last]
        if len(known) == len(waiting):
            waiting.clear()
        elif known:
            self._waiting = deque(point for point in waiting if point.t > last)
        return known

    def _take(self, point: Sighting, newest: float) -> None:
        """Keep a position, unless it is none, is stray, or repeats the one before."""
        r_o = _checked(point)
        seen = point.found and bool(np.all(np.isfinite(r_o))) and bool(np.any(r_o))
        if not seen or not isfinite(point.t):  # nothing is seen: no number, or all zero
            self._counts.stray += seen
            self._away += 1
            if self._away % WINDOW == 0:
                self._miss(newest, "stamps" if seen else "positions")
            return
        if self._away < WINDOW:  # not seen in between; for longer it is away
            self._none += self._away
        self._away, self._used, self.absent = 0, newest, ""
        gap = point.t - newest
        self._gaps.append(gap)
        self._sizes.append(float(r_o @ r_o))
        same = self._last is not None and np.array_equal(self._last, r_o)
        self._last = r_o
        if not abs(gap) < STRAY:
            self._counts.stray += 1
        elif same:  # to the last digit: no measurement of its own
            self._same += 1
            self._counts.repeated += 1
        else:
            self._waiting.append(point)

    def _miss(self, newest: float, what: str) -> None:
        """Say that none can be used, unless some could a while ago, and begin anew."""
        if not newest - self._used < _ABSENT:
            self.absent = f"the {what} of the ball are no numbers, or all zero"
        self.note = ""
        self._gaps, self._sizes, self._none, self._same = [], [], 0, 0

    def _judge(self, newest: float) -> None:
        """Say what is wrong with as many as are looked at together, and begin anew."""
        gaps, none, same = self._gaps, self._none, self._same
        self.fault, self.note, self._judged = "", "", newest
        if min(self._sizes) > FAR**2:
            far = min(self._sizes) ** 0.5
            self.fault = (f"the ball's positions are {far:.3g} m away or more:"
                          " they are in metres (REP 103); are these millimetres?")  # fmt: skip
        elif (least := min(gaps)) > _FAULT:
            self.fault = f"the ball's positions are stamped {_long(least)} ahead of {_CLOCKS}"
        elif least > _AHEAD:
            self.note = f"the ball's positions are stamped {_long(least)} ahead of {_CLOCKS}"
        elif (most := max(gaps)) < -STRAY:
            self.fault = f"the ball's positions are stamped {_long(-most)} behind {_CLOCKS}"
        elif most < -_LATE:
            self.note = (f"the ball's positions come {-1e3 * most:.0f} ms after their stamps: where"
                         " that is not how long they take, their clock is behind")  # fmt: skip
        elif same == len(gaps):
            self.note = "the ball's positions are one and the same: their source is stuck"
        elif 3 * same > WINDOW:
            self.note = "the ball's positions repeat: their source is slower than its publisher"
        elif 2 * none > WINDOW:
            self.note = f"{none} of {WINDOW} positions of the ball are no numbers, or all zero"
        self._gaps, self._sizes, self._none, self._same = [], [], 0, 0


def _long(t: float) -> str:
    """Return a time in words [s]."""
    return f"{1e3 * t:.0f} ms" if t < 10.0 else f"{t:.3g} s"


def _checked(point: Sighting) -> Array:
    """Return the place of a position; refuse what has another shape."""
    if not isinstance(point, Sighting) or np.shape(point.r_o) != (3,):
        raise InputError("a position of the ball", "a Sighting of three numbers", repr(point)[:80])
    if np.shape(point.covariance) != (3, 3) or not isinstance(point.t, float | int):
        raise InputError("a position of the ball", "a time, a covariance of shape (3, 3)",
                         repr(point)[:80])  # fmt: skip
    return np.asarray(point.r_o, dtype=np.float64)
