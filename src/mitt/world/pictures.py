"""Pictures of the world, drawn in software: the machine needs neither GL nor a display."""

from dataclasses import dataclass
from typing import NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from mitt.signals import Array, Image
from mitt.world.hand import ARM
from mitt.world.raycast import Lens, render
from mitt.world.solids import BOX, CAPSULE, CYLINDER, SPHERE, Solids

_KINDS = {
    int(mujoco.mjtGeom.mjGEOM_SPHERE): SPHERE,
    int(mujoco.mjtGeom.mjGEOM_CAPSULE): CAPSULE,
    int(mujoco.mjtGeom.mjGEOM_CYLINDER): CYLINDER,
    int(mujoco.mjtGeom.mjGEOM_BOX): BOX,
}

#: Joint housings and the stand, which are drawn but touch nothing: radius, half length [m].
_HOUSING, _STAND, _FOOT = (0.052, 0.062), 0.07, (0.20, 0.012)
_DARK, _ORANGE = (0.045, 0.05, 0.06), (0.95, 0.22, 0.02)
_TRAIL_RADIUS = 0.011
_SAMPLES = 3


@dataclass(frozen=True, slots=True, kw_only=True)
class View:
    """Where a picture is taken from.

    Attributes:
        eye: Position of the camera [m].
        target: Point in the middle of the picture [m].
        width: Width of the picture [px].
        height: Height of the picture [px].
        field_deg: Angle from top to bottom of the picture [deg].
    """

    eye: tuple[float, float, float] = (1.35, -3.2, 0.5)
    target: tuple[float, float, float] = (0.62, 0.0, 0.08)
    width: int = 300
    height: int = 300
    field_deg: float = 29.0

    def axes(self) -> Array:
        """Return the camera's axes right, down and forward as rows, shape (3, 3)."""
        forward = np.array(self.target) - np.array(self.eye)
        forward /= np.linalg.norm(forward)
        right = np.cross(forward, (0.0, 0.0, 1.0))
        right /= np.linalg.norm(right)
        return np.array([right, np.cross(forward, right), forward])

    @property
    def focal(self) -> float:
        """Focal length [px]."""
        return float(0.5 * self.height / np.tan(0.5 * np.deg2rad(self.field_deg)))


def picture(model: mujoco.MjModel, qpos: Array, view: View, *, trail: Array | None = None) -> Image:
    """Draw the world in one state.

    Args:
        model: Compiled scene of a :class:`~mitt.world.simulation.World`.
        qpos: State of the whole plant, shape (nq,).
        view: Where the picture is taken from.
        trail: Earlier positions of the ball, drawn as dots [m], shape (k, 3).

    Returns:
        Image, shape (height, width, 3).
    """
    data = mujoco.MjData(model)
    data.qpos[:] = qpos
    mujoco.mj_kinematics(model, data)
    floor = float(data.geom_xpos[model.geom("floor").id, 2])
    parts = [_geoms(model, data), _housings(model, data, floor), _dots(trail)]
    image = np.empty((view.height, view.width, 3), dtype=np.uint8)
    lens = Lens(np.array(view.eye), view.axes(), view.focal)
    render(image, lens, _table(parts, view), floor, _SAMPLES)
    return image


def strip(
    model: mujoco.MjModel,
    states: Array,
    view: View,
    *,
    columns: int = 6,
    trail: Array | None = None,
) -> Image:
    """Draw a row of states, as the paper's fig. 12 does every 33 ms.

    Args:
        model: Compiled scene.
        states: States of the whole plant in the order of time, shape (k, nq).
        view: Where the pictures are taken from.
        columns: Pictures in a row; further ones go below.
        trail: Positions of the ball before each state, shape (k, m, 3).

    Returns:
        All pictures with white gaps between them, shape (rows height, columns width, 3).
    """
    gap = 4
    rows = -(-len(states) // columns)
    shape = (rows * (view.height + gap) - gap, columns * (view.width + gap) - gap, 3)
    sheet = np.full(shape, 255, dtype=np.uint8)
    for k, qpos in enumerate(states):
        top, left = (k // columns) * (view.height + gap), (k % columns) * (view.width + gap)
        dots = None if trail is None else trail[k]
        sheet[top : top + view.height, left : left + view.width] = picture(
            model, qpos, view, trail=dots
        )
    return sheet


class _Part(NamedTuple):
    """Some solids: kind, pos, mat, size and rgb of their table."""

    kind: NDArray[np.int64]
    pos: Array
    mat: Array
    size: Array
    rgb: Array


def _geoms(model: mujoco.MjModel, data: mujoco.MjData) -> _Part:
    """Return the geoms of the scene except the floor."""
    drawn = [g for g in range(model.ngeom) if int(model.geom_type[g]) in _KINDS]
    return _Part(
        kind=np.array([_KINDS[int(model.geom_type[g])] for g in drawn], dtype=np.int64),
        pos=data.geom_xpos[drawn],
        mat=data.geom_xmat[drawn].reshape(-1, 3, 3),
        size=model.geom_size[drawn],
        rgb=model.geom_rgba[drawn, :3].astype(np.float64) ** 2.2,
    )


def _housings(model: mujoco.MjModel, data: mujoco.MjData, floor: float) -> _Part:
    """Return a drum at each joint of the arm, and the stand below its base."""
    bodies = set(model.geom_bodyid[model.geom_contype == ARM])
    bodies |= {model.body_parentid[b] for b in bodies}
    joints = [j for j in range(model.njnt) if model.jnt_bodyid[j] in bodies]
    x, y, top = data.xanchor[joints[0]] if joints else np.zeros(3)
    half = 0.5 * (top - floor)
    parts = [(data.xanchor[j], _turned(data.xaxis[j]), (*_HOUSING, 0.0)) for j in joints]
    parts.append((np.array([x, y, floor + half]), np.eye(3), (_STAND, half, 0.0)))
    parts.append((np.array([x, y, floor + _FOOT[1]]), np.eye(3), (*_FOOT, 0.0)))
    return _Part(
        kind=np.full(len(parts), CYLINDER, dtype=np.int64),
        pos=np.array([p for p, _, _ in parts]),
        mat=np.array([m for _, m, _ in parts]),
        size=np.array([s for _, _, s in parts]),
        rgb=np.tile(_DARK, (len(parts), 1)),
    )


def _dots(trail: Array | None) -> _Part:
    """Return small balls along the way of the ball."""
    points = np.zeros((0, 3)) if trail is None else np.asarray(trail, float).reshape(-1, 3)
    count = len(points)
    return _Part(
        kind=np.full(count, SPHERE, dtype=np.int64),
        pos=points,
        mat=np.tile(np.eye(3), (count, 1, 1)),
        size=np.tile((_TRAIL_RADIUS, 0.0, 0.0), (count, 1)),
        rgb=np.tile(_ORANGE, (count, 1)),
    )


def _table(parts: list[_Part], view: View) -> Solids:
    """Return all solids in one table, with their bounds."""
    kind, pos, mat, size, rgb = (
        np.ascontiguousarray(np.concatenate(column)) for column in zip(*parts, strict=True)
    )
    r, h = size[:, 0], size[:, 1]
    reach = np.choose(kind, [r, r + h, np.hypot(r, h), np.linalg.norm(size, axis=1)])
    return Solids(kind, pos, mat, size, rgb, reach, _bounds(pos, reach, view))


def _turned(axis: Array) -> Array:
    """Return a rotation that takes z to ``axis``, shape (3, 3)."""
    helper = np.eye(3)[int(np.argmin(np.abs(axis)))]
    x = np.cross(helper, axis)
    x /= np.linalg.norm(x)
    return np.column_stack((x, np.cross(axis, x), axis))


def _bounds(pos: Array, reach: Array, view: View) -> Array:
    """Return left, right, top and bottom of each solid on the image [px], shape (k, 4)."""
    local = (pos - np.array(view.eye)) @ view.axes().T
    bounds = np.empty((len(pos), 4))
    near = local[:, 2] - reach
    ahead = near > 1e-3
    depth = np.where(ahead, near, 1.0)
    for axis, extent in ((0, view.width), (1, view.height)):
        centre = 0.5 * (extent - 1)
        low, high = local[:, axis] - reach, local[:, axis] + reach
        # A corner of the box around the ball is furthest out at its near or its far side.
        far = np.maximum(local[:, 2] + reach, 1e-3)
        edge_low = np.minimum(low / depth, low / far) * view.focal + centre - 1.0
        edge_high = np.maximum(high / depth, high / far) * view.focal + centre + 1.0
        bounds[:, 2 * axis] = np.where(ahead, edge_low, -np.inf)
        bounds[:, 2 * axis + 1] = np.where(ahead, edge_high, np.inf)
    bounds[local[:, 2] + reach < 0.0] = (np.inf, -np.inf, np.inf, -np.inf)
    return bounds
