"""What a course says about the catch: its place, its margin, its probability; compiled.

| here       | meaning                                                          | unit | shape |
|------------|------------------------------------------------------------------|------|-------|
| ``region`` | lowest and highest virtual joints at the catch                   | rad  | (2, n)|
| ``P``      | covariance of the ball's position and velocity now               |      | (6, 6)|
| ``odds``   | of the region, of the binding limit, of the hand                 | 1    |       |

The three events are taken as independent, the ball's error as Gaussian, carried on without drag.
"""

from math import erf, sqrt

import numpy as np

from mitt.generator.horizon import LATE, Course
from mitt.generator.inverse import lift, solve3
from mitt.generator.packing import unfold, unpack
from mitt.generator.polynomial import jets
from mitt.generator.sqp_step import Buffers, Map
from mitt.generator.stopping import spare
from mitt.generator.tangent import coordinate, expand, to_go, turn_all
from mitt.generator.utilization import Plant, asked_of
from mitt.jit import kernel
from mitt.robot.dynamics import inverse_dynamics
from mitt.robot.limits import torque_share
from mitt.signals import Array

#: Time before the catch in which the arm can no longer follow [s] (aT^2/4 of 3 mm), and the ball's
#: distance from the catch point at which the fingers still close around it [m].
_BLIND, _GRASP = 0.020, 0.030
#: Steps of the differences: position [m], velocity [m/s].
_DR, _DDR = 1e-4, 1e-3
#: Kinds of limits by number: rows of the shares, then the region of the map and the brake.
KINDS = ("torque", "speed", "range", "region", "brake")
_REGION, _BRAKE = 3, 4


@kernel
def assure(
    f: Map, p: Plant, alpha: Array, b: Buffers, P: Array, region: Array, tolerance: Array,
    place_: Array,
) -> tuple[tuple[int, int, int], float, float]:  # fmt: skip
    """Return the binding limit (kind, link, instant), the probability of a catch, and the share.

    Args:
        f: The map.
        p: The arm.
        alpha: Coefficients, whose shares of the limits are in the buffers, shape (m, n).
        b: Buffers of the step.
        P: Covariance of the ball, shape (6, 6).
        region: Lowest and highest virtual joints at the catch [rad], shape (2, n).
        tolerance: Shares of torque, speed and range at which a throw is refused.
        place_: Result: virtual joints at the catch and their 1-sigma, shape (2, n).
    """
    limit, share = (0, 0, 0), 0.0
    for kind in range(3):
        for d in range(b.shares.shape[1]):
            part = b.shares[kind, d] / tolerance[kind]
            if part > share:
                limit, share = (kind, d, int(b.at[kind, d])), part
    odds = in_hand(P) * place(f, b.course, P, region, place_)
    room = (1.0 - share) * tolerance[limit[0]]
    odds *= within(f, p, alpha, b, limit, P, room)
    for j in range(alpha.shape[1]):
        if j != int(f.packed[1]):
            middle = 0.5 * (region[0, j] + region[1, j])
            part = abs(place_[0, j] - middle) / max(region[1, j] - middle, 1e-9)
            if part > max(share, 1.0):
                limit, share = (_REGION, p.joints[j], 0), part
    part, joint = spare(p, alpha, b)
    if part > max(share, 1.0):
        limit, share = (_BRAKE, p.joints[joint], len(b.course.after) - 1), part
    return limit, float(odds), float(share)


@kernel
def spread_ahead(P: Array, t: float) -> float:
    """Return the 1-sigma of the ball's position a time ahead, along its worst axis or less [m]."""
    trace = 0.0
    for x in range(3):
        trace += ahead_of(P, t, x, x)
    return sqrt(trace)


@kernel
def place(f: Map, c: Course, P: Array, region: Array, out: Array) -> float:
    """Write the catch's virtual joints and their 1-sigma, shape (2, n); return the odds.

    The odds are those of the ball's passing through the region of the map, eq. (5) linearised: a
    change of the ball moves q_o by J_c^-1 dr and the catch in time by -ds / (ds/dt).
    """
    g, k = unpack(f.packed), len(c.after) - 1 - LATE
    n, i = c.rows.shape[2], g.catch_joint
    w = unfold(f.work, n)
    q, dq = c.rows[k, 0], c.rows[k, 1]
    expand(g, q, w)
    answer = np.zeros((3, n))
    out[0], out[1] = q, np.inf
    ds = coordinate(g, dq, g.catch)
    if ds == 0.0:
        return 0.0
    units = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
    for x in range(3):
        if not solve3(w.J_c, units[x], g.free, answer[x]):
            return 0.0
        turn_all(g, answer[x])
        late = coordinate(g, answer[x], g.catch) / ds
        for j in range(n):
            answer[x, j] -= dq[j] * late
    odds = 1.0
    for j in range(n):
        variance = 0.0
        for x in range(3):
            for y in range(3):
                variance += answer[x, j] * answer[y, j] * ahead_of(P, c.after[k], x, y)
        out[0, j], out[1, j] = q[j], sqrt(max(variance, 0.0))
        # Further joints follow the free ones, or stay.
        if j != i and (j == g.free[0] or j == g.free[1] or j == g.free[2]):
            odds *= _between(q[j], out[1, j], region[0, j], region[1, j])
    return odds


@kernel
def ahead_of(P: Array, t: float, x: int, y: int) -> float:
    """Return an entry of the position's covariance a time ahead [m^2]."""
    return float(P[x, y] + t * (P[x, 3 + y] + P[3 + x, y]) + t * t * P[3 + x, 3 + y])


@kernel
def _between(x: float, sigma: float, low: float, high: float) -> float:
    """Return the probability that a Gaussian lies between two numbers."""
    scale = 1.0 / (sqrt(2.0) * max(sigma, 1e-12))
    return 0.5 * (erf((high - x) * scale) - erf((low - x) * scale))


@kernel
def in_hand(P: Array) -> float:
    """Return the probability that what cannot be corrected any more stays within the grasp."""
    trace = 0.0
    for x in range(3):
        trace += ahead_of(P, _BLIND, x, x)
    return float(1.0 - np.exp(-0.5 * _GRASP * _GRASP / max(trace / 3.0, 1e-18)))


@kernel
def within(
    f: Map, p: Plant, alpha: Array, b: Buffers, limit: tuple[int, int, int], P: Array, room: float
) -> float:
    """Return the probability that a limit's share grows by no more than ``room``.

    The share's slope in the ball's position and velocity at its instant is taken by differences,
    at the same distance s from the catch: that the catch comes sooner or later costs nothing.
    """
    c, k, g = b.course, limit[2], unpack(f.packed)
    w = unfold(f.work, alpha.shape[1])
    ball, rows, phi = c.path[k].copy(), c.rows[k].copy(), np.empty((3, alpha.shape[0]))
    slope = np.zeros(6)
    before = _share(f, p, alpha, b, (ball, rows, phi), limit)
    for x in range(6):
        step = _DR if x < 3 else _DDR
        ball[:] = c.path[k]
        ball[x // 3, x % 3] += step
        if not lift(g, ball, rows, w):
            return 0.0
        ds = coordinate(g, rows[1], g.catch)
        if ds == 0.0:
            return 0.0
        late = (to_go(g, c.rows[k, 0]) - to_go(g, rows[0])) / ds
        for e in range(3):
            ball[0, e] += late * ball[1, e]
            ball[1, e] += late * ball[2, e]
        slope[x] = (_share(f, p, alpha, b, (ball, rows, phi), limit) - before) / step
    t, variance = c.after[k], 0.0
    for x in range(6):
        # d share / d state now: a change of velocity also moves the ball by t.
        for y in range(6):
            sx = slope[x] + (t * slope[x - 3] if x > 2 else 0.0)
            sy = slope[y] + (t * slope[y - 3] if y > 2 else 0.0)
            variance += sx * sy * P[x, y]
    return 0.5 * (1.0 + erf(room / (sqrt(2.0) * max(sqrt(max(variance, 0.0)), 1e-12))))


@kernel
def _share(
    f: Map, p: Plant, alpha: Array, b: Buffers, at: tuple[Array, Array, Array],
    limit: tuple[int, int, int],
) -> float:  # fmt: skip
    """Return the share of a limit that a ball asks for; infinite outside the domain."""
    (ball, rows, phi), w, (kind, index, _) = at, b.work, limit
    g = unpack(f.packed)
    n, links = alpha.shape[1], len(w.tau)
    if not lift(g, ball, rows, unfold(f.work, n)):
        return np.inf
    free = np.empty((3, 3))
    for d in range(3):
        for a in range(3):
            free[d, a] = coordinate(g, rows[d], a)
    jets(f.powers, f.window[0], f.window[1], free[0], free[1], free[2], phi)
    for d in range(3):
        for j in range(n):
            total = rows[d, j]
            for a in range(alpha.shape[0]):
                total += phi[d, a] * alpha[a, j]
            w.motion[d, j] = total
    if kind == 2:
        for j in range(n):
            if p.joints[j] == index:
                return float(abs(w.motion[0, j] - p.scales[2, j]) / p.scales[3, j])
    if kind == 0:
        inverse_dynamics(p.bodies, w.motion[0], w.motion[1], w.motion[2], w.tau, w.notes)
    tau, omega = asked_of(p, index, w.tau, w.motion[1])
    if kind == 1:
        return float(abs(omega) / p.drives[2 * links + 2, index])
    return float(torque_share(p.drives, index, tau, omega))
