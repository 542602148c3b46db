"""The catcher's time, from a robot's stamps whose differences are held to the steady clock.

A robot's stamps say when its encoders were read, whatever the way to here took. So they are the
time of the catcher. But a clock of the day can be set: then stamps jump, while the messages come
as before. Stamps that jump are a fault, after which time goes on from tick to tick, for the stop.
"""

from math import isfinite
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


@final
class Stamps:
    """Turns stamps into the catcher's time.

    Attributes:
        t: Time of the newest reading [s], from 0 at the first.
        fault: What was found wrong with the stamps, in words; nothing so far.
    """

    def __init__(self) -> None:
        """Know nothing yet."""
        self.t, self.fault = 0.0, ""
        self._zero: float | None = None
        self._stamp = self._arrived = 0.0
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
            step, passed = stamp - self._stamp, arrived - self._arrived
            if step < _LEAST:
                self._repeats += 1
                if step > -_SWAPPED and self._repeats <= _REPEATS:
                    return None
                self._jump(f"its clock was set back by {-step:.3g} s", stamp)
            elif step - passed > _AHEAD:
                self._jump(f"its clock was set forward by {step - passed:.3g} s", stamp)
        self._repeats, self._stamp, self._arrived = 0, stamp, arrived
        self.t = stamp - self._zero
        return self.t

    def at(self, stamp: float) -> float:
        """Return the catcher's time of another stamp of the same clock [s]."""
        return stamp - (0.0 if self._zero is None else self._zero)

    def _jump(self, fault: str, stamp: float) -> None:
        """Note a fault and let time go on by a tick."""
        self.fault = self.fault or fault
        self._zero = stamp - (self.t + TICK)
