"""Inverse dynamics of a serial chain as a kernel: recursive Newton-Euler in the links' frames.

tau of eq. (14) for every link, held ones included: the limits of drives that share motors need
the torque with which a brake or a neighbour holds them. Pinocchio is what tests hold this to.

A chain is a table, one link a row (held joints are folded into the placement):

| columns | what                                                     | unit       |
|---------|----------------------------------------------------------|------------|
| 0 - 8   | orientation of the link's frame in the one before, at 0  | 1          |
| 9 - 11  | its position there                                       | m          |
| 12 - 14 | joint axis in the link's own frame                       | 1          |
| 15      | 1 where the joint slides, 0 where it turns               |            |
| 16      | mass                                                     | kg         |
| 17 - 19 | centre of mass                                           | m          |
| 20 - 28 | inertia about the centre of mass                         | kg m^2     |
| 29      | rotor inertia at the joint                               | kg m^2     |
| 30      | index among the active joints, -1 for a held one         |            |
"""

import numpy as np

from mitt.jit import kernel
from mitt.robot.description import ArmModel, joint_motion
from mitt.robot.vectors import (
    ZERO,
    Mat,
    Vec,
    compose,
    cross,
    dot,
    mat_at,
    plus,
    put_at,
    rotate,
    times,
    turn,
    unturn,
    vec_at,
)
from mitt.signals import GRAVITY, Array

#: Columns of the table: rotation (from 0) and position of the joint frame, joint axis, whether it
#: slides, mass, centre, inertia, rotor, index among the active joints.
P, AXIS, SLIDES, MASS, COM, INERTIA, ROTOR, JOINT, _COLUMNS = 9, 12, 15, 16, 17, 20, 29, 30, 31
#: Columns of the scratch: rotation (from 0), position, force and moment of a link.
_P, _FORCE, _MOMENT, _SCRATCH = 9, 12, 15, 18


def bodies_of(model: ArmModel) -> Array:
    """Return the table of an arm's links, shape (N, 31); see the module's text."""
    rows, active = np.zeros((len(model.links), _COLUMNS)), 0
    for k, (row, link) in enumerate(zip(rows, model.links, strict=True)):
        T = link.placement if k > 0 else model.mount @ link.placement
        T = T if link.held is None else T @ joint_motion(link, link.held)
        row[:9], row[9:12], row[12:15] = T[:3, :3].ravel(), T[:3, 3], link.axis
        row[15:17], row[17:20] = (link.prismatic, link.mass), link.com
        row[20:29] = link.inertia.ravel()
        row[29:] = link.armature, -1 if link.held is not None else active
        active += link.held is None
    return rows


def dynamics_scratch(links: int) -> Array:
    """Return scratch for :func:`inverse_dynamics` of so many links."""
    return np.zeros((links, _SCRATCH))


@kernel
def inverse_dynamics(
    bodies: Array, q: Array, dq: Array, ddq: Array, tau: Array, scratch: Array
) -> None:
    """Write tau of eq. (14) for all links.

    Args:
        bodies: Table of the links, shape (N, 31).
        q: Active joint positions [rad], shape (n,).
        dq: Their velocities [rad/s], shape (n,).
        ddq: Their accelerations [rad/s^2], shape (n,).
        tau: Result [N m], shape (N,).
        scratch: Scratch, shape (N, 18).
    """
    omega, alpha, acc = ZERO, ZERO, (0.0, 0.0, GRAVITY)
    for k in range(bodies.shape[0]):
        axis, j = vec_at(bodies, k, AXIS), int(bodies[k, JOINT])
        here, speed, push = (q[j], dq[j], ddq[j]) if j >= 0 else (0.0, 0.0, 0.0)
        R, p = mat_at(bodies, k, 0), vec_at(bodies, k, P)
        if bodies[k, SLIDES] > 0.0:
            p = plus(p, rotate(R, times(here, axis)))
        elif j >= 0:
            R = compose(R, turn(axis, here))
        acc = unturn(R, plus(acc, _swung(omega, alpha, p)))
        omega, alpha = unturn(R, omega), unturn(R, alpha)
        whirl = cross(omega, times(speed, axis))
        if bodies[k, SLIDES] > 0.0:
            acc = plus(acc, plus(times(push, axis), times(2.0, whirl)))
        else:
            alpha = plus(alpha, plus(times(push, axis), whirl))
            omega = plus(omega, times(speed, axis))
        _note(scratch, k, R, p, *_wrench(bodies, k, omega, alpha, acc))
    force, moment = ZERO, ZERO
    for k in range(bodies.shape[0] - 1, -1, -1):
        force, moment = (
            plus(force, vec_at(scratch, k, _FORCE)),
            plus(moment, vec_at(scratch, k, _MOMENT)),
        )
        axis, j = vec_at(bodies, k, AXIS), int(bodies[k, JOINT])
        tau[k] = dot(axis, force if bodies[k, SLIDES] > 0.0 else moment)
        if j >= 0:
            tau[k] += bodies[k, ROTOR] * ddq[j]
        R, p = mat_at(scratch, k, 0), vec_at(scratch, k, _P)
        force = rotate(R, force)
        moment = plus(rotate(R, moment), cross(p, force))


@kernel
def torques(bodies: Array, motion: Array, tau: Array, scratch: Array) -> None:
    """Write tau of q, dq, ddq at K instants; see :func:`inverse_dynamics`.

    Args:
        bodies: Table of the links, shape (N, 31).
        motion: q, dq, ddq of the active joints, shape (K, 3, n).
        tau: Result [N m], shape (K, N).
        scratch: Scratch, shape (N, 18).
    """
    for k in range(len(motion)):
        inverse_dynamics(bodies, motion[k, 0], motion[k, 1], motion[k, 2], tau[k], scratch)


@kernel
def _swung(omega: Vec, alpha: Vec, r: Vec) -> Vec:
    """Return the acceleration of a point at ``r`` that a turning body adds to its origin's."""
    added: Vec = plus(cross(alpha, r), cross(omega, cross(omega, r)))
    return added


@kernel
def _wrench(bodies: Array, k: int, omega: Vec, alpha: Vec, acc: Vec) -> tuple[Vec, Vec]:
    """Return force and moment about its origin that move link k so, in its frame."""
    com, inertia = vec_at(bodies, k, COM), mat_at(bodies, k, INERTIA)
    force = times(bodies[k, MASS], plus(acc, _swung(omega, alpha, com)))
    spin = plus(rotate(inertia, alpha), cross(omega, rotate(inertia, omega)))
    return force, plus(spin, cross(com, force))


@kernel
def _note(scratch: Array, k: int, R: Mat, p: Vec, force: Vec, moment: Vec) -> None:
    """Keep of link k what the way back needs."""
    for c in range(9):
        scratch[k, c] = R[c]
    put_at(scratch, k, _P, p)
    put_at(scratch, k, _FORCE, force)
    put_at(scratch, k, _MOMENT, moment)
