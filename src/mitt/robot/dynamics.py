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
    plus,
    rotate,
    times,
    turn,
    unturn,
)
from mitt.signals import Array

#: Standard gravity rounded as usual in robotics [m/s^2].
GRAVITY = 9.81
#: Columns of the table, and numbers that the kernel notes of each link.
_COLUMNS, _NOTES = 31, 18


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


def notes_of(links: int) -> Array:
    """Return scratch for :func:`inverse_dynamics` of so many links."""
    return np.zeros((links, _NOTES))


@kernel
def inverse_dynamics(
    bodies: Array, q: Array, dq: Array, ddq: Array, tau: Array, notes: Array
) -> None:
    """Write tau of eq. (14) for all links.

    Args:
        bodies: Table of the links, shape (N, 31).
        q: Active joint positions [rad], shape (n,).
        dq: Their velocities [rad/s], shape (n,).
        ddq: Their accelerations [rad/s^2], shape (n,).
        tau: Result [N m], shape (N,).
        notes: Scratch, shape (N, 18).
    """
    omega, alpha, acc = ZERO, ZERO, (0.0, 0.0, GRAVITY)
    for k in range(bodies.shape[0]):
        axis, j = _vec(bodies, k, 12), int(bodies[k, 30])
        here, speed, push = (q[j], dq[j], ddq[j]) if j >= 0 else (0.0, 0.0, 0.0)
        R, p = _mat(bodies, k, 0), _vec(bodies, k, 9)
        if bodies[k, 15] > 0.0:
            p = plus(p, rotate(R, times(here, axis)))
        elif j >= 0:
            R = compose(R, turn(axis, here))
        acc = unturn(R, plus(acc, _swung(omega, alpha, p)))
        omega, alpha = unturn(R, omega), unturn(R, alpha)
        whirl = cross(omega, times(speed, axis))
        if bodies[k, 15] > 0.0:
            acc = plus(acc, plus(times(push, axis), times(2.0, whirl)))
        else:
            alpha = plus(alpha, plus(times(push, axis), whirl))
            omega = plus(omega, times(speed, axis))
        _note(notes, k, R, p, *_wrench(bodies, k, omega, alpha, acc))
    force, moment = ZERO, ZERO
    for k in range(bodies.shape[0] - 1, -1, -1):
        force, moment = plus(force, _vec(notes, k, 12)), plus(moment, _vec(notes, k, 15))
        axis, j = _vec(bodies, k, 12), int(bodies[k, 30])
        tau[k] = dot(axis, force if bodies[k, 15] > 0.0 else moment)
        if j >= 0:
            tau[k] += bodies[k, 29] * ddq[j]
        R, p = _mat(notes, k, 0), _vec(notes, k, 9)
        force = rotate(R, force)
        moment = plus(rotate(R, moment), cross(p, force))


@kernel
def torques(bodies: Array, motion: Array, tau: Array, notes: Array) -> None:
    """Write tau of q, dq, ddq at K instants; see :func:`inverse_dynamics`.

    Args:
        bodies: Table of the links, shape (N, 31).
        motion: q, dq, ddq of the active joints, shape (K, 3, n).
        tau: Result [N m], shape (K, N).
        notes: Scratch, shape (N, 18).
    """
    for k in range(len(motion)):
        inverse_dynamics(bodies, motion[k, 0], motion[k, 1], motion[k, 2], tau[k], notes)


@kernel
def _swung(omega: Vec, alpha: Vec, r: Vec) -> Vec:
    """Return the acceleration of a point at ``r`` that a turning body adds to its origin's."""
    added: Vec = plus(cross(alpha, r), cross(omega, cross(omega, r)))
    return added


@kernel
def _wrench(bodies: Array, k: int, omega: Vec, alpha: Vec, acc: Vec) -> tuple[Vec, Vec]:
    """Return force and moment about its origin that move link k so, in its frame."""
    com, inertia = _vec(bodies, k, 17), _mat(bodies, k, 20)
    force = times(bodies[k, 16], plus(acc, _swung(omega, alpha, com)))
    spin = plus(rotate(inertia, alpha), cross(omega, rotate(inertia, omega)))
    return force, plus(spin, cross(com, force))


@kernel
def _note(notes: Array, k: int, R: Mat, p: Vec, force: Vec, moment: Vec) -> None:
    """Keep of link k what the way back needs."""
    for c in range(9):
        notes[k, c] = R[c]
    for c in range(3):
        notes[k, 9 + c], notes[k, 12 + c], notes[k, 15 + c] = p[c], force[c], moment[c]


@kernel
def _vec(rows: Array, k: int, c: int) -> Vec:
    """Return three numbers of row k from column c."""
    return rows[k, c], rows[k, c + 1], rows[k, c + 2]


@kernel
def _mat(rows: Array, k: int, c: int) -> Mat:
    """Return nine numbers of row k from column c."""
    return (
        rows[k, c], rows[k, c + 1], rows[k, c + 2],
        rows[k, c + 3], rows[k, c + 4], rows[k, c + 5],
        rows[k, c + 6], rows[k, c + 7], rows[k, c + 8],
    )  # fmt: skip
