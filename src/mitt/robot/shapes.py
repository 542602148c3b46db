"""What the arm is made of, for telling how far it is from itself and from what stands around it.

Every shape is a capsule, but for the floor. Moving ones hang on a link; those that stand still are
the arm's base and the zones to be kept out of. A pair is watched if the arm in its ready pose
keeps the two apart: shapes that overlap at a joint are not obstacles to one another. Nor are shapes
of the arm that no pose brings together, as those of a wrist: they are near all the time.

Shapes, one a row: link that carries it (``STILL``, ``FLOOR``), start, end [m], radius [m]; of the
floor the height stands in the place of the start's z.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from mitt import fields
from mitt.errors import InputError
from mitt.fields import brief
from mitt.robot.arm import Arm
from mitt.robot.description import ArmModel, Capsule
from mitt.robot.gaps import FLOOR, MOST_BOXES, STILL, all_apart, gap, place
from mitt.robot.hand_shapes import hand_capsules
from mitt.signals import Array

#: Gap in the ready pose above which a pair is watched [m].
_APART = 0.01
#: Gap in the ready pose below which it is tried whether any pose brings a pair together [m], and
#: most joints between two shapes for which that is tried.
_NEAR, _MOST_BETWEEN = 0.1, 2


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
        fields.check(self)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Shapes:
    """Shapes of an arm and of what stands around it, as arrays.

    Attributes:
        table: As of the module's text, shape (m, 8).
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
        return _ends(self.table)


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
    ends = _ends(table)
    place(arm.bodies, arm.q_ready, table, ends)
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
    return bool(all_apart(arm.bodies, both, joints, slopes, boxes, q, _ends(both)))


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


def _ends(table: Array) -> Array:
    """Return scratch for the ends of shapes in the world, shape (2 m, 3)."""
    return np.zeros((2 * len(table), 3))


def _moving(model: ArmModel) -> Iterator[Array]:
    """Yield the rows of the shapes of links and hand."""
    for k, link in enumerate(model.links):
        yield from (_row(k, x, np.eye(4)) for x in link.capsules)
    if model.hand is not None:
        last = len(model.links) - 1
        yield from (_row(last, x, model.tool) for x in hand_capsules(model.hand))


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
