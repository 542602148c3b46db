"""MJCF files: MuJoCo resolves classes, defaults, frames and units, and what it makes is read.

Read as MuJoCo Menagerie writes them: ranges and actuators by default classes, keyframes, cameras,
tendons and textures that do not matter here. MuJoCo has no limit of speed, so it stands among the
file's own numbers: ``<custom><numeric name="velocity_limit_JOINT" data="8.0"/></custom>`` [rad/s].
A joint, body or site without a name is called by its number. MuJoCo opens files and makes copies
while it parses, so what a file asks for is looked at before: no other file, and not more than an
arm has. Of its meshes those below its folder are read, as of a URDF (:mod:`mitt.io.meshes`). The
elements and what they mean: the XML reference of MuJoCo's documentation.
"""

from collections import defaultdict
from collections.abc import Callable
from dataclasses import dataclass
from math import prod
from pathlib import Path, PurePosixPath
from typing import Any, TypeAlias
from xml.etree.ElementTree import Element

import mujoco
import numpy as np

from mitt.core import checks
from mitt.core.arm.description import mended_inertia, rotation, transform
from mitt.core.errors import FileError, MittError, ModelError, heard
from mitt.core.signals import GRAVITY, Array
from mitt.io.description_files import (
    JOIN,
    LINK,
    WORLD,
    Kind,
    KinematicPart,
    LeftOut,
    Mimic,
    Shape,
    Stated,
    Tree,
    number_of,
    read_xml,
)
from mitt.io.meshes import (
    Meshes,
    Missing,
    check_place,
    find_mesh,
    missing_notes,
    solid_points,
)

_KEYS = {
    "range": "range",
    "torque": "actuatorfrcrange or forcerange",
    "speed": "the numeric velocity_limit_JOINT",
    "mass": "<inertial> of the body",
}
#: Kinds of geoms, joints, ways of actuators to a joint and what they add to their control. As plain
#: numbers: an enum of MuJoCo is not equal to a number of numpy.
_PLANE = int(mujoco.mjtGeom.mjGEOM_PLANE)
_SOLIDS = {
    int(mujoco.mjtGeom.mjGEOM_SPHERE): "sphere",
    int(mujoco.mjtGeom.mjGEOM_CAPSULE): "capsule",
    int(mujoco.mjtGeom.mjGEOM_CYLINDER): "cylinder",
    int(mujoco.mjtGeom.mjGEOM_BOX): "box",
    int(mujoco.mjtGeom.mjGEOM_ELLIPSOID): "ellipsoid",
}
_HINGE = int(mujoco.mjtJoint.mjJNT_HINGE)
_SLIDE = int(mujoco.mjtJoint.mjJNT_SLIDE)
_JOINTS: dict[int, Kind] = {
    _HINGE: "hinge",
    _SLIDE: "slide",
    int(mujoco.mjtJoint.mjJNT_BALL): "ball",
    int(mujoco.mjtJoint.mjJNT_FREE): "free",
}
_AT_JOINT = int(mujoco.mjtTrn.mjTRN_JOINT), int(mujoco.mjtTrn.mjTRN_JOINTINPARENT)
_BY_TENDON = int(mujoco.mjtTrn.mjTRN_TENDON)
_ON_JOINT = int(mujoco.mjtWrap.mjWRAP_JOINT)
_MOTOR = int(mujoco.mjtBias.mjBIAS_NONE)
_DC_MOTOR = int(mujoco.mjtBias.mjBIAS_DCMOTOR)
_CONNECT = int(mujoco.mjtEq.mjEQ_CONNECT)
_WELD = int(mujoco.mjtEq.mjEQ_WELD)
_FOLLOWS = int(mujoco.mjtEq.mjEQ_JOINT)
#: What opens other files, or runs code, as MuJoCo parses it.
_OTHERS = ("model", "attach", "plugin", "extension", "include")
#: Most elements once copies are made.
_MOST_ELEMENTS = 100_000
_Mesh: TypeAlias = tuple[str, Path | None, Array]
"""What a mesh is called, where it is, and its scale."""
_NONE: _Mesh = ("", None, np.ones(3))


@dataclass(frozen=True, slots=True, kw_only=True)
class Names:
    """Names of joints, bodies and sites, each by its number; none of a joint is that of another."""

    joints: tuple[str, ...]
    bodies: tuple[str, ...]
    sites: tuple[str, ...]


def read_mjcf(path: Path) -> Stated:
    """Read an MJCF file.

    Raises:
        FileError: It cannot be read or compiled, or a body has no mass but that of its meshes.
    """
    path = checks.path("arm", path)
    text, root = read_xml(path, "mujoco")
    _check_files(path, root)
    speed = _speeds_of(path, root)
    with heard():
        m, meshes, mended = _compiled(path, text)
    names = _names_of(m)
    shapes, missing = _shapes(path, m, names, meshes)
    mimics, notes = _mimics_of(m, names)
    torque, unusable = _torques_of(m, names)
    notes = (*mended, *notes, *_file_notes(m, names))
    return Stated(
        place=str(path),
        tree=_tree(m, names),
        ranges=_ranges_of(m, names),
        torque=torque,
        speed=speed,
        mimics=mimics,
        loops=_loops_of(m, names),
        shapes=tuple(shapes),
        notes=(*missing_notes(path, missing), *notes),
        keys=_KEYS,
        left_out=_left_out_of(m, names),
        unusable=unusable,
    )


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
                notes.append(
                    f"the height field {geom.hfieldname!r} is left out: nothing keeps the"
                    " arm off it"
                )
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
            name = names.bodies[b] if b else WORLD
            if int(m.geom_type[g]) == _PLANE:
                continue  # which a note says
            found = _points(m, int(g), meshes, known)
            if found is None:
                missing.append(Missing(name, meshes.get(m.geom(g).name, _NONE)[0]))
                continue
            T = _pose(m.geom_pos[g], m.geom_quat[g])
            points = found[0] @ T[:3, :3].T + T[:3, 3]
            check_place(str(path), points)
            shapes.append(Shape(frame=name, points=points, radius=found[1]))
    return shapes, missing


def _points(
    m: mujoco.MjModel, g: int, meshes: dict[str, _Mesh], known: Meshes
) -> tuple[Array, float] | None:
    """Return the points of a geom in its own frame, and a radius about them [m]."""
    kind = _SOLIDS.get(int(m.geom_type[g]))
    _, file, scale = meshes.get(m.geom(g).name, _NONE)
    if m.geom(g).name in meshes:
        points = None if file is None else known.points(file)
        return None if points is None else (points * scale, 0.0)
    return None if kind is None else solid_points(kind, m.geom_size[g])


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
        raise FileError(
            f"{path} body {body.name!r}",
            wanted,
            "meshes to get it from",
            do="let MuJoCo save the file once: mj_saveLastXML writes it",
        )


def _tree(m: mujoco.MjModel, names: Names) -> Tree:
    """Return bodies with the joints before them, then sites."""
    parts, place = [KinematicPart(name=WORLD, kind="world")], {0: 0}
    for b in range(1, m.nbody):
        before, T = place[m.body_parentid[b]], _pose(m.body_pos[b], m.body_quat[b])
        for k in range(m.body_jntadr[b], m.body_jntadr[b] + m.body_jntnum[b]):
            at = transform(p=m.jnt_pos[k])
            parts.append(
                KinematicPart(
                    name=names.joints[k],
                    kind=_JOINTS[int(m.jnt_type[k])],
                    before=before,
                    placement=T @ at @ _back(m, k),
                    axis=np.array(m.jnt_axis[k]),
                    armature=float(m.dof_armature[m.jnt_dofadr[k]]),
                )
            )
            before, T = len(parts) - 1, transform(p=-m.jnt_pos[k])
        own = _pose(m.body_ipos[b], m.body_iquat[b])
        place[b] = len(parts)
        parts.append(
            KinematicPart(
                name=names.bodies[b],
                kind="link",
                before=before,
                placement=T,
                mass=float(m.body_mass[b]),
                com=own[:3, 3],
                inertia=own[:3, :3] @ np.diag(m.body_inertia[b]) @ own[:3, :3].T,
            )
        )
    parts += [
        KinematicPart(
            name=name,
            kind="site",
            before=place[m.site_bodyid[s]],
            placement=_pose(m.site_pos[s], m.site_quat[s]),
        )
        for s, name in enumerate(names.sites)
        if name not in names.bodies  # which goes before it
    ]
    return Tree(parts)


def _back(m: mujoco.MjModel, k: int) -> Array:
    """Return the motion from where the file shows a joint's body (``ref``) to its zero, (4, 4)."""
    value, axis = float(m.qpos0[m.jnt_qposadr[k]]), np.array(m.jnt_axis[k])
    if m.jnt_type[k] == _HINGE:
        return transform(rotation(axis, -value))
    return transform(p=-value * axis) if m.jnt_type[k] == _SLIDE else transform()


def _pose(p: Array, quaternion: Array) -> Array:
    """Return a frame from its place [m] and a quaternion (w, x, y, z), shape (4, 4)."""
    R = np.zeros(9)
    mujoco.mju_quat2Mat(R, np.array(quaternion, dtype=np.float64))
    return transform(R.reshape(3, 3), p)


def _names_of(m: mujoco.MjModel) -> Names:
    """Return what everything is called; frames that are called as a joint is end with ``LINK``."""
    joints = _named(m.joint, m.njnt, "joint")
    taken = frozenset(joints)
    bodies, sites = (
        tuple(x + LINK if x in taken else x for x in names)
        for names in (_named(m.body, m.nbody, "body"), _named(m.site, m.nsite, "site"))
    )
    return Names(joints=joints, bodies=bodies, sites=sites)


def _named(of: Callable[[int], Any], count: int, kind: str) -> tuple[str, ...]:
    """Return names, new ones where there are none."""
    given = [str(of(k).name) for k in range(count)]
    taken = frozenset(given)
    out = []
    for k, name in enumerate(given):
        new = f"{kind} {k}"
        while new in taken:
            new += " unnamed"
        out.append(name or new)
    return tuple(out)


def _ranges_of(m: mujoco.MjModel, names: Names) -> dict[str, tuple[float, float]]:
    """Return the joints' ranges; a hinge without one turns once about zero."""
    out = {}
    for k in range(m.njnt):
        if m.jnt_limited[k]:
            out[names.joints[k]] = (float(m.jnt_range[k, 0]), float(m.jnt_range[k, 1]))
        elif m.jnt_type[k] == _HINGE:
            out[names.joints[k]] = (-np.pi, np.pi)
    return out


def _torques_of(m: mujoco.MjModel, names: Names) -> tuple[dict[str, float], dict[str, str]]:
    """Return the joints' largest torques, the least that joint and actuator allow.

    And, by joint, what is written in the place of one: ranges that allow nothing one way.
    """
    bounds: dict[str, list[float]] = {}
    for k in range(m.njnt):
        if m.jnt_type[k] in (_HINGE, _SLIDE) and m.jnt_actfrclimited[k]:
            bounds.setdefault(names.joints[k], []).append(_width(m.jnt_actfrcrange[k]))
    for a in range(m.nu):
        if int(m.actuator_trntype[a]) not in _AT_JOINT:
            continue
        name, gear = names.joints[m.actuator_trnid[a, 0]], abs(float(m.actuator_gear[a, 0]))
        if m.actuator_forcelimited[a]:
            bounds.setdefault(name, []).append(gear * _width(m.actuator_forcerange[a]))
        motor = int(m.actuator_biastype[a]) == _MOTOR
        if motor and m.actuator_ctrllimited[a]:
            gain = abs(float(m.actuator_gainprm[a, 0]))
            bounds.setdefault(name, []).append(gear * gain * _width(m.actuator_ctrlrange[a]))
    torques = {name: min(x) for name, x in bounds.items() if min(x) > 0.0}
    one_way = "a range of force or control that is not about 0"
    return torques, {name: one_way for name in bounds if name not in torques}


def _width(ends: Array) -> float:
    """Return what a range allows both ways."""
    return float(min(-ends[0], ends[1]))


def _speeds_of(path: Path, root: Element) -> dict[str, float]:
    """Return the joints' largest speeds [rad/s or m/s], as the file's own numbers say."""
    out = {}
    for numeric in root.iter("numeric"):
        name, given = numeric.get("name", ""), numeric.get("data", "")
        if not name.startswith("velocity_limit_"):
            continue
        limit = number_of(given)
        if not 0.0 < limit < np.inf:
            raise FileError(f"{path} {name}", "a number above 0", repr(given[:60]))
        out[name.removeprefix("velocity_limit_")] = limit
    return out


def _loops_of(m: mujoco.MjModel, names: Names) -> tuple[tuple[str, str], ...]:
    """Return the pairs of bodies that an equality joins."""
    out = []
    for k in np.flatnonzero(np.isin(m.eq_type, (_CONNECT, _WELD))):
        ends = [int(m.eq_obj1id[k]), int(m.eq_obj2id[k])]
        if int(m.eq_objtype[k]) == int(mujoco.mjtObj.mjOBJ_SITE):
            ends = [int(m.site_bodyid[x]) for x in ends]
        out.append((names.bodies[ends[0]], names.bodies[ends[1]]))
    return tuple(out)


def _mimics_of(m: mujoco.MjModel, names: Names) -> tuple[dict[str, Mimic], tuple[str, ...]]:
    """Return the joints that an equality makes follow others, and notes of what is not kept.

    A joint's value less its initial one is a polynomial of the other's less its initial one; what
    is not straight is taken for its tangent. A joint that is joined to none follows itself, with no
    slope.
    """
    out, notes = {}, []
    for k in np.flatnonzero(m.eq_type == _FOLLOWS):
        if not m.eq_active0[k]:
            continue
        joint, other = int(m.eq_obj1id[k]), int(m.eq_obj2id[k])
        here = float(m.qpos0[m.jnt_qposadr[joint]])
        there = float(m.qpos0[m.jnt_qposadr[other]]) if other >= 0 else 0.0
        offset, slope = (float(x) for x in m.eq_data[k, :2])
        slope = slope if other >= 0 else 0.0
        name = names.joints[joint]
        out[name] = Mimic(
            joint=names.joints[other if other >= 0 else joint],
            multiplier=slope,
            offset=here + offset - slope * there,
        )
        if other >= 0 and np.any(m.eq_data[k, 2:5] != 0.0):
            notes.append(
                f"joint {name!r} follows {names.joints[other]!r} along a curve: taken for"
                " its tangent"
            )
    return out, tuple(notes)


def _left_out_of(m: mujoco.MjModel, names: Names) -> dict[str, LeftOut]:
    """Return what is stated of joints and not counted."""
    others = _others(m)
    out = {}
    for k in range(m.njnt):
        if int(m.jnt_type[k]) not in (_HINGE, _SLIDE):
            continue
        v = m.jnt_dofadr[k]
        words = []
        if m.jnt_stiffness[k] != 0.0:
            unit = "N m/rad" if int(m.jnt_type[k]) == _HINGE else "N/m"
            words.append(f"a spring of {m.jnt_stiffness[k]:.4g} {unit}")
        if np.any(m.dof_dampingpoly[v]) or np.any(m.jnt_stiffnesspoly[k]):
            words.append("damping or a spring along a curve")
        words += others[k]
        out[names.joints[k]] = LeftOut(
            damping=float(m.dof_damping[v]),
            friction=float(m.dof_frictionloss[v]),
            others=tuple(dict.fromkeys(words)),
        )
    return out


def _others(m: mujoco.MjModel) -> defaultdict[int, list[str]]:
    """Return what acts on joints besides their drives, by joint."""
    out: defaultdict[int, list[str]] = defaultdict(list)
    pulled = {
        int(m.actuator_trnid[a, 0]) for a in range(m.nu) if int(m.actuator_trntype[a]) == _BY_TENDON
    }
    for tendon in range(m.ntendon):
        first = m.tendon_adr[tendon]
        wraps = range(first, first + m.tendon_num[tendon])
        for k in (int(m.wrap_objid[w]) for w in wraps if int(m.wrap_type[w]) == _ON_JOINT):
            out[k].append("an actuator at a tendon" if tendon in pulled else "a tendon")
    for a in range(m.nu):
        if int(m.actuator_trntype[a]) not in _AT_JOINT:
            continue
        joint = int(m.actuator_trnid[a, 0])
        if int(m.actuator_biastype[a]) == _DC_MOTOR:
            out[joint].append("a motor whose torque falls with its speed")
        if m.actuator_damping[a] != 0.0 or np.any(m.actuator_dampingpoly[a]):
            out[joint].append("damping of its actuator")
    for body in np.flatnonzero(m.body_gravcomp):
        if m.body_jntnum[body]:
            out[int(m.body_jntadr[body])].append("gravity compensation")
    return out


def _file_notes(m: mujoco.MjModel, names: Names) -> tuple[str, ...]:
    """Return notes of what the file states of its world and is not read."""
    notes = []
    none = bool(m.opt.disableflags & int(mujoco.mjtDisableBit.mjDSBL_GRAVITY))
    gravity = np.zeros(3) if none else np.array(m.opt.gravity)
    off = float(np.linalg.norm(gravity - np.array((0.0, 0.0, -GRAVITY))))
    if off > 0.03:  # m/s^2: on Earth it is 9.80 to 9.83
        said = " ".join(f"{x:g}" for x in gravity)
        notes.append(
            f"gravity {said} of the file is left out: taken as 0 0 -{GRAVITY:g} m/s^2, with z up"
        )
    flat = np.flatnonzero(m.geom_type == _PLANE)
    planes = ", ".join(_called(m, names, int(g)) for g in flat[:3])
    stated = {
        f"planes ({planes})": len(flat) > 0,
        "flexible bodies": m.nflex > 0,
        "wind, density and viscosity of a fluid": _has_fluid(m),
        "equalities of tendons or flexible bodies": not np.isin(
            m.eq_type, (_CONNECT, _WELD, _FOLLOWS)
        ).all(),
    }
    words = [what for what, given in stated.items() if given]
    if words:
        notes.append(f"stated in the file and left out: {', '.join(words)}")
    return tuple(notes)


def _called(m: mujoco.MjModel, names: Names, g: int) -> str:
    """Return the name of a geom, or that of its body."""
    body = int(m.geom_bodyid[g])
    return str(m.geom(g).name) or (names.bodies[body] if body else WORLD)


def _has_fluid(m: mujoco.MjModel) -> bool:
    """Say whether the file states a fluid about the arm."""
    return bool(m.opt.density or m.opt.viscosity or np.any(m.opt.wind))


def _check_files(path: Path, root: Element) -> None:
    """Refuse files that MuJoCo would open as it parses, and copies without number.

    Meshes and textures it opens as it compiles, and these are taken out before.

    Raises:
        FileError: Of what is refused.
    """
    for element in root.iter():
        if element.tag in _OTHERS:
            raise FileError(
                str(path), "one file, without others and plugins", f"<{element.tag}>", do=JOIN
            )
        if element.tag == "flexcomp" and "file" in element.attrib:
            raise FileError(
                str(path),
                "an arm without flexible bodies from files",
                "<flexcomp>",
                do="take it out",
            )
    if _count(path, root) > _MOST_ELEMENTS:
        raise FileError(
            str(path),
            f"at most {_MOST_ELEMENTS} elements with all copies",
            "more",
            do="take out <replicate> and <composite>",
        )


def _count(path: Path, element: Element) -> int:
    """Return the number of elements in one, copies included."""
    inner = 1 + sum(_count(path, child) for child in element)
    if element.tag not in ("replicate", "composite", "flexcomp"):
        return inner
    given = element.get("count", "1")
    try:
        counts = [int(x) for x in given.split()]
    except ValueError:
        counts = []
    if not counts or not all(1 <= x <= _MOST_ELEMENTS for x in counts):
        wanted = f"whole numbers in 1..{_MOST_ELEMENTS} for count"
        raise FileError(f"{path} <{element.tag}>", wanted, repr(given[:60]))
    return min(prod(counts) * inner, _MOST_ELEMENTS + 1)
