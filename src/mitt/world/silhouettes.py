"""Silhouettes of arm and hand in an image: capsules, seen in outline.

A capsule's outline is taken as the hull of two discs, one at each end; edges are not smoothed and
do not smear: what matters is what they hide and where they are dark or bright beside the ball.

| here     | meaning                                                            | unit | shape  |
|----------|--------------------------------------------------------------------|------|--------|
| capsules | both ends of the axis in the world, then the radius                | m    | (k, 7) |
"""

from math import sqrt

import mujoco
import numpy as np
from numba import njit
from numpy.typing import NDArray

from mitt.signals import Array, Image
from mitt.world.hand import ARM, HAND

_NEAR = 0.05


@njit(cache=True)
def lay_capsules(pos: Array, mat: Array, sizes: Array, which: Array, capsules: Array) -> None:
    """Write the capsules of geoms.

    Args:
        pos: Centres of all geoms [m], shape (g, 3).
        mat: Their axes, shape (g, 9).
        sizes: Radius, half length [m] and axis of each capsule, shape (k, 3).
        which: The geom of each capsule, shape (k,).
        capsules: Result.
    """
    for k in range(capsules.shape[0]):
        g, axis = int(which[k]), int(sizes[k, 2])
        for i in range(3):
            half = sizes[k, 1] * mat[g, 3 * i + axis]
            capsules[k, i], capsules[k, 3 + i] = pos[g, i] - half, pos[g, i] + half
        capsules[k, 6] = sizes[k, 0]


@njit(cache=True)
def seen_from(camera: Array, capsule: Array, seen: Array) -> bool:
    """Write a capsule in the optical frame, cut off near the lens; False if none of it is ahead.

    Args:
        camera: Rotation in rows 0 to 2, centre [m], and f_px, cu, cv [px], shape (5, 3).
        capsule: In the world, shape (7,).
        seen: Result, in the optical frame, shape (7,).
    """
    for end in range(0, 6, 3):
        for i in range(3):
            total = 0.0
            for j in range(3):
                total += camera[j, i] * (capsule[end + j] - camera[3, j])
            seen[end + i] = total
    seen[6] = capsule[6]
    if max(seen[2], seen[5]) <= _NEAR:
        return False
    for end, other in ((0, 3), (3, 0)):
        if seen[end + 2] < _NEAR:
            share = (_NEAR - seen[end + 2]) / (seen[other + 2] - seen[end + 2])
            for i in range(3):
                seen[end + i] += share * (seen[other + i] - seen[end + i])
    return True


@njit(cache=True)
def in_front(seen: Array, x: float, y: float, z: float) -> bool:
    """Tell whether the part of a capsule nearest to a point is nearer to the lens than the point.

    Args:
        seen: A capsule in the optical frame, shape (7,).
        x: Point in the optical frame [m], as ``y`` and ``z``.
        y: See ``x``.
        z: See ``x``.
    """
    ax, ay, az = seen[3] - seen[0], seen[4] - seen[1], seen[5] - seen[2]
    along = ax * (x - seen[0]) + ay * (y - seen[1]) + az * (z - seen[2])
    share = min(max(along / max(ax * ax + ay * ay + az * az, 1e-12), 0.0), 1.0)
    return bool(seen[2] + share * az < z)


@njit(cache=True)
def draw_capsule(
    pixels: Image, lens: Array, seen: Array, level: int, noise: Image, window: NDArray[np.int64]
) -> None:
    """Draw the outline of a capsule.

    Args:
        pixels: Image, overwritten where the capsule is, shape (height, width).
        lens: f_px, cu, cv [px], shape (3,).
        seen: The capsule in the optical frame, shape (7,).
        level: Its grey level.
        noise: Noise of the sensor [grey levels], modulo 256, one a pixel of the image, shape (n,).
        window: First and last row, first and last column that are drawn [px], shape (4,).
    """
    width, upper, lower = pixels.shape[1], float(window[0]), float(window[1])
    west, east = float(window[2]), float(window[3])
    f0, f1 = lens[0] / seen[2], lens[0] / seen[5]
    u0, v0, r0 = lens[1] + f0 * seen[0], lens[2] + f0 * seen[1], f0 * seen[6]
    u1, v1, r1 = lens[1] + f1 * seen[3], lens[2] + f1 * seen[4], f1 * seen[6]
    top, bottom = min(v0 - r0, v1 - r1), max(v0 + r0, v1 + r1)
    if bottom < upper or top > lower:
        return
    most, least = max(u0 + r0, u1 + r1), min(u0 - r0, u1 - r1)
    if most < max(west - 1.0, 0.0) or least > min(east + 1.0, width - 1.0):
        return
    du, dv = u1 - u0, v1 - v0
    length = max(sqrt(du * du + dv * dv), 1e-9)
    across_u, across_v = -dv / length, du / length
    # The straight edges as lines u = at + slope v, between the rows where they meet the discs.
    a_v, b_v = v0 + across_v * r0, v1 + across_v * r1
    c_v, d_v = v0 - across_v * r0, v1 - across_v * r1
    ab = (u1 + across_u * r1 - u0 - across_u * r0) / (b_v - a_v) if a_v != b_v else 0.0
    cd = (u1 - across_u * r1 - u0 + across_u * r0) / (d_v - c_v) if c_v != d_v else 0.0
    for row in range(int(max(top, upper)), int(min(bottom, lower)) + 1):
        left, right = np.inf, -np.inf
        rest0, rest1 = r0 * r0 - (row - v0) * (row - v0), r1 * r1 - (row - v1) * (row - v1)
        if rest0 > 0.0:
            half = sqrt(rest0)
            left, right = u0 - half, u0 + half
        if rest1 > 0.0:
            half = sqrt(rest1)
            left, right = min(left, u1 - half), max(right, u1 + half)
        if (a_v - row) * (b_v - row) < 0.0:
            cut = u0 + across_u * r0 + (row - a_v) * ab
            left, right = min(left, cut), max(right, cut)
        if (c_v - row) * (d_v - row) < 0.0:
            cut = u0 - across_u * r0 + (row - c_v) * cd
            left, right = min(left, cut), max(right, cut)
        first, last = int(max(left + 0.5, west)), int(min(right + 0.5, east + 0.5))
        if not left <= right or last < first:
            continue
        line, at = np.uint64(row), np.uint64(row * width)  # unsigned: none counts from the end
        for k in range(np.uint64(first), np.uint64(last + 1)):
            pixels[line, k] = np.uint8(level + noise[at + k])


class Silhouettes:
    """Arm and hand of a world as capsules.

    Attributes:
        capsules: As in the module's table; brought up to date by ``update``.
    """

    def __init__(self, model: mujoco.MjModel, data: mujoco.MjData) -> None:
        """Find the shapes of arm and hand."""
        own = np.flatnonzero((model.geom_contype & (ARM | HAND)) != 0)
        self._which = own.astype(np.float64)
        self._sizes = np.array([_size(model, int(g)) for g in own]).reshape(len(own), 3)
        self._pos, self._mat = data.geom_xpos, data.geom_xmat
        self.capsules = np.zeros((len(own), 7))

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
