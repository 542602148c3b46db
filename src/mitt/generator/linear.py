"""The quadratic programme of one online step: cost and limits along a course, linear in alpha.

| here        | meaning                                                     | shape         |
|-------------|-------------------------------------------------------------|---------------|
| ``J``       | d (weighted torque residual of eq. (22)) / d alpha          | (K n, m n)    |
| ``h, g``    | Gauss-Newton Hessian and gradient of half the cost (22)     | (m n, m n), ..|
| ``gram``    | weighted sum of phi-dot phi-dot': the speeds' part of h     | (m, m)        |
| ``A, room`` | rows of limits near their bound: A step <= room             | (R, m n), (R,)|
| ``scales``  | tau_max, dq_max, middle and half width of the ranges        | (4, n)        |
| ``drives``  | ``Limits.packed``                                           | (2 N + 3, N)  |
"""

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from mitt.generator.course import Course
from mitt.robot.arm import Arm
from mitt.robot.dynamics import inverse_dynamics, notes_of
from mitt.robot.slopes import slopes_work, torque_slopes
from mitt.signals import Array


class Plant(NamedTuple):
    """What the kernels know of an arm; see the module's table."""

    bodies: Array
    drives: Array
    scales: Array
    index: NDArray[np.int64]


class Programme(NamedTuple):
    """Arrays of a programme; see the module's table."""

    J: Array
    h: Array
    g: Array
    A: Array
    room: Array
    residual: Array
    gram: Array


class Work(NamedTuple):
    """Buffers: motion of one instant, torques, slopes, drives' rows, the kernel's own."""

    motion: Array
    tau: Array
    slope: Array
    drive: Array
    speed: Array
    links: Array
    notes: Array


def plant_of(arm: Arm) -> Plant:
    """Return the arrays of an arm."""
    middle, half = 0.5 * (arm.q_max + arm.q_min), 0.5 * (arm.q_max - arm.q_min)
    scales = np.array([arm.tau_max, arm.dq_max, middle, half])
    return Plant(arm.bodies, arm.limits.packed, scales, np.array(arm.model.active))


def programme_of(arm: Arm, *, instants: int, size: int, extra: int) -> Programme:
    """Return empty arrays for a programme in ``size`` coefficients with ``extra`` further rows."""
    n, most = arm.n, instants * (3 * len(arm.model.links)) + extra
    return Programme(
        J=np.zeros((instants * n, size)),
        h=np.zeros((size, size)),
        g=np.zeros(size),
        A=np.zeros((most, size)),
        room=np.zeros(most),
        residual=np.zeros(instants * n),
        gram=np.zeros((size // n, size // n)),
    )


def work_of(arm: Arm) -> Work:
    """Return the buffers for an arm."""
    n, links = arm.n, len(arm.model.links)
    return Work(
        motion=np.zeros((3, n)),
        tau=np.zeros(links),
        slope=np.zeros((3, links, n)),
        drive=np.zeros((3, n)),
        speed=np.zeros(n),
        links=slopes_work(links),
        notes=notes_of(links),
    )


@njit(cache=True)
def linearise(
    p: Plant, c: Course, alpha: Array, use: tuple[float, float], out: Programme,
    shares: Array, at: Array, w: Work,
) -> tuple[int, float, float]:  # fmt: skip
    """Write cost and limits of the motion that ``alpha`` gives along a course, after 2n rows.

    Args:
        p: The arm.
        c: The course.
        alpha: Coefficients [rad], shape (m, n).
        use: Share of each limit that may be used, and share from which it gets a row.
        out: Result.
        shares: Result: largest share of each limit, as in :func:`weigh`.
        at: Result: their instants.
        w: Buffers.

    Returns:
        How many rows there are now, the cost (22), and the squared excess over the limits.
    """
    n, count, cost, over = alpha.shape[1], 2 * alpha.shape[1], 0.0, 0.0
    out.g[:] = 0.0
    out.gram[:] = 0.0
    shares[:] = 0.0
    for k in range(len(c.after)):
        motion_at(c, k, alpha, w.motion)
        torque_slopes(p.bodies, w.motion, w.tau, w.slope, w.links)
        here, excess = _assess(p, k, use[0], shares, at, w)
        cost, over = cost + c.weight[k] * here, over + excess
        root = np.sqrt(c.weight[k])
        for r in range(n):
            scale = root / p.scales[0, r]
            out.residual[k * n + r] = w.tau[p.index[r]] * scale
            for d in range(3):
                for j in range(n):
                    w.drive[d, j] = w.slope[d, p.index[r], j] * scale
            spread(c.phi, k, w.drive, out.J, k * n + r)
        _speeds(p, c, k, w.motion, out)
        count = _limits(p, c, k, use, out, w, count)
    np.dot(out.J.T, out.J, out.h)
    out.g[:] += np.dot(out.residual, out.J)
    for a in range(len(out.gram)):
        for b in range(len(out.gram)):
            x = out.gram[max(a, b), min(a, b)]
            for j in range(n):
                out.h[a * n + j, b * n + j] += x / p.scales[1, j] ** 2
    return count, cost, over


@njit(cache=True)
def prepare(
    p: Plant, c: Course, alpha: Array, goal: Array, H: Array, weights: Array,
    out: Programme, shares: Array, at: Array, w: Work,
) -> tuple[int, float]:  # fmt: skip
    """Write the whole programme of a step from ``alpha``: continuity first, then the limits.

    Args:
        p: The arm.
        c: The course.
        alpha: Coefficients [rad], shape (m, n).
        goal: alpha* [rad], shape (m, n).
        H: Metric of the pull towards it, shape (m n, m n).
        weights: Pull, share of the limits, share from which they count, weight of their excess.
        out: Result.
        shares: Largest share of each limit now, shape (3, N).
        at: Their instants, shape (3, N).
        w: Buffers.

    Returns:
        How many rows there are, and the merit of ``alpha``.
    """
    m, n = alpha.shape
    out.A[: 2 * n] = 0.0
    for d in range(2):
        for a in range(m):
            for j in range(n):
                out.A[d * n + j, a * n + j] = c.phi[0, d, a]
    out.room[: 2 * n] = 0.0
    count, cost, over = linearise(p, c, alpha, (weights[1], weights[2]), out, shares, at, w)
    pull = 0.0
    for a in range(m * n):
        slope = 0.0
        for b in range(m * n):
            slope += weights[0] * H[a, b] * (alpha[b // n, b % n] - goal[b // n, b % n])
            out.h[a, b] += weights[0] * H[a, b]
        out.g[a] += slope
        pull += slope * (alpha[a // n, a % n] - goal[a // n, a % n])
    return count, cost + pull + weights[3] * over


@njit(cache=True)
def merit(
    p: Plant, c: Course, alpha: Array, goal: Array, H: Array, weights: Array,
    shares: Array, at: Array, w: Work,
) -> float:  # fmt: skip
    """Return cost (22), pull and price of exceeded limits of a motion along a course."""
    cost, over = weigh(p, c, alpha, weights[1], shares, at, w)
    m, n = alpha.shape
    pull = 0.0
    for a in range(m * n):
        x = alpha[a // n, a % n] - goal[a // n, a % n]
        for b in range(m * n):
            pull += x * H[a, b] * (alpha[b // n, b % n] - goal[b // n, b % n])
    return cost + weights[0] * pull + weights[3] * over


@njit(cache=True)
def motion_at(c: Course, k: int, alpha: Array, motion: Array) -> None:
    """Write q_d, dq_d, ddq_d = q_o + Phi alpha and its derivatives at one instant."""
    for d in range(3):
        for j in range(alpha.shape[1]):
            total = c.rows[k, d, j]
            for a in range(alpha.shape[0]):
                total += c.phi[k, d, a] * alpha[a, j]
            motion[d, j] = total


@njit(cache=True)
def spread(phi: Array, k: int, slope: Array, A: Array, r: int) -> None:
    """Write row r: d x/d alpha = x_q Phi + x_qdot Phi-dot + x_qddot Phi-ddot, slope (3, n)."""
    n = slope.shape[1]
    for a in range(phi.shape[2]):
        for j in range(n):
            A[r, a * n + j] = (
                slope[0, j] * phi[k, 0, a] + slope[1, j] * phi[k, 1, a] + slope[2, j] * phi[k, 2, a]
            )


@njit(cache=True)
def _speeds(p: Plant, c: Course, k: int, motion: Array, out: Programme) -> None:
    """Add the speed's part of the gradient of cost (22), and to its gram the lower half."""
    n = motion.shape[1]
    for a in range(c.phi.shape[2]):
        x = c.weight[k] * c.phi[k, 1, a]
        for j in range(n):
            out.g[a * n + j] += x * motion[1, j] / p.scales[1, j] ** 2
        for b in range(a + 1):
            out.gram[a, b] += x * c.phi[k, 1, b]


@njit(cache=True)
def _limits(
    p: Plant, c: Course, k: int, use: tuple[float, float], out: Programme, w: Work, count: int
) -> int:
    """Write the rows (18), (20) and of the joint ranges that are near their bound."""
    n, links, (share, near) = w.motion.shape[1], len(w.tau), use
    for d in range(links):
        tau, omega = 0.0, 0.0
        for i in range(links):
            tau += p.drives[d, i] * w.tau[i]
        for j in range(n):
            omega += p.drives[links + d, p.index[j]] * w.motion[1, j]
        bound, fall = bound_of(p.drives, d, tau, omega)
        if abs(tau) > near * bound:
            sign = np.copysign(1.0 / bound, tau)
            for e in range(3):
                for j in range(n):
                    total = 0.0
                    for i in range(links):
                        total += p.drives[d, i] * w.slope[e, i, j]
                    w.drive[e, j] = sign * total
            for j in range(n):
                # Where the bound falls with speed: tau' + share fall omega' <= what is left.
                w.drive[1, j] += share * fall * sign * p.drives[links + d, p.index[j]]
            spread(c.phi, k, w.drive, out.A, count)
            out.room[count] = share - abs(tau) / bound
            count += 1
        top = p.drives[2 * links + 2, d]
        if abs(omega) > near * top:
            w.drive[:] = 0.0
            sign = np.copysign(1.0 / top, omega)
            for j in range(n):
                w.drive[1, j] = sign * p.drives[links + d, p.index[j]]
            spread(c.phi, k, w.drive, out.A, count)
            out.room[count] = share - abs(omega) / top
            count += 1
    for j in range(n):
        x = (w.motion[0, j] - p.scales[2, j]) / p.scales[3, j]
        if abs(x) > near:
            w.drive[:] = 0.0
            w.drive[0, j] = np.copysign(1.0 / p.scales[3, j], x)
            spread(c.phi, k, w.drive, out.A, count)
            out.room[count] = share - abs(x)
            count += 1
    return count


@njit(cache=True)
def bound_of(drives: Array, d: int, tau: float, omega: float) -> tuple[float, float]:
    """Return the bound on a drive's torque [N m], and by how much it falls a rad/s of speed."""
    links = drives.shape[1]
    bound, stall, top = drives[2 * links, d], drives[2 * links + 1, d], drives[2 * links + 2, d]
    if tau * omega > 0.0 and np.isfinite(stall):
        line = stall * max(1.0 - abs(omega) / top, 1e-3)
        if line < bound:
            return line, stall / top
    return bound, 0.0


@njit(cache=True)
def weigh(
    p: Plant, c: Course, alpha: Array, share: float, shares: Array, at: Array, w: Work
) -> tuple[float, float]:
    """Return cost (22) and squared excess over limits of a motion along a course.

    Args:
        p: The arm.
        c: The course.
        alpha: Coefficients [rad], shape (m, n).
        share: Share of each limit that may be used.
        shares: Result: largest share of each drive's torque and speed and of each range, (3, N).
        at: Result: instant of each of those shares, shape (3, N).
        w: Buffers.
    """
    cost, over = 0.0, 0.0
    shares[:] = 0.0
    for k in range(len(c.after)):
        motion_at(c, k, alpha, w.motion)
        inverse_dynamics(p.bodies, w.motion[0], w.motion[1], w.motion[2], w.tau, w.notes)
        here, excess = _assess(p, k, share, shares, at, w)
        cost, over = cost + c.weight[k] * here, over + excess
    return cost, over


@njit(cache=True)
def _assess(
    p: Plant, k: int, share: float, shares: Array, at: Array, w: Work
) -> tuple[float, float]:
    """Return cost and squared excess of the motion and torques in the buffers, at instant k."""
    n, links, cost, over = w.motion.shape[1], len(w.tau), 0.0, 0.0
    for j in range(n):
        cost += (w.tau[p.index[j]] / p.scales[0, j]) ** 2
        cost += (w.motion[1, j] / p.scales[1, j]) ** 2
        x = abs(w.motion[0, j] - p.scales[2, j]) / p.scales[3, j]
        over += _note(shares, at, 2, p.index[j], x, k, share)
    for d in range(links):
        tau, omega = 0.0, 0.0
        for i in range(links):
            tau += p.drives[d, i] * w.tau[i]
        for j in range(n):
            omega += p.drives[links + d, p.index[j]] * w.motion[1, j]
        part = abs(tau) / bound_of(p.drives, d, tau, omega)[0]
        over += _note(shares, at, 0, d, part, k, share)
        part = abs(omega) / p.drives[2 * links + 2, d]
        over += _note(shares, at, 1, d, part, k, share)
    return cost, over


@njit(cache=True)
def _note(
    shares: Array, at: Array, kind: int, k: int, part: float, instant: int, share: float
) -> float:
    """Keep the larger share and its instant; return the squared excess. NaN is infinitely much."""
    part = part if part == part else np.inf
    if part > shares[kind, k]:
        shares[kind, k] = part
        at[kind, k] = instant
    return max(part - share, 0.0) ** 2


@njit(cache=True)
def sound(q: Programme, count: int) -> bool:
    """Say whether the programme's first ``count`` rows and its cost are finite numbers."""
    total = 0.0
    for a in range(len(q.g)):
        total += abs(q.g[a])
        for b in range(len(q.g)):
            total += abs(q.h[a, b])
    for r in range(count):
        total += abs(q.room[r])
        for a in range(len(q.g)):
            total += abs(q.A[r, a])
    return bool(np.isfinite(total))
