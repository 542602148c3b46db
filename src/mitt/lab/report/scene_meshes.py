"""What a scene looks like: the arm as a line, and triangle meshes of all that it consists of.

The line goes from shoulder to catch point. A link leaves its joint along the joint's own axis and
turns off at a right angle where the next joint is off that axis; the last one arrives along the
palm's normal. So the WAM's elbow shows both of its 45 mm offsets.
"""

from itertools import pairwise
from typing import TypeAlias

import mujoco
import numpy as np
import trimesh
from trimesh import Trimesh

from mitt.core.arm.arm import Arm
from mitt.core.arm.description import ArmModel, Capsule, joint_motion, mounting
from mitt.core.signals import Array
from mitt.io.meshes import hull_faces
from mitt.lab.world.scene import Scene


def bones(model: ArmModel) -> list[Array]:
    """Return the corners of the line in the frame of each link [m], shape (k, 3) each, k >= 1."""
    out = []
    for link, after in zip(model.links, (*model.links[1:], None), strict=True):
        if after is not None:
            end = after.placement[:3, 3]
            corners = [np.zeros(3), link.axis * (link.axis @ end), end]
        else:
            plate = model.tool @ np.linalg.inv(mounting(model.hand)[1])
            end, normal = plate[:3, 3], plate[:3, 2]
            corners = [np.zeros(3), end - normal * (normal @ end), end, model.catch_point]
        out.append(_distinct(np.array(corners)))
    return out


def frames(model: ArmModel, q: Array) -> Array:
    """Return T_world_link of every link, shape (N, 4, 4), for q of the active joints (n,)."""
    T, active, out = model.mount, iter(q), []
    for link in model.links:
        value = float(next(active)) if link.held is None else link.held
        T = T @ link.placement @ joint_motion(link, value)
        out.append(T)
    return np.array(out)


def skeleton(model: ArmModel, q: Array) -> Array:
    """Return the corners of the line in the world [m], shape (k, 3), for q (n,)."""
    parts = zip(bones(model), frames(model, q), strict=True)
    return _distinct(np.concatenate([points @ T[:3, :3].T + T[:3, 3] for points, T in parts]))


def _distinct(points: Array) -> Array:
    """Return points without those less than 0.1 mm from the one before, shape (k, 3)."""
    steps = np.linalg.norm(np.diff(points, axis=0), axis=1)
    out: Array = points[np.concatenate(([True], steps > 1e-4))]
    return out


Colour: TypeAlias = tuple[int, int, int]
"""Red, green, blue, 0 to 255."""

#: Corners around the axis of a round shape, and of one as thin as a finger, radius so small [m].
_AROUND = 24
_AROUND_THIN = 12
_THIN = 0.015
METAL = (214, 218, 224)
DARK = (92, 100, 112)
FINGER = (150, 158, 170)
BALL = (213, 94, 0)
"""Colours of links, joints, fingers and ball."""


def body_meshes(
    model: mujoco.MjModel, body: int, arm: Arm, scene: Scene
) -> list[tuple[Trimesh, Colour]]:
    """Return the meshes of a body of the plant in its own frame, one a colour."""
    name = model.body(body).name
    by_colour: dict[Colour, list[Trimesh]] = {DARK: _extras(arm, scene, name)}
    for g in np.flatnonzero(model.geom_bodyid == body):
        mesh = geom_mesh(model, int(g))
        if mesh is None:
            continue
        geom = model.geom(int(g)).name
        if geom == "ball":
            colour = BALL
        elif geom.startswith(("finger", "cord")):
            colour = FINGER
        else:
            colour = METAL if name.startswith(("link_", "basket")) else DARK
        by_colour.setdefault(colour, []).append(mesh)
    if _has_shapes(arm.model) and name.startswith("link_") and METAL in by_colour:
        by_colour[METAL] = [_hull(trimesh.util.concatenate(by_colour[METAL]))]
    return [
        (trimesh.util.concatenate(found), colour) for colour, found in by_colour.items() if found
    ]


def _hull(mesh: Trimesh) -> Trimesh:
    """Return the convex hull of a mesh; trimesh's own asks for SciPy."""
    faces = hull_faces(np.array(mesh.vertices))
    return mesh if faces is None else Trimesh(mesh.vertices, faces)


def _holds_origin(capsule: Capsule) -> bool:
    """Say whether the origin of its frame is well inside a capsule."""
    a, b = np.array(capsule.start), np.array(capsule.end)
    along = float(np.clip(-a @ (b - a) / max((b - a) @ (b - a), 1e-12), 0.0, 1.0))
    return float(np.linalg.norm(a + along * (b - a))) < 0.3 * capsule.radius


def _has_shapes(model: ArmModel) -> bool:
    """Say whether its capsules show the arm: most links have some."""
    return 2 * sum(bool(link.capsules) for link in model.links) > len(model.links)


def geom_mesh(model: mujoco.MjModel, g: int) -> Trimesh | None:
    """Return a geom's mesh in the frame of its body; None for a plane, and other shapes."""
    size, kind = model.geom_size[g], int(model.geom_type[g])
    if kind == int(mujoco.mjtGeom.mjGEOM_SPHERE):
        mesh = sphere(float(size[0]))
    elif kind == int(mujoco.mjtGeom.mjGEOM_CAPSULE):
        mesh = capsule(float(size[0]), 2.0 * float(size[1]))
    elif kind == int(mujoco.mjtGeom.mjGEOM_CYLINDER):
        mesh = cylinder(float(size[0]), 2.0 * float(size[1]))
    elif kind == int(mujoco.mjtGeom.mjGEOM_BOX):
        mesh = trimesh.creation.box(extents=2.0 * size)
    else:
        return None
    T = trimesh.transformations.quaternion_matrix(model.geom_quat[g])
    T[:3, 3] = model.geom_pos[g]
    return mesh.apply_transform(T)


def sphere(radius: float, *, corners: int = _AROUND) -> Trimesh:
    """Return a sphere [m]."""
    return trimesh.creation.uv_sphere(radius, count=(corners // 2, corners))


def capsule(radius: float, length: float) -> Trimesh:
    """Return a capsule about z, its straight part so long [m]."""
    around = _AROUND if radius > _THIN else _AROUND_THIN
    return trimesh.creation.capsule(length, radius, count=(around // 2, around))


def cylinder(radius: float, length: float) -> Trimesh:
    """Return a cylinder about z, its edges doubled, so that they shade as edges [m]."""
    mesh = trimesh.creation.cylinder(radius, length, sections=_AROUND)
    up = np.round(mesh.face_normals[:, 2])  # 1 and -1 at the ends, 0 around
    parts = [mesh.submesh([np.flatnonzero(up == side)], append=True) for side in (-1, 0, 1)]
    return trimesh.util.concatenate(parts)


def rod(start: Array, end: Array, radius: float) -> Trimesh:
    """Return a capsule from one point to another [m], shape (3,) each."""
    along = end - start
    T = trimesh.geometry.align_vectors((0.0, 0.0, 1.0), along)
    T[:3, 3] = 0.5 * (start + end)
    return capsule(radius, float(np.linalg.norm(along))).apply_transform(T)


def _extras(arm: Arm, scene: Scene, body: str) -> list[Trimesh]:
    """Return what is only for the eye: the stand, and a band at the joint of a link [m].

    Where capsules do not show the arm, a drum at the joint, and struts along the link.
    """
    if body == "world":
        top = float(arm.model.mount[2, 3])
        if top <= scene.floor:
            return []
        stand = cylinder(0.07, top - scene.floor)
        return [stand.apply_translation((*arm.model.mount[:2, 3], 0.5 * (top + scene.floor)))]
    names = [f"link_{link.name}" for link in arm.model.links]
    if body not in names:
        return []
    k = names.index(body)
    points, link = bones(arm.model)[k], arm.model.links[k]
    turn = trimesh.geometry.align_vectors((0.0, 0.0, 1.0), link.axis)
    if _has_shapes(arm.model):
        about = [] if link.prismatic else [x.radius for x in link.capsules if _holds_origin(x)]
        return [cylinder(max(about) + 0.003, 0.016).apply_transform(turn)] if about else []
    struts = [rod(a, b, 0.028) for a, b in pairwise(points)]
    if k + 1 == len(names):
        struts = struts[:-1] or struts
    if link.prismatic or link.held is not None:
        return struts
    return [*struts, cylinder(0.052, 0.124).apply_transform(turn)]
