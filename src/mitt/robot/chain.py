"""Forward kinematics of a serial chain as a kernel: positions, axes and their motion.

| here              | meaning                                            | unit      | shape   |
|-------------------|----------------------------------------------------|-----------|---------|
| ``W``             | rotation axis of each active joint (0 if it slides)| 1         | (n, 3)  |
| ``J``             | dl/dq_k of each active joint                       | m/rad     | (n, 3)  |
| ``p, dp, ddp``    | l(q) and its derivatives along dq with ddq = 0     | m, m/s .. | (3,)    |
| ``dJ, ddJ``       | derivatives of ``J`` along dq with ddq = 0         | m/rad/s ..| (n, 3)  |

All in the world frame. Rows of ``J`` are the columns of the Jacobian.
"""

from typing import NamedTuple

import numpy as np

from mitt.jit import kernel
from mitt.robot.description import ArmModel, joint_motion, transform
from mitt.robot.vectors import (
    IDENTITY,
    ZERO,
    Mat,
    Vec,
    compose,
    cross,
    matrix,
    minus,
    plus,
    put,
    rotate,
    row,
    times,
    turn,
)
from mitt.signals import Array
from mitt.views import view


class Chain(NamedTuple):
    """A chain of n active joints as arrays; joints held still are folded into the placements."""

    R: Array  # (n, 3, 3) orientation of each joint frame in the one before it
    p: Array  # (n, 3) its position there [m]
    axis: Array  # (n, 3) joint axis in its own frame
    prismatic: Array  # (n,) 1 where the joint slides, 0 where it turns
    tip: Array  # (3,) catch point in the last frame [m]


class Motion(NamedTuple):
    """Buffers that the kernel fills; see the module's table."""

    W: Array
    J: Array
    dJ: Array  # noqa: N815
    ddJ: Array  # noqa: N815
    tip: Array  # (3, 3): rows p, dp, ddp
    origin: Array  # (3, n, 3): position, velocity, acceleration of each joint's origin
    line: Array  # (3, n, 3): direction of each joint's axis, its velocity, its acceleration


def chain_of(model: ArmModel) -> Chain:
    """Fold the held joints of an arm into the placements of the active ones."""
    frames, axes, sliding = [], [], []
    T = model.mount
    for link in model.links:
        T = T @ link.placement
        if link.held is None:
            frames.append(T)
            axes.append(link.axis)
            sliding.append(link.prismatic)
            T = transform()
        else:
            T = T @ joint_motion(link, link.held)
    tip = T[:3, :3] @ model.catch_point + T[:3, 3]
    return Chain(
        R=np.ascontiguousarray([F[:3, :3] for F in frames]),
        p=np.ascontiguousarray([F[:3, 3] for F in frames]),
        axis=np.ascontiguousarray(axes),
        prismatic=np.array(sliding, dtype=np.float64),
        tip=tip,
    )


def motion_of(n: int) -> Motion:
    """Return buffers for a chain of ``n`` active joints."""
    return Motion(
        W=np.zeros((n, 3)),
        J=np.zeros((n, 3)),
        dJ=np.zeros((n, 3)),
        ddJ=np.zeros((n, 3)),
        tip=np.zeros((3, 3)),
        origin=np.zeros((3, n, 3)),
        line=np.zeros((3, n, 3)),
    )


def packed_chain(chain: Chain) -> Array:
    """Return a chain as one vector, to be read by :func:`tip_motion`, shape (16 n + 3,)."""
    parts = (chain.R, chain.p, chain.axis, chain.prismatic, chain.tip)
    return np.concatenate([x.ravel() for x in parts])


@kernel
def tip_motion(packed: Array, q: Array, dq: Array, motion: Array) -> Mat:
    """Write where the catch point is and how fast it moves.

    Args:
        packed: As of :func:`packed_chain`.
        q: Joint positions [rad], shape (n,).
        dq: Joint velocities [rad/s], shape (n,).
        motion: Result, position [m] and velocity [m/s] in its first two rows, shape (.., 3).

    Returns:
        The rotation of the last frame, row by row.
    """
    n = len(q)
    R, p, axis = (
        view(packed, 0, (n, 3, 3)),
        view(packed, 9 * n, (n, 3)),
        view(packed, 12 * n, (n, 3)),
    )
    frame, o, omega, v = IDENTITY, ZERO, ZERO, ZERO
    for k in range(n):
        step = rotate(frame, row(p, k))
        o, v = plus(o, step), plus(v, cross(omega, step))
        frame = compose(frame, matrix(R, k))
        w = rotate(frame, row(axis, k))
        if packed[15 * n + k] > 0.0:
            step = times(q[k], w)
            o, v = plus(o, step), plus(v, plus(cross(omega, step), times(dq[k], w)))
        else:
            frame = compose(frame, turn(row(axis, k), q[k]))
            omega = plus(omega, times(dq[k], w))
    a = 16 * n
    step = rotate(frame, (packed[a], packed[a + 1], packed[a + 2]))
    put(motion, 0, plus(o, step))
    put(motion, 1, plus(v, cross(omega, step)))
    return frame


@kernel
def sweep(chain: Chain, q: Array, dq: Array, m: Motion) -> None:
    """Fill all of ``m`` for joint positions ``q`` and constant joint velocities ``dq``."""
    place(chain, q, m)
    move(chain, q, dq, m)


@kernel
def place(chain: Chain, q: Array, m: Motion) -> None:
    """Fill of ``m`` what does not depend on velocities: W, J and the first rows of the others."""
    frame, o = IDENTITY, ZERO
    for k in range(len(q)):
        o = plus(o, rotate(frame, row(chain.p, k)))
        frame = compose(frame, matrix(chain.R, k))
        w = rotate(frame, row(chain.axis, k))
        if chain.prismatic[k] > 0.0:
            o = plus(o, times(q[k], w))
        else:
            frame = compose(frame, turn(row(chain.axis, k), q[k]))
        for c in range(3):
            m.origin[0, k, c], m.line[0, k, c] = o[c], w[c]
    tip = plus(o, rotate(frame, (chain.tip[0], chain.tip[1], chain.tip[2])))
    put(m.tip, 0, tip)
    for k in range(len(q)):
        w = m.line[0, k, 0], m.line[0, k, 1], m.line[0, k, 2]
        o = m.origin[0, k, 0], m.origin[0, k, 1], m.origin[0, k, 2]
        slides = chain.prismatic[k] > 0.0
        put(m.W, k, ZERO if slides else w)
        put(m.J, k, w if slides else cross(w, minus(tip, o)))


@kernel
def move(chain: Chain, q: Array, dq: Array, m: Motion) -> None:
    """Fill in the derivatives in time, for constant joint velocities, of what is placed.

    What lies between two joints is fixed in the body between them, so no rotation is needed.
    """
    omega, domega = ZERO, ZERO
    at, do, ddo = ZERO, ZERO, ZERO
    for k in range(len(q)):
        w = m.line[0, k, 0], m.line[0, k, 1], m.line[0, k, 2]
        o = m.origin[0, k, 0], m.origin[0, k, 1], m.origin[0, k, 2]
        slides = chain.prismatic[k] > 0.0
        fixed = minus(o, at)
        if slides:
            fixed = minus(fixed, times(q[k], w))
        _, dr, ddr = _arm_of(fixed, omega, domega)
        _, dw, ddw = _arm_of(w, omega, domega)
        do, ddo, at = plus(do, dr), plus(ddo, ddr), o
        if slides:
            do = plus(do, plus(times(q[k], dw), times(dq[k], w)))
            ddo = plus(ddo, plus(times(q[k], ddw), times(2.0 * dq[k], dw)))
        else:
            omega, domega = plus(omega, times(dq[k], w)), plus(domega, times(dq[k], dw))
        for c in range(3):
            m.origin[1, k, c], m.origin[2, k, c] = do[c], ddo[c]
            m.line[1, k, c], m.line[2, k, c] = dw[c], ddw[c]
    _, dr, ddr = _arm_of(minus(row(m.tip, 0), at), omega, domega)
    put(m.tip, 1, plus(do, dr))
    put(m.tip, 2, plus(ddo, ddr))
    for k in range(len(q)):
        _column(chain.prismatic[k] > 0.0, k, m)


@kernel
def _arm_of(r: Vec, omega: Vec, domega: Vec) -> tuple[Vec, Vec, Vec]:
    """Return a vector fixed in a turning body, and its first and second derivative in time."""
    dr = cross(omega, r)
    return r, dr, plus(cross(domega, r), cross(omega, dr))


@kernel
def _jet(jets: Array, k: int) -> tuple[Vec, Vec, Vec]:
    """Return a vector and its derivatives from entry k of an array of shape (3, n, 3)."""
    return (
        (jets[0, k, 0], jets[0, k, 1], jets[0, k, 2]),
        (jets[1, k, 0], jets[1, k, 1], jets[1, k, 2]),
        (jets[2, k, 0], jets[2, k, 1], jets[2, k, 2]),
    )


@kernel
def _column(prismatic: bool, k: int, m: Motion) -> None:
    """Write the two derivatives of J_k = w_k x (p - o_k), or of w_k where the joint slides."""
    w, dw, ddw = _jet(m.line, k)
    if prismatic:
        put(m.dJ, k, dw)
        put(m.ddJ, k, ddw)
        return
    o, do, ddo = _jet(m.origin, k)
    r, dr, ddr = minus(row(m.tip, 0), o), minus(row(m.tip, 1), do), minus(row(m.tip, 2), ddo)
    put(m.dJ, k, plus(cross(dw, r), cross(w, dr)))
    turning = plus(cross(ddw, r), times(2.0, cross(dw, dr)))
    put(m.ddJ, k, plus(turning, cross(w, ddr)))
