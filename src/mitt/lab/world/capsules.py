"""Arm and hand as capsules, and how they are painted: a smooth edge, a lit side, a grain.

A capsule's outline is taken as the hull of two discs, one at each end. It does not smear: what
matters is what it hides and where it is dark or bright beside the ball.

| here     | meaning                                                            | unit   | shape  |
|----------|--------------------------------------------------------------------|--------|--------|
| canvas   | an image without noise                                             | levels | (h, w) |
| capsules | both ends of the axis in the world, the radius, 1 for the hand's   | m      | (k, 8) |
| seen     | ends and radius of one of them in the optical frame                | m      | 7      |
| camera   | rotation by rows, centre, f_px, cu, cv, as in                      | m      | 15     |
|          | :mod:`mitt.core.eyes.triangulation`                              | px     |        |
| lens     | f_px, cu, cv                                                       | px     | 3      |
| window   | first and last row, first and last column that are drawn           | px     | 4      |

What has a number for a shape is a tuple.
"""

from math import floor, sqrt
from typing import NamedTuple, TypeAlias

import mujoco
import numpy as np
from numpy.typing import NDArray

from mitt.core.kernels import kernel
from mitt.core.signals import Array
from mitt.lab.world.engine import owned
from mitt.lab.world.hand_bodies import ARM, HAND

Canvas: TypeAlias = NDArray[np.float32]
Camera: TypeAlias = tuple[float, ...]
Seen: TypeAlias = tuple[float, float, float, float, float, float, float]
Point: TypeAlias = tuple[float, float, float]
Edges: TypeAlias = tuple[int, int, int, int]

#: Nearer to the lens than this nothing is drawn [m]: there the projection has no end.
_NEAR = 0.05
#: Direction in the image, right and down, from which arm and hand are lit: the upper left.
_LIT_FROM = -0.6, -0.8
#: Half a period of the grain of arm and hand [px]; a choice of this project.
_GRAIN_SIZE = 5.0


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
def capsule_in_view(camera: Camera, capsules: Array, k: int) -> tuple[bool, Seen]:
    """Return a capsule in the optical frame, cut off near the lens; False if none of it is ahead.

    Args:
        camera: Where it is seen from.
        capsules: All of them.
        k: Which one.
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

    For the arguments see the module's table.
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
def _wave(x: float) -> float:
    """Return a triangle wave of period 2 between -1 and 1."""
    return 2.0 * abs(x - 2.0 * floor(0.5 * x + 0.5)) - 1.0


@kernel
def _beside(
    u0: float, v0: float, du: float, dv: float, length: float, reach: float, row: int
) -> tuple[float, float]:
    """Return first and last column that may be within reach of a segment in a row."""
    begin, end = 0.0, length
    if abs(dv) > 1e-6:
        a, b = (row - reach - v0) / dv, (row + reach - v0) / dv
        begin, end = min(max(min(a, b), 0.0), length), min(max(a, b, 0.0), length)
    a, b = u0 + begin * du, u0 + end * du
    return min(a, b) - reach, max(a, b) + reach


@kernel
def paint_capsule(
    canvas: Canvas, lens: Point, seen: Seen, level: float, style: Point, window: Edges
) -> None:
    """Paint the hull of two discs with a smooth edge, a lit side and a grain.

    Args:
        canvas: Overwritten where the capsule is.
        lens: As in the module's table, as are ``seen`` and ``window``.
        seen: The capsule.
        level: Its grey level.
        style: Relative shading, relative grain and phase of the grain [1].
        window: What is drawn.
    """
    f0, f1 = lens[0] / seen[2], lens[0] / seen[5]
    u0, v0, r0 = lens[1] + f0 * seen[0], lens[2] + f0 * seen[1], f0 * seen[6]
    u1, v1, r1 = lens[1] + f1 * seen[3], lens[2] + f1 * seen[4], f1 * seen[6]
    if r0 < r1:
        u0, v0, r0, u1, v1, r1 = u1, v1, r1, u0, v0, r0
    du, dv = u1 - u0, v1 - v0
    length = sqrt(du * du + dv * dv)
    if length <= r0 - r1 + 1e-6:
        length, du, dv = 0.0, 0.0, 1.0
    else:
        du, dv = du / length, dv / length
    lean = (r0 - r1) / length if length > 0.0 else 0.0
    rise = sqrt(max(1.0 - lean * lean, 0.0))
    top, bottom = min(v0 - r0, v1 - r1) - 1.0, max(v0 + r0, v1 + r1) + 1.0
    west, east = min(u0 - r0, u1 - r1) - 1.0, max(u0 + r0, u1 + r1) + 1.0
    if length == 0.0:
        top, bottom, west, east = v0 - r0 - 1.0, v0 + r0 + 1.0, u0 - r0 - 1.0, u0 + r0 + 1.0
    first, last = int(max(top, float(window[0]))), int(min(bottom, float(window[1])))
    left, right = int(max(west, float(window[2]))), int(min(east, float(window[3])))
    plain, bare = style[0] == 0.0 and style[1] == 0.0, min(max(level, 0.0), 255.0)
    for v in range(first, last + 1):
        near, far = _beside(u0, v0, du, dv, length, r0 + 1.0, v)
        begin, end = int(max(near, float(left))), int(min(far, float(right)))
        for k in range(begin, end + 1):
            line, u = np.uint64(v), np.uint64(k)  # none counts from the end
            x, y = k - u0, v - v0
            along, aside = x * du + y * dv, x * dv - y * du
            across = abs(aside)
            at = rise * along - lean * across
            if at <= 0.0:
                cover, r = r0 - sqrt(x * x + y * y), r0
            elif at >= rise * length:
                x, y = k - u1, v - v1
                cover, r = r1 - sqrt(x * x + y * y), r1
            else:
                cover, r = r0 - rise * across - lean * along, r0 + (r1 - r0) * along / length
                x, y = aside * dv, -aside * du
            cover = min(max(cover + 0.5, 0.0), 1.0)
            if not cover > 0.0:
                continue
            paint = bare
            if not plain:
                lit = (x * _LIT_FROM[0] + y * _LIT_FROM[1]) / max(r, 0.5)
                grain = _wave(along / _GRAIN_SIZE + style[2]) * _wave(aside / _GRAIN_SIZE)
                paint = level * (1.0 + style[0] * lit + style[1] * grain)
                paint = min(max(paint, 0.0), 255.0)
            canvas[line, u] += np.float32(cover * (paint - canvas[line, u]))


class Body(NamedTuple):
    """Arm and hand as MuJoCo moves them, and as k capsules.

    Attributes:
        pos: Centres of all geoms [m], shape (g, 3).
        mat: Their axes, shape (g, 9).
        geom: The geom of each capsule, shape (k,).
        axis: Which of its axes the capsule has, shape (k,).
        half: Half the length of the capsule's axis [m], shape (k,).
        radius: Its radius [m], shape (k,).
        hand: 1 for a part of the hand, else 0, shape (k,).
        capsules: As in the module's table.
    """

    pos: Array
    mat: Array
    geom: NDArray[np.int64]
    axis: NDArray[np.int64]
    half: Array
    radius: Array
    hand: Array
    capsules: Array


@kernel
def lay_capsules(body: Body, capsules: Array) -> None:
    """Write where the capsules of a body are, as in the module's table."""
    for k in range(capsules.shape[0]):
        g, axis = body.geom[k], body.axis[k]
        for i in range(3):
            half = body.half[k] * body.mat[g, 3 * i + axis]
            capsules[k, i], capsules[k, 3 + i] = body.pos[g, i] - half, body.pos[g, i] + half
        capsules[k, 6], capsules[k, 7] = body.radius[k], body.hand[k]


def body_of(model: mujoco.MjModel, data: mujoco.MjData) -> Body:
    """Return arm and hand of a simulation, whose memory they show."""
    own = np.flatnonzero((model.geom_contype & (ARM | HAND)) != 0)
    hand = (model.geom_contype[own] & HAND) != 0
    sizes = np.array([_size(model, int(g)) for g in own]).reshape(len(own), 3)
    owner = model, data
    return Body(
        pos=owned(owner, data.geom_xpos),
        mat=owned(owner, data.geom_xmat),
        geom=own.astype(np.int64),
        axis=sizes[:, 2].astype(np.int64),
        half=sizes[:, 1].copy(),
        radius=sizes[:, 0].copy(),
        hand=hand.astype(np.float64),
        capsules=np.zeros((len(own), 8)),
    )


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
