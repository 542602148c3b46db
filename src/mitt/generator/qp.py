"""The quadratic programme of one online step: cost and limits along a course, linear in alpha.

| here        | meaning                                                     | shape         |
|-------------|-------------------------------------------------------------|---------------|
| ``J``       | d (weighted torque residual of eq. (22)) / d alpha          | (K n, m n)    |
| ``h, g``    | Gauss-Newton Hessian and gradient of half the cost (22)     | (m n, m n), ..|
| ``gram``    | weighted sum of phi-dot phi-dot': the speeds' part of h     | (m, m)        |
| ``slope``   | of the pull towards alpha*                                  | (m n,)        |
| ``A, room`` | rows: continuity, then limits near their bound: A step <= room | (R, m n), (R,)|
"""

from typing import NamedTuple

import numpy as np

from mitt.generator.horizon import Course
from mitt.generator.utilization import Plant, Work, asked_of, assess, motion_at
from mitt.jit import kernel
from mitt.robot.arm import Arm
from mitt.robot.dynamics import torque_slopes
from mitt.robot.limits import voltage_share
from mitt.signals import Array


class Programme(NamedTuple):
    """Arrays of a programme; see the module's table."""

    J: Array
    h: Array
    g: Array
    A: Array
    room: Array
    residual: Array
    gram: Array
    slope: Array


def programme_of(arm: Arm, *, instants: int, size: int, pairs: int) -> Programme:
    """Return empty arrays for a programme in ``size`` coefficients, with gaps of ``pairs``."""
    n, most = arm.n, instants * (4 * len(arm.model.links) + 1 + pairs) + 2 * arm.n
    return Programme(
        J=np.zeros((instants * n, size)),
        h=np.zeros((size, size)),
        g=np.zeros(size),
        A=np.zeros((most, size)),
        room=np.zeros(most),
        residual=np.zeros(instants * n),
        gram=np.zeros((size // n, size // n)),
        slope=np.zeros(size),
    )


@kernel
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
        here, excess = assess(p, k, use[0], shares, at, w)
        cost, over = cost + c.weight[k] * here, over + excess
        root = np.sqrt(c.weight[k])
        for r in range(n):
            scale = root / p.scales[0, r]
            out.residual[k * n + r] = w.tau[p.joints[r]] * scale
            for d in range(3):
                for j in range(n):
                    w.drive[d, j] = w.slope[d, p.joints[r], j] * scale
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


@kernel
def spread(phi: Array, k: int, slope: Array, A: Array, r: int) -> None:
    """Write row r: d x/d alpha = x_q Phi + x_qdot Phi-dot + x_qddot Phi-ddot, slope (3, n)."""
    n = slope.shape[1]
    for a in range(phi.shape[2]):
        for j in range(n):
            A[r, a * n + j] = (
                slope[0, j] * phi[k, 0, a] + slope[1, j] * phi[k, 1, a] + slope[2, j] * phi[k, 2, a]
            )


@kernel
def _speeds(p: Plant, c: Course, k: int, motion: Array, out: Programme) -> None:
    """Add the speed's part of the gradient of cost (22), and to its gram the lower half."""
    n = motion.shape[1]
    for a in range(c.phi.shape[2]):
        x = c.weight[k] * c.phi[k, 1, a]
        for j in range(n):
            out.g[a * n + j] += x * motion[1, j] / p.scales[1, j] ** 2
        for b in range(a + 1):
            out.gram[a, b] += x * c.phi[k, 1, b]


@kernel
def _limits(
    p: Plant, c: Course, k: int, use: tuple[float, float], out: Programme, w: Work, count: int
) -> int:
    """Write the rows (18), (20) and of the joint ranges that are near their bound."""
    n, links, (share, near) = w.motion.shape[1], len(w.tau), use
    for d in range(links):
        tau, omega = asked_of(p, d, w.tau, w.motion[1])
        peak, stall = p.drives[2 * links, d], p.drives[2 * links + 1, d]
        if abs(tau) > near * peak:
            _torque(p, d, np.copysign(1.0 / peak, tau), w)
            spread(c.phi, k, w.drive, out.A, count)
            out.room[count] = share - abs(tau) / peak
            count += 1
        voltage = voltage_share(p.drives, d, tau, omega)
        if voltage > near:
            _torque(p, d, np.copysign(1.0 / stall, tau), w)
            for j in range(n):
                ratio = p.drives[links + d, p.joints[j]] / p.drives[2 * links + 2, d]
                w.drive[1, j] += np.sign(omega) * ratio
            spread(c.phi, k, w.drive, out.A, count)
            out.room[count] = share - voltage
            count += 1
        top = p.drives[2 * links + 2, d]
        if abs(omega) > near * top:
            w.drive[:] = 0.0
            sign = np.copysign(1.0 / top, omega)
            for j in range(n):
                w.drive[1, j] = sign * p.drives[links + d, p.joints[j]]
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


@kernel
def _torque(p: Plant, d: int, scale: float, w: Work) -> None:
    """Write how a drive's torque, times a scale, answers to q, dq and ddq, to ``w.drive``."""
    for e in range(3):
        for j in range(w.motion.shape[1]):
            total = 0.0
            for i in range(len(w.tau)):
                total += p.drives[d, i] * w.slope[e, i, j]
            w.drive[e, j] = scale * total


@kernel
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
