"""Reading contacts and the catch point's velocity from a simulation, without allocating."""

import mujoco
import numpy as np
from numpy.typing import NDArray

from mitt.jit import kernel
from mitt.signals import Array
from mitt.world.engine import MOST, Plant, contact_force
from mitt.world.hand import ARM, BALL, FLOOR, HAND

#: What touches what, as bits of the result of :func:`survey`.
BALL_HAND, BALL_ARM, BALL_FLOOR, SELF, ARM_FLOOR = 1, 2, 4, 8, 16
BALL_ANY = BALL_HAND | BALL_ARM | BALL_FLOOR


@kernel
def survey(plant: Plant, felt: bool, largest: Array) -> int:
    """Sort the contacts of one step, and write which geoms touch the ball.

    Args:
        plant: The plant; its ``touching`` is overwritten.
        felt: Whether forces are known, as they are after a step.
        largest: Result, raised to the largest contact force on the ball [N], then scratch,
            shape (7,).

    Returns:
        Bits of what touches what.
    """
    address, geoms, kinds, touching = plant.address, plant.geoms, plant.kinds, plant.touching
    found, force = 0, largest[1:7]
    touching[:] = False
    for c in range(min(plant.contacts[0], MOST)):
        first, second = geoms[c, 0], geoms[c, 1]
        both = kinds[first] | kinds[second]
        if both & BALL:
            if kinds[first] == BALL:
                first = second
            touching[first] = True
            found |= BALL_HAND if both & HAND else (BALL_ARM if both & ARM else BALL_FLOOR)
            if felt:
                contact_force(address[0], address[1], c, force.ctypes.data)
                size = np.sqrt(force[0] ** 2 + force[1] ** 2 + force[2] ** 2)
                largest[0] = max(largest[0], size)
        elif both & FLOOR:
            found |= ARM_FLOOR
        elif both & ARM:
            found |= SELF
    return found


@kernel
def tip_velocity(plant: Plant, out: Array) -> None:
    """Write the velocity of the catch point [m/s], shape (3,), from those of the joints."""
    place, anchor, axis, dq = plant.place, plant.anchor, plant.axis, plant.qvel
    out[:] = 0.0
    for i in range(len(plant.slides)):
        ax, ay, az = axis[i, 0], axis[i, 1], axis[i, 2]
        if plant.slides[i]:
            x, y, z = ax, ay, az
        else:
            rx, ry, rz = place[0] - anchor[i, 0], place[1] - anchor[i, 1], place[2] - anchor[i, 2]
            x, y, z = ay * rz - az * ry, az * rx - ax * rz, ax * ry - ay * rx
        out[0] += dq[i] * x
        out[1] += dq[i] * y
        out[2] += dq[i] * z


def hand_names(model: mujoco.MjModel) -> tuple[str | None, ...]:
    """Return the names of the geoms of the hand, None for any other geom."""
    kinds = model.geom_contype == HAND
    return tuple(model.geom(g).name if kinds[g] else None for g in range(model.ngeom))


def names_touching(names: tuple[str | None, ...], touching: NDArray[np.bool_]) -> frozenset[str]:
    """Return the names of the hand's geoms, of :func:`hand_names`, that touch the ball, (g,)."""
    found = (names[g] for g in np.flatnonzero(touching).tolist())
    return frozenset(name for name in found if name is not None)
