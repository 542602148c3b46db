"""Faults of the exposure: when cameras look, and where they see the ball."""

from math import floor
from typing import final

import numpy as np

from mitt.robot.description import rotation
from mitt.signals import Array
from mitt.world.faults.draw import direction
from mitt.world.faults.plan import Calibration, FrameRate, Noise, Outlier
from mitt.world.faults.stage import Stage

#: Time between two exposures of a camera that misses none [s].
_TICK = 0.001


@final
class Displaced(Stage):
    """Shows the ball displaced, by noise at every exposure or by an outlier at some."""

    def __init__(self, fault: Noise | Outlier, rng: np.random.Generator) -> None:
        """Take the fault and its source of randomness."""
        self._fault, self._rng = fault, rng

    def shown(self, t: float, r_o: Array) -> Array:
        """Return the displaced ball; every tick draws, so that none depends on those before."""
        fault, size = self._fault, self._fault.magnitude
        if isinstance(fault, Noise):
            off, hit = size * self._rng.standard_normal(3), True
        else:
            hit = bool(self._rng.random() < fault.chance)
            off = size * direction(self._rng)
        return np.asarray(r_o + off) if hit and fault.holds(t) else r_o


@final
class Slow(Stage):
    """Exposes so many times a second, from a random phase."""

    def __init__(self, fault: FrameRate, rng: np.random.Generator) -> None:
        """Take the fault and draw its phase."""
        self._fault, self._phase = fault, rng.random()

    def looks(self, t: float) -> bool:
        """Say whether an exposure is due."""
        if not self._fault.holds(t):
            return True
        rate = min(self._fault.magnitude, 1.0 / _TICK)
        now = floor(t * rate + self._phase + 1e-9)
        return now != floor((t - _TICK) * rate + self._phase + 1e-9)


@final
class Turned(Stage):
    """Moves points as cameras in the wrong place would, for worlds without cameras."""

    def __init__(self, fault: Calibration, rng: np.random.Generator) -> None:
        """Draw the error of the trial."""
        size = fault.magnitude * rng.standard_normal()
        axis = direction(rng)
        self._A = rotation(axis, size) if fault.part == "angles" else (1.0 + size) * np.eye(3)

    def shown(self, t: float, r_o: Array) -> Array:  # noqa: ARG002
        """Return the ball as the wrong calibration places it."""
        return np.asarray(self._A @ r_o)
