"""The catcher's time, from a robot's stamps whose differences are held to the steady clock.

A robot's stamps say when its encoders were read, whatever the way to here took. So they are the
time of the catcher. But a clock of the day can be set: then stamps jump, while the messages come
as before. Stamps that jump are a fault, after which time goes on from tick to tick, for the stop.

Readings that wait in a queue on their way come later and later, and so do those of a clock that
runs slow: the lag, arrival minus stamp, grows. It is compared with the least lag so far, of three
readings in a row the middle one, so that one wrong stamp decides nothing. How long the readings
were on their way then is not known; a queue that was full from the start is not found. What was
found late stays late until it comes as before, the robot's clock is set, or the robot was away.
"""

from collections import deque
from math import inf, isfinite
from statistics import median_low
from typing import final

from mitt.errors import InputError
from mitt.signals import TICK

#: By how much stamps may run ahead of the time between two messages [s]; what waits here longer
#: than this is late anyway.
_AHEAD = 0.02
#: Messages in a row that may repeat a stamp or come in the wrong order, and by how much [s].
_REPEATS, _SWAPPED = 3, 0.01
#: Least step from one reading to the next [s].
_LEAST = 0.1 * TICK
#: By how much readings may come later than the least late ones [s]: at the catcher's bandwidth of
#: 80 rad/s a delay of 10 ms takes 46 degrees of the phase margin.
LATER = 0.01
#: How fast the least lag is let grow [s/s]: clocks are slewed by up to 500 ppm (``adjtime``). A lag
#: that grows more slowly cannot be told from a drift.
DRIFT = 5e-4
#: Time between two stamps after which a robot was away, and may have been started anew [s].
_AWAY = 1.0
#: For how long they come so late before it is a fault [s]: after a stall of ours a few are old.
_LASTS = 0.02


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
        # What came before says nothing of a clock that was set back, or a robot that was away.
        if not -_SWAPPED < stamp - self._stamp < _AWAY:
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
        self._late = arrived - self._since >= _LASTS
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

        Args:
            stamp: Of the robot [s].
            arrived: When it came, by the steady clock here [s].

        Raises:
            InputError: The stamp is no number.
        """
        if not isfinite(stamp):
            raise InputError("the stamp of a reading", "a finite time [s]", stamp)
        if self._zero is None:
            self._zero = stamp
        else:
            step, passed = stamp - self.stamp, arrived - self._arrived
            if step < _LEAST:
                self._repeats += 1
                if step > -_SWAPPED and self._repeats <= _REPEATS:
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
