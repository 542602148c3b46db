"""What the arm is made of, for telling how far it is from itself and from what stands around it.

Every shape is a capsule, but for the floor. Moving ones hang on a link; those that stand still are
the arm's base and the zones to be kept out of. A pair is watched if the arm in its ready pose
keeps the two apart: shapes that overlap at a joint are not obstacles to one another. Nor are shapes
of the arm that no pose brings together, as those of a wrist or a base and the housing on top of it:
they are near all the time.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import combinations
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from mitt.core.arm.arm import Arm
from mitt.core.arm.description import ArmModel, Capsule
from mitt.core.arm.kinematics import (
    IDENTITY,
    VECTOR,
    ZERO,
    Vec,
    compose,
    dot,
    mat,
    minus,
    plus,
    put_vec,
    rotate,
    times,
    turn,
    vec,
)
from mitt.core.errors import InputError
from mitt.core.fields import Settings, brief
from mitt.core.kernels import Fields, Record, kernel
from mitt.core.signals import Array

#: What stands in the place of a link's index.
STILL = -1
FLOOR = -2
#: Gap that the arm keeps from itself and from what stands around it [m]. A pair that is nearer in
#: the ready pose is not watched.
MARGIN = 0.01
#: Gap that two shapes keep in every pose if they never meet [m]. Those of a link and the next that
#: are nearer in the ready pose are not watched: a wrist's stay about as near in every pose, and an
#: arm that may come no nearer could not move.
LEAST_GAP = MARGIN + 0.002
#: Whether any pose brings a pair together is tried if its gap in the ready pose is smaller [m], if
#: there are at most so many joints between the two, and with at most so many boxes of poses.
_NEAR = 0.1
_MOST_BETWEEN = 2
MOST_BOXES = 20000
#: Slope of a gap that does not change: rounding [m/rad].
_UNCHANGED = 1e-9

SHAPE: Final = np.dtype(
    [
        ("link", np.int64),  # that carries it, or STILL, or FLOOR
        ("start", VECTOR),  # in the link's frame [m]; of the floor, z is its height in the world
        ("end", VECTOR),  # likewise
        ("radius", np.float64),  # [m]
    ]
)
"""A capsule, or the floor."""

SEGMENT: Final = np.dtype([("start", VECTOR), ("end", VECTOR)])
"""Where both ends of a shape are in the world [m]."""


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Surroundings(Settings):
    """What stands around the arm.

    A part of the arm that is within 10 mm of the floor in the ready pose, as the foot of an arm
    that stands on it, is not kept from the floor.

    Attributes:
        floor: Height of the floor in the world frame [m].
        zones: Capsules in the world frame that no part of the arm may enter, as about the heads.
    """

    floor: float = -1.0
    zones: tuple[Capsule, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Shapes:
    """Shapes of an arm and of what stands around it, as arrays.

    Attributes:
        table: Shapes of type :data:`SHAPE`, first those that stand still, then by link, shape (m,).
        pairs: Indices of shapes to be kept apart, shape (p, 2).
        slopes: How fast each active joint may change the gap of each pair [m/rad], shape (p, n).
    """

    table: Record
    pairs: NDArray[np.int64]
    slopes: Array

    __repr__ = brief

    @property
    def ends(self) -> Record:
        """Scratch for where the shapes are, of type :data:`SEGMENT`, shape (m,)."""
        return np.zeros(len(self.table), SEGMENT)


def shapes_of(arm: Arm, around: Surroundings) -> Shapes:
    """Return the shapes of an arm with its hand and of what stands around it.

    Raises:
        InputError: The arm is in a zone, or within 10 mm of one, in the ready pose; or the floor is
            above what the arm stands on.
    """
    check_floor(arm.model, around.floor)
    still = [_record(STILL, x, arm.model.mount) for x in arm.model.base_capsules]
    still += [_record(STILL, x, np.eye(4)) for x in around.zones]
    floor = FLOOR, (0.0, 0.0, around.floor), ZERO, 0.0
    table = np.array([floor, *still, *_moving(arm.model)], SHAPE)
    ends = np.zeros(len(table), SEGMENT)
    place_shapes(arm.bodies, arm.q_ready, table, ends)
    first_zone, zones = 1 + len(arm.model.base_capsules), len(around.zones)
    apart = []
    for a, b in combinations(range(len(table)), 2):
        if table[a]["link"] != table[b]["link"] and table[b]["link"] >= 0:
            distance = gap(table, ends, a, b)
            kindred = table[b]["link"] - table[a]["link"] == 1
            if distance > (LEAST_GAP if kindred else MARGIN):
                apart.append((a, b))
            elif first_zone <= a < first_zone + zones:
                raise InputError(
                    f"zone {a - first_zone}",
                    f"{1e3 * MARGIN:.0f} mm or more from the arm in its ready pose",
                    f"{1e3 * distance:.0f} mm",
                    do="move the zone or the ready pose",
                )
    far = _far_from_joints(arm, table)
    near = [x for x in apart if gap(table, ends, *x) < _NEAR]
    never = _never_meeting(arm, table, far, near) if near else set()
    apart = [x for x in apart if x not in never]
    pairs = np.array(apart, dtype=np.int64).reshape(len(apart), 2)
    slopes = [_slopes(arm, table, far, *x) for x in apart]
    return Shapes(table=table, pairs=pairs, slopes=np.array(slopes).reshape(len(apart), arm.n))


def check_floor(model: ArmModel, floor: float) -> None:
    """Refuse a floor that the lowest end of the arm's base would be under as a whole."""
    ends = [x[2] + y.radius for y in model.base_capsules for x in (y.start, y.end)]
    foot = min((model.mount[2, 3] + top for top in ends), default=np.inf)
    if floor > foot:
        raise InputError(
            "floor",
            f"at most {foot:.2f} m, where {model.name} stands",
            f"{floor:g}",
            do="give its height in the frame of the arm's base",
        )


def _never_meeting(
    arm: Arm, table: Record, far: Array, near: list[tuple[int, int]]
) -> set[tuple[int, int]]:
    """Return the pairs of the arm's own shapes that the one or two joints between never join.

    Nor does one whose gap no joint changes.
    """
    never = set()
    for a, b in near:
        between = _between(arm, table, a, b)
        around = table[a]["link"] < 0 and not 1 <= a <= len(arm.model.base_capsules)
        if not around and len(between) <= _MOST_BETWEEN:
            slopes = _slopes(arm, table, far, a, b)[between]
            if not np.any(slopes > _UNCHANGED) or _stay_apart(arm, table[[a, b]], between, slopes):
                never.add((a, b))
    return never


def _stay_apart(arm: Arm, both: Record, between: list[int], slopes: Array) -> bool:
    """Say whether it is certain that no pose brings two shapes nearer than ``LEAST_GAP``."""
    boxes = np.zeros((MOST_BOXES + 2, 2, len(between)))
    boxes[0, 0] = 0.5 * (arm.q_min + arm.q_max)[between]
    boxes[0, 1] = arm.q_max[between] - boxes[0, 0]
    joints, q = np.array(between, dtype=np.int64), arm.q_ready.copy()
    return bool(all_apart(arm.bodies, both, joints, slopes, boxes, q, np.zeros(2, SEGMENT)))


def _between(arm: Arm, table: Record, a: int, b: int) -> list[int]:
    """Return the active joints that move one shape against another."""
    first, last = (int(table[x]["link"]) for x in (a, b))
    return [j for j, link in enumerate(arm.model.active) if first < link <= last]


def _slopes(arm: Arm, table: Record, far: Array, a: int, b: int) -> Array:
    """Return how fast each active joint may change the gap of two shapes [m/rad], shape (n,).

    No faster than the farthest of the points of either shape is from the joint's axis: what turns
    against what is the same. The radii do not count, as the gap is that of the segments less the
    radii.
    """
    out, between = np.zeros(arm.n), _between(arm, table, a, b)
    out[between] = np.minimum(far[a], far[b])[between]
    return out


def _far_from_joints(arm: Arm, table: Record) -> Array:
    """Return how far the segment of each shape may be from each active joint, shape (m, n).

    That is, from the joint's axis, where no active joint lies between; else from its origin, by the
    lengths of the links between [m]. The floor ends nowhere. A joint that slides moves all by 1.
    """
    links, active, m = arm.model.links, arm.model.active, len(table)
    axes = np.array([(k, ZERO, tuple(links[k].axis), 0.0) for k in active], SHAPE)
    placed = np.zeros(m + len(axes), SEGMENT)
    place_shapes(arm.bodies, arm.q_ready, table, placed[:m])
    place_shapes(arm.bodies, arm.q_ready, axes, placed[m:])
    ends = np.array([[list(x[y].item()) for y in ("start", "end")] for x in placed])
    out = np.ones((m, len(active)))
    for i in range(m):
        for j, k in enumerate(active):
            own = int(table[i]["link"])
            low, high = min(own, k), max(own, k)
            if links[k].prismatic:
                continue
            if own == FLOOR:
                out[i, j] = np.inf
            elif any(low < x <= high and x != k for x in active):
                out[i, j] = _farthest(table[i]) + _longest(arm, low, high)
            else:
                at, axis = ends[m + j, 0], ends[m + j, 1] - ends[m + j, 0]
                out[i, j] = np.linalg.norm(np.cross(ends[i] - at, axis), axis=1).max()
    return out


def _longest(arm: Arm, low: int, high: int) -> float:
    """Return how far apart the origins of two links may be [m]; the world's is that of ``STILL``.

    It is the way along the links between, as far as they slide.
    """
    length = 0.0 if low >= 0 else float(np.linalg.norm(arm.model.mount[:3, 3]))
    for link in arm.model.links[low + 1 : high + 1]:
        slide = max(abs(link.q_min), abs(link.q_max)) if link.prismatic else 0.0
        length += float(np.linalg.norm(link.placement[:3, 3])) + slide
    return length


def _moving(model: ArmModel) -> Iterator[tuple[Any, ...]]:
    """Yield the records of the shapes of links and hand."""
    for k, link in enumerate(model.links):
        yield from (_record(k, x, np.eye(4)) for x in link.capsules)
    if model.hand is not None:
        last = len(model.links) - 1
        yield from (_record(last, x, model.tool) for x in model.hand.capsules())


def _record(link: int, capsule: Capsule, T: Array) -> tuple[Any, ...]:
    """Return the record of a capsule moved by a transform."""
    start, end = (T[:3, :3] @ np.array(x) + T[:3, 3] for x in (capsule.start, capsule.end))
    return link, tuple(start), tuple(end), capsule.radius


def _farthest(shape: Fields) -> float:
    """Return how far the segment of a shape reaches from its link's origin [m]."""
    return float(max(np.linalg.norm(shape[end].item()) for end in ("start", "end")))


@kernel
def place_shapes(bodies: Record, q: Array, table: Record, ends: Record) -> None:
    """Write where both ends of every shape are in the world.

    Args:
        bodies: ``Arm.bodies``, shape (N,).
        q: Active joint positions [rad], shape (n,).
        table: ``Shapes.table``.
        ends: Result, shape (m,).
    """
    R, p, at = IDENTITY, ZERO, 0
    for link in range(-1, len(bodies)):
        if link >= 0:
            body = bodies[link]
            axis, j = vec(body.axis), body.joint
            p = plus(p, rotate(R, vec(body.p)))
            R = compose(R, mat(body.R))
            if j >= 0 and body.slides:
                p = plus(p, rotate(R, times(q[j], axis)))
            elif j >= 0:
                R = compose(R, turn(axis, q[j]))
        while at < len(table) and table[at].link <= link:
            put_vec(ends[at].start, plus(p, rotate(R, vec(table[at].start))))
            put_vec(ends[at].end, plus(p, rotate(R, vec(table[at].end))))
            at += 1


@kernel
def gap(table: Record, ends: Record, a: int, b: int) -> float:
    """Return the gap between two placed shapes [m]; negative where they overlap.

    Args:
        table: ``Shapes.table``.
        ends: Where they are, shape (m,).
        a: Index of one shape, which may be the floor.
        b: Index of another one, which is a capsule.
    """
    one, other = ends[a], ends[b]
    if table[a].link == FLOOR:
        lowest = min(other.start.z, other.end.z)
        return float(lowest - table[b].radius - table[a].start.z)
    apart = segment_distance(vec(one.start), vec(one.end), vec(other.start), vec(other.end))
    return float(apart - table[a].radius - table[b].radius)


@kernel
def all_apart(
    bodies: Record,
    table: Record,
    joints: NDArray[np.int64],
    slopes: Array,
    boxes: Array,
    q: Array,
    ends: Record,
) -> bool:
    """Say whether no pose of a box brings two shapes nearer than ``LEAST_GAP``.

    A box of poses in which the gap in the middle, less what it may change by up to the corners, is
    larger holds no such pose; any other is cut in two (branch and bound, Lipschitz: Piyavskii
    1972). What is not settled after ``MOST_BOXES`` boxes counts as meeting.

    Args:
        bodies: ``Arm.bodies``, shape (N,).
        table: The two shapes, shape (2,).
        joints: Active joints that move, shape (k,).
        slopes: How fast each of them may change the gap [m/rad], shape (k,).
        boxes: Middle and half width [rad]; the first is the box, shape (MOST_BOXES + 2, 2, k).
        q: A pose, overwritten [rad], shape (n,).
        ends: Scratch, shape (2,).
    """
    left = 1
    for _ in range(MOST_BOXES):
        if left == 0:
            return True
        left -= 1
        box, widest, change = boxes[left], 0, 0.0
        for i in range(len(joints)):
            q[joints[i]] = box[0, i]
            change += slopes[i] * box[1, i]
            if slopes[i] * box[1, i] > slopes[widest] * box[1, widest]:
                widest = i
        place_shapes(bodies, q, table, ends)
        found = gap(table, ends, 0, 1)
        if found <= LEAST_GAP:
            return False
        if found - change <= LEAST_GAP:
            half = 0.5 * box[1, widest]
            box[1, widest] = half
            boxes[left + 1] = box
            box[0, widest] -= half
            boxes[left + 1, 0, widest] += half
            left += 2
    return left == 0


@kernel
def clearance(
    bodies: Record, q: Array, table: Record, pairs: NDArray[np.int64], ends: Record
) -> float:
    """Return the smallest gap of any watched pair [m]; infinite if none is watched.

    Args:
        bodies: ``Arm.bodies``, shape (N,).
        q: Active joint positions [rad], shape (n,).
        table: ``Shapes.table``.
        pairs: ``Shapes.pairs``.
        ends: Scratch, shape (m,).
    """
    place_shapes(bodies, q, table, ends)
    nearest = np.inf
    for k in range(len(pairs)):
        nearest = min(nearest, gap(table, ends, pairs[k, 0], pairs[k, 1]))
    return float(nearest)


@kernel
def segment_distance(a: Vec, b: Vec, c: Vec, d: Vec) -> float:
    """Return the distance of the segments a-b and c-d [m].

    Ericson, Real-Time Collision Detection (2004), section 5.1.9; s and t are the shares of their
    ways at which their nearest points lie.
    """
    u, v, w = minus(b, a), minus(d, c), minus(a, c)
    uu, vv, uv, uw, vw = dot(u, u), dot(v, v), dot(u, v), dot(u, w), dot(v, w)
    s, t = 0.0, 0.0
    if uu <= 1e-18 and vv > 1e-18:
        t = min(max(vw / vv, 0.0), 1.0)
    elif uu > 1e-18 and vv <= 1e-18:
        s = min(max(-uw / uu, 0.0), 1.0)
    elif uu > 1e-18:
        across = uu * vv - uv * uv
        if across > 1e-12 * uu * vv:
            s = min(max((uv * vw - uw * vv) / across, 0.0), 1.0)
        t = (uv * s + vw) / vv
        if t < 0.0:
            t, s = 0.0, min(max(-uw / uu, 0.0), 1.0)
        elif t > 1.0:
            t, s = 1.0, min(max((uv - uw) / uu, 0.0), 1.0)
    apart = minus(plus(w, times(s, u)), times(t, v))
    return float(np.sqrt(dot(apart, apart)))
