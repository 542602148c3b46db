"""What the arm is made of, for telling how far it is from itself and from what stands around it.

Every shape is a capsule, but for the floor. Moving ones hang on a link; those that stand still are
the arm's base and the zones to be kept out of. A pair is watched if the arm in its ready pose
keeps the two apart: shapes that overlap at a joint are not obstacles to one another. Nor are shapes
of the arm that no pose brings together, as those of a wrist: they are near all the time.

| here     | meaning                                                            | unit | shape  |
|----------|--------------------------------------------------------------------|------|--------|
| ``table``| link that carries a shape (``STILL``, ``FLOOR``), start, end,      | m    | (m, 8) |
|          | radius, first those that stand still, then by link; of the floor   |      |        |
|          | the height stands in the place of the start's z                    |      |        |
| ``ends`` | both ends of every shape in the world                              | m    | (2m, 3)|
"""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from mitt.arm.arm import Arm
from mitt.arm.description import ArmModel, Capsule
from mitt.arm.dynamics import AXIS, JOINT, SLIDES, P
from mitt.arm.kinematics import (
    IDENTITY,
    ZERO,
    Vec,
    compose,
    dot,
    mat_at,
    minus,
    plus,
    put,
    rotate,
    row,
    times,
    turn,
    vec_at,
)
from mitt.errors import InputError
from mitt.fields import brief, check
from mitt.kernels import kernel
from mitt.signals import Array

#: What stands in the place of a link's index.
STILL, FLOOR = -1, -2
#: Gap in the ready pose above which a pair is watched [m].
_APART = 0.01
#: Gap in the ready pose below which it is tried whether any pose brings a pair together [m], and
#: most joints between two shapes for which that is tried.
_NEAR, _MOST_BETWEEN = 0.1, 2
#: Gap that two shapes keep in every pose if they never meet [m], and the most boxes of poses that
#: are looked at to find that out.
LEAST_GAP, MOST_BOXES = 0.012, 20000


@dataclass(frozen=True, slots=True, kw_only=True)
class Surroundings:
    """What stands around the arm.

    A part of the arm that is within 10 mm of the floor in the ready pose, as the foot of an arm
    that stands on it, is not kept from the floor.

    Attributes:
        floor: Height of the floor in the world frame [m].
        zones: Capsules in the world frame that no part of the arm may enter, as about the heads.
    """

    floor: float = -1.0
    zones: tuple[Capsule, ...] = ()

    __repr__ = brief

    def __post_init__(self) -> None:
        """Refuse what cannot be; InputError names the field."""
        check(self)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Shapes:
    """Shapes of an arm and of what stands around it, as arrays.

    Attributes:
        table: Shapes; see the module's table, shape (m, 8).
        pairs: Indices of shapes to be kept apart, shape (p, 2).
        reach: Farthest of any point from each active joint [m], shape (n,); 1 where it slides.
    """

    table: Array
    pairs: NDArray[np.int64]
    reach: Array

    __repr__ = brief

    @property
    def ends(self) -> Array:
        """Scratch for the ends of the shapes in the world, shape (2 m, 3)."""
        return np.zeros((2 * len(self.table), 3))


def shapes_of(arm: Arm, around: Surroundings) -> Shapes:
    """Return the shapes of an arm with its hand and of what stands around it.

    Raises:
        InputError: The arm is in a zone, or within 10 mm of one, in the ready pose; or the floor is
            above what the arm stands on.
    """
    check_floor(arm.model, around.floor)
    still = [_row(STILL, x, arm.model.mount) for x in arm.model.base_capsules]
    still += [_row(STILL, x, np.eye(4)) for x in around.zones]
    floor = np.array([FLOOR, 0.0, 0.0, around.floor, 0.0, 0.0, 0.0, 0.0])
    table = np.array([floor, *still, *_moving(arm.model)])
    ends = np.zeros((2 * len(table), 3))
    place_shapes(arm.bodies, arm.q_ready, table, ends)
    first_zone, zones = 1 + len(arm.model.base_capsules), len(around.zones)
    apart = []
    for a, b in combinations(range(len(table)), 2):
        if table[a, 0] != table[b, 0] and table[b, 0] >= 0:
            distance = gap(table, ends, a, b)
            if distance > _APART:
                apart.append((a, b))
            elif first_zone <= a < first_zone + zones:
                raise InputError(f"zone {a - first_zone}", f"{1e3 * _APART:.0f} mm or more from "
                                 "the arm in its ready pose", f"{1e3 * distance:.0f} mm",
                                 do="move the zone or the ready pose")  # fmt: skip
    near = [x for x in apart if gap(table, ends, *x) < _NEAR]
    never = _never_meeting(arm, table, near) if near else set()
    apart = [x for x in apart if x not in never]
    pairs = np.array(apart, dtype=np.int64).reshape(len(apart), 2)
    return Shapes(table=table, pairs=pairs, reach=_reach(arm, table))


def check_floor(model: ArmModel, floor: float) -> None:
    """Refuse a floor that the lowest end of the arm's base would be under as a whole."""
    ends = [x[2] + y.radius for y in model.base_capsules for x in (y.start, y.end)]
    foot = min((model.mount[2, 3] + top for top in ends), default=np.inf)
    if floor > foot:
        raise InputError("floor", f"at most {foot:.2f} m, where {model.name} stands", f"{floor:g}",
                         do="give its height in the frame of the arm's base")  # fmt: skip


def _never_meeting(arm: Arm, table: Array, near: list[tuple[int, int]]) -> set[tuple[int, int]]:
    """Return the pairs of the arm's own shapes that the one or two joints between never join."""
    never = set()
    for a, b in near:
        first, last = (int(table[x, 0]) for x in (a, b))
        between = [j for j, link in enumerate(arm.model.active) if first < link <= last]
        around = first < 0 and not 1 <= a <= len(arm.model.base_capsules)
        if not around and len(between) <= _MOST_BETWEEN and _stay_apart(arm, table, a, b, between):
            never.add((a, b))
    return never


def _stay_apart(arm: Arm, table: Array, a: int, b: int, between: list[int]) -> bool:
    """Say whether it is certain that no pose brings two shapes nearer than ``LEAST_GAP``."""
    both, boxes = table[[a, b]], np.zeros((MOST_BOXES + 2, 2, len(between)))
    boxes[0, 0] = 0.5 * (arm.q_min + arm.q_max)[between]
    boxes[0, 1] = arm.q_max[between] - boxes[0, 0]
    slopes = np.array([_slope(arm, table, a, b, arm.model.active[j]) for j in between])
    joints, q = np.array(between, dtype=np.int64), arm.q_ready.copy()
    return bool(all_apart(arm.bodies, both, joints, slopes, boxes, q, np.zeros((4, 3))))


def _slope(arm: Arm, table: Array, a: int, b: int, k: int) -> float:
    """Return how fast link ``k``'s joint may change the gap of two shapes [m/rad]; 1 if it slides.

    The farthest of the points of either shape from the joint: what turns against what is the same.
    The radii do not count, as the gap is that of the segments less the radii.
    """
    links, (first, last) = arm.model.links, (int(table[x, 0]) for x in (a, b))
    if links[k].prismatic:
        return 1.0
    far = [max(np.linalg.norm(table[x, 1:4]), np.linalg.norm(table[x, 4:7])) for x in (a, b)]
    if first < 0:  # in the world, where the first link is placed on the mount
        far[0] += np.linalg.norm(arm.model.mount[:3, 3])
    for side, way in enumerate((range(first + 1, k + 1), range(k + 1, last + 1))):
        for i in way:
            slide = max(abs(links[i].q_min), abs(links[i].q_max)) if links[i].prismatic else 0.0
            far[side] += np.linalg.norm(links[i].placement[:3, 3]) + slide
    return float(min(far))


def _moving(model: ArmModel) -> Iterator[Array]:
    """Yield the rows of the shapes of links and hand."""
    for k, link in enumerate(model.links):
        yield from (_row(k, x, np.eye(4)) for x in link.capsules)
    if model.hand is not None:
        last = len(model.links) - 1
        yield from (_row(last, x, model.tool) for x in model.hand.capsules())


def _row(carrier: int, capsule: Capsule, T: Array) -> Array:
    """Return a capsule as a row, moved by a transform."""
    start, end = (T[:3, :3] @ np.array(x) + T[:3, 3] for x in (capsule.start, capsule.end))
    return np.array([carrier, *start, *end, capsule.radius])


def _reach(arm: Arm, table: Array) -> Array:
    """Return a bound on the distance of any moving point from each active joint, shape (n,)."""
    links, out, beyond = arm.model.links, np.ones(arm.n), 0.0
    for k in range(len(links) - 1, -1, -1):
        own = table[table[:, 0] == k]
        far = [max(np.linalg.norm(x[1:4]), np.linalg.norm(x[4:7])) + x[7] for x in own]
        beyond = max([beyond, *far])
        if links[k].prismatic:
            beyond += max(abs(links[k].q_min), abs(links[k].q_max))
        elif links[k].held is None:
            out[arm.model.active.index(k)] = beyond
        beyond += float(np.linalg.norm(links[k].placement[:3, 3]))
    return out


@kernel
def place_shapes(bodies: Array, q: Array, table: Array, ends: Array) -> None:
    """Write where both ends of every shape are in the world.

    Args:
        bodies: Table of :mod:`mitt.arm.dynamics`, shape (N, 31).
        q: Active joint positions [rad], shape (n,).
        table: Shapes, those that stand still first, then by link, shape (m, 8).
        ends: Result [m], shape (2 m, 3).
    """
    R, p, at = IDENTITY, ZERO, 0
    for link in range(-1, len(bodies)):
        if link >= 0:
            axis, j = vec_at(bodies, link, AXIS), int(bodies[link, JOINT])
            p = plus(p, rotate(R, vec_at(bodies, link, P)))
            R = compose(R, mat_at(bodies, link, 0))
            if j >= 0 and bodies[link, SLIDES] > 0.0:
                p = plus(p, rotate(R, times(q[j], axis)))
            elif j >= 0:
                R = compose(R, turn(axis, q[j]))
        while at < len(table) and table[at, 0] <= link:
            put(ends, 2 * at, plus(p, rotate(R, vec_at(table, at, 1))))
            put(ends, 2 * at + 1, plus(p, rotate(R, vec_at(table, at, 4))))
            at += 1


@kernel
def gap(table: Array, ends: Array, a: int, b: int) -> float:
    """Return the gap between two placed shapes [m]; negative where they overlap.

    Args:
        table: Shapes, shape (m, 8).
        ends: Where they are, shape (2 m, 3).
        a: Index of one shape, which may be the floor.
        b: Index of another one, which is a capsule.
    """
    if table[a, 0] == FLOOR:
        lowest = min(ends[2 * b, 2], ends[2 * b + 1, 2])
        return float(lowest - table[b, 7] - table[a, 3])
    apart = segment_distance(
        row(ends, 2 * a), row(ends, 2 * a + 1), row(ends, 2 * b), row(ends, 2 * b + 1)
    )
    return float(apart - table[a, 7] - table[b, 7])


@kernel
def all_apart(
    bodies: Array, table: Array, joints: NDArray[np.int64], slopes: Array, boxes: Array,
    q: Array, ends: Array,
) -> bool:  # fmt: skip
    """Say whether no pose of a box brings two shapes nearer than ``LEAST_GAP``.

    A box of poses in which the gap in the middle, less what it may change by up to the corners, is
    larger holds no such pose; any other is cut in two (branch and bound, Lipschitz: Piyavskii
    1972). What is not settled after ``MOST_BOXES`` boxes counts as meeting.

    Args:
        bodies: Table of :mod:`mitt.arm.dynamics`, shape (N, 31).
        table: The two shapes, shape (2, 8).
        joints: Active joints that move, shape (k,).
        slopes: How fast each of them may change the gap [m/rad], shape (k,).
        boxes: Middle and half width [rad]; the first is the box, shape (MOST_BOXES + 2, 2, k).
        q: A pose, overwritten [rad], shape (n,).
        ends: Scratch, shape (4, 3).
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
    bodies: Array, q: Array, table: Array, pairs: NDArray[np.int64], ends: Array
) -> float:
    """Return the smallest gap of any watched pair [m]; infinite if none is watched.

    Args:
        bodies: Table of :mod:`mitt.arm.dynamics`, shape (N, 31).
        q: Active joint positions [rad], shape (n,).
        table: ``Shapes.table``.
        pairs: ``Shapes.pairs``.
        ends: Scratch, shape (2 m, 3).
    """
    place_shapes(bodies, q, table, ends)
    nearest = np.inf
    for k in range(len(pairs)):
        nearest = min(nearest, gap(table, ends, pairs[k, 0], pairs[k, 1]))
    return float(nearest)


@kernel
def nearest_shares(a: Vec, b: Vec, c: Vec, d: Vec) -> tuple[float, float]:
    """Return the shares of the ways a-b and c-d at which their nearest points lie, 0 to 1.

    Ericson, Real-Time Collision Detection (2004), section 5.1.9.
    """
    u, v, w = minus(b, a), minus(d, c), minus(a, c)
    uu, vv, uv, uw, vw = dot(u, u), dot(v, v), dot(u, v), dot(u, w), dot(v, w)
    s, t = 0.0, 0.0
    if uu <= 1e-18 and vv <= 1e-18:
        return s, t
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
    return s, t


@kernel
def segment_distance(a: Vec, b: Vec, c: Vec, d: Vec) -> float:
    """Return the distance of the segments a-b and c-d [m]."""
    s, t = nearest_shares(a, b, c, d)
    apart = minus(plus(minus(a, c), times(s, minus(b, a))), times(t, minus(d, c)))
    return float(np.sqrt(dot(apart, apart)))
