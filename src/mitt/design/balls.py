"""The balls that are to be caught, where they arrive."""

from dataclasses import dataclass

import numpy as np

from mitt.signals import Array

#: Half-widths of the box of throws for a catch point 1 m from the second joint [m]: across the
#: ball's way and upwards as the default throws of the WAM (docs/throws.md).
BOX = (0.05, 0.3, 0.22)
#: Farthest from that joint for which the box grows [m]: 0.77 is the WAM's.
FAR = 0.8


@dataclass(frozen=True, slots=True, kw_only=True)
class Balls:
    """The balls that are to be caught, where they arrive; measured on throws.

    What is left out is that of 400 default throws (:func:`mitt.design.arrivals.of_default_throws`).

    Attributes:
        speed: Middle of their speeds at the arrival [m/s].
        descent: Middle of the angles by which they come down there [rad].
        speeds: Speeds that 5 and 95 % of them stay below [m/s].
        descents: The same of the angles [rad].
        azimuth: Middle of where they come from, off +x [rad].
        aim: Centre and half-widths of the box that they pass [m], shape (2, 3); None where the
            design may choose it.
        around: Half-widths of the box where the design chooses its centre [m], shape (3,); as of
            default throws where None.
    """

    speed: float = 5.86
    descent: float = 0.51
    speeds: tuple[float, float] = (5.19, 6.70)
    descents: tuple[float, float] = (0.35, 0.67)
    azimuth: float = 0.0
    aim: Array | None = None
    around: Array | None = None

    def velocity(self, faster: float = 0.0, azimuth: float = 0.0, steeper: float = 0.0) -> Array:
        """Return a velocity at the arrival [m/s], shape (3,); they come from +x.

        Args:
            faster: From the least speed (-1) by the middle (0) to the most (1).
            azimuth: Where it comes from, off the middle [rad].
            steeper: From the least descent (-1) by the middle (0) to the most (1).
        """
        speed = _between(self.speed, self.speeds, faster)
        down = _between(self.descent, self.descents, steeper)
        flat, side = np.cos(down), self.azimuth + azimuth
        v: Array = -speed * np.array([flat * np.cos(side), flat * np.sin(side), np.sin(down)])
        return v


def _between(middle: float, ends: tuple[float, float], place: float) -> float:
    """Return a number from the lower end (-1) by the middle (0) to the upper end (1)."""
    return middle + abs(place) * (ends[int(place > 0.0)] - middle)
