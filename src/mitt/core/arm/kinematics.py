"""Forward kinematics of a serial chain as kernels: positions, axes and their motion.

| here              | meaning                                            | unit      | shape   |
|-------------------|----------------------------------------------------|-----------|---------|
| ``W``             | rotation axis of each active joint (0 if it slides)| 1         | (n, 3)  |
| ``J``             | dl/dq_k of each active joint                       | m/rad     | (n, 3)  |
| ``p, dp, ddp``    | l(q) and its derivatives along dq with ddq = 0     | m, m/s .. | (3,)    |
| ``dJ, ddJ``       | derivatives of ``J`` along dq with ddq = 0         | m/rad/s ..| (n, 3)  |

All in the world frame. Rows of ``J`` are the columns of the Jacobian.
"""

from typing import Final, NamedTuple, TypeAlias

import numpy as np

from mitt.core.arm.description import ArmModel, joint_motion, transform
from mitt.core.kernels import Fields, Record, kernel
from mitt.core.signals import Array

Vec: TypeAlias = tuple[float, float, float]
Mat: TypeAlias = tuple[float, float, float, float, float, float, float, float, float]
"""Vectors, and rotations row by row, as tuples: what compiled kernels keep in registers, where
views of arrays cost reference counts."""

VECTOR: Final = np.dtype([(name, np.float64) for name in ("x", "y", "z")])
MATRIX: Final = np.dtype([(row + column, np.float64) for row in "xyz" for column in "xyz"])
"""The same as parts of records."""

ZERO: Vec = (0.0, 0.0, 0.0)
IDENTITY: Mat = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)


@kernel
def row(rows: Array, k: int) -> Vec:
    """Return row k of an array of shape (n, 3)."""
    return rows[k, 0], rows[k, 1], rows[k, 2]


@kernel
def put(rows: Array, k: int, v: Vec) -> None:
    """Write row k of an array of shape (n, 3)."""
    rows[k, 0], rows[k, 1], rows[k, 2] = v


@kernel
def cross(a: Vec, b: Vec) -> Vec:
    """Return a x b."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@kernel
def plus(a: Vec, b: Vec) -> Vec:
    """Return a + b."""
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


@kernel
def minus(a: Vec, b: Vec) -> Vec:
    """Return a - b."""
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


@kernel
def times(s: float, a: Vec) -> Vec:
    """Return s a."""
    return s * a[0], s * a[1], s * a[2]


@kernel
def dot(a: Vec, b: Vec) -> float:
    """Return a . b."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@kernel
def rotate(R: Mat, v: Vec) -> Vec:
    """Return R v."""
    return (
        R[0] * v[0] + R[1] * v[1] + R[2] * v[2],
        R[3] * v[0] + R[4] * v[1] + R[5] * v[2],
        R[6] * v[0] + R[7] * v[1] + R[8] * v[2],
    )


@kernel
def unturn(R: Mat, v: Vec) -> Vec:
    """Return R' v: a vector as the turned frame sees it."""
    return (
        R[0] * v[0] + R[3] * v[1] + R[6] * v[2],
        R[1] * v[0] + R[4] * v[1] + R[7] * v[2],
        R[2] * v[0] + R[5] * v[1] + R[8] * v[2],
    )


@kernel
def compose(A: Mat, B: Mat) -> Mat:
    """Return A B."""
    return (
        A[0] * B[0] + A[1] * B[3] + A[2] * B[6],
        A[0] * B[1] + A[1] * B[4] + A[2] * B[7],
        A[0] * B[2] + A[1] * B[5] + A[2] * B[8],
        A[3] * B[0] + A[4] * B[3] + A[5] * B[6],
        A[3] * B[1] + A[4] * B[4] + A[5] * B[7],
        A[3] * B[2] + A[4] * B[5] + A[5] * B[8],
        A[6] * B[0] + A[7] * B[3] + A[8] * B[6],
        A[6] * B[1] + A[7] * B[4] + A[8] * B[7],
        A[6] * B[2] + A[7] * B[5] + A[8] * B[8],
    )


@kernel
def turn(axis: Vec, angle: float) -> Mat:
    """Return the rotation about a unit axis (Rodrigues)."""
    x, y, z = axis
    c, s = np.cos(angle), np.sin(angle)
    u = 1.0 - c
    return (
        c + x * x * u,
        x * y * u - z * s,
        x * z * u + y * s,
        x * y * u + z * s,
        c + y * y * u,
        y * z * u - x * s,
        x * z * u - y * s,
        y * z * u + x * s,
        c + z * z * u,
    )


@kernel
def matrix(rows: Array, k: int) -> Mat:
    """Return matrix k of an array of shape (n, 3, 3)."""
    return (
        rows[k, 0, 0],
        rows[k, 0, 1],
        rows[k, 0, 2],
        rows[k, 1, 0],
        rows[k, 1, 1],
        rows[k, 1, 2],
        rows[k, 2, 0],
        rows[k, 2, 1],
        rows[k, 2, 2],
    )


@kernel
def vec(v: Fields) -> Vec:
    """Return a record of type :data:`VECTOR` as a tuple."""
    return v.x, v.y, v.z


@kernel
def put_vec(record: Fields, v: Vec) -> None:
    """Write a vector into a record of type :data:`VECTOR`."""
    record.x, record.y, record.z = v


@kernel
def mat(m: Fields) -> Mat:
    """Return a record of type :data:`MATRIX` as a tuple."""
    return m.xx, m.xy, m.xz, m.yx, m.yy, m.yz, m.zx, m.zy, m.zz


@kernel
def put_mat(record: Fields, m: Mat) -> None:
    """Write a matrix into a record of type :data:`MATRIX`."""
    record.xx, record.xy, record.xz = m[0], m[1], m[2]
    record.yx, record.yy, record.yz = m[3], m[4], m[5]
    record.zx, record.zy, record.zz = m[6], m[7], m[8]


class Chain(NamedTuple):
    """A chain of n active joints as arrays; joints held still are folded into the placements."""

    R: Array  # (n, 3, 3) orientation of each joint frame in the one before it
    p: Array  # (n, 3) its position there [m]
    axis: Array  # (n, 3) joint axis in its own frame
    prismatic: Array  # (n,) 1 where the joint slides, 0 where it turns
    tip: Array  # (3,) catch point in the last frame [m]


JOINT: Final = np.dtype(
    [
        ("R", MATRIX),  # orientation of the joint's frame in the one before, at joint position 0
        ("p", VECTOR),  # its position there [m]
        ("axis", VECTOR),  # joint axis in its own frame
        ("slides", np.bool_),  # whether the joint slides; else it turns
    ],
    align=True,
)
"""A joint of a :class:`Chain`."""


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
    active = [link for link in model.links if link.held is None]
    frames, T = [], model.mount
    for link in model.links:
        T = T @ link.placement
        if link.held is None:
            frames.append(T)
            T = transform()
        else:
            T = T @ joint_motion(link, link.held)
    return Chain(
        R=np.array([F[:3, :3] for F in frames]),
        p=np.array([F[:3, 3] for F in frames]),
        axis=np.array([link.axis for link in active]),
        prismatic=np.array([link.prismatic for link in active], dtype=np.float64),
        tip=T[:3, :3] @ model.catch_point + T[:3, 3],
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


def joint_records(chain: Chain) -> Record:
    """Return a chain as records of type :data:`JOINT`, shape (n + 1,).

    The last one stands for the catch point; of it only the position counts.
    """
    joints = np.zeros(len(chain.R) + 1, JOINT)
    for joint, R, p, axis, slides in zip(joints[:-1], *chain[:4], strict=True):
        joint["R"], joint["p"], joint["axis"] = tuple(R.flat), tuple(p), tuple(axis)
        joint["slides"] = slides > 0.0
    joints[-1]["p"] = tuple(chain.tip)
    return joints


@kernel
def tip_motion(joints: Record, q: Array, dq: Array, motion: Array) -> Mat:
    """Write where the catch point is and how fast it moves.

    Args:
        joints: As of :func:`joint_records`.
        q: Joint positions [rad], shape (n,).
        dq: Joint velocities [rad/s], shape (n,).
        motion: Result, position [m] and velocity [m/s] in its first two rows, shape (.., 3).

    Returns:
        The rotation of the last frame, row by row.
    """
    frame, o, omega, v = IDENTITY, ZERO, ZERO, ZERO
    for k in range(len(q)):
        joint = joints[k]
        step = rotate(frame, vec(joint.p))
        o, v = plus(o, step), plus(v, cross(omega, step))
        frame = compose(frame, mat(joint.R))
        w = rotate(frame, vec(joint.axis))
        if joint.slides:
            step = times(q[k], w)
            o, v = plus(o, step), plus(v, plus(cross(omega, step), times(dq[k], w)))
        else:
            frame = compose(frame, turn(vec(joint.axis), q[k]))
            omega = plus(omega, times(dq[k], w))
    step = rotate(frame, vec(joints[len(q)].p))
    put(motion, 0, plus(o, step))
    put(motion, 1, plus(v, cross(omega, step)))
    return frame


@kernel
def sweep(chain: Chain, q: Array, dq: Array, m: Motion) -> None:
    """Fill all of ``m`` for joint positions ``q`` and constant joint velocities ``dq``."""
    place(chain, q, m)
    move(chain, q, dq, m)


@kernel
def place(chain: Chain, q: Array, m: Motion) -> Mat:
    """Fill of ``m`` what does not depend on velocities: W, J and the first rows of the others.

    Returns:
        The rotation of the last frame, row by row.
    """
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
    return frame


@kernel
def hand_along(
    chain: Chain, normal: Array, motion: Array, velocity: Array, palm: Array, m: Motion
) -> None:
    """Write the velocity of the catch point and the palm's normal along a motion.

    Args:
        chain: The arm.
        normal: The palm's normal in the last frame, shape (3,).
        motion: q, dq in the first two rows at K instants, shape (K, 2 or more, n).
        velocity: Result [m/s], shape (K, 3).
        palm: Result, shape (K, 3).
        m: Scratch.
    """
    for t in range(len(motion)):
        frame = place(chain, motion[t, 0], m)
        put(palm, t, rotate(frame, (normal[0], normal[1], normal[2])))
        for c in range(3):
            velocity[t, c] = 0.0
            for k in range(motion.shape[2]):
                velocity[t, c] += m.J[k, c] * motion[t, 1, k]


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
