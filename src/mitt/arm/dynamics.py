"""Dynamics of a serial chain as kernels: the torque of eq. (14), its derivatives, the mass matrix.

Torques are those of every link, held ones included: the limits of drives that share motors need the
torque with which a brake or a neighbour holds them. Tests hold all of it to Pinocchio and MuJoCo.

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

The torque alone is recursive Newton-Euler in the links' frames. The derivatives are those of Singh,
Russell and Wensing (RA-L 2022), in the world frame, where the bodies beyond a joint simply add up:

| here     | meaning                                                    | unit             | shape |
|----------|------------------------------------------------------------|------------------|-------|
| ``S``    | motion of a joint: velocity at the world's origin, turning | m/s, rad/s a unit| (6,)  |
| ``dS``   | v x S, its change while the chain moves                    |                  | (6,)  |
| ``ddS``  | a x S + v x dS                                             |                  | (6,)  |
| ``mass`` | mass, mass times centre, second moments: sums over points  | kg, kg m, kg m^2 | (10,) |
| ``flow`` | momentum p and K = sum of m r v' over points               | kg m/s, kg m^2/s | (12,) |
| ``load`` | force and its moment about the world's origin              | N, N m           | (6,)  |

Their 6 x 6 matrix 2B is, in these sums, the wrench of the force field 2 m w x v(r): 2 w x p, with
the moment 2 (tr(K) w - K' w).
"""

from typing import TypeAlias

import numpy as np

from mitt.arm.description import ArmModel, joint_motion
from mitt.arm.kinematics import (
    IDENTITY,
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
from mitt.kernels import kernel
from mitt.signals import GRAVITY, Array

#: Columns of the table: rotation (from 0) and position of the joint frame, joint axis, whether it
#: slides, mass, centre, inertia, rotor, index among the active joints.
P, AXIS, SLIDES, MASS, COM, INERTIA, ROTOR, JOINT, _COLUMNS = 9, 12, 15, 16, 17, 20, 29, 30, 31
#: Columns of the scratch of the torque: rotation (from 0), position, force and moment of a link.
_P, _FORCE, _MOMENT, _SCRATCH = 9, 12, 15, 18
#: Columns of the scratch of the derivatives; the second table above.
_S, _DS, _DDS, _M, _MC, _EE, _F, _W, _PP, _K, _WIDTH = 0, 6, 12, 18, 19, 22, 28, 31, 34, 37, 46

Pair: TypeAlias = tuple[Vec, Vec]
"""A spatial vector in the world frame: of a motion the velocity at the world's origin and the
turning [m/s, rad/s], of a load a force and its moment about the world's origin [N, N m]."""
Sym: TypeAlias = tuple[float, float, float, float, float, float]
"""A symmetric matrix: xx, yy, zz, xy, xz, yz."""


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


def slopes_work(links: int) -> Array:
    """Return the buffer of the kernel for a chain of so many links."""
    return np.zeros((links, _WIDTH))


@kernel
def torque_slopes(bodies: Array, motion: Array, tau: Array, slope: Array, work: Array) -> None:
    """Write tau of eq. (14) and how it answers to the active joints' motion.

    Args:
        bodies: The chain, as of :func:`mitt.arm.dynamics.bodies_of`, shape (N, 31).
        motion: q, dq, ddq of the active joints in the first three rows, shape (3 or more, n).
        tau: Torques of all N links [N m], shape (N,).
        slope: d tau/dq, d tau/d dq and M over the active joints, shape (3, N, n).
        work: Buffer, shape (N, 46).
    """
    _outwards(bodies, motion, work)
    count = len(bodies)
    for j in range(count - 1, -1, -1):
        tau[j] = _axis_load(bodies, motion, work, j)
        _row_and_column(bodies, work, j, slope)
        _mass(bodies, work, j, slope[2])
        if j > 0:
            for c in range(_M, _WIDTH):
                work[j - 1, c] += work[j, c]
    _add_rotors(bodies, slope[2])


@kernel
def bias_and_mass(bodies: Array, motion: Array, tau: Array, M: Array, work: Array) -> None:
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
            for c in range(_M, _PP):  # momentum and K count for the slopes alone
                work[j - 1, c] += work[j, c]
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
def _add_rotors(bodies: Array, M: Array) -> None:
    """Add the rotors to the mass matrix, shape (N, n)."""
    for j in range(len(bodies)):
        a = int(bodies[j, JOINT])
        if a >= 0:
            M[j, a] += bodies[j, ROTOR]


@kernel
def _mass(bodies: Array, work: Array, j: int, M: Array) -> None:
    """Write row and column of M where link j comes last, with the sums beyond it."""
    here, S = int(bodies[j, JOINT]), pair_at(work, j, _S)
    if here >= 0:
        by_ddq = _inertia(work, j, S)
        for i in range(j + 1):
            M[i, here] = power(pair_at(work, i, _S), by_ddq)
    for i in range(j):
        a = int(bodies[i, JOINT])
        if a >= 0:
            M[j, a] = power(S, _inertia(work, j, pair_at(work, i, _S)))


@kernel
def _axis_load(bodies: Array, motion: Array, work: Array, k: int) -> float:
    """Return what the drive of link k must give against the load of all beyond it."""
    total = 0.0
    for c in range(6):
        total += work[k, _S + c] * work[k, _F + c]
    a = int(bodies[k, JOINT])
    return total + (bodies[k, ROTOR] * motion[2, a] if a >= 0 else 0.0)


@kernel
def _row_and_column(bodies: Array, work: Array, j: int, slope: Array) -> None:
    """Write how the torques of link j and of those before it answer to one another's motion.

    With the sums beyond j, for i before j: what moves q_j changes the load of j by
    2B dS_j + I ddS_j + S_j x* f, felt at i; what moves q_i changes it by 2B dS_i + I ddS_i, felt
    at j, the turning of axis and load together changing nothing.
    """
    here = int(bodies[j, JOINT])
    S, dS, ddS = pair_at(work, j, _S), pair_at(work, j, _DS), pair_at(work, j, _DDS)
    if here >= 0:
        force, moment = (work[j, _F], work[j, _F + 1], work[j, _F + 2]), vec_at(work, j, _W)
        turned = cross(S[1], force), plus(cross(S[0], force), cross(S[1], moment))
        by_q = plus_pair(plus_pair(_coriolis(work, j, dS), _inertia(work, j, ddS)), turned)
        by_dq = plus_pair(
            _coriolis(work, j, S), _inertia(work, j, (times(2.0, dS[0]), times(2.0, dS[1])))
        )
        for i in range(j + 1):
            T = pair_at(work, i, _S)
            slope[0, i, here] = power(T, by_q)
            slope[1, i, here] = power(T, by_dq)
    for i in range(j):
        a = int(bodies[i, JOINT])
        if a < 0:
            continue
        T, dT, ddT = pair_at(work, i, _S), pair_at(work, i, _DS), pair_at(work, i, _DDS)
        slope[0, j, a] = power(S, plus_pair(_coriolis(work, j, dT), _inertia(work, j, ddT)))
        twice = times(2.0, dT[0]), times(2.0, dT[1])
        slope[1, j, a] = power(S, plus_pair(_coriolis(work, j, T), _inertia(work, j, twice)))


@kernel
def _outwards(bodies: Array, motion: Array, work: Array) -> None:
    """Write axes, their changes and the body's own sums of each link, from the base outwards."""
    frame, o = IDENTITY, ZERO
    v, omega, a, domega = ZERO, ZERO, (0.0, 0.0, GRAVITY), ZERO
    for k in range(len(bodies)):
        joint = int(bodies[k, JOINT])
        q, dq, ddq = 0.0, 0.0, 0.0
        if joint >= 0:
            q, dq, ddq = motion[0, joint], motion[1, joint], motion[2, joint]
        o = plus(o, rotate(frame, vec_at(bodies, k, P)))
        frame = compose(frame, mat_at(bodies, k, 0))
        axis = vec_at(bodies, k, AXIS)
        w = rotate(frame, axis)
        if bodies[k, SLIDES] > 0.0:
            o = plus(o, times(q, w))
            S = w, ZERO
        else:
            if joint >= 0:
                frame = compose(frame, turn(axis, q))
            S = cross(o, w), w
        dS = crossed((v, omega), S)
        ddS = plus_pair(crossed((a, domega), S), crossed((v, omega), dS))
        put_pair(work, k, _S, S)
        put_pair(work, k, _DS, dS)
        put_pair(work, k, _DDS, ddS)
        v, omega = plus(v, times(dq, S[0])), plus(omega, times(dq, S[1]))
        a = plus(a, plus(times(ddq, S[0]), times(dq, dS[0])))
        domega = plus(domega, plus(times(ddq, S[1]), times(dq, dS[1])))
        _body(bodies, work, k, (frame, o), (v, omega, a, domega))


@kernel
def _body(
    bodies: Array, work: Array, k: int, pose: tuple[Mat, Vec], moving: tuple[Vec, Vec, Vec, Vec]
) -> None:
    """Write mass, flow and load of one body; see the module's table."""
    frame, o = pose
    v, omega, a, domega = moving
    m = bodies[k, MASS]
    c = plus(o, rotate(frame, vec_at(bodies, k, COM)))
    mc, E = times(m, c), _second_moments(bodies, k, frame, c)
    p = plus(times(m, v), cross(omega, mc))
    # K = mc v' + E [omega]x': row r of the second term is (omega x (row r of E)).
    k0 = plus(times(mc[0], v), cross(omega, (E[0], E[3], E[4])))
    k1 = plus(times(mc[1], v), cross(omega, (E[3], E[1], E[5])))
    k2 = plus(times(mc[2], v), cross(omega, (E[4], E[5], E[2])))
    work[k, _M] = m
    put_at(work, k, _MC, mc)
    for e in range(6):
        work[k, _EE + e] = E[e]
    put_at(work, k, _PP, p)
    put_at(work, k, _K, k0)
    put_at(work, k, _K + 3, k1)
    put_at(work, k, _K + 6, k2)
    trace = k0[0] + k1[1] + k2[2]
    back = plus(times(omega[0], k0), plus(times(omega[1], k1), times(omega[2], k2)))
    pull = _inertia(work, k, (a, domega))
    put_at(work, k, _F, plus(pull[0], cross(omega, p)))
    put_at(work, k, _W, plus(pull[1], plus(times(trace, omega), times(-1.0, back))))


@kernel
def _second_moments(bodies: Array, k: int, R: Mat, c: Vec) -> Sym:
    """Return the sum of m r r' of a body about the world's origin, its centre being at ``c``.

    About the centre, in the body's axes, it is tr(I)/2 - I.
    """
    xx, yy, zz = bodies[k, INERTIA], bodies[k, INERTIA + 4], bodies[k, INERTIA + 8]
    xy, xz, yz = -bodies[k, INERTIA + 1], -bodies[k, INERTIA + 2], -bodies[k, INERTIA + 5]
    half = 0.5 * (xx + yy + zz)
    u, v, w = (half - xx, xy, xz), (xy, half - yy, yz), (xz, yz, half - zz)
    a, b, d = (R[0], R[1], R[2]), (R[3], R[4], R[5]), (R[6], R[7], R[8])
    ea = dot(u, a), dot(v, a), dot(w, a)
    eb = dot(u, b), dot(v, b), dot(w, b)
    ed = dot(u, d), dot(v, d), dot(w, d)
    m = bodies[k, MASS]
    return (
        dot(ea, a) + m * c[0] * c[0],
        dot(eb, b) + m * c[1] * c[1],
        dot(ed, d) + m * c[2] * c[2],
        dot(ea, b) + m * c[0] * c[1],
        dot(ea, d) + m * c[0] * c[2],
        dot(eb, d) + m * c[1] * c[2],
    )


@kernel
def _inertia(work: Array, k: int, motion: Pair) -> Pair:
    """Return I times a motion (velocity at the origin u, turning w)."""
    u, w = motion
    mc = vec_at(work, k, _MC)
    xx, yy, zz = work[k, _EE], work[k, _EE + 1], work[k, _EE + 2]
    xy, xz, yz = work[k, _EE + 3], work[k, _EE + 4], work[k, _EE + 5]
    turned = (
        (yy + zz) * w[0] - xy * w[1] - xz * w[2],
        -xy * w[0] + (xx + zz) * w[1] - yz * w[2],
        -xz * w[0] - yz * w[1] + (xx + yy) * w[2],
    )
    return plus(times(work[k, _M], u), cross(w, mc)), plus(cross(mc, u), turned)


@kernel
def _coriolis(work: Array, k: int, motion: Pair) -> Pair:
    """Return 2B times a motion: the wrench of the force field 2 m w x v(r)."""
    w = motion[1]
    trace = work[k, _K] + work[k, _K + 4] + work[k, _K + 8]
    back = plus(
        times(w[0], vec_at(work, k, _K)),
        plus(times(w[1], vec_at(work, k, _K + 3)), times(w[2], vec_at(work, k, _K + 6))),
    )
    moment = plus(times(trace, w), times(-1.0, back))
    return times(2.0, cross(w, vec_at(work, k, _PP))), times(2.0, moment)


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
def pair_at(rows: Array, k: int, at: int) -> Pair:
    """Return two vectors of row k from column ``at``."""
    return vec_at(rows, k, at), vec_at(rows, k, at + 3)


@kernel
def put_pair(rows: Array, k: int, at: int, pair: Pair) -> None:
    """Write two vectors to row k from column ``at``."""
    put_at(rows, k, at, pair[0])
    put_at(rows, k, at + 3, pair[1])
