"""How the torque of eq. (14) answers to a motion: its derivatives as a kernel.

| here     | meaning                                                    | unit             | shape |
|----------|------------------------------------------------------------|------------------|-------|
| ``S``    | motion of a joint: velocity at the world's origin, turning | m/s, rad/s a unit| (6,)  |
| ``dS``   | v x S, its change while the chain moves                    |                  | (6,)  |
| ``ddS``  | a x S + v x dS                                             |                  | (6,)  |
| ``mass`` | mass, mass times centre, second moments: sums over points  | kg, kg m, kg m^2 | (10,) |
| ``flow`` | momentum p and K = sum of m r v' over points               | kg m/s, kg m^2/s | (12,) |
| ``load`` | force and its moment about the world's origin              | N, N m           | (6,)  |

All in the world frame, where the bodies beyond a joint simply add up. The derivatives are those of
Singh, Russell and Wensing (RA-L 2022); their 6 x 6 matrix 2B is, in these sums, the wrench of the
force field 2 m w x v(r): 2 w x p, with the moment 2 (tr(K) w - K' w).
"""

import numpy as np

from mitt.jit import kernel
from mitt.robot.dynamics import AXIS, COM, INERTIA, JOINT, MASS, ROTOR, SLIDES, P
from mitt.robot.spatial import Pair, crossed, pair_at, plus_pair, power, put_pair
from mitt.robot.vectors import (
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
    vec_at,
)
from mitt.signals import GRAVITY, Array

#: Columns of a link's working row.
_S, _DS, _DDS, _M, _MC, _EE, _F, _W, _PP, _K, _WIDTH = 0, 6, 12, 18, 19, 22, 28, 31, 34, 37, 46

Sym = tuple[float, float, float, float, float, float]  # xx, yy, zz, xy, xz, yz


def slopes_work(links: int) -> Array:
    """Return the buffer of the kernel for a chain of so many links."""
    return np.zeros((links, _WIDTH))


@kernel
def torque_slopes(bodies: Array, motion: Array, tau: Array, slope: Array, work: Array) -> None:
    """Write tau of eq. (14) and how it answers to the active joints' motion.

    Args:
        bodies: The chain, as of :func:`mitt.robot.dynamics.bodies_of`, shape (N, 31).
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
