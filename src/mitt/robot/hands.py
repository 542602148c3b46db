"""The hand as data: what it weighs, where it catches, how its fingers close.

Mass, centre of mass and catch point are choices of this project where the paper is silent.
"""

from dataclasses import dataclass, field

import numpy as np

from mitt.signals import Array


def _cylinder(mass: float, radius: float, length: float) -> Array:
    """Return the inertia of a solid cylinder along z [kg m^2], shape (3, 3)."""
    across = mass * (3.0 * radius**2 + length**2) / 12.0
    return np.diag([across, across, 0.5 * mass * radius**2])


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class HandModel:
    """A hand mounted on the tool plate, palm normal along the plate's z axis.

    Attributes:
        mass: Mass [kg].
        com: Centre of mass beyond the tool plate [m].
        inertia: Inertia about it, axes of the tool plate [kg m^2], shape (3, 3).
        catch_offset: Distance of the catch point beyond the tool plate [m].
    """

    mass: float = 0.8
    com: float = 0.05
    inertia: Array = field(default_factory=lambda: _cylinder(0.8, 0.06, 0.10))
    catch_offset: float = 0.12
