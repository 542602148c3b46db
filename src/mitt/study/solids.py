"""Triangle meshes of the round shapes that a scene consists of: capsules, cylinders, spheres."""

from typing import NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from mitt.signals import Array

#: Corners around the axis, and steps from the equator of a dome to its pole.
_AROUND, _DOME = 20, 5


class Mesh(NamedTuple):
    """A mesh: corners [m], shape (v, 3), and triangles of their indices, shape (f, 3)."""

    vertices: Array
    faces: NDArray[np.uint32]


def turned(profile: Array) -> Mesh:
    """Return the solid that a profile of radius and height, shape (k, 2), makes about z."""
    angle = np.linspace(0.0, 2.0 * np.pi, _AROUND, endpoint=False)
    r, z = profile.T
    ring = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    sides = np.concatenate(
        [r[:, None, None] * ring, np.broadcast_to(z[:, None, None], (len(r), _AROUND, 1))], axis=-1
    )
    low = np.arange((len(r) - 1) * _AROUND).reshape(-1, _AROUND)
    right = np.roll(low, -1, axis=1)
    quads = np.stack([low, right, right + _AROUND, low + _AROUND], axis=-1).reshape(-1, 4)
    faces = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
    return Mesh(sides.reshape(-1, 3), faces.astype(np.uint32))


def capsule(radius: float, half: float) -> Mesh:
    """Return a capsule along z with so long a straight part to either side [m]."""
    dome = np.linspace(0.0, np.pi / 2, _DOME + 1)
    upper = np.column_stack([radius * np.cos(dome), half + radius * np.sin(dome)])
    lower = upper[::-1] * (1.0, -1.0)
    return turned(
        np.concatenate([lower, upper]) if half > 0.0 else np.concatenate([lower, upper[1:]])
    )


def cylinder(radius: float, half: float) -> Mesh:
    """Return a cylinder along z; its edges are doubled, so that they shade as edges."""
    rim = np.array([(0.0, -half), (radius, -half), (radius, -half), (radius, half), (radius, half),
                    (0.0, half)])  # fmt: skip
    return turned(rim)


def placed(mesh: Mesh, R: Array, p: Array) -> Mesh:
    """Return a mesh turned by R, shape (3, 3), and moved by p [m], shape (3,)."""
    return Mesh(mesh.vertices @ R.T + p, mesh.faces)


def joined(meshes: list[Mesh]) -> Mesh:
    """Return several meshes as one."""
    starts = np.cumsum([0, *(len(m.vertices) for m in meshes[:-1])]).astype(np.uint32)
    return Mesh(
        np.concatenate([m.vertices for m in meshes]),
        np.concatenate([m.faces + start for m, start in zip(meshes, starts, strict=True)]),
    )


def rod(start: Array, end: Array, radius: float) -> Mesh:
    """Return a capsule from one point to another."""
    along = end - start
    length = float(np.linalg.norm(along))
    return placed(capsule(radius, 0.5 * length), towards(along / length), 0.5 * (start + end))


def towards(axis: Array) -> Array:
    """Return a rotation that takes z to a unit axis, shape (3, 3)."""
    helper = np.eye(3)[int(np.argmin(np.abs(axis)))]
    x = np.cross(helper, axis)
    x /= np.linalg.norm(x)
    return np.column_stack((x, np.cross(axis, x), axis))


def of_geom(model: mujoco.MjModel, g: int) -> Mesh | None:
    """Return a geom's mesh in the frame of its body; None for shapes that are not round."""
    size, kind = model.geom_size[g], int(model.geom_type[g])
    if kind in (int(mujoco.mjtGeom.mjGEOM_CAPSULE), int(mujoco.mjtGeom.mjGEOM_SPHERE)):
        flat = kind == int(mujoco.mjtGeom.mjGEOM_SPHERE)
        mesh = capsule(float(size[0]), 0.0 if flat else float(size[1]))
    elif kind == int(mujoco.mjtGeom.mjGEOM_CYLINDER):
        mesh = cylinder(float(size[0]), float(size[1]))
    else:
        return None
    R = np.zeros(9)
    mujoco.mju_quat2Mat(R, model.geom_quat[g])
    return placed(mesh, R.reshape(3, 3), model.geom_pos[g])
