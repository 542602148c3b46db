"""One online step in two compiled halves, around the solver of its quadratic programme.

| here       | meaning                                                                      |
|------------|------------------------------------------------------------------------------|
| ``Goal``   | alpha* and its metric, weights, hand, room: what a step is after             |
| ``Model``  | everything that stays the same from one step to the next                     |
| ``begin``  | lays the course, writes cost and rows at the present alpha                   |
| ``finish`` | weighs the step with exact torques, halves it where it does not help         |
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mitt.generator.approach import approach
from mitt.generator.clearance import Space, keep_clear
from mitt.generator.horizon import Course, lay
from mitt.generator.packing import unfold, unpack
from mitt.generator.qp import Programme, linearise, sound
from mitt.generator.utilization import Plant, Work, weigh
from mitt.jit import kernel
from mitt.signals import Array


class Goal(NamedTuple):
    """What a step is after."""

    alpha: Array  # (m, n) alpha* [rad]
    H: Array  # (m n, m n) metric of the pull towards it
    weights: Array  # pull, share of limits, share from which they get rows, weight of excess, gap
    palm: Array  # (3, 3) see :mod:`mitt.generator.approach`
    space: Space


class Map(NamedTuple):
    """The map without its coefficients, and its buffers."""

    packed: Array
    powers: NDArray[np.int64]
    window: Array
    work: Array


class Buffers(NamedTuple):
    """What the two halves share; see :mod:`mitt.generator.utilization` for shares and instants."""

    course: Course
    programme: Programme
    work: Work
    shares: Array
    at: Array


@kernel
def begin(
    f: Map, p: Plant, goal: Goal, state: Array, ahead: tuple[float, float], alpha: Array, b: Buffers
) -> tuple[float, int, float]:
    """Write the programme of a step from ``alpha``; continuity, limits, approach, clearance.

    Args:
        f: The map.
        p: The arm.
        goal: What the step is after.
        state: The ball: position, velocity, drag coefficient, shape (7,).
        ahead: Time until new coefficients act, and from there to the catch as far as known [s].
        alpha: Coefficients now in use [rad], shape (m, n).
        b: Buffers and results.

    Returns:
        A better time to the catch (NaN outside the domain), the number of rows (0 where
        anything is not finite), and the merit of ``alpha``.
    """
    c, out, (m, n) = b.course, b.programme, alpha.shape
    better = lay(f.packed, f.powers, f.window, state, ahead, c, f.work)
    if not np.isfinite(better):
        return np.nan, 0, np.inf
    out.A[: 2 * n] = 0.0
    out.room[: 2 * n] = 0.0
    for d in range(2):
        for a in range(m):
            for j in range(n):
                out.A[d * n + j, a * n + j] = c.phi[0, d, a]
    use = (goal.weights[1], goal.weights[2])
    count, cost, over = linearise(p, c, alpha, use, out, b.shares, b.at, b.work)
    g, scratch = unpack(f.packed), unfold(f.work, n)
    count, more = approach(g, c, alpha, goal.palm, out, b.work, scratch, count)
    count, close = keep_clear(
        p, g, goal.space, goal.weights[4], c, alpha, out, b.work, scratch, count
    )
    pull = _pull(goal, alpha, out.slope)
    for a in range(m * n):
        for e in range(m * n):
            out.h[a, e] += goal.weights[0] * goal.H[a, e]
        out.g[a] += out.slope[a]
    if not sound(out, count):
        return better, 0, np.inf
    return better, count, cost + pull + goal.weights[3] * (over + more + close)


@kernel
def finish(
    f: Map, p: Plant, goal: Goal, trial: tuple[float, float, int], alpha: Array, step: Array,
    moved: Array, b: Buffers,
) -> float:  # fmt: skip
    """Write the coefficients after the largest share of a step that helps.

    Args:
        f: The map.
        p: The arm.
        goal: What the step is after.
        trial: Merit of ``alpha``, share of the step that is tried first, how often it is halved.
        alpha: Coefficients now in use [rad], shape (m, n).
        step: Solution of the programme, shape (m n,).
        moved: Result, shape (m, n); ``alpha`` where nothing helped.
        b: Buffers.

    Returns:
        The merit of ``moved``.
    """
    n, (before, share, halvings) = alpha.shape[1], trial
    for _ in range(halvings + 1):
        for a in range(len(step)):
            moved[a // n, a % n] = alpha[a // n, a % n] + share * step[a]
        after = merit(f, p, goal, moved, b)
        if after < before:
            return float(after)
        share *= 0.5
    moved[:] = alpha
    weigh(
        p, b.course, alpha, goal.weights[1], b.shares, b.at, b.work
    )  # not those of the last trial
    return before


@kernel
def merit(f: Map, p: Plant, goal: Goal, alpha: Array, b: Buffers) -> float:
    """Return cost (22), pull, and the price of limits exceeded, of a motion along the course."""
    cost, over = weigh(p, b.course, alpha, goal.weights[1], b.shares, b.at, b.work)
    g, scratch, c, out = unpack(f.packed), unfold(f.work, alpha.shape[1]), b.course, b.programme
    _, more = approach(g, c, alpha, goal.palm, out, b.work, scratch, -1)
    _, close = keep_clear(p, g, goal.space, goal.weights[4], c, alpha, out, b.work, scratch, -1)
    pull = _pull(goal, alpha, b.programme.slope)
    return float(cost + pull + goal.weights[3] * (over + more + close))


@kernel
def _pull(goal: Goal, alpha: Array, slope: Array) -> float:
    """Return the price of the distance from alpha*; write its slope, H times that distance."""
    size = len(slope)
    here, there, price = alpha.reshape(size), goal.alpha.reshape(size), 0.0
    slope[:] = 0.0
    for e in range(size):
        off = goal.weights[0] * (here[e] - there[e])
        for a in range(size):
            slope[a] += goal.H[e, a] * off
    for a in range(size):
        price += slope[a] * (here[a] - there[a])
    return price


@kernel
def kept(q: Programme, equal: int, step: Array, residual: float) -> bool:
    """Say whether a step is finite and leaves q_d and dq_d at its start as they are."""
    for r in range(equal):
        total = 0.0
        for a in range(len(step)):
            total += q.A[r, a] * step[a]
        if not abs(total) <= residual:
            return False
    return bool(np.all(np.isfinite(step)))
