"""Whether anything can touch anything in the next tick; if not, MuJoCo need not look for it.

Most of a throw is flight, and in flight half of a step's cost is to find out that nothing touches
anything and that no joint is at its stop. So the gaps between all shapes that may meet are
measured now and then, and after that it is only asked whether what has moved since, and what will
move in the next tick, could have closed them. What a step brings about does not depend on it: with
no contact and no stop it is the same to the last bit.

Hinges move shapes by at most their angle times the length of all that they carry. A cylinder is
held for the capsule around it.

| table    | a row for each                      | columns                                       |
|----------|-------------------------------------|-----------------------------------------------|
| pairs    | two shapes that may meet            | geoms a and b, what brings them together (OWN |
|          |                                     | and so on), sum of radii, half lengths [m]    |
| joints   | joint of arm and fingers            | low and high end of its range [rad, m], shift |
|          |                                     | of a shape by a unit of it [m/rad, 1]         |
| measured | (one row)                           | gaps then [m], ball then [m], joints then     |
"""

import mujoco
import numpy as np

from mitt.jit import kernel
from mitt.robot.segments import segment_distance
from mitt.signals import Array
from mitt.views import lent
from mitt.world.build import Plant
from mitt.world.hand import BALL, FLOOR, HAND
from mitt.world.meeting import meeting

#: What brings two shapes together: joints of arm and hand, those of the fingers alone, or the
#: flight of the ball and joints.
OWN, FINGERS, FLIGHT = 0, 1, 2

#: What a tick may add to all that is foreseen from the speeds at its begin [m], and to the way of
#: a joint [rad, m]. In a tick in which the ball is pushed nothing is switched off at all.
MARGIN = 0.01

#: What is switched off where nothing can touch; stops of joints as well, so none may be near.
OFF = int(mujoco.mjtDisableBit.mjDSBL_CONSTRAINT)

_FLOOR, _SPHERE = int(mujoco.mjtGeom.mjGEOM_PLANE), int(mujoco.mjtGeom.mjGEOM_SPHERE)
_LONG = int(mujoco.mjtGeom.mjGEOM_CAPSULE), int(mujoco.mjtGeom.mjGEOM_CYLINDER)


def pairs_of(model: mujoco.MjModel) -> Array:
    """Return the shapes that may meet, as in the module's table, shape (p, 6)."""
    found = meeting(model)
    return np.array([_row(model, *sorted(pair, key=lambda g: -_half(model, g))) for pair in found])


def joints_of(plant: Plant) -> Array:
    """Return the joints of arm and fingers, as in the module's table, shape (n + f, 3)."""
    model, out = plant.model, []
    own = np.flatnonzero((model.geom_contype & (BALL | FLOOR)) == 0)
    size = max(np.linalg.norm(model.geom_pos[g]) + model.geom_rbound[g] for g in own)
    ends = np.where(model.jnt_limited[:, None], model.jnt_range, np.inf)
    sliding = model.jnt_type == mujoco.mjtJoint.mjJNT_SLIDE
    for j in range(plant.joints + plant.fingers):
        body, slides = model.jnt_bodyid[j], sliding[j]
        carried = [b for b in range(body + 1, model.nbody) if _carries(model, body, b)]
        drawn_out = sliding & np.isin(model.jnt_bodyid, [body, *carried])
        length = sum(np.linalg.norm(model.body_pos[b]) for b in carried) + size
        length += np.abs(ends[drawn_out]).max(axis=1).sum()
        low, high = model.jnt_range[j] if model.jnt_limited[j] else (-np.inf, np.inf)
        out.append((low, high, 1.0 if slides else length + np.linalg.norm(model.jnt_pos[j])))
    return np.array(out)


def fresh_table(joints: int) -> Array:
    """Return what was measured before anything was, shape (6 + joints,)."""
    return np.full(6 + joints, -np.inf)


def _carries(model: mujoco.MjModel, body: int, other: int) -> bool:
    """Say whether a body moves with another one."""
    while other > body:
        other = model.body_parentid[other]
    return bool(other == body)


def _row(model: mujoco.MjModel, a: int, b: int) -> tuple[float, ...]:
    """Return a row of the table of pairs; a plane comes last."""
    kinds = int(model.geom_contype[a]), int(model.geom_contype[b])
    what = FLIGHT if BALL in kinds else FINGERS if kinds == (HAND, HAND) else OWN
    radii = _radius(model, a) + _radius(model, b)
    return float(a), float(b), float(what), radii, _half(model, a), _half(model, b)


def _radius(model: mujoco.MjModel, g: int) -> float:
    """Return the radius of the capsule around a geom [m]."""
    kind = int(model.geom_type[g])
    if kind == _FLOOR:
        return 0.0
    return float(model.geom_size[g, 0] if kind in (*_LONG, _SPHERE) else model.geom_rbound[g])


def _half(model: mujoco.MjModel, g: int) -> float:
    """Return half the length of its axis, which is its z axis [m]; negative for a floor."""
    kind = int(model.geom_type[g])
    if kind == _FLOOR:
        return -1.0
    return float(model.geom_size[g, 1]) if kind in _LONG else 0.0


@kernel
def _end(pos: Array, mat: Array, g: int, half: float) -> tuple[float, float, float]:
    """Return an end of a shape's axis [m]."""
    x, y, z = mat[g, 2], mat[g, 5], mat[g, 8]
    return pos[g, 0] + half * x, pos[g, 1] + half * y, pos[g, 2] + half * z


@kernel
def measure(pos: Array, mat: Array, pairs: Array, gaps: Array) -> None:
    """Write the smallest gap of each kind of pair.

    Args:
        pos: Centres of all geoms [m], shape (g, 3).
        mat: Their axes, shape (g, 9).
        pairs: As in the module's table.
        gaps: Result [m], shape (3,).
    """
    pos, mat, pairs, gaps = lent((pos, mat, pairs, gaps))
    gaps[:] = np.inf
    for k in range(pairs.shape[0]):
        a, b, what = int(pairs[k, 0]), int(pairs[k, 1]), int(pairs[k, 2])
        one, other = _end(pos, mat, a, -pairs[k, 4]), _end(pos, mat, a, pairs[k, 4])
        if pairs[k, 5] < 0.0:  # floors lie level
            far = min(one[2], other[2]) - pos[b, 2]
        else:
            begin, end = _end(pos, mat, b, -pairs[k, 5]), _end(pos, mat, b, pairs[k, 5])
            far = segment_distance(one, other, begin, end)
        gaps[what] = min(gaps[what], far - pairs[k, 3])


@kernel
def _closing(qpos: Array, qvel: Array, joints: Array, measured: Array, h: float, n: int) -> bool:
    """Say whether a gap can have closed since it was measured, or can within ``h`` [s].

    Args:
        qpos: Positions of the plant, shape (n + f + 7,).
        qvel: Velocities of the plant, shape (n + f + 6,).
        joints: As in the module's table.
        measured: As in the module's table.
        h: Time ahead [s].
        n: Number of joints of the arm.
    """
    qpos, qvel, joints, measured = lent((qpos, qvel, joints, measured))
    count, arm, fingers, way, ahead = joints.shape[0], 0.0, 0.0, 0.0, 0.0
    for j in range(count):
        shift = joints[j, 2] * (abs(qpos[j] - measured[6 + j]) + h * abs(qvel[j]))
        arm, fingers = (arm + shift, fingers) if j < n else (arm, fingers + shift)
    for i in range(3):
        way += (qpos[count + i] - measured[3 + i]) ** 2
        ahead += qvel[count + i] ** 2
    flight = np.sqrt(way) + h * np.sqrt(ahead)
    own = arm + fingers
    return bool(
        not own + MARGIN < measured[OWN]
        or not fingers + MARGIN < measured[FINGERS]
        or not own + flight + MARGIN < measured[FLIGHT]
    )


@kernel
def is_clear(
    qpos: Array,
    qvel: Array,
    pos: Array,
    mat: Array,
    pairs: Array,
    joints: Array,
    measured: Array,
    h: float,
    n: int,
) -> bool:
    """Say whether nothing can touch anything, nor a joint meet its stop, within ``h`` [s].

    Args:
        qpos: As for :func:`_closing`, as ``qvel``, ``joints``, ``h`` and ``n``.
        qvel: See ``qpos``.
        pos: As for :func:`measure`, as ``mat`` and ``pairs``; true for ``qpos``.
        mat: See ``pos``.
        pairs: See ``pos``.
        joints: See ``qpos``.
        measured: As in the module's table; measured again where that may help.
        h: See ``qpos``.
        n: See ``qpos``.
    """
    qpos, qvel, joints, measured = lent((qpos, qvel, joints, measured))
    count = joints.shape[0]
    for j in range(count):
        room = 2.0 * h * abs(qvel[j]) + MARGIN
        if not joints[j, 0] + room < qpos[j] < joints[j, 1] - room:
            return False
    if not _closing(qpos, qvel, joints, measured, h, n):
        return True
    measure(pos, mat, pairs, measured[:3])
    for i in range(3):
        measured[3 + i] = qpos[count + i]
    for j in range(count):
        measured[6 + j] = qpos[j]
    return not _closing(qpos, qvel, joints, measured, h, n)
