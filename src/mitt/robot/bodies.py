"""What the arm is made of, for telling how far it is from itself and from what stands around.

Every shape is a capsule. Moving ones hang on an active joint; those that stand still are the
arm's base and the zones to be kept out of. A pair is watched if the arm in its ready pose keeps
the two apart: shapes that overlap at a joint are not obstacles to one another.

Packed shapes, one a row: joint that carries it (-1: stands still), start, end [m], radius [m].
"""

from dataclasses import dataclass
from itertools import combinations
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from mitt.errors import InputError
from mitt.robot.arm import Arm
from mitt.robot.chain import Chain
from mitt.robot.description import ArmModel, Capsule, joint_motion, transform
from mitt.robot.hands import HandModel
from mitt.robot.vectors import (
    IDENTITY,
    ZERO,
    Vec,
    compose,
    dot,
    matrix,
    minus,
    plus,
    put,
    rotate,
    row,
    times,
    turn,
)
from mitt.signals import Array

#: Gap in the ready pose above which a pair is watched [m].
_APART = 0.01


@dataclass(frozen=True, slots=True, kw_only=True)
class Surroundings:
    """What stands around the arm.

    Attributes:
        floor: Height of the floor in the world frame [m].
        zones: Capsules in the world frame that no part of the arm may enter, as about the heads.
    """

    floor: float = -1.0
    zones: tuple[Capsule, ...] = ()

    def __post_init__(self) -> None:
        """Refuse what is not finite."""
        if not np.isfinite(self.floor):
            raise InputError("floor", "a height [m]", self.floor)
        for zone in self.zones:
            numbers = (*zone.start, *zone.end, zone.radius)
            if not (np.all(np.isfinite(numbers)) and zone.radius > 0.0):
                raise InputError("zone", "finite ends and a radius above 0 m", zone)


class Bodies(NamedTuple):
    """Shapes of an arm and of what stands around it, as arrays."""

    shapes: Array  # (m, 8) as of the module's text
    pairs: NDArray[np.int64]  # (p, 2) indices of shapes to be kept apart
    floor: float  # its height [m]
    reach: Array  # (n,) farthest of any point from each joint [m]; 1 for one that slides
    ends: Array  # (2 m, 3) where the ends of the shapes are in the world [m]; overwritten


def bodies_of(arm: Arm, surroundings: Surroundings) -> Bodies:
    """Return the shapes of an arm with its hand and of what stands around it."""
    model = arm.model
    rows = [_row(-1, capsule, np.eye(4)) for capsule in (*model.base_capsules, *surroundings.zones)]
    carrier, T = -1, model.mount
    for link in model.links:
        T = T @ link.placement
        if link.held is None:
            carrier, T = carrier + 1, transform()
        else:
            T = T @ joint_motion(link, link.held)
        rows += [_row(carrier, capsule, T) for capsule in link.capsules]
    if model.hand is not None:
        rows += [_row(carrier, x, T @ model.tool) for x in hand_capsules(model.hand)]
    shapes = np.array(rows).reshape(len(rows), 8)
    work = np.zeros((2 * len(rows), 3))
    _place(arm.chain, arm.q_ready, shapes, work)
    pairs = [p for p in combinations(range(len(rows)), 2) if _watched(shapes, work, *p)]
    return Bodies(
        shapes=shapes,
        pairs=np.array(pairs, dtype=np.int64).reshape(len(pairs), 2),
        floor=surroundings.floor,
        reach=_reach(model, arm.chain, shapes),
        ends=work,
    )


def hand_capsules(hand: HandModel) -> tuple[Capsule, ...]:
    """Return capsules on the tool plate that hold the palm, and the fingers at any angle."""
    finger = hand.finger
    points = np.array([finger.points(x) for x in np.linspace(0.0, hand.drive.closed, 31)])
    width = np.hypot(np.abs(points[..., 0]).max(), finger.offset) + finger.thickness
    low, high = points[..., 1].min() - finger.thickness, points[..., 1].max() + finger.thickness
    palm = 0.5 * hand.palm_height
    return (
        Capsule(start=(0.0, 0.0, 0.0), end=(0.0, 0.0, palm), radius=0.045),
        # The tops of the swept fingers are narrow: the round end of the capsule covers them.
        Capsule(
            start=(0.0, 0.0, float(low)),
            end=(0.0, 0.0, float(max(high - 0.5 * width, low))),
            radius=float(width),
        ),
    )


def _row(carrier: int, capsule: Capsule, T: Array) -> Array:
    """Return a capsule as a row, moved by a transform."""
    start, end = (T[:3, :3] @ np.array(x) + T[:3, 3] for x in (capsule.start, capsule.end))
    return np.array([carrier, *start, *end, capsule.radius])


def _watched(shapes: Array, work: Array, a: int, b: int) -> bool:
    """Say whether two shapes hang on different joints and stand apart."""
    return bool(shapes[a, 0] != shapes[b, 0] and _gap(shapes, work, a, b) > _APART)


def _reach(model: ArmModel, chain: Chain, shapes: Array) -> Array:
    """Return a bound on the distance of any moving point from each active joint, shape (n,)."""
    n = len(chain.axis)
    extent = np.zeros(n)  # farthest point of the shapes on a joint from that joint's origin
    for shape in shapes[shapes[:, 0] >= 0]:
        far = max(np.linalg.norm(shape[1:4]), np.linalg.norm(shape[4:7])) + shape[7]
        extent[int(shape[0])] = max(extent[int(shape[0])], far)
    slide = [max(abs(model.links[k].q_min), abs(model.links[k].q_max)) for k in model.active]
    out = np.zeros(n)
    beyond = 0.0
    for k in range(n - 1, -1, -1):
        beyond = max(beyond, extent[k])
        beyond += slide[k] * chain.prismatic[k]
        out[k] = 1.0 if chain.prismatic[k] else beyond
        beyond += float(np.linalg.norm(chain.p[k]))
    return out


@njit(cache=True)
def _place(chain: Chain, q: Array, shapes: Array, ends: Array) -> None:
    """Write where both ends of every shape are in the world, shape (2 m, 3)."""
    R, p, at = IDENTITY, ZERO, 0
    m = len(shapes)
    for joint in range(-1, len(q)):
        if joint >= 0:
            p = plus(p, rotate(R, row(chain.p, joint)))
            R = compose(R, matrix(chain.R, joint))
            axis = row(chain.axis, joint)
            if chain.prismatic[joint] > 0.0:
                p = plus(p, rotate(R, times(q[joint], axis)))
            else:
                R = compose(R, turn(axis, q[joint]))
        while at < m and int(shapes[at, 0]) == joint:
            start = (shapes[at, 1], shapes[at, 2], shapes[at, 3])
            end = (shapes[at, 4], shapes[at, 5], shapes[at, 6])
            put(ends, 2 * at, plus(p, rotate(R, start)))
            put(ends, 2 * at + 1, plus(p, rotate(R, end)))
            at += 1


@njit(cache=True)
def segment_distance(a: Vec, b: Vec, c: Vec, d: Vec) -> float:
    """Return the distance of the segments a-b and c-d [m] (Ericson 2004, section 5.1.9)."""
    u, v, w = minus(b, a), minus(d, c), minus(a, c)
    uu, vv, uv, uw, vw = dot(u, u), dot(v, v), dot(u, v), dot(u, w), dot(v, w)
    s, t = 0.0, 0.0
    if uu <= 1e-18 and vv <= 1e-18:
        return float(np.sqrt(dot(w, w)))
    if uu <= 1e-18:
        t = min(max(vw / vv, 0.0), 1.0)
    elif vv <= 1e-18:
        s = min(max(-uw / uu, 0.0), 1.0)
    else:
        across = uu * vv - uv * uv
        if across > 1e-12 * uu * vv:
            s = min(max((uv * vw - uw * vv) / across, 0.0), 1.0)
        t = (uv * s + vw) / vv
        if t < 0.0:
            t, s = 0.0, min(max(-uw / uu, 0.0), 1.0)
        elif t > 1.0:
            t, s = 1.0, min(max((uv - uw) / uu, 0.0), 1.0)
    gap = minus(plus(w, times(s, u)), times(t, v))
    return float(np.sqrt(dot(gap, gap)))


@njit(cache=True)
def _gap(shapes: Array, ends: Array, a: int, b: int) -> float:
    """Return the gap between two placed shapes [m]; negative where they overlap."""
    apart = segment_distance(
        row(ends, 2 * a), row(ends, 2 * a + 1), row(ends, 2 * b), row(ends, 2 * b + 1)
    )
    return float(apart - shapes[a, 7] - shapes[b, 7])


@njit(cache=True)
def clearance(
    chain: Chain, q: Array, shapes: Array, pairs: NDArray[np.int64], floor: float, ends: Array
) -> float:
    """Return the smallest gap of any watched pair, and of any moving shape and the floor [m].

    Args:
        chain: Kinematics of the arm.
        q: Joint positions [rad], shape (n,).
        shapes: ``Bodies.shapes``.
        pairs: ``Bodies.pairs``.
        floor: Height of the floor [m].
        ends: Scratch, shape (2 m, 3).
    """
    _place(chain, q, shapes, ends)
    nearest = np.inf
    for k in range(len(shapes)):
        if shapes[k, 0] >= 0.0:
            lowest = min(ends[2 * k, 2], ends[2 * k + 1, 2])
            nearest = min(nearest, lowest - shapes[k, 7] - floor)
    for k in range(len(pairs)):
        nearest = min(nearest, _gap(shapes, ends, pairs[k, 0], pairs[k, 1]))
    return float(nearest)
