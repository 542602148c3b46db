"""Arm and hand of a world as capsules, which cameras see in outline."""

import mujoco
import numpy as np

from mitt.jit import kernel
from mitt.signals import Array
from mitt.views import lent
from mitt.world.engine import owned
from mitt.world.hand import ARM, HAND


@kernel
def lay_capsules(pos: Array, mat: Array, sizes: Array, which: Array, capsules: Array) -> None:
    """Write the capsules of geoms.

    Args:
        pos: Centres of all geoms [m], shape (g, 3).
        mat: Their axes, shape (g, 9).
        sizes: Radius, half length [m] and axis of each capsule, 1 for the hand's, shape (k, 4).
        which: The geom of each capsule, shape (k,).
        capsules: Result, as in :mod:`mitt.world.painting`.
    """
    pos, mat, sizes, which, capsules = lent((pos, mat, sizes, which, capsules))
    for k in range(capsules.shape[0]):
        g, axis = int(which[k]), int(sizes[k, 2])
        for i in range(3):
            half = sizes[k, 1] * mat[g, 3 * i + axis]
            capsules[k, i], capsules[k, 3 + i] = pos[g, i] - half, pos[g, i] + half
        capsules[k, 6], capsules[k, 7] = sizes[k, 0], sizes[k, 3]


class Silhouettes:
    """Arm and hand of a world as capsules.

    Attributes:
        capsules: As in :mod:`mitt.world.painting`; brought up to date by ``update``.
    """

    def __init__(self, model: mujoco.MjModel, data: mujoco.MjData) -> None:
        """Find the shapes of arm and hand."""
        own = np.flatnonzero((model.geom_contype & (ARM | HAND)) != 0)
        self._which = own.astype(np.float64)
        hand = (model.geom_contype[own] & HAND) != 0
        sizes = np.array([_size(model, int(g)) for g in own]).reshape(len(own), 3)
        self._sizes = np.column_stack((sizes, hand.astype(np.float64)))
        owner = model, data
        self._pos, self._mat = owned(owner, data.geom_xpos), owned(owner, data.geom_xmat)
        self.capsules = np.zeros((len(own), 8))

    @property
    def table(self) -> tuple[Array, Array, Array, Array, Array]:
        """What :func:`lay_capsules` takes."""
        return self._pos, self._mat, self._sizes, self._which, self.capsules

    def update(self) -> None:
        """Bring the capsules to where the plant is."""
        lay_capsules(*self.table)


def _size(model: mujoco.MjModel, geom: int) -> tuple[float, float, float]:
    """Return radius, half length and axis of the capsule that stands for a geom."""
    kind, size = model.geom_type[geom], model.geom_size[geom]
    if kind == mujoco.mjtGeom.mjGEOM_CAPSULE:
        return size[0], size[1], 2.0
    if kind == mujoco.mjtGeom.mjGEOM_CYLINDER:
        return size[0], max(size[1] - size[0], 0.0), 2.0
    if kind == mujoco.mjtGeom.mjGEOM_BOX:
        axis = int(np.argmax(size))
        radius = float(np.sqrt(np.prod(np.delete(size, axis))))
        return radius, max(size[axis] - radius, 0.0), float(axis)
    return (
        float(model.geom_rbound[geom]) if kind != mujoco.mjtGeom.mjGEOM_SPHERE else size[0],
        0.0,
        2.0,
    )
