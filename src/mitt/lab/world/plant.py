"""The arm as bodies of a MuJoCo scene: the second implementation, and the plant of the world."""

import mujoco
import numpy as np

from mitt.core.arm.description import ArmModel, Capsule, Link, joint_motion, transform
from mitt.core.signals import Array

#: Colours of the pictures: the moving links and what carries them.
_METAL = (0.78, 0.80, 0.83, 1.0)
_DARK = (0.25, 0.27, 0.30, 1.0)

#: Length that a ball gets as a capsule, of which MuJoCo has none without length [m].
_SHORTEST = 1e-4


def add_arm(spec: mujoco.MjSpec, model: ArmModel) -> mujoco.MjsBody:
    """Add the links of an arm, without its hand, to a scene.

    Active joints become hinges or slides named as in the model, with a motor each of the same
    name; held joints are rigid. Collision shapes are geoms named ``<joint>_<number>``.

    Returns:
        A massless body ``tool`` at the tool plate, with a site ``catch_point`` beyond it; the
        z axis of both is the palm's normal.
    """
    for k, capsule in enumerate(model.base_capsules):
        _add_capsule(spec.worldbody, capsule, name=f"base_{k}", rgba=_DARK)
    body, T = spec.worldbody, model.mount
    for link in model.links:
        body = _add_link(spec, body, link, T @ link.placement)
        T = transform()
    p, quaternion = _pose(model.tool)
    tool = body.add_body(name="tool", pos=p, quat=quaternion)
    offset = 0.0 if model.hand is None else model.hand.catch_offset
    tool.add_site(name="catch_point", pos=[0.0, 0.0, offset])
    return tool


def _add_link(spec: mujoco.MjSpec, parent: mujoco.MjsBody, link: Link, T: Array) -> mujoco.MjsBody:
    """Add one link with its joint, its mass and its shapes."""
    held = link.held is not None
    p, quaternion = _pose(T @ joint_motion(link, link.held) if link.held is not None else T)
    body = parent.add_body(name=f"link_{link.name}", pos=p, quat=quaternion)
    body.explicitinertial = True
    body.mass, body.ipos = link.mass, link.com
    xx, yy, zz = np.diag(link.inertia)
    body.fullinertia = [xx, yy, zz, link.inertia[0, 1], link.inertia[0, 2], link.inertia[1, 2]]
    if not held:
        kind = mujoco.mjtJoint.mjJNT_SLIDE if link.prismatic else mujoco.mjtJoint.mjJNT_HINGE
        joint = body.add_joint(name=link.name, type=kind, axis=link.axis)
        joint.armature = link.armature
        joint.limited = mujoco.mjtLimited.mjLIMITED_TRUE
        joint.range = [link.q_min, link.q_max]
        motor = spec.add_actuator(
            name=link.name, target=link.name, trntype=mujoco.mjtTrn.mjTRN_JOINT
        )
        motor.set_to_motor()
    for k, capsule in enumerate(link.capsules):
        _add_capsule(body, capsule, name=f"{link.name}_{k}", rgba=_METAL)
    return body


def _add_capsule(
    body: mujoco.MjsBody, capsule: Capsule, *, name: str, rgba: tuple[float, ...]
) -> None:
    """Add a capsule that gives shape and contact but no mass."""
    start, end = np.array(capsule.start), np.array(capsule.end)
    if np.linalg.norm(end - start) < _SHORTEST:
        end = start + np.array((0.0, 0.0, _SHORTEST))
    body.add_geom(
        name=name,
        type=mujoco.mjtGeom.mjGEOM_CAPSULE,
        fromto=[*start, *end],
        size=[capsule.radius, 0.0, 0.0],
        mass=0.0,
        rgba=rgba,
    )


def _pose(T: Array) -> tuple[Array, Array]:
    """Return position [m], shape (3,), and quaternion (w, x, y, z), shape (4,)."""
    quaternion = np.zeros(4)
    mujoco.mju_mat2Quat(quaternion, np.ascontiguousarray(T[:3, :3]).ravel())
    return T[:3, 3].copy(), quaternion
