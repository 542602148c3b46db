"""Coming at a ball from behind, palm first, and waiting for it within the reach.

The point that is led to the ball lies h in front of the catch point, along the palm's normal as
the hand is turned just then; h goes to zero at the catch. So the ball comes into the open hand
from the front, wherever the palm looks on the way.
"""

from dataclasses import dataclass
from functools import cached_property
from itertools import product
from typing import Generic, TypeVar

import numpy as np

from mitt.generator.mapping import DirectMap
from mitt.generator.packing import unfold, unpack
from mitt.jit import kernel
from mitt.rivals.meeting import hand_of
from mitt.rivals.servo import bounds_of
from mitt.robot.chain import sweep
from mitt.robot.vectors import Vec
from mitt.signals import Array

#: Values of each joint at which the reach is looked up.
_GRID = 9


@dataclass(frozen=True, slots=True, kw_only=True)
class Shares:
    """How much of an arm may be used.

    Attributes:
        reach: Share of its reach within which the hand may wait.
        torque: Share of the torques on each joint's own inertia that bounds its acceleration.
    """

    reach: float = 0.96
    torque: float = 2.0


S = TypeVar("S", bound=Shares)


@dataclass(frozen=True, kw_only=True, eq=False)
class Reaching(Generic[S]):
    """An arm that comes at a ball, and its settings."""

    map: DirectMap
    settings: S

    @cached_property
    def most(self) -> Array:
        """Bounds of the joints, as of :func:`mitt.rivals.servo.bounds_of`."""
        return bounds_of(self.map.arm, share=self.settings.torque)

    @cached_property
    def hand(self) -> Array:
        """Numbers of the hand, as of :func:`mitt.rivals.meeting.hand_of`."""
        return hand_of(self.map.arm)

    @cached_property
    def sphere(self) -> Array:
        """Where the hand may wait: centre and radius [m], shape (4,)."""
        return sphere_of(self.map, share=self.settings.reach)


def sphere_of(f: DirectMap, *, share: float) -> Array:
    """Return the second joint's place and a share of the reach about it [m], shape (4,)."""
    arm = f.arm
    centre = np.zeros(3)
    _second(f.packed, arm.q_ready, centre, f.work)
    ends = zip(arm.q_min, arm.q_max, strict=True)
    grid = product(*(np.linspace(low, high, _GRID) for low, high in ends))
    far = max(float(np.linalg.norm(arm.position(np.array(q)) - centre)) for q in grid)
    return np.array([*centre, share * far])


@kernel
def _second(packed: Array, q: Array, place: Array, work: Array) -> None:
    """Write the origin of the second active joint in the world."""
    g = unpack(packed)
    w = unfold(work, len(q))
    sweep(g.chain, q, w.still, w.motion)
    place[:] = w.motion.origin[0, 1]


@kernel
def set_back(tau: float, a: float, most: float) -> Vec:
    """Return h [m] and its two derivatives in time, a time ``tau`` [s] before the catch.

    h = x / (1 + x / h_max) with x = a tau^2 / 2: near the catch the ball nears the palm with the
    relative acceleration a, far from it h is at most h_max.
    """
    x = 0.5 * a * tau * tau
    part = 1.0 / (1.0 + x / most)
    bend = a * part * part - 2.0 * (a * tau) ** 2 * part**3 / most
    return x * part, -a * tau * part * part, bend


@kernel
def hold_back(point: Array, sphere: Array, longer: float) -> None:
    """Project a moving point onto the reach, its centre and radius in ``sphere`` (4,) [m]."""
    size, radius = 0.0, sphere[3] + longer
    for c in range(3):
        size += (point[0, c] - sphere[c]) ** 2
    size = np.sqrt(size)
    if size <= radius:
        return
    along = 0.0
    for c in range(3):
        along += point[1, c] * (point[0, c] - sphere[c]) / size
    for c in range(3):
        ray = (point[0, c] - sphere[c]) / size
        point[0, c] = sphere[c] + radius * ray
        point[1, c] = radius / size * (point[1, c] - along * ray)
        point[2, c] = 0.0
