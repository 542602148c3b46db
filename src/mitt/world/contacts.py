"""Reading the contacts of a simulation step without allocating."""

import mujoco
import numpy as np
from numpy.typing import NDArray

from mitt.jit import kernel
from mitt.signals import Array
from mitt.views import lent
from mitt.world.engine import MOST, Views, contact_force
from mitt.world.hand import ARM, BALL, FLOOR, HAND

#: What touches what, as bits of the result of :func:`survey`.
BALL_HAND, BALL_ARM, BALL_FLOOR, SELF, ARM_FLOOR = 1, 2, 4, 8, 16
BALL_ANY = BALL_HAND | BALL_ARM | BALL_FLOOR

#: No position, velocity or acceleration of ours is so large (SI units); NaN is not below it.
HUGE = 1e8


@kernel
def survey(
    views: Views, kinds: NDArray[np.int32], touching: NDArray[np.bool_], felt: bool, largest: Array
) -> int:
    """Sort the contacts of one step.

    Args:
        views: As of :func:`mitt.world.engine.views_of`.
        kinds: Kind of each geom, shape (g,).
        touching: Result, whether a geom touches the ball, shape (g,).
        felt: Whether forces are known, as they are after a step.
        largest: Result, raised to the largest contact force on the ball [N], then scratch,
            shape (7,).

    Returns:
        Bits of what touches what.
    """
    views, kinds, touching, largest = lent(views), lent(kinds), lent(touching), lent(largest)
    address, counts, geoms = views[0], views[1], views[2]
    found, force = 0, largest[1:7]
    touching[:] = False
    for c in range(min(counts[0], MOST)):
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
def is_sane(qpos: Array, qvel: Array, qacc: Array, ball: int, top_speed: float) -> bool:
    """Tell whether a state can be real; MuJoCo's own warnings come later, if they come.

    Args:
        qpos: Positions, shape (nq,).
        qvel: Velocities, shape (nv,).
        qacc: Accelerations, shape (nv,).
        ball: Index of the ball's first degree of freedom.
        top_speed: Largest speed that a ball can have [m/s].
    """
    qpos, qvel, qacc = lent((qpos, qvel, qacc))
    for values in (qpos, qvel, qacc):
        for x in values:
            if not abs(x) < HUGE:
                return False
    square = qvel[ball] ** 2 + qvel[ball + 1] ** 2 + qvel[ball + 2] ** 2
    return bool(square <= top_speed * top_speed)


def hand_names(model: mujoco.MjModel) -> tuple[str | None, ...]:
    """Return the names of the geoms of the hand, None for any other geom."""
    kinds = model.geom_contype == HAND
    return tuple(model.geom(g).name if kinds[g] else None for g in range(model.ngeom))


def names_touching(names: tuple[str | None, ...], touching: NDArray[np.bool_]) -> frozenset[str]:
    """Return the names of the hand's geoms, of :func:`hand_names`, that touch the ball, (g,)."""
    found = (names[g] for g in np.flatnonzero(touching).tolist())
    return frozenset(name for name in found if name is not None)
