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
from numba import njit
from numpy.typing import NDArray

from mitt.robot.description import ArmModel, joint_motion, transform
from mitt.signals import Array


class Chain(NamedTuple):
    """A chain of n active joints as arrays; joints held still are folded into the placements."""

    R: Array  # (n, 3, 3) orientation of each joint frame in the one before it
    p: Array  # (n, 3) its position there [m]
    axis: Array  # (n, 3) joint axis in its own frame
    prismatic: NDArray[np.bool_]  # (n,)
    tip: Array  # (3,) catch point in the last frame [m]


class Motion(NamedTuple):
    """Buffers that the kernel fills; see the module's table."""

    W: Array
    J: Array
    dJ: Array  # noqa: N815
    ddJ: Array  # noqa: N815
    tip: Array  # (3, 3): rows p, dp, ddp
    frame: Array  # (2, 3, 3): orientation of the joint frame at hand, and the one before it
    origin: Array  # (n, 3, 3): rows position, velocity, acceleration of each joint's origin
    line: Array  # (n, 3, 3): rows direction of each joint's axis, its velocity, its acceleration
    spin: Array  # (5, 3): angular velocity and acceleration of the link at hand, scratch


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
        prismatic=np.array(sliding),
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
        frame=np.zeros((2, 3, 3)),
        origin=np.zeros((n, 3, 3)),
        line=np.zeros((n, 3, 3)),
        spin=np.zeros((5, 3)),
    )


@njit(cache=True)
def cross(a: Array, b: Array, out: Array) -> None:
    """Write a x b."""
    x = a[1] * b[2] - a[2] * b[1]
    y = a[2] * b[0] - a[0] * b[2]
    z = a[0] * b[1] - a[1] * b[0]
    out[0], out[1], out[2] = x, y, z


@njit(cache=True)
def add_cross(a: Array, b: Array, factor: float, out: Array) -> None:
    """Add factor (a x b)."""
    x = a[1] * b[2] - a[2] * b[1]
    y = a[2] * b[0] - a[0] * b[2]
    z = a[0] * b[1] - a[1] * b[0]
    out[0] += factor * x
    out[1] += factor * y
    out[2] += factor * z


@njit(cache=True)
def sweep(chain: Chain, q: Array, dq: Array, m: Motion) -> None:
    """Fill all of ``m`` for joint positions ``q`` and constant joint velocities ``dq``."""
    n = len(q)
    omega, domega = m.spin[0], m.spin[1]
    omega[:] = 0.0
    domega[:] = 0.0
    m.frame[1] = 0.0
    for c in range(3):
        m.frame[1, c, c] = 1.0
    for k in range(n):
        _enter(chain, k, m)
        if chain.prismatic[k]:
            _slide(q[k], dq[k], k, m)
        else:
            _turn(chain.axis[k], q[k], m)
            for c in range(3):
                domega[c] += m.line[k, 1, c] * dq[k]
                omega[c] += m.line[k, 0, c] * dq[k]
        m.frame[1] = m.frame[0]
    _carry(chain.tip, m.origin[n - 1], m.tip, m)
    for k in range(n):
        _column(chain.prismatic[k], k, m)


@njit(cache=True)
def _enter(chain: Chain, k: int, m: Motion) -> None:
    """Move on to joint k: its origin and axis, still carried by the link before it."""
    if k == 0:
        m.origin[0, 0] = chain.p[0]
        m.origin[0, 1:] = 0.0
    else:
        _carry(chain.p[k], m.origin[k - 1], m.origin[k], m)
    _product(m.frame[1], chain.R[k], m.frame[0])
    omega, domega, scratch = m.spin[0], m.spin[1], m.spin[2]
    w, dw, ddw = m.line[k, 0], m.line[k, 1], m.line[k, 2]
    for r in range(3):
        w[r] = 0.0
        for c in range(3):
            w[r] += m.frame[0, r, c] * chain.axis[k, c]
    cross(omega, w, dw)
    cross(domega, w, ddw)
    scratch[:] = dw
    add_cross(omega, scratch, 1.0, ddw)


@njit(cache=True)
def _carry(offset: Array, origin: Array, out: Array, m: Motion) -> None:
    """Write position, velocity, acceleration of a point at ``offset`` in the link at hand."""
    omega, domega, r, v = m.spin[0], m.spin[1], m.spin[2], m.spin[3]
    for i in range(3):
        r[i] = 0.0
        for c in range(3):
            r[i] += m.frame[1, i, c] * offset[c]
    cross(omega, r, v)
    for i in range(3):
        out[0, i] = origin[0, i] + r[i]
        out[1, i] = origin[1, i] + v[i]
        out[2, i] = origin[2, i]
    add_cross(domega, r, 1.0, out[2])
    add_cross(omega, v, 1.0, out[2])


@njit(cache=True)
def _slide(q: float, dq: float, k: int, m: Motion) -> None:
    """Move the origin of a prismatic joint along its axis."""
    for c in range(3):
        w, dw, ddw = m.line[k, 0, c], m.line[k, 1, c], m.line[k, 2, c]
        m.origin[k, 0, c] += w * q
        m.origin[k, 1, c] += dw * q + w * dq
        m.origin[k, 2, c] += ddw * q + 2.0 * dw * dq


@njit(cache=True)
def _turn(axis: Array, angle: float, m: Motion) -> None:
    """Turn the joint frame about the joint's axis (Rodrigues)."""
    x, y, z = axis[0], axis[1], axis[2]
    c, s = np.cos(angle), np.sin(angle)
    u = 1.0 - c
    for r in range(3):
        a, b, d = m.frame[0, r, 0], m.frame[0, r, 1], m.frame[0, r, 2]
        m.frame[0, r, 0] = a * (c + x * x * u) + b * (x * y * u + z * s) + d * (x * z * u - y * s)
        m.frame[0, r, 1] = a * (x * y * u - z * s) + b * (c + y * y * u) + d * (y * z * u + x * s)
        m.frame[0, r, 2] = a * (x * z * u + y * s) + b * (y * z * u - x * s) + d * (c + z * z * u)


@njit(cache=True)
def _product(A: Array, B: Array, out: Array) -> None:
    """Write A @ B for 3 x 3 matrices."""
    for r in range(3):
        for c in range(3):
            out[r, c] = A[r, 0] * B[0, c] + A[r, 1] * B[1, c] + A[r, 2] * B[2, c]


@njit(cache=True)
def _column(prismatic: bool, k: int, m: Motion) -> None:
    """Write J_k = w_k x (p - o_k), or w_k where the joint slides, and its two derivatives."""
    w, dw, ddw = m.line[k, 0], m.line[k, 1], m.line[k, 2]
    if prismatic:
        m.W[k] = 0.0
        m.J[k], m.dJ[k], m.ddJ[k] = w, dw, ddw
        return
    m.W[k] = w
    r, dr, ddr = m.spin[2], m.spin[3], m.spin[4]
    for c in range(3):
        r[c] = m.tip[0, c] - m.origin[k, 0, c]
        dr[c] = m.tip[1, c] - m.origin[k, 1, c]
        ddr[c] = m.tip[2, c] - m.origin[k, 2, c]
    cross(w, r, m.J[k])
    cross(dw, r, m.dJ[k])
    add_cross(w, dr, 1.0, m.dJ[k])
    cross(ddw, r, m.ddJ[k])
    add_cross(dw, dr, 2.0, m.ddJ[k])
    add_cross(w, ddr, 1.0, m.ddJ[k])
