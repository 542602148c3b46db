"""Whether an arm that waits is clear of the floor, and of slabs, as belts and trays are.

What overlaps at the start would be touched from the first tick on, and the catcher does not keep an
arm from what it touches already (:mod:`mitt.core.arm.shapes`).
"""

from collections.abc import Mapping
from dataclasses import dataclass
from math import cos, sin
from typing import final

import numpy as np

from mitt.core.arm.arm import Arm
from mitt.core.arm.shapes import SEGMENT, STILL, Surroundings, place_shapes, shapes_of
from mitt.core.errors import InputError
from mitt.core.signals import Array

#: Points of a capsule's axis that are held against a slab.
_POINTS = 101
#: Rounding of a gap [m].
_ROUNDING = 1e-6


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Slab:
    """A level slab.

    Attributes:
        middle: Its middle, seen from above [m].
        direction: Where its length leads, from +x towards +y [rad].
        height: Of its surface [m].
        size: Length, width and thickness [m].
    """

    middle: tuple[float, float]
    direction: float
    height: float
    size: tuple[float, float, float]

    def distance(self, points: Array) -> float:
        """Return the least distance of points, shape (k, 3), from the slab [m]; 0 inside."""
        c, s = cos(self.direction), sin(self.direction)
        R, half = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]), 0.5 * np.array(self.size)
        away = (points - [*self.middle, self.height - half[2]]) @ R
        return float(np.linalg.norm(np.maximum(np.abs(away) - half, 0.0), axis=1).min())


def check_standing(
    arm: Arm, floor: float, slabs: Mapping[str, tuple[Slab, str]] | None = None
) -> None:
    """Refuse a floor or slabs that the arm is in where it stands, or waits in its ready pose.

    Args:
        arm: The arm.
        floor: Height of the floor [m].
        slabs: What else there is, by what an error calls it, each with what to do.

    Raises:
        InputError: A part of the arm is in one of them.
    """
    table = shapes_of(arm, Surroundings(floor=floor)).table
    ends = np.zeros(len(table), SEGMENT)
    place_shapes(arm.bodies, arm.q_ready, table, ends)
    share = np.linspace(0.0, 1.0, _POINTS)[:, None]
    for shape, end in zip(table[1:], ends[1:], strict=True):  # the first is the floor
        start, stop = (np.array(end[x].item()) for x in ("start", "end"))
        points, radius = start + share * (stop - start), float(shape["radius"])
        where = "where it stands" if shape["link"] == STILL else "in its ready pose"
        under = floor - (float(points[:, 2].min()) - radius)
        if shape["link"] != STILL and under > _ROUNDING:
            raise InputError(
                "floor",
                f"one below {arm.model.name} {where}",
                f"{floor:g} m, with a part of the arm {1e3 * under:.0f} mm under it",
                do="lower the floor, or change the ready pose",
            )
        for name, (slab, do) in (slabs or {}).items():
            into = radius - slab.distance(points)
            if into > _ROUNDING:
                raise InputError(
                    name,
                    f"one beside {arm.model.name} {where}",
                    f"one that is {1e3 * into:.0f} mm in it",
                    do=do,
                )
