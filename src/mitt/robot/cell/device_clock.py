"""Stamps of a device's own clock as times of day, as cameras and ``mitt`` stamp them.

A device is a robot, or what tracks the ball. What came fastest tells how far its clock is behind.
As two clocks drift apart, this difference follows them: by what came fastest in the last seconds,
and no faster than clocks drift, as stamps must not jump while an arm moves. Readings that are late
all of a sudden are no drift: their stamps stay as they are, so that the live loop finds them late.
"""

from collections.abc import Callable
from math import inf
from typing import final

from mitt.clock import time_of_day

#: How fast two clocks drift apart at most [s/s]: two quartzes of 100 ppm each.
_DRIFT = 2e-4
#: For how long it is looked what came fastest [s], and by how much that may have changed since [s].
_WINDOW = 5.0
_MOST = 0.002


@final
class DeviceClock:
    """Adds to a device's stamps what they were behind the clock here when they came fastest."""

    def __init__(self, day: Callable[[], float] = time_of_day) -> None:
        """Know no stamp yet; ``day`` returns the time of day [s]."""
        self._day, self._behind, self._fixed = day, inf, False
        self._goal, self._least, self._last, self._until = inf, inf, 0.0, 0.0

    def at(self, stamp: float) -> float:
        """Return the time of day of a stamp [s]."""
        now = self._day() - stamp
        if self._fixed:
            self._follow(now, stamp)
        else:
            self._behind = min(self._behind, now)
        self._last = stamp
        return stamp + self._behind

    def _follow(self, now: float, stamp: float) -> None:
        """Let the difference follow the drift."""
        self._least = min(self._least, now)
        if stamp > self._until:
            changed = self._least - self._behind
            self._goal = self._behind if changed > _MOST else self._least
            self._least, self._until = inf, stamp + _WINDOW
        step = _DRIFT * max(stamp - self._last, 0.0)
        self._behind += min(max(self._goal - self._behind, -step), step)

    def fix(self) -> None:
        """Let the difference follow the drift alone from now on, once one is known."""
        if not self._fixed and self._behind < inf:
            self._fixed, self._goal = True, self._behind
            self._until = self._last + _WINDOW
