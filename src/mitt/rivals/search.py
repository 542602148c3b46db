"""The search for the cheapest catch: candidates in even steps, then about the best; compiled.

| here       | meaning                                                            | shape        |
|------------|--------------------------------------------------------------------|--------------|
| ``offers`` | table of :mod:`mitt.rivals.offers`                                 | (K, 5)       |
"""

from typing import NamedTuple

import numpy as np

from mitt.generator.foresight import fly
from mitt.generator.strain import Plant, Work
from mitt.jit import kernel
from mitt.rivals.meeting import meetings
from mitt.rivals.offers import OFFER, Numbers, cheapest
from mitt.signals import Array


class Known(NamedTuple):
    """What a search knows of the arm, and its buffers."""

    packed: Array  # this, hand and work as of mitt.rivals.meeting
    hand: Array
    bounds: tuple[float, float]  # smallest and largest relative acceleration [m/s^2]
    reach: Array  # (3, n) lowest and highest joints; where the first meeting starts [rad]
    work: Array
    plant: Plant  # this, scratch and numbers as of mitt.rivals.offers.cheapest
    scratch: Work
    numbers: Numbers


class Arena(NamedTuple):
    """Buffers for K candidates: balls, ends of the ways, the ways at S instants, the offers."""

    balls: Array
    ends: Array
    ways: Array
    offers: Array


def arena_of(candidates: int, instants: int, n: int) -> Arena:
    """Return buffers for so many candidates, instants of a way, and joints."""
    return Arena(
        np.zeros((candidates, 3, 3)),
        np.zeros((candidates, 3, n)),
        np.zeros((candidates, instants, 3, n)),
        np.zeros((candidates, OFFER)),
    )


@kernel
def elect(g: Known, after: Array, arena: Arena, motion: Array) -> int:
    """Return the cheapest of several catches, whose balls are in the arena; -1 without one.

    Args:
        g: The arm.
        after: Times from now [s], shape (K,).
        arena: Buffers; ends and offers are the result.
        motion: q, dq, ddq now, shape (3, n).
    """
    ends, reach = arena.ends, g.reach
    ends[0, 0] = reach[2]
    found = meetings(g.packed, g.hand, g.bounds, arena.balls, ends, g.work)
    for k in range(len(after)):
        for j in range(motion.shape[1]):
            found[k] &= reach[0, j] < ends[k, 0, j] < reach[1, j]
    return int(
        cheapest(
            g.plant, g.scratch, g.hand[3:], g.numbers, found, after, arena.balls, ends, motion,
            arena.ways, arena.offers,
        )
    )  # fmt: skip


@kernel
def search(
    g: Known, after: Array, arena: Arena, stride: float, state: Array, motion: Array, end: Array,
    ball: Array,
) -> tuple[float, float, int, bool]:  # fmt: skip
    """Write the cheapest catch of a ball: q, dq, ddq then, (3, n), and r_o, dr_o, ddr_o, (3, 3).

    Args:
        g: The arm.
        after: The even steps [s], shape (K,); none is sooner than the first.
        arena: Buffers.
        stride: Step of the times [s].
        state: The ball now, as of :func:`mitt.generator.foresight.state_of`, shape (10,).
        motion: q, dq, ddq now, shape (3, n).
        end: Result.
        ball: Result.

    Returns:
        Time of the catch from now [s], infinite without one; the largest share of a limit on the
        way there, which limit, and whether the catch is low.
    """
    best, times, part = (np.inf, np.inf, 0, False), after, arena
    for turn in range(2):
        fly(state, times, part.balls)
        k = elect(g, times, part, motion)
        if k >= 0:
            end[:], ball[:], offer = part.ends[k], part.balls[k], part.offers[k]
            best = times[k], offer[2], int(offer[3]), offer[4] > 0.0
        if turn > 0 or k < 0:
            break
        times = _about(best[0], stride, after[0])
        m = len(times)
        part = Arena(arena.balls[:m], arena.ends[:m], arena.ways[:m], arena.offers[:m])
    return best


@kernel
def _about(t: float, stride: float, soonest: float) -> Array:
    """Return the times about a catch that are not too soon [s]."""
    low, high = t - stride / 2, t + stride / 2
    step = (high - low) / 2
    times = np.array([low, low + step, high])
    first = 0
    while times[first] < soonest:
        first += 1
    return times[first:]
