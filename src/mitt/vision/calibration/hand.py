"""Where a rig stands before the robot, from a ball that the hand held at known places.

The ball's centre is known in the world, from the arm's encoders; each camera gives the centroid
of its image. What is found is the pose of the rig's frame, robust against a centroid that was
something else. Image points are those of the pinhole camera (``Lens.straighten``).
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from mitt.errors import InputError
from mitt.signals import Array
from mitt.vision.camera import Camera
from mitt.vision.poses import applied, by_pose, inverse, laid, turned

#: Fewest places of the ball that fix a pose, and a few to spare.
FEWEST = 4


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class HandProblem:
    """Centroids of a ball at known places, and the pose that should explain them.

    Attributes:
        cameras: Cameras of the rig; their poses are in the rig's frame.
        camera: Camera of each centroid, shape (n,).
        p_world: Ball centre in the world [m], shape (n, 3).
        uv: Centroid [px], shape (n, 2).
        radius: Ball radius [m].
        T_rig_world: p_rig = T_rig_world @ p_world [m], shape (4, 4).
    """

    cameras: tuple[Camera, ...]
    camera: NDArray[np.int64]
    p_world: Array
    uv: Array
    radius: float
    T_rig_world: Array

    @property
    def names(self) -> tuple[str, ...]:
        """The six of a pose."""
        return ("turn_x", "turn_y", "turn_z", "x", "y", "z")

    def _optical(self) -> tuple[Array, Array, Array]:
        """Return points [m], (n, 3), rotations from the rig, (n, 3, 3), f, cu, cv [px], (n, 3)."""
        R = np.array([c.rotation.T for c in self.cameras])[self.camera]
        at = np.array([c.centre for c in self.cameras])[self.camera]
        lens = np.array([(c.f_px, c.cu, c.cv) for c in self.cameras])[self.camera]
        p = np.einsum("nij,nj->ni", R, applied(self.T_rig_world, self.p_world) - at)
        return p, R, lens

    def residuals(self) -> Array:
        """Return seen minus predicted [px], shape (2 n,); the centroid as in ``triangulation``."""
        p, _, lens = self._optical()
        if np.any(p[:, 2] <= self.radius):
            return np.full(2 * len(p), np.inf)
        xy = p[:, :2] * p[:, 2:] / (p[:, 2:] ** 2 - self.radius**2)
        return np.asarray((self.uv - lens[:, :1] * xy - lens[:, 1:]).ravel())

    def jacobian(self) -> Array:
        """Return the derivative of the centroids with respect to a step, shape (2 n, 6)."""
        p, R, lens = self._optical()
        z, gap = p[:, 2], p[:, 2] ** 2 - self.radius**2
        by_p = np.zeros((len(p), 2, 3))
        by_p[:, 0, 0] = by_p[:, 1, 1] = z / gap
        by_p[:, :, 2] = -p[:, :2] * ((z * z + self.radius**2) / gap**2)[:, None]
        by_step = by_pose(self.p_world @ self.T_rig_world[:3, :3].T)
        return np.asarray((lens[:, :1, None] * (by_p @ R @ by_step)).reshape(-1, 6))

    def moved(self, step: Array) -> "HandProblem":
        """Return the problem with the pose moved by a step."""
        return replace(self, T_rig_world=turned(self.T_rig_world, step))


def first_pose(seen: Array, p_world: Array) -> Array:
    """Return a first T_rig_world, shape (4, 4), that a few wrong points do not spoil.

    Args:
        seen: Triangulated points in the rig's frame [m], shape (k, 3).
        p_world: The same in the world [m], shape (k, 3).

    Raises:
        InputError: The points are too few, or lie on one line.
    """
    if len(seen) < FEWEST:
        raise InputError("ball in the hand", f"{FEWEST} places or more that two cameras saw",
                         len(seen))  # fmt: skip
    spread = np.linalg.svd(p_world - p_world.mean(axis=0), compute_uv=False)
    if spread[1] < 0.02 * np.sqrt(len(seen)):
        raise InputError("ball in the hand", "places that do not lie on one line, 0.1 m apart",
                         f"{1e3 * spread[1] / np.sqrt(len(seen)):.0f} mm across it")  # fmt: skip
    weights = np.ones(len(seen))
    for _ in range(20):
        T = laid(p_world, seen, weights)
        error = np.linalg.norm(applied(T, p_world) - seen, axis=1)
        weights = 1.0 / np.maximum(error, max(0.2 * float(np.median(error)), 1e-9))
    return T


def placed(cameras: tuple[Camera, ...], T_rig_world: Array) -> tuple[Camera, ...]:
    """Return the cameras with their poses in the world."""
    T_world_rig = inverse(T_rig_world)
    return tuple(replace(c, T_world_cam=T_world_rig @ c.T_world_cam) for c in cameras)
