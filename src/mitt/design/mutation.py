"""Small changes of a candidate: what a search tries once it has something that catches."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from mitt.design.candidate import Candidate
from mitt.design.whole import movable
from mitt.robot.arm import Arm
from mitt.signals import Array

#: Standard deviations of a change: joints at the catch, held joints, ready pose [rad]; kappa - 1
#: and inward together, as a share; each by itself, as a share.
_FREE, _HELD, _READY, _KAPPA, _INWARD = 0.12, 0.2, 0.2, 0.3, 0.15
#: The same of how far a further joint turns per coordinate of the free ones.
_FOLLOWS = 0.1
#: Room that is left to the ends of the ranges [rad].
_MARGIN = 0.06
#: Standard deviations of the slope of the catch angle, and of the match weight as a share; how
#: often the weight is set to 0, or to 1 where it was 0.
_SLOPE, _WEIGHT, _SWITCHED = 0.3, 0.7, 0.05
#: Shift of the aim against the catch point [m], and how often a held joint is turned square.
_AIM, _SQUARE = 0.07, 0.1
#: How often each part is changed.
_OFTEN = 0.6


def mutated(whole: Arm, c: Candidate, rng: np.random.Generator, *, size: float, moves: bool) -> (
    Candidate
):  # fmt: skip
    """Return a candidate a little different.

    Args:
        whole: The arm with all joints active.
        c: What is changed.
        rng: Source of randomness.
        size: Of the changes; 1 for the first ones.
        moves: Whether the aim goes with the catch point; it stays otherwise.
    """
    free = list(c.free)
    q, ready, A = c.q.copy(), c.ready.copy(), c.A.copy()
    if rng.random() < _OFTEN:
        sigma = np.full(whole.n, _HELD)
        sigma[free] = _FREE
        sigma[~movable(whole)] = 0.0
        q = q + size * sigma * rng.standard_normal(whole.n) * (rng.random(whole.n) < _OFTEN)
        q = _inside(whole, _squared(q, free, rng), np.arange(whole.n))
        ready = ready + (q - c.q)[free]
    if len(c.active) > 3 and rng.random() < _OFTEN:
        further = [k for k in c.active if k not in free]
        A[further] += size * _FOLLOWS * rng.standard_normal((len(further), 3))
    if rng.random() < _OFTEN:
        others = [x for x in range(3) if x != c.catch]
        slope = c.A[free[c.catch], others]
        change = np.clip(slope + size * _SLOPE * rng.standard_normal(2), -10.0, 10.0) - slope
        A[:, others] += np.outer(A[:, c.catch], change)
    if rng.random() < _OFTEN:
        ready = ready + size * _READY * rng.standard_normal(3)
    kappa, inward = c.kappa, c.inward
    if rng.random() < _OFTEN:  # harder or softer: both by one factor, the ball's way in stays
        factor = float(np.exp(size * _KAPPA * rng.standard_normal()))
        kappa, inward = 1.0 + (kappa - 1.0 + 0.02) * factor, inward * factor
    if rng.random() < _OFTEN:
        kappa = 1.0 + (kappa - 1.0) * float(np.exp(size * _INWARD * rng.standard_normal()))
        inward += size * _INWARD * (kappa - 1.0 + abs(inward) + 0.1) * float(rng.standard_normal())
    aim = _aim(c.aim, whole.position(q) - whole.position(c.q), size, rng) if moves else c.aim
    turn = c.turn + (np.pi / 3.0 if rng.random() < 0.1 else 0.0)
    return replace(
        c, q=q, A=A, ready=_inside(whole, ready, np.array(free)), kappa=min(kappa, 50.0),
        inward=float(np.clip(inward, -50.0, 50.0)), aim=aim, match_weight=_weight(c, size, rng),
        turn=float(np.mod(turn, 2.0 * np.pi / 3.0)),
    )  # fmt: skip


def _weight(c: Candidate, size: float, rng: np.random.Generator) -> float:
    """Return a match weight that is a little larger or smaller, and now and then 0."""
    weight = c.match_weight * float(np.exp(size * _WEIGHT * rng.standard_normal()))
    if rng.random() < _SWITCHED:
        weight = 0.0 if weight > 0.0 else 1.0
    return min(weight, 1000.0)


def _squared(q: Array, free: list[int], rng: np.random.Generator) -> Array:
    """Return a pose of which some held joints are turned to the next right angle."""
    square = np.round(q / (0.5 * np.pi)) * (0.5 * np.pi)
    held = np.ones(len(q), dtype=bool)
    held[free] = False
    out: Array = np.where(held & (rng.random(len(q)) < _SQUARE), square, q)
    return out


def _aim(aim: Array, moved: Array, size: float, rng: np.random.Generator) -> Array:
    """Return an aim that goes with the catch point, and sometimes is shifted against it."""
    out = aim.copy()
    out[0] += moved
    if rng.random() < _OFTEN:
        out[0] += size * _AIM * rng.standard_normal(3)
    return out


def _inside(whole: Arm, q: Array, joints: NDArray[np.int64]) -> Array:
    """Return angles of some joints, kept in their ranges [rad]."""
    room = np.minimum(_MARGIN, 0.1 * (whole.q_max - whole.q_min))[joints]
    out: Array = np.clip(q, whole.q_min[joints] + room, whole.q_max[joints] - room)
    return out
