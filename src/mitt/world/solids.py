"""Where a ray meets a simple solid, exactly, and the normal there.

| here     | meaning                                                         | shape     |
|----------|-----------------------------------------------------------------|-----------|
| ``kind`` | SPHERE, CAPSULE, CYLINDER or BOX                                | (k,)      |
| ``pos``  | centre, world frame [m]                                         | (k, 3)    |
| ``mat``  | world from solid                                                | (k, 3, 3) |
| ``size`` | radius and half length along z, or half edges [m]               | (k, 3)    |
| ``rgb``  | colour, linear light                                            | (k, 3)    |
| ``reach``| radius of a ball around the solid [m]                           | (k,)      |
| ``boxes``| bound on the image: left, right, top, bottom [px]               | (k, 4)    |
"""

from math import sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mitt.jit import kernel
from mitt.signals import Array

SPHERE, CAPSULE, CYLINDER, BOX = 0, 1, 2, 3

#: A ray that meets nothing goes so far [m]; nothing nearer than the second counts as met [m].
FAR, NEAR = 1e9, 1e-4


class Solids(NamedTuple):
    """What is drawn; see the module's table."""

    kind: NDArray[np.int64]
    pos: Array
    mat: Array
    size: Array
    rgb: Array
    reach: Array
    boxes: Array


@kernel
def _round_part(
    r: float, h: float, ox: float, oy: float, oz: float, dx: float, dy: float, dz: float, cap: bool
) -> tuple[float, float, float, float]:
    """Meet a cylinder's wall, and its round caps where ``cap``: distance and normal."""
    best, nx, ny, nz = FAR, 0.0, 0.0, 0.0
    a, b, c = dx * dx + dy * dy, ox * dx + oy * dy, ox * ox + oy * oy - r * r
    if a > 1e-12 and b * b - a * c > 0.0:
        t = (-b - sqrt(b * b - a * c)) / a
        if t > NEAR and abs(oz + t * dz) <= h:
            best, nx, ny, nz = t, (ox + t * dx) / r, (oy + t * dy) / r, 0.0
    if cap:
        for side in (-1.0, 1.0):
            z = oz - side * h
            b, c = ox * dx + oy * dy + z * dz, ox * ox + oy * oy + z * z - r * r
            if b * b - c > 0.0:
                t = -b - sqrt(b * b - c)
                if NEAR < t < best:
                    best = t
                    nx, ny, nz = (ox + t * dx) / r, (oy + t * dy) / r, (z + t * dz) / r
    return best, nx, ny, nz


@kernel
def _flat_caps(
    r: float, h: float, ox: float, oy: float, oz: float, dx: float, dy: float, dz: float
) -> tuple[float, float]:
    """Meet a cylinder's flat ends: distance and the normal's z."""
    if abs(dz) < 1e-12:
        return FAR, 0.0
    side = -1.0 if dz > 0.0 else 1.0
    t = (side * h - oz) / dz
    x, y = ox + t * dx, oy + t * dy
    return (t, side) if t > NEAR and x * x + y * y <= r * r else (FAR, 0.0)


@kernel
def _box(
    size: Array, ox: float, oy: float, oz: float, dx: float, dy: float, dz: float
) -> tuple[float, float, float, float]:
    """Meet a box: distance and normal."""
    enter, leave, axis, sign = -FAR, FAR, 0, 1.0
    for i in range(3):
        o, d = (ox, dx) if i == 0 else ((oy, dy) if i == 1 else (oz, dz))
        if abs(d) < 1e-12:
            if abs(o) > size[i]:
                return FAR, 0.0, 0.0, 0.0
            continue
        side = -1.0 if d > 0.0 else 1.0
        near, far = (side * size[i] - o) / d, (-side * size[i] - o) / d
        if near > enter:
            enter, axis, sign = near, i, side
        leave = min(leave, far)
    if enter > leave or enter < NEAR:
        return FAR, 0.0, 0.0, 0.0
    return (
        enter,
        sign if axis == 0 else 0.0,
        sign if axis == 1 else 0.0,
        sign if axis == 2 else 0.0,
    )


@kernel
def meet(solids: Solids, k: int, eye: Array, ray: Array, normal: Array) -> float:
    """Return the distance at which a ray meets a solid [m], and write the world normal there.

    Args:
        solids: The solids.
        k: Which of them.
        eye: Start of the ray [m], shape (3,).
        ray: Its unit direction, shape (3,).
        normal: Result, unit normal, shape (3,).
    """
    kind, size, pos, mat = solids.kind[k], solids.size[k], solids.pos[k], solids.mat[k]
    px, py, pz = eye[0] - pos[0], eye[1] - pos[1], eye[2] - pos[2]
    ox = mat[0, 0] * px + mat[1, 0] * py + mat[2, 0] * pz
    oy = mat[0, 1] * px + mat[1, 1] * py + mat[2, 1] * pz
    oz = mat[0, 2] * px + mat[1, 2] * py + mat[2, 2] * pz
    dx = mat[0, 0] * ray[0] + mat[1, 0] * ray[1] + mat[2, 0] * ray[2]
    dy = mat[0, 1] * ray[0] + mat[1, 1] * ray[1] + mat[2, 1] * ray[2]
    dz = mat[0, 2] * ray[0] + mat[1, 2] * ray[1] + mat[2, 2] * ray[2]
    if kind == BOX:
        t, x, y, z = _box(size, ox, oy, oz, dx, dy, dz)
    else:
        h = 0.0 if kind == SPHERE else size[1]
        t, x, y, z = _round_part(size[0], h, ox, oy, oz, dx, dy, dz, kind != CYLINDER)
        if kind == CYLINDER:
            end, side = _flat_caps(size[0], h, ox, oy, oz, dx, dy, dz)
            if end < t:
                t, x, y, z = end, 0.0, 0.0, side
    for i in range(3):
        normal[i] = mat[i, 0] * x + mat[i, 1] * y + mat[i, 2] * z
    return float(t)


@kernel
def shades(solids: Solids, point: Array, sun: Array, normal: Array) -> bool:
    """Tell whether a solid stands between a point [m], shape (3,), and the sun, shape (3,)."""
    for k in range(solids.kind.shape[0]):
        reach = solids.reach[k]
        x, y, z = (
            solids.pos[k, 0] - point[0],
            solids.pos[k, 1] - point[1],
            solids.pos[k, 2] - point[2],
        )
        along = x * sun[0] + y * sun[1] + z * sun[2]
        off = x * x + y * y + z * z - along * along
        if along < -reach or off > reach * reach:
            continue
        if meet(solids, k, point, sun, normal) < FAR:
            return True
    return False
