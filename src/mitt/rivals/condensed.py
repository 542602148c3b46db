"""The predictive rival's programme, written into arrays by one kernel.

Accelerations a at M + 1 even instants, (M + 1) n of them, decide angles and speeds there:
q = drift + P a, dq = drift + D a joint by joint (:mod:`mitt.rivals.pieces`). Torques are
linearised along the quintic between the same ends.

| here      | meaning                                           | unit    | shape        |
|-----------|---------------------------------------------------|---------|--------------|
| ``rows``  | ends, torques, angles, speeds per acceleration    |         | (4 n + K, m) |
| ``low``   | their lower bounds; ``high``, their upper ones    |         | (4 n + K,)   |
| ``price`` | joints' torques, then speeds, over their limits   | s^2/rad | (2 m, m)     |
| ``at``    | the same at no acceleration                       | 1       | (2 m,)       |

m = (M + 1) n, K = (M + 1) N + 2 (M - 1) n.
"""

import numpy as np

from mitt.generator.strain import Plant, Work, asked_of
from mitt.jit import kernel
from mitt.rivals.pieces import responses
from mitt.rivals.quintics import quintic
from mitt.robot.limits import bound_of
from mitt.robot.slopes import torque_slopes
from mitt.signals import Array

#: Share of a drive's peak torque that its bound never falls below.
_LEAST = 0.05


@kernel
def condense(
    p: Plant,
    w: Work,
    ranges: Array,
    start: Array,
    end: Array,
    step: float,
    shares: tuple[float, float],
    rows: Array,
    low: Array,
    high: Array,
    price: Array,
    at: Array,
) -> None:
    """Write the programme; see the module's table.

    Args:
        p: The arm.
        w: Buffers.
        ranges: Smallest and largest angle allowed [rad], shape (2, n).
        start: q, dq, ddq now, shape (3, n).
        end: q, dq, ddq at the end, shape (3, n).
        step: Time between two instants [s].
        shares: Shares of the torque and of the speed limits.
        rows: Result.
        low: Result.
        high: Result.
        price: Result.
        at: Result.
    """
    n, links = start.shape[1], len(w.tau)
    M = rows.shape[1] // n - 1
    D, P = responses(M, step)
    rows[:], price[:] = 0.0, 0.0
    _pin_ends(D, P, start, end, step, rows, low, high)
    first = 4 * n + (M + 1) * links
    half, size = (M - 1) * n, (M + 1) * n
    for k in range(M + 1):
        _load(p, w, D, P, start, end, step, k, shares[0], rows, low, high, price, at)
        for j in range(n):
            own, top = k * n + j, p.scales[1, j]
            at[size + own] = start[1, j] / top
            for i in range(k + 1):
                price[size + own, i * n + j] = D[k, i] / top
            if not 0 < k < M:
                continue
            q, v = first + own - n, first + half + own - n
            drift = start[0, j] + k * step * start[1, j]
            low[q], high[q] = ranges[0, j] - drift, ranges[1, j] - drift
            low[v], high[v] = -shares[1] - at[size + own], shares[1] - at[size + own]
            for i in range(k + 1):
                rows[q, i * n + j], rows[v, i * n + j] = P[k, i], price[size + own, i * n + j]


@kernel
def _pin_ends(
    D: Array, P: Array, start: Array, end: Array, step: float, rows: Array, low: Array, high: Array
) -> None:
    """Write what must hold: both ends' accelerations, angles and speeds at the end."""
    n, M = start.shape[1], len(D) - 1
    for j in range(n):
        rows[j, j], rows[n + j, M * n + j] = 1.0, 1.0
        for i in range(M + 1):
            rows[2 * n + j, i * n + j], rows[3 * n + j, i * n + j] = P[M, i], D[M, i]
        low[j], low[n + j] = start[2, j], end[2, j]
        low[2 * n + j] = end[0, j] - (start[0, j] + M * step * start[1, j])
        low[3 * n + j] = end[1, j] - start[1, j]
    high[: 4 * n] = low[: 4 * n]


@kernel
def _load(
    p: Plant,
    w: Work,
    D: Array,
    P: Array,
    start: Array,
    end: Array,
    step: float,
    k: int,
    share: float,
    rows: Array,
    low: Array,
    high: Array,
    price: Array,
    at: Array,
) -> None:
    """Write the torques of instant k: those of the drives as bounds, the joints' as a price."""
    n, links, motion, slope = start.shape[1], len(w.tau), w.motion, w.slope
    quintic(start, end, (len(D) - 1) * step, k * step, motion)
    torque_slopes(p.bodies, motion, w.tau, slope, w.links)
    none, per = np.zeros(links), np.zeros((links, (k + 1) * n))
    for a in range(links):
        none[a] = w.tau[a]
        for j in range(n):
            drift = start[0, j] + k * step * start[1, j]
            none[a] += slope[0, a, j] * (drift - motion[0, j])
            none[a] += slope[1, a, j] * (start[1, j] - motion[1, j]) - slope[2, a, j] * motion[2, j]
            for i in range(k + 1):
                per[a, i * n + j] = slope[0, a, j] * P[k, i] + slope[1, a, j] * D[k, i]
            per[a, k * n + j] += slope[2, a, j]
    for d in range(links):
        tau, omega = asked_of(p, d, w.tau, motion[1])
        bound, _ = bound_of(p.drives, d, tau, omega, 0.0)
        bound = max(bound, _LEAST * p.drives[2 * links, d])
        row, load = 4 * n + k * links + d, 0.0
        for a in range(links):
            scale = p.drives[d, a] / bound
            load += scale * none[a]
            for c in range((k + 1) * n):
                rows[row, c] += scale * per[a, c]
        low[row], high[row] = -share - load, share - load
    for j in range(n):
        a, row = p.joints[j], k * n + j
        at[row] = none[a] / p.scales[0, j]
        for c in range((k + 1) * n):
            price[row, c] = per[a, c] / p.scales[0, j]
