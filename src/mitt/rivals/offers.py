"""What the ways to several catches ask of the arm, and which of them is the cheapest.

The way is a quintic. It costs eq. (22), and more where it asks much of a limit or ends low.

| columns of ``offers`` | meaning                                                       | unit |
|-----------------------|---------------------------------------------------------------|------|
| 0                     | price                                                         | 1    |
| 1                     | largest share of a speed limit                                | 1    |
| 2, 3                  | largest share of any limit, and of which: kind n + joint      | 1    |
| 4                     | whether the catch is low                                      | 0, 1 |
"""

from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from mitt.generator.strain import Plant, Work, assess
from mitt.jit import kernel
from mitt.rivals.quintics import sample
from mitt.robot.dynamics import inverse_dynamics
from mitt.signals import Array

#: Columns of the table of offers.
OFFER = 5

#: ``refused, spare, price, low, follow`` of ``CourseSettings``, and the height below which a catch
#: is low [m].
Numbers: TypeAlias = tuple[float, float, float, float, float, float]


@kernel
def cheapest(
    p: Plant,
    w: Work,
    inertia: Array,
    numbers: Numbers,
    found: NDArray[np.bool_],
    after: Array,
    balls: Array,
    ends: Array,
    motion: Array,
    ways: Array,
    offers: Array,
) -> int:
    """Return the cheapest of several catches; -1 where there is none.

    Ways that are much too fast are left out, as long as there are others. The slowest is weighed
    first, and another no longer than until it is dearer than the cheapest so far.

    Args:
        p: The arm.
        w: Buffers.
        inertia: Inertia over the largest torque, joint by joint [s^2/rad], shape (n,).
        numbers: As above.
        found: Which catches there are, shape (K,).
        after: Their times from now [s], shape (K,).
        balls: r_o, dr_o, ddr_o then, shape (K, 3, 3).
        ends: q, dq, ddq then, shape (K, 3, n).
        motion: q, dq, ddq now, shape (3, n).
        ways: Result: the ways to those there are at S even instants, shape (K, S, 3, n).
        offers: Result: the module's table, whole for the cheapest alone, shape (K, 5).
    """
    slowest = -1
    for k in range(len(after)):
        if not found[k]:
            continue
        sample(motion, ends[k], after[k], ways[k])
        offers[k, 1] = _quickness(p, ways[k])
        if slowest < 0 or offers[k, 1] < offers[slowest, 1]:
            slowest = k
    if slowest < 0:
        return -1
    best, most = slowest, max(numbers[0], offers[slowest, 1])
    _weigh(p, w, inertia, numbers, np.inf, balls[best], ends[best], ways[best], offers[best])
    for k in range(len(after)):
        if k == slowest or not (found[k] and offers[k, 1] <= most):
            continue
        dearest = offers[best, 0]
        _weigh(p, w, inertia, numbers, dearest, balls[k], ends[k], ways[k], offers[k])
        if offers[k, 0] < dearest or (offers[k, 0] == dearest and k < best):
            best = k
    return best


@kernel
def _quickness(p: Plant, way: Array) -> float:
    """Return the largest share of a joint's speed limit on a way, shape (S, 3, n)."""
    largest = 0.0
    for s in range(way.shape[0]):
        for j in range(way.shape[2]):
            largest = max(largest, abs(way[s, 1, j] / p.scales[1, j]))
    return largest


@kernel
def _weigh(
    p: Plant,
    w: Work,
    inertia: Array,
    numbers: Numbers,
    dearest: float,
    ball: Array,
    end: Array,
    way: Array,
    offer: Array,
) -> None:
    """Write an offer, shape (5,); its price is infinite as soon as it exceeds ``dearest``."""
    _, spare, price, dear, follow, floor = numbers
    n, cost, low = way.shape[2], 0.0, ball[0, 2] < floor
    shares, at = np.zeros((3, len(w.tau))), np.empty((3, len(w.tau)))
    for j in range(n):
        stop = end[0, j] + follow * end[1, j] + 0.5 * end[1, j] * abs(end[1, j]) * inertia[j]
        x = abs(stop - p.scales[2, j]) / p.scales[3, j]
        shares[2, p.joints[j]] = max(shares[2, p.joints[j]], x)
    offer[0], offer[4] = np.inf, low
    for s in range(len(way)):
        w.motion[:] = way[s]
        inverse_dynamics(p.bodies, way[s, 0], way[s, 1], way[s, 2], w.tau, w.notes)
        cost += assess(p, s, np.inf, shares, at, w)[0]
        offer[2], offer[3] = _largest(p, shares)
        # Each term grows from instant to instant: what is dearer now is dearer in the end.
        so_far = cost / len(way) + price * max(offer[2] - spare, 0.0) ** 2 + dear * low
        if so_far > dearest:
            return
    offer[0] = so_far


@kernel
def _largest(p: Plant, shares: Array) -> tuple[float, int]:
    """Return the largest share of a joint's limits, shape (3, N), and of which: kind n + joint."""
    share, which, n = -1.0, 0, len(p.joints)
    for kind in range(3):
        for j in range(n):
            if shares[kind, p.joints[j]] > share:
                share, which = shares[kind, p.joints[j]], kind * n + j
    return share, which
