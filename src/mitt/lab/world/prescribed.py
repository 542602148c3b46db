"""The motion of a ball that follows a path, kept tick by tick for compiled code.

A recorded flight, a spring, a hand, and a flight that something disturbs do not depend on the arm
until something touches the ball. So the path is worked out beforehand, a little ahead of the
simulation, and the compiled loop moves the ball along it.
"""

from collections.abc import Iterator
from typing import final

import numpy as np

from mitt.core.signals import TICK, Array
from mitt.lab.world.flights import BallPath

#: The path of a ball that is free: it has no rows.
FREE = np.empty((0, 2, 3))
#: Ticks that are worked out at once at least.
_AHEAD = 64


def states_of(path: BallPath) -> Iterator[tuple[Array, Array]]:
    """Return position [m] and velocity [m/s] at the start of each tick, both of shape (3,)."""
    k = 0
    while True:
        yield path.at(k * TICK)
        k += 1


@final
class Prescribed:
    """A path, worked out as far as it was asked for."""

    def __init__(self, states: Iterator[tuple[Array, Array]]) -> None:
        """Take position and velocity tick by tick, without an end."""
        self._states, self._known = states, 0
        self._rows = np.empty((0, 2, 3))

    def rows(self, count: int) -> Array:
        """Return position and velocity at the start of ``count`` ticks or more, (k, 2, 3)."""
        if count > len(self._rows):
            rows = np.empty((max(count, 2 * len(self._rows), 8 * _AHEAD), 2, 3))
            rows[: self._known] = self._rows[: self._known]
            self._rows = rows
        if count > self._known:
            until = min(max(count, self._known + _AHEAD), len(self._rows))
            for k in range(self._known, until):
                self._rows[k, 0], self._rows[k, 1] = next(self._states)
            self._known = until
        return self._rows
