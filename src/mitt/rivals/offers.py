"""What the ways to several catches ask of the arm, and which of them is the cheapest.

The way is a quintic. It costs eq. (22), and more where it asks much of a limit or ends low.

| columns of ``offers`` | meaning                                                       | unit |
|-----------------------|---------------------------------------------------------------|------|
| 0                     | price                                                         | 1    |
| 1                     | largest share of a speed limit                                | 1    |
| 2, 3                  | largest share of any limit, and of which: kind n + joint      | 1    |
| 4                     | whether the catch is low                                      | 0, 1 |
"""

import numpy as np
from numba import njit
from numpy.typing import NDArray

from mitt.generator.strain import Plant, Work, assess
from mitt.rivals.quintics import sampled
from mitt.robot.dynamics import inverse_dynamics
from mitt.signals import Array

#: Columns of the table of offers.
OFFER = 5


@njit(cache=True)
def cheapest(
    p: Plant,
    w: Work,
    inertia: Array,
    numbers: tuple[float, float, float, float, float, float],
    found: NDArray[np.bool_],
    after: Array,
    balls: Array,
    ends: Array,
    motion: Array,
    ways: Array,
    offers: Array,
) -> int:
    """Return the cheapest of several catches; -1 where there is none.

    Ways that are much too fast are left out, as long as there are others.

    Args:
        p: The arm.
        w: Buffers.
        inertia: Inertia over the largest torque, joint by joint [s^2/rad], shape (n,).
        numbers: ``refused, spare, price, low, follow`` of ``CourseSettings``, and the height
            below which a catch is low [m].
        found: Which catches there are, shape (K,).
        after: Their times from now [s], shape (K,).
        balls: r_o, dr_o, ddr_o then, shape (K, 3, 3).
        ends: q, dq, ddq then, shape (K, 3, n).
        motion: q, dq, ddq now, shape (3, n).
        ways: Result: the ways at S even instants, shape (K, S, 3, n).
        offers: Result: the module's table, shape (K, 5).
    """
    refused, spare, price, dear, follow, floor = numbers
    sampled(motion, ends, after, ways)
    quickest, best = np.inf, -1
    for k in range(len(after)):
        offers[k, 1] = _quickness(p, ways[k])
        if found[k]:
            quickest = min(quickest, offers[k, 1])
    for k in range(len(after)):
        if not (found[k] and offers[k, 1] <= max(refused, quickest)):
            continue
        cost, share, which = _weighed(p, w, inertia, follow, ways[k], ends[k])
        low = balls[k, 0, 2] < floor
        offers[k, 0] = cost + price * max(share - spare, 0.0) ** 2 + dear * low
        offers[k, 2], offers[k, 3], offers[k, 4] = share, which, low
        if best < 0 or offers[k, 0] < offers[best, 0]:
            best = k
    return best


@njit(cache=True)
def _quickness(p: Plant, way: Array) -> float:
    """Return the largest share of a joint's speed limit on a way, shape (S, 3, n)."""
    largest = 0.0
    for s in range(way.shape[0]):
        for j in range(way.shape[2]):
            largest = max(largest, abs(way[s, 1, j] / p.scales[1, j]))
    return largest


@njit(cache=True)
def _weighed(
    p: Plant, w: Work, inertia: Array, follow: float, way: Array, end: Array
) -> tuple[float, float, int]:
    """Return cost of a way, its largest share of a limit, and of which: kind n + joint."""
    n, links = way.shape[2], len(w.tau)
    shares, at, cost = np.zeros((3, links)), np.empty((3, links)), 0.0
    for s in range(len(way)):
        w.motion[:] = way[s]
        inverse_dynamics(p.bodies, way[s, 0], way[s, 1], way[s, 2], w.tau, w.notes)
        cost += assess(p, s, np.inf, shares, at, w)[0]
    for j in range(n):
        stop = end[0, j] + follow * end[1, j] + 0.5 * end[1, j] * abs(end[1, j]) * inertia[j]
        x = abs(stop - p.scales[2, j]) / p.scales[3, j]
        shares[2, p.joints[j]] = max(shares[2, p.joints[j]], x)
    share, which = -1.0, 0
    for kind in range(3):
        for j in range(n):
            if shares[kind, p.joints[j]] > share:
                share, which = shares[kind, p.joints[j]], kind * n + j
    return cost / len(way), share, which
