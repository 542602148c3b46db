"""What an MJCF file states and mitt does not count: passive forces, tendons, planes, gravity."""

from collections import defaultdict

import mujoco
import numpy as np

from mitt.robot.mjcf_joints import AT_JOINT, HINGE, SLIDE, Names
from mitt.robot.stated import LeftOut
from mitt.signals import GRAVITY

_PLANE = int(mujoco.mjtGeom.mjGEOM_PLANE)
_DC_MOTOR = int(mujoco.mjtBias.mjBIAS_DCMOTOR)
_BY_TENDON, _ON_JOINT = int(mujoco.mjtTrn.mjTRN_TENDON), int(mujoco.mjtWrap.mjWRAP_JOINT)
#: Kinds of equalities that are read.
_READ = tuple(
    int(kind)
    for kind in (mujoco.mjtEq.mjEQ_CONNECT, mujoco.mjtEq.mjEQ_WELD, mujoco.mjtEq.mjEQ_JOINT)
)
#: How far gravity may be off [m/s^2]: it is 9.80 to 9.83 on Earth.
_NEAR = 0.03


def left_out_of(m: mujoco.MjModel, names: Names) -> dict[str, LeftOut]:
    """Return what is stated of joints and not counted."""
    others = _others(m)
    out = {}
    for k in range(m.njnt):
        if int(m.jnt_type[k]) not in (HINGE, SLIDE):
            continue
        v = m.jnt_dofadr[k]
        words = []
        if m.jnt_stiffness[k] != 0.0:
            unit = "N m/rad" if int(m.jnt_type[k]) == HINGE else "N/m"
            words.append(f"a spring of {m.jnt_stiffness[k]:.4g} {unit}")
        if np.any(m.dof_dampingpoly[v]) or np.any(m.jnt_stiffnesspoly[k]):
            words.append("damping or a spring along a curve")
        words += others[k]
        out[names.joints[k]] = LeftOut(
            damping=float(m.dof_damping[v]), friction=float(m.dof_frictionloss[v]),
            others=tuple(dict.fromkeys(words)),
        )  # fmt: skip
    return out


def _others(m: mujoco.MjModel) -> defaultdict[int, list[str]]:
    """Return what acts on joints besides their drives, by joint."""
    out: defaultdict[int, list[str]] = defaultdict(list)
    pulled = {int(m.actuator_trnid[a, 0]) for a in range(m.nu)
              if int(m.actuator_trntype[a]) == _BY_TENDON}  # fmt: skip
    for tendon in range(m.ntendon):
        first = m.tendon_adr[tendon]
        wraps = range(first, first + m.tendon_num[tendon])
        for k in (int(m.wrap_objid[w]) for w in wraps if int(m.wrap_type[w]) == _ON_JOINT):
            out[k].append("an actuator at a tendon" if tendon in pulled else "a tendon")
    for a in range(m.nu):
        if int(m.actuator_trntype[a]) not in AT_JOINT:
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


def file_notes(m: mujoco.MjModel, names: Names) -> tuple[str, ...]:
    """Return notes of what the file states of its world and is not read."""
    notes = []
    off = bool(m.opt.disableflags & int(mujoco.mjtDisableBit.mjDSBL_GRAVITY))
    gravity = np.zeros(3) if off else np.array(m.opt.gravity)
    if np.linalg.norm(gravity - np.array((0.0, 0.0, -GRAVITY))) > _NEAR:
        said = " ".join(f"{x:g}" for x in gravity)
        notes.append(f"gravity {said} of the file is left out: taken as 0 0 -{GRAVITY:g} m/s^2,"
                     " with z up")  # fmt: skip
    flat = np.flatnonzero(m.geom_type == _PLANE)
    planes = ", ".join(_called(m, names, int(g)) for g in flat[:3])
    stated = {
        f"planes ({planes})": len(flat) > 0,
        "flexible bodies": m.nflex > 0,
        "wind, density and viscosity of a fluid": _has_fluid(m),
        "equalities of tendons or flexible bodies": not np.isin(m.eq_type, _READ).all(),
    }
    words = [what for what, given in stated.items() if given]
    if words:
        notes.append(f"stated in the file and left out: {', '.join(words)}")
    return tuple(notes)


def _called(m: mujoco.MjModel, names: Names, g: int) -> str:
    """Return the name of a geom, or that of its body."""
    body = int(m.geom_bodyid[g])
    return str(m.geom(g).name) or (names.bodies[body] if body else "universe")


def _has_fluid(m: mujoco.MjModel) -> bool:
    """Say whether the file states a fluid about the arm."""
    return bool(m.opt.density or m.opt.viscosity or np.any(m.opt.wind))
