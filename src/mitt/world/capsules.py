"""Arm and hand as capsules, and their outlines in an image.

A capsule's outline is taken as the hull of two discs, one at each end; edges are not smoothed and
do not smear: what matters is what they hide and where they are dark or bright beside the ball.

| here     | meaning                                                            | unit | shape  |
|----------|--------------------------------------------------------------------|------|--------|
| capsules | both ends of the axis in the world, then the radius                | m    | (k, 7) |
| seen     | one of them in the optical frame                                   | m    | 7      |
| camera   | rotation by rows, centre, f_px, cu, cv, as in                      | m    | 15     |
|          | :mod:`mitt.vision.triangulation`                                   | px   |        |
| window   | first and last row, first and last column that are drawn           | px   | 4      |

What has a number for a shape is a tuple.
"""

from math import sqrt
from typing import TypeAlias

import mujoco
import numpy as np

from mitt.jit import kernel
from mitt.signals import Array, Image
from mitt.world.engine import owned
from mitt.world.hand import ARM, HAND

Camera: TypeAlias = tuple[float, ...]
Seen: TypeAlias = tuple[float, float, float, float, float, float, float]
Point: TypeAlias = tuple[float, float, float]
Edges: TypeAlias = tuple[int, int, int, int]

_NEAR = 0.05


@kernel
def into(camera: Camera, x: float, y: float, z: float) -> Point:
    """Return a point of the world [m] in the optical frame [m]."""
    x, y, z = x - camera[9], y - camera[10], z - camera[11]
    return (
        camera[0] * x + camera[3] * y + camera[6] * z,
        camera[1] * x + camera[4] * y + camera[7] * z,
        camera[2] * x + camera[5] * y + camera[8] * z,
    )


@kernel
def seen_from(camera: Camera, capsules: Array, k: int) -> tuple[bool, Seen]:
    """Return a capsule in the optical frame, cut off near the lens; False if none of it is ahead.

    Args:
        camera: As in the module's table.
        capsules: As in the module's table.
        k: Which of them.
    """
    ax, ay, az = into(camera, capsules[k, 0], capsules[k, 1], capsules[k, 2])
    bx, by, bz = into(camera, capsules[k, 3], capsules[k, 4], capsules[k, 5])
    ahead = max(az, bz) > _NEAR
    if ahead and az < _NEAR:
        share = (_NEAR - az) / (bz - az)
        ax, ay, az = ax + share * (bx - ax), ay + share * (by - ay), az + share * (bz - az)
    elif ahead and bz < _NEAR:
        share = (_NEAR - bz) / (az - bz)
        bx, by, bz = bx + share * (ax - bx), by + share * (ay - by), bz + share * (az - bz)
    return ahead, (ax, ay, az, bx, by, bz, capsules[k, 6])


@kernel
def in_front(seen: Seen, point: Point) -> bool:
    """Tell whether the part of a capsule nearest to a point is nearer to the lens than the point.

    Args:
        seen: A capsule, as in the module's table.
        point: Point in the optical frame [m].
    """
    ax, ay, az = seen[3] - seen[0], seen[4] - seen[1], seen[5] - seen[2]
    x, y, z = point[0] - seen[0], point[1] - seen[1], point[2] - seen[2]
    along = ax * x + ay * y + az * z
    share = min(max(along / max(ax * ax + ay * ay + az * az, 1e-12), 0.0), 1.0)
    return bool(seen[2] + share * az < point[2])


@kernel
def misses(lens: Point, seen: Seen, window: Edges) -> bool:
    """Tell, without a division, whether a capsule is more than a pixel beyond a window.

    Args:
        lens: f_px, cu, cv [px].
        seen: A capsule, as in the module's table.
        window: As in the module's table.
    """
    (f, cu, cv), (x0, y0, z0, x1, y1, z1, r) = lens, seen
    up, down = window[0] - 1 - cv, window[1] + 1 - cv
    west, east = window[2] - 2 - cu, window[3] + 2 - cu
    return bool(
        ((f * (y0 + r) < up * z0) & (f * (y1 + r) < up * z1))
        | ((f * (y0 - r) > down * z0) & (f * (y1 - r) > down * z1))
        | ((f * (x0 + r) < west * z0) & (f * (x1 + r) < west * z1))
        | ((f * (x0 - r) > east * z0) & (f * (x1 - r) > east * z1))
    )


@kernel
def draw_capsule(
    pixels: Image, lens: Point, seen: Seen, level: int, noise: Image, start: int, window: Edges
) -> None:
    """Draw the outline of a capsule.

    Args:
        pixels: Image, overwritten where the capsule is, shape (height, width).
        lens: f_px, cu, cv [px].
        seen: The capsule, as in the module's table.
        level: Its grey level.
        noise: Noise of the sensor [grey levels], modulo 256, shape (n,).
        start: Where in it the image begins, which takes one number a pixel.
        window: As in the module's table.
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
        # Unsigned: none counts from the end.
        line, at = np.uint64(row), np.uint64(start + row * width)
        for k in range(np.uint64(first), np.uint64(last + 1)):
            pixels[line, k] = np.uint8(level + noise[at + k])


@kernel
def draw_body(
    pixels: Image, camera: Camera, capsules: Array, level: int, noise: Image, start: int,
    window: Edges, ball: Point, nearer: bool,
) -> int:  # fmt: skip
    """Draw the capsules that are behind the ball, or those that are nearer than it.

    Camera, capsules and window as in the module's table, the rest as for :func:`draw_capsule`.
    ``ball`` is the ball's centre in the optical frame [m]; its depth is -inf where there is none.

    Returns:
        How many others may be seen in the window.
    """
    others, lens = 0, (camera[12], camera[13], camera[14])
    for k in range(capsules.shape[0]):
        ahead, seen = seen_from(camera, capsules, k)
        if not ahead or misses(lens, seen, window):
            continue
        if in_front(seen, ball) == nearer:
            draw_capsule(pixels, lens, seen, level, noise, start, window)
        else:
            others += 1
    return others


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
    sphere = kind == mujoco.mjtGeom.mjGEOM_SPHERE
    return float(size[0] if sphere else model.geom_rbound[geom]), 0.0, 2.0
