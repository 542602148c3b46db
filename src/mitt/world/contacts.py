"""Reading the contacts of a simulation step without allocating."""

from typing import final

import mujoco
import numpy as np
from numba import njit
from numpy.typing import NDArray

from mitt.signals import Array
from mitt.world.hand import ARM, BALL, FLOOR, HAND

#: What touches what, as bits of the result of :func:`survey`.
BALL_HAND, BALL_ARM, BALL_FLOOR, SELF, ARM_FLOOR = 1, 2, 4, 8, 16
BALL_ANY = BALL_HAND | BALL_ARM | BALL_FLOOR

#: No position, velocity or acceleration of ours is so large (SI units); NaN is not below it.
HUGE = 1e8


@njit(cache=True)
def survey(
    geoms: NDArray[np.int32],
    address: NDArray[np.int32],
    force: Array,
    kinds: NDArray[np.int32],
    touching: NDArray[np.bool_],
    largest: Array,
) -> int:
    """Sort the contacts of one step.

    Args:
        geoms: Pairs of geoms that touch, shape (c, 2).
        address: Where each contact's forces begin, negative where it has none, shape (c,).
        force: Constraint forces: normal, then two tangential [N], shape (m,).
        kinds: Kind of each geom, shape (g,).
        touching: Result, whether a geom touches the ball, shape (g,).
        largest: Result, raised to the largest contact force on the ball [N], shape (>= 1,).

    Returns:
        Bits of what touches what.
    """
    found = 0
    touching[:] = False
    for c in range(geoms.shape[0]):
        first, second = geoms[c, 0], geoms[c, 1]
        both = kinds[first] | kinds[second]
        if both & BALL:
            if kinds[first] == BALL:
                first = second
            touching[first] = True
            found |= BALL_HAND if both & HAND else (BALL_ARM if both & ARM else BALL_FLOOR)
            a = address[c]
            if 0 <= a < force.shape[0] - 2:
                size = np.sqrt(force[a] ** 2 + force[a + 1] ** 2 + force[a + 2] ** 2)
                largest[0] = max(largest[0], size)
        elif both & FLOOR:
            found |= ARM_FLOOR
        elif both & ARM:
            found |= SELF
    return found


@njit(cache=True)
def is_sane(qpos: Array, qvel: Array, qacc: Array, ball: int, top_speed: float) -> bool:
    """Tell whether a state can be real; MuJoCo's own warnings come later, if they come.

    Args:
        qpos: Positions, shape (nq,).
        qvel: Velocities, shape (nv,).
        qacc: Accelerations, shape (nv,).
        ball: Index of the ball's first degree of freedom.
        top_speed: Largest speed that a ball can have [m/s].
    """
    for values in (qpos, qvel, qacc):
        for x in values:
            if not abs(x) < HUGE:
                return False
    square = qvel[ball] ** 2 + qvel[ball + 1] ** 2 + qvel[ball + 2] ** 2
    return bool(square <= top_speed * top_speed)


@final
class Contacts:
    """Reads the contacts of one simulation."""

    def __init__(self, model: mujoco.MjModel, data: mujoco.MjData) -> None:
        """Remember which kind each geom is."""
        self._model, self._data = model, data
        self._kinds = model.geom_contype.copy()
        self._touching = np.zeros(model.ngeom, dtype=np.bool_)
        self._no_force = np.zeros(1)

    def made(self, largest: Array) -> int:
        """Return what touched what in the step just made; see :func:`survey` for ``largest``."""
        contact, force = self._data.contact, self._data.efc_force
        return int(
            survey(contact.geom, contact.efc_address, force, self._kinds, self._touching, largest)
        )

    def present(self) -> int:
        """Return what touches what at this instant, before any force is known."""
        contact, none = self._data.contact, self._no_force
        return int(
            survey(contact.geom, contact.efc_address, none, self._kinds, self._touching, none)
        )

    def hand(self) -> frozenset[str]:
        """Return the names of the geoms of the hand that touch the ball at this instant."""
        self.present()
        found = np.flatnonzero(self._touching & (self._kinds == HAND))
        return frozenset(self._model.geom(int(g)).name for g in found)
