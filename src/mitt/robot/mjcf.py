"""MJCF files: MuJoCo resolves classes, defaults, frames and units; Pinocchio gets the result.

Read as MuJoCo Menagerie writes them: ranges and actuators by default classes, keyframes, cameras,
tendons and textures that do not matter here. MuJoCo has no limit of speed, so it stands among the
file's own numbers: ``<custom><numeric name="velocity_limit_JOINT" data="8.0"/></custom>`` [rad/s].
The elements and what they mean: the XML reference of MuJoCo's documentation.
"""

from pathlib import Path, PurePosixPath
from typing import TypeAlias

import mujoco
import numpy as np
import pinocchio as pin

from mitt import checks
from mitt.errors import FileError, MittError, ModelError, heard
from mitt.robot.description import rotation
from mitt.robot.inertia import mended_inertia
from mitt.robot.meshes import (
    Meshes,
    Missing,
    ball_points,
    box_points,
    check_place,
    cylinder_points,
    find_mesh,
    missing_notes,
)
from mitt.robot.mjcf_files import check_files
from mitt.robot.mjcf_joints import (
    BALL,
    HINGE,
    SLIDE,
    Names,
    loops_of,
    mimics_of,
    names_of,
    ranges_of,
    speeds_of,
    torques_of,
)
from mitt.robot.mjcf_left_out import file_notes, left_out_of
from mitt.robot.stated import Shape, Stated
from mitt.robot.xml_files import read_xml
from mitt.signals import GRAVITY, Array

_KEYS = {
    "range": "range", "torque": "actuatorfrcrange or forcerange",
    "speed": "the numeric velocity_limit_JOINT",
}  # fmt: skip
#: Kinds of geoms. As plain numbers: an enum of MuJoCo is not equal to a number of numpy.
_PLANE, _SPHERE, _CAPSULE, _ELLIPSOID, _CYLINDER, _BOX = (
    int(kind)
    for kind in (
        mujoco.mjtGeom.mjGEOM_PLANE,
        mujoco.mjtGeom.mjGEOM_SPHERE,
        mujoco.mjtGeom.mjGEOM_CAPSULE,
        mujoco.mjtGeom.mjGEOM_ELLIPSOID,
        mujoco.mjtGeom.mjGEOM_CYLINDER,
        mujoco.mjtGeom.mjGEOM_BOX,
    )
)
_Mesh: TypeAlias = tuple[str, Path | None, Array]
"""What a mesh is called, where it is, and its scale."""
_NONE: _Mesh = ("", None, np.ones(3))


def read_mjcf(path: Path) -> Stated:
    """Read an MJCF file.

    Raises:
        FileError: It cannot be read or compiled, or a body has no mass but that of its meshes.
    """
    path = checks.path("arm", path)
    text, root = read_xml(path, "mujoco")
    check_files(path, root)
    speed = speeds_of(path, root)
    with heard():
        m, meshes, mended = _compiled(path, text)
    names = names_of(m)
    shapes, missing = _shapes(path, m, names, meshes)
    mimics, notes = mimics_of(m, names)
    torque, unusable = torques_of(m, names)
    notes = (*mended, *notes, *file_notes(m, names))
    return Stated(
        place=str(path), model=_to_pinocchio(m, names), ranges=ranges_of(m, names),
        torque=torque, speed=speed, mimics=mimics, loops=loops_of(m, names),
        shapes=tuple(shapes), notes=(*missing_notes(path, missing), *notes), keys=_KEYS,
        left_out=left_out_of(m, names), unusable=unusable,
    )  # fmt: skip


def _compiled(path: Path, text: str) -> tuple[mujoco.MjModel, dict[str, _Mesh], tuple[str, ...]]:
    """Compile a file without what only is to be looked at; no other file is opened.

    Returns:
        The model, each mesh a tiny sphere in its place, the meshes by the names of these, and
        notes of inertias that were mended.
    """
    try:
        spec = mujoco.MjSpec.from_string(text)
        meshes: dict[str, _Mesh] = {}
        notes: list[str] = []
        for k, geom in enumerate(list(spec.geoms)):
            if geom.type == mujoco.mjtGeom.mjGEOM_HFIELD:
                notes.append(f"the height field {geom.hfieldname!r} is left out: nothing keeps the"
                             " arm off it")  # fmt: skip
                spec.delete(geom)
            elif geom.meshname:  # a mesh, or the solid that MuJoCo fits to one
                _check_weight(path, spec, geom)
                meshes[_replaced(geom, k)] = _mesh(path, spec, geom.meshname)
                geom.meshname = ""
        looks = (spec.skins, spec.meshes, spec.hfields, spec.textures, spec.materials)
        drop = (spec.pairs, spec.sensors, *looks, spec.keys)
        for element in (x for kind in drop for x in list(kind)):
            spec.delete(element)
        for element in (*spec.geoms, *spec.sites, *spec.tendons):
            element.material = ""
        notes += _mend_inertias(path, spec)
        return spec.compile(), meshes, tuple(notes)
    except MittError:
        raise
    except (ValueError, RuntimeError, TypeError) as error:
        reason = " ".join(str(error).split())[:200]
        raise FileError(str(path), "an MJCF arm", reason) from error


def _mend_inertias(path: Path, spec: mujoco.MjSpec) -> list[str]:
    """Mend the rounded inertias that bodies state, in their place, and return notes of it.

    Raises:
        ModelError: A body has a mass below 0, or moments that no body can have.
    """
    kind = spec.compiler.inertiafromgeom
    if kind == mujoco.mjtInertiaFromGeom.mjINERTIAFROMGEOM_TRUE or spec.compiler.balanceinertia:
        return []
    notes = []
    for body in spec.bodies:
        if not body.explicitinertial:
            continue
        where = f"{path} body {body.name!r}"
        if body.mass < 0.0:
            raise ModelError(where, "a mass of at least 0 kg", f"{body.mass:g}")
        full = not np.isnan(body.fullinertia[0])
        xx, yy, zz, xy, xz, yz = body.fullinertia if full else (*body.inertia, 0.0, 0.0, 0.0)
        given = np.array(((xx, xy, xz), (xy, yy, yz), (xz, yz, zz)))
        light = body.mass == 0.0 and not given.any()
        if light or np.any(np.isnan(given)):
            continue
        inertia, note = mended_inertia(where, float(body.mass), given)
        if note:
            notes.append(note)
            if full:
                ((xx, xy, xz), (_, yy, yz), (_, _, zz)) = inertia
                body.fullinertia = [xx, yy, zz, xy, xz, yz]
            else:
                body.inertia = np.diag(inertia)
    return notes


def _replaced(geom: mujoco.MjsGeom, k: int) -> str:
    """Make a mesh a tiny sphere without mass, and return its name, a new one if it has none."""
    geom.name = geom.name or f"mesh {k} of the file"
    geom.type, geom.size, geom.mass = mujoco.mjtGeom.mjGEOM_SPHERE, [1e-6, 0.0, 0.0], 0.0
    return str(geom.name)


def _mesh(path: Path, spec: mujoco.MjSpec, name: str) -> _Mesh:
    """Return a mesh's file as it is named, where it is, None where it is not, and its scale."""
    mesh = next((x for x in spec.meshes if x.name == name), None)
    if mesh is None:
        return _NONE
    file = str(PurePosixPath(spec.meshdir) / mesh.file)
    return file, find_mesh(path, file), np.array(mesh.scale)


def _shapes(
    path: Path, m: mujoco.MjModel, names: Names, meshes: dict[str, _Mesh]
) -> tuple[list[Shape], list[Missing]]:
    """Return the shapes of the bodies, and those whose meshes are missing.

    Those that may touch something, or all where a body has none that may.
    """
    touching = (m.geom_contype != 0) | (m.geom_conaffinity != 0)
    shapes: list[Shape] = []
    missing: list[Missing] = []
    known = Meshes(str(path))
    for b in range(m.nbody):
        own = np.flatnonzero(m.geom_bodyid == b)
        for g in own[touching[own]] if touching[own].any() else own:
            name = names.bodies[b] if b else "universe"
            if int(m.geom_type[g]) == _PLANE:
                continue  # which a note says
            found = _points(m, int(g), meshes, known)
            if found is None:
                missing.append(Missing(name, meshes.get(m.geom(g).name, _NONE)[0]))
                continue
            T = _pose(m.geom_pos[g], m.geom_quat[g])
            points = found[0] @ T.rotation.T + T.translation
            check_place(str(path), points)
            shapes.append(Shape(frame=name, points=points, radius=found[1]))
    return shapes, missing


def _points(
    m: mujoco.MjModel, g: int, meshes: dict[str, _Mesh], known: Meshes
) -> tuple[Array, float] | None:
    """Return the points of a geom in its own frame, and a radius about them [m]."""
    size, kind = m.geom_size[g], int(m.geom_type[g])
    _, file, scale = meshes.get(m.geom(g).name, _NONE)
    if m.geom(g).name in meshes:
        points = None if file is None else known.points(file)
        return None if points is None else (points * scale, 0.0)
    if kind == _SPHERE:
        return np.zeros((1, 3)), float(size[0])
    if kind == _CAPSULE:
        return np.array([[0.0, 0.0, -size[1]], [0.0, 0.0, size[1]]]), float(size[0])
    if kind == _CYLINDER:
        return cylinder_points(float(size[0]), float(size[1])), 0.0
    if kind == _ELLIPSOID:
        return ball_points() * size, 0.0
    return (box_points(size), 0.0) if kind == _BOX else None


def _check_weight(path: Path, spec: mujoco.MjSpec, geom: mujoco.MjsGeom) -> None:
    """Refuse a body that moves and whose mass would come from its meshes, which are not there."""
    body, kind = geom.parent, spec.compiler.inertiafromgeom
    if kind == mujoco.mjtInertiaFromGeom.mjINERTIAFROMGEOM_FALSE or (
        kind == mujoco.mjtInertiaFromGeom.mjINERTIAFROMGEOM_AUTO and body.explicitinertial
    ):
        return
    low, high = spec.compiler.inertiagrouprange
    light = geom.mass == 0.0 or (np.isnan(geom.mass) and geom.density == 0.0)
    if light or not low <= geom.group <= high:
        return
    above = body
    while above.parent is not None and not len(above.joints):
        above = above.parent
    if above.parent is not None:
        wanted = "an <inertial>, and inertiafromgeom not true"
        raise FileError(f"{path} body {body.name!r}", wanted, "meshes to get it from",
                        do="let MuJoCo save the file once: mj_saveLastXML writes it")  # fmt: skip


def _to_pinocchio(m: mujoco.MjModel, names: Names) -> pin.Model:
    """Return the tree of bodies with all joints, a frame for each body and each site."""
    model = pin.Model()
    model.gravity.linear = np.array([0.0, 0.0, -GRAVITY])
    joint_of, seat = {0: 0}, {0: pin.SE3.Identity()}
    armature: list[float] = []
    for b in range(1, m.nbody):
        parent = m.body_parentid[b]
        joint, T = joint_of[parent], seat[parent] * _pose(m.body_pos[b], m.body_quat[b])
        for k in range(m.body_jntadr[b], m.body_jntadr[b] + m.body_jntnum[b]):
            kind, at = _joint(m, k), pin.SE3(np.eye(3), np.array(m.jnt_pos[k]))
            T = T * at * _initial(m, k).inverse()
            joint = model.addJoint(joint, kind, T, names.joints[k])
            model.addJointFrame(joint)
            T = at.inverse()
            armature += [float(x) for x in m.dof_armature[m.jnt_dofadr[k] :][: kind.nv]]
        R = _pose(m.body_ipos[b], m.body_iquat[b])
        about = R.rotation @ np.diag(m.body_inertia[b]) @ R.rotation.T
        inertia = pin.Inertia(float(m.body_mass[b]), R.translation, about)
        model.appendBodyToJoint(joint, inertia, T)
        joint_of[b], seat[b] = joint, T
        model.addFrame(pin.Frame(names.bodies[b], joint, 0, T, pin.FrameType.BODY), False)
    for s in range(m.nsite):
        b = m.site_bodyid[s]
        T = seat[b] * _pose(m.site_pos[s], m.site_quat[s])
        if names.sites[s] in names.bodies:
            continue  # the body of that name goes before it
        model.addFrame(pin.Frame(names.sites[s], joint_of[b], 0, T, pin.FrameType.OP_FRAME), False)
    model.armature = np.array(armature)
    return model


def _joint(m: mujoco.MjModel, k: int) -> pin.JointModel:
    """Return a joint as Pinocchio has it."""
    if m.jnt_type[k] == HINGE:
        return pin.JointModelRevoluteUnaligned(np.array(m.jnt_axis[k]))
    if m.jnt_type[k] == SLIDE:
        return pin.JointModelPrismaticUnaligned(np.array(m.jnt_axis[k]))
    if m.jnt_type[k] == BALL:
        return pin.JointModelSpherical()
    return pin.JointModelFreeFlyer()


def _initial(m: mujoco.MjModel, k: int) -> pin.SE3:
    """Return how far joint ``k`` has moved where the file shows its body (``ref``)."""
    value, axis = float(m.qpos0[m.jnt_qposadr[k]]), np.array(m.jnt_axis[k])
    if m.jnt_type[k] == HINGE:
        return pin.SE3(rotation(axis, value), np.zeros(3))
    return pin.SE3(np.eye(3), value * axis if m.jnt_type[k] == SLIDE else np.zeros(3))


def _pose(p: Array, quaternion: Array) -> pin.SE3:
    """Return a pose from a position [m] and a quaternion (w, x, y, z)."""
    R = np.zeros(9)
    mujoco.mju_quat2Mat(R, np.array(quaternion, dtype=np.float64))
    return pin.SE3(R.reshape(3, 3), np.array(p, dtype=np.float64))
