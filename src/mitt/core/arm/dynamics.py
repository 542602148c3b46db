"""Dynamics of a serial chain as kernels: the torque of eq. (14), its derivatives, the mass matrix.

Torques are those of every link, held ones included: the limits of drives that share motors need the
torque with which a brake or a neighbour holds them. Tests hold all of it to Pinocchio and MuJoCo.

The torque alone is recursive Newton-Euler in the links' frames. The derivatives are those of Singh,
Russell and Wensing (RA-L 2022), in the world frame, where the bodies beyond a joint simply add up
(``_SUMS``). Their 6 x 6 matrix 2B is, in these sums, the wrench of the force field 2 m w x v(r):
2 w x p, with the moment 2 (tr(K) w - K' w).
"""

from typing import Final, TypeAlias

import numpy as np

from mitt.core.arm.description import ArmModel, joint_motion
from mitt.core.arm.kinematics import (
    IDENTITY,
    MATRIX,
    VECTOR,
    ZERO,
    Mat,
    Vec,
    compose,
    cross,
    dot,
    mat,
    plus,
    put_mat,
    put_vec,
    rotate,
    times,
    turn,
    unturn,
    vec,
)
from mitt.core.kernels import Fields, Record, kernel
from mitt.core.signals import GRAVITY, Array

LINK: Final = np.dtype(
    [
        ("R", MATRIX),  # orientation of the link's frame in the one before, at joint position 0
        ("p", VECTOR),  # its position there [m]
        ("axis", VECTOR),  # joint axis in the link's own frame
        ("slides", np.bool_),  # whether the joint slides; else it turns
        (
            "joint",
            np.int64,
        ),  # index among the active joints, -1 for a held one, which R and p contain
        ("mass", np.float64),  # [kg]
        ("com", VECTOR),  # centre of mass [m]
        ("inertia", MATRIX),  # about the centre of mass [kg m^2]
        ("rotor", np.float64),  # rotor inertia at the joint [kg m^2]
    ],
    align=True,
)
"""A link and the joint before it."""

_FORCES: Final = np.dtype(
    [
        ("R", MATRIX),  # frame of the link in the one before
        ("p", VECTOR),  # its position there [m]
        ("force", VECTOR),  # that moves the link [N]
        ("moment", VECTOR),  # about the frame's origin [N m]
    ]
)
"""What the torque needs of a link on the way back, in the link's frame."""

_PAIR: Final = np.dtype([("linear", VECTOR), ("angular", VECTOR)])
_SYM: Final = np.dtype([(x, np.float64) for x in ("xx", "yy", "zz", "xy", "xz", "yz")])
_SUMS: Final = np.dtype(
    [
        ("S", _PAIR),  # motion of the joint: velocity at the world's origin, turning [a unit of q]
        ("dS", _PAIR),  # v x S, its change while the chain moves
        ("ddS", _PAIR),  # a x S + v x dS
        ("mass", np.float64),  # of the link, then with all links beyond [kg], as all that follows
        ("mc", VECTOR),  # mass times centre [kg m]
        ("E", _SYM),  # second moments, the sum of m r r' over points [kg m^2]
        ("load", _PAIR),  # force [N] and its moment about the world's origin [N m]
        ("momentum", VECTOR),  # p [kg m/s]
        ("K", MATRIX),  # the sum of m r v' over points [kg m^2/s]
    ]
)
"""What the derivatives need of a link, in the world frame."""

Pair: TypeAlias = tuple[Vec, Vec]
"""A spatial vector in the world frame: of a motion the velocity at the world's origin and the
turning [m/s, rad/s], of a load a force and its moment about the world's origin [N, N m]."""
Sym: TypeAlias = tuple[float, float, float, float, float, float]
"""A symmetric matrix: xx, yy, zz, xy, xz, yz."""


def bodies_of(model: ArmModel) -> Record:
    """Return the links of an arm as records of type :data:`LINK`, shape (N,)."""
    rows, active = np.zeros(len(model.links), LINK), 0
    for k, (row, link) in enumerate(zip(rows, model.links, strict=True)):
        T = link.placement if k > 0 else model.mount @ link.placement
        T = T if link.held is None else T @ joint_motion(link, link.held)
        row["R"], row["p"], row["axis"] = tuple(T[:3, :3].flat), tuple(T[:3, 3]), tuple(link.axis)
        row["slides"], row["mass"], row["com"] = link.prismatic, link.mass, tuple(link.com)
        row["inertia"], row["rotor"] = tuple(link.inertia.flat), link.armature
        row["joint"] = -1 if link.held is not None else active
        active += link.held is None
    return rows


def dynamics_scratch(links: int) -> Record:
    """Return scratch for :func:`inverse_dynamics` of so many links."""
    return np.zeros(links, _FORCES)


def slopes_work(links: int) -> Record:
    """Return scratch for :func:`torque_slopes` and :func:`bias_and_mass` of so many links."""
    return np.zeros(links, _SUMS)


@kernel
def inverse_dynamics(
    bodies: Record, q: Array, dq: Array, ddq: Array, tau: Array, scratch: Record
) -> None:
    """Write tau of eq. (14) for all links.

    Args:
        bodies: The links, shape (N,).
        q: Active joint positions [rad], shape (n,).
        dq: Their velocities [rad/s], shape (n,).
        ddq: Their accelerations [rad/s^2], shape (n,).
        tau: Result [N m], shape (N,).
        scratch: Of :func:`dynamics_scratch`.
    """
    omega, alpha, acc = ZERO, ZERO, (0.0, 0.0, GRAVITY)
    for k in range(len(bodies)):
        axis, j = vec(bodies[k].axis), bodies[k].joint
        here, speed, push = (q[j], dq[j], ddq[j]) if j >= 0 else (0.0, 0.0, 0.0)
        R, p = mat(bodies[k].R), vec(bodies[k].p)
        if bodies[k].slides:
            p = plus(p, rotate(R, times(here, axis)))
        elif j >= 0:
            R = compose(R, turn(axis, here))
        acc = unturn(R, plus(acc, _swung(omega, alpha, p)))
        omega, alpha = unturn(R, omega), unturn(R, alpha)
        whirl = cross(omega, times(speed, axis))
        if bodies[k].slides:
            acc = plus(acc, plus(times(push, axis), times(2.0, whirl)))
        else:
            alpha = plus(alpha, plus(times(push, axis), whirl))
            omega = plus(omega, times(speed, axis))
        put_mat(scratch[k].R, R)
        put_vec(scratch[k].p, p)
        force, moment = _wrench(bodies[k], omega, alpha, acc)
        put_vec(scratch[k].force, force)
        put_vec(scratch[k].moment, moment)
    force, moment = ZERO, ZERO
    for k in range(len(bodies) - 1, -1, -1):
        force = plus(force, vec(scratch[k].force))
        moment = plus(moment, vec(scratch[k].moment))
        axis, j = vec(bodies[k].axis), bodies[k].joint
        tau[k] = dot(axis, force if bodies[k].slides else moment)
        if j >= 0:
            tau[k] += bodies[k].rotor * ddq[j]
        R, p = mat(scratch[k].R), vec(scratch[k].p)
        force = rotate(R, force)
        moment = plus(rotate(R, moment), cross(p, force))


@kernel
def torques(bodies: Record, motion: Array, tau: Array, scratch: Record) -> None:
    """Write tau of q, dq, ddq at K instants; see :func:`inverse_dynamics`.

    Args:
        bodies: The links, shape (N,).
        motion: q, dq, ddq of the active joints, shape (K, 3, n).
        tau: Result [N m], shape (K, N).
        scratch: Of :func:`dynamics_scratch`.
    """
    for k in range(len(motion)):
        inverse_dynamics(bodies, motion[k, 0], motion[k, 1], motion[k, 2], tau[k], scratch)


@kernel
def _swung(omega: Vec, alpha: Vec, r: Vec) -> Vec:
    """Return the acceleration of a point at ``r`` that a turning body adds to its origin's."""
    added: Vec = plus(cross(alpha, r), cross(omega, cross(omega, r)))
    return added


@kernel
def _wrench(link: Fields, omega: Vec, alpha: Vec, acc: Vec) -> tuple[Vec, Vec]:
    """Return force and moment about its origin that move a link so, in its frame."""
    com, inertia = vec(link.com), mat(link.inertia)
    force = times(link.mass, plus(acc, _swung(omega, alpha, com)))
    spin = plus(rotate(inertia, alpha), cross(omega, rotate(inertia, omega)))
    return force, plus(spin, cross(com, force))


@kernel
def torque_slopes(bodies: Record, motion: Array, tau: Array, slope: Array, work: Record) -> None:
    """Write tau of eq. (14) and how it answers to the active joints' motion.

    Args:
        bodies: As for :func:`inverse_dynamics`.
        motion: q, dq, ddq of the active joints in the first three rows, shape (3 or more, n).
        tau: Torques of all N links [N m], shape (N,).
        slope: d tau/dq, d tau/d dq and M over the active joints, shape (3, N, n).
        work: Of :func:`slopes_work`.
    """
    _outwards(bodies, motion, work)
    count = len(bodies)
    for j in range(count - 1, -1, -1):
        tau[j] = _axis_load(bodies, motion, work, j)
        _row_and_column(bodies, work, j, slope)
        _mass(bodies, work, j, slope[2])
        if j > 0:
            _add_body(work[j - 1], work[j])
            _add_flow(work[j - 1], work[j])
    _add_rotors(bodies, slope[2])


@kernel
def slopes_along(bodies: Record, motion: Array, tau: Array, slope: Array, work: Record) -> None:
    """Write torques, (K, N), and how they answer, (K, 3, N, n), at K instants of a motion.

    See :func:`torque_slopes`.
    """
    for k in range(len(motion)):
        torque_slopes(bodies, motion[k], tau[k], slope[k], work)


@kernel
def bias_and_mass(bodies: Record, motion: Array, tau: Array, M: Array, work: Record) -> None:
    """Write tau of eq. (14) and M over the active joints alone; see :func:`torque_slopes`.

    Args:
        bodies: As for :func:`torque_slopes`.
        motion: As for :func:`torque_slopes`.
        tau: As for :func:`torque_slopes`.
        M: Answer of all torques to the active joints' accelerations, shape (N, n).
        work: As for :func:`torque_slopes`.
    """
    _outwards(bodies, motion, work)
    for j in range(len(bodies) - 1, -1, -1):
        tau[j] = _axis_load(bodies, motion, work, j)
        _mass(bodies, work, j, M)
        if j > 0:
            _add_body(work[j - 1], work[j])
    _add_rotors(bodies, M)


@kernel
def solve_positive(system: Array) -> bool:
    """Solve A X = B for [A B], A positive definite; Numba's own solver needs SciPy.

    Args:
        system: A beside B, shape (n, n + m); overwritten, B by X.

    Returns:
        False where A is not positive definite: then X says nothing.
    """
    n, columns = system.shape
    for c in range(n):
        if not system[c, c] > 0.0:
            return False
        for r in range(c + 1, n):
            factor = system[r, c] / system[c, c]
            for k in range(c + 1, columns):
                system[r, k] -= factor * system[c, k]
    for x in range(n, columns):
        for c in range(n - 1, -1, -1):
            for k in range(c + 1, n):
                system[c, x] -= system[c, k] * system[k, x]
            system[c, x] /= system[c, c]
    return True


@kernel
def _add_body(sums: Fields, beyond: Fields) -> None:
    """Add mass, moments and load beyond a joint to those beyond the joint before."""
    sums.mass += beyond.mass
    put_vec(sums.mc, plus(vec(sums.mc), vec(beyond.mc)))
    sums.E.xx += beyond.E.xx
    sums.E.yy += beyond.E.yy
    sums.E.zz += beyond.E.zz
    sums.E.xy += beyond.E.xy
    sums.E.xz += beyond.E.xz
    sums.E.yz += beyond.E.yz
    put_pair(sums.load, plus_pair(pair(sums.load), pair(beyond.load)))


@kernel
def _add_flow(sums: Fields, beyond: Fields) -> None:
    """Add momentum and K, which count for the slopes alone, likewise."""
    K, more = mat(sums.K), mat(beyond.K)
    put_vec(sums.momentum, plus(vec(sums.momentum), vec(beyond.momentum)))
    put_mat(
        sums.K,
        (
            K[0] + more[0],
            K[1] + more[1],
            K[2] + more[2],
            K[3] + more[3],
            K[4] + more[4],
            K[5] + more[5],
            K[6] + more[6],
            K[7] + more[7],
            K[8] + more[8],
        ),
    )


@kernel
def _add_rotors(bodies: Record, M: Array) -> None:
    """Add the rotors to the mass matrix, shape (N, n)."""
    for j in range(len(bodies)):
        a = bodies[j].joint
        if a >= 0:
            M[j, a] += bodies[j].rotor


@kernel
def _mass(bodies: Record, work: Record, j: int, M: Array) -> None:
    """Write row and column of M where link j comes last, with the sums beyond it."""
    here, S = bodies[j].joint, pair(work[j].S)
    if here >= 0:
        by_ddq = _inertia(work[j], S)
        for i in range(j + 1):
            M[i, here] = power(pair(work[i].S), by_ddq)
    for i in range(j):
        a = bodies[i].joint
        if a >= 0:
            M[j, a] = power(S, _inertia(work[j], pair(work[i].S)))


@kernel
def _axis_load(bodies: Record, motion: Array, work: Record, k: int) -> float:
    """Return what the drive of link k must give against the load of all beyond it."""
    S, (force, moment) = pair(work[k].S), pair(work[k].load)
    total = 0.0
    for c in range(3):
        total += S[0][c] * force[c]
    for c in range(3):
        total += S[1][c] * moment[c]
    a = bodies[k].joint
    return total + (bodies[k].rotor * motion[2, a] if a >= 0 else 0.0)


@kernel
def _row_and_column(bodies: Record, work: Record, j: int, slope: Array) -> None:
    """Write how the torques of link j and of those before it answer to one another's motion.

    With the sums beyond j, for i before j: what moves q_j changes the load of j by
    2B dS_j + I ddS_j + S_j x* f, felt at i; what moves q_i changes it by 2B dS_i + I ddS_i, felt
    at j, the turning of axis and load together changing nothing.
    """
    here = bodies[j].joint
    S, dS, ddS = pair(work[j].S), pair(work[j].dS), pair(work[j].ddS)
    if here >= 0:
        force, moment = pair(work[j].load)
        turned = cross(S[1], force), plus(cross(S[0], force), cross(S[1], moment))
        by_q = plus_pair(plus_pair(_coriolis(work[j], dS), _inertia(work[j], ddS)), turned)
        by_dq = plus_pair(
            _coriolis(work[j], S), _inertia(work[j], (times(2.0, dS[0]), times(2.0, dS[1])))
        )
        for i in range(j + 1):
            T = pair(work[i].S)
            slope[0, i, here] = power(T, by_q)
            slope[1, i, here] = power(T, by_dq)
    for i in range(j):
        a = bodies[i].joint
        if a < 0:
            continue
        T, dT, ddT = pair(work[i].S), pair(work[i].dS), pair(work[i].ddS)
        slope[0, j, a] = power(S, plus_pair(_coriolis(work[j], dT), _inertia(work[j], ddT)))
        twice = times(2.0, dT[0]), times(2.0, dT[1])
        slope[1, j, a] = power(S, plus_pair(_coriolis(work[j], T), _inertia(work[j], twice)))


@kernel
def _outwards(bodies: Record, motion: Array, work: Record) -> None:
    """Write axes, their changes and the body's own sums of each link, from the base outwards."""
    frame, o = IDENTITY, ZERO
    v, omega, a, domega = ZERO, ZERO, (0.0, 0.0, GRAVITY), ZERO
    for k in range(len(bodies)):
        joint = bodies[k].joint
        q, dq, ddq = 0.0, 0.0, 0.0
        if joint >= 0:
            q, dq, ddq = motion[0, joint], motion[1, joint], motion[2, joint]
        o = plus(o, rotate(frame, vec(bodies[k].p)))
        frame = compose(frame, mat(bodies[k].R))
        axis = vec(bodies[k].axis)
        w = rotate(frame, axis)
        if bodies[k].slides:
            o = plus(o, times(q, w))
            S = w, ZERO
        else:
            if joint >= 0:
                frame = compose(frame, turn(axis, q))
            S = cross(o, w), w
        dS = crossed((v, omega), S)
        ddS = plus_pair(crossed((a, domega), S), crossed((v, omega), dS))
        put_pair(work[k].S, S)
        put_pair(work[k].dS, dS)
        put_pair(work[k].ddS, ddS)
        v, omega = plus(v, times(dq, S[0])), plus(omega, times(dq, S[1]))
        a = plus(a, plus(times(ddq, S[0]), times(dq, dS[0])))
        domega = plus(domega, plus(times(ddq, S[1]), times(dq, dS[1])))
        _body(bodies[k], work[k], (frame, o), (v, omega, a, domega))


@kernel
def _body(
    link: Fields, sums: Fields, pose: tuple[Mat, Vec], moving: tuple[Vec, Vec, Vec, Vec]
) -> None:
    """Write mass, moments, load, momentum and K of one link."""
    frame, o = pose
    v, omega, a, domega = moving
    c = plus(o, rotate(frame, vec(link.com)))
    mc, E = times(link.mass, c), _second_moments(link, frame, c)
    p = plus(times(link.mass, v), cross(omega, mc))
    # K = mc v' + E [omega]x': row r of the second term is (omega x (row r of E)).
    k0 = plus(times(mc[0], v), cross(omega, (E[0], E[3], E[4])))
    k1 = plus(times(mc[1], v), cross(omega, (E[3], E[1], E[5])))
    k2 = plus(times(mc[2], v), cross(omega, (E[4], E[5], E[2])))
    sums.mass = link.mass
    put_vec(sums.mc, mc)
    sums.E.xx, sums.E.yy, sums.E.zz, sums.E.xy, sums.E.xz, sums.E.yz = E
    put_vec(sums.momentum, p)
    put_mat(sums.K, (*k0, *k1, *k2))
    trace = k0[0] + k1[1] + k2[2]
    back = plus(times(omega[0], k0), plus(times(omega[1], k1), times(omega[2], k2)))
    force, moment = _inertia(sums, (a, domega))
    force = plus(force, cross(omega, p))
    put_pair(sums.load, (force, plus(moment, plus(times(trace, omega), times(-1.0, back)))))


@kernel
def _second_moments(link: Fields, R: Mat, c: Vec) -> Sym:
    """Return the sum of m r r' of a body about the world's origin, its centre being at ``c``.

    About the centre, in the body's axes, it is tr(I)/2 - I.
    """
    m, J = link.mass, link.inertia
    half, xy, xz, yz = 0.5 * (J.xx + J.yy + J.zz), -J.xy, -J.xz, -J.yz
    u, v, w = (half - J.xx, xy, xz), (xy, half - J.yy, yz), (xz, yz, half - J.zz)
    a, b, d = (R[0], R[1], R[2]), (R[3], R[4], R[5]), (R[6], R[7], R[8])
    ea = dot(u, a), dot(v, a), dot(w, a)
    eb = dot(u, b), dot(v, b), dot(w, b)
    ed = dot(u, d), dot(v, d), dot(w, d)
    return (
        dot(ea, a) + m * c[0] * c[0],
        dot(eb, b) + m * c[1] * c[1],
        dot(ed, d) + m * c[2] * c[2],
        dot(ea, b) + m * c[0] * c[1],
        dot(ea, d) + m * c[0] * c[2],
        dot(eb, d) + m * c[1] * c[2],
    )


@kernel
def _inertia(body: Fields, motion: Pair) -> Pair:
    """Return I times a motion (velocity at the origin u, turning w)."""
    (u, w), mc, E = motion, vec(body.mc), body.E
    turned = (
        (E.yy + E.zz) * w[0] - E.xy * w[1] - E.xz * w[2],
        -E.xy * w[0] + (E.xx + E.zz) * w[1] - E.yz * w[2],
        -E.xz * w[0] - E.yz * w[1] + (E.xx + E.yy) * w[2],
    )
    return plus(times(body.mass, u), cross(w, mc)), plus(cross(mc, u), turned)


@kernel
def _coriolis(body: Fields, motion: Pair) -> Pair:
    """Return 2B times a motion: the wrench of the force field 2 m w x v(r)."""
    w, K = motion[1], mat(body.K)
    trace = K[0] + K[4] + K[8]
    back = plus(
        times(w[0], (K[0], K[1], K[2])),
        plus(times(w[1], (K[3], K[4], K[5])), times(w[2], (K[6], K[7], K[8]))),
    )
    moment = plus(times(trace, w), times(-1.0, back))
    return times(2.0, cross(w, vec(body.momentum))), times(2.0, moment)


@kernel
def crossed(v: Pair, m: Pair) -> Pair:
    """Return v x m of two spatial motions (velocity at the origin, turning)."""
    return plus(cross(v[1], m[0]), cross(v[0], m[1])), cross(v[1], m[1])


@kernel
def power(m: Pair, f: Pair) -> float:
    """Return the power of a load on a motion."""
    return float(dot(m[0], f[0]) + dot(m[1], f[1]))


@kernel
def plus_pair(a: Pair, b: Pair) -> Pair:
    """Return the sum of two spatial vectors."""
    return plus(a[0], b[0]), plus(a[1], b[1])


@kernel
def pair(record: Fields) -> Pair:
    """Return a record of type ``_PAIR`` as two vectors."""
    return vec(record.linear), vec(record.angular)


@kernel
def put_pair(record: Fields, v: Pair) -> None:
    """Write two vectors into a record of type ``_PAIR``."""
    put_vec(record.linear, v[0])
    put_vec(record.angular, v[1])
