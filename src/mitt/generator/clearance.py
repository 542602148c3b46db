"""The arm's clearance of itself, of the floor and of zones, as rows of a programme; compiled.

A gap that is small at an instant of the course gets a row: its slope is the way, along the line
between the two nearest points, by which a joint carries one of them away from the other. At an
instant that was found clear no point has come closer than the joints' reach times their way since
then: as long as that is enough it is not looked again, and the answer is the same.

| here       | meaning                                                          | unit | shape |
|------------|------------------------------------------------------------------|------|-------|
| ``table``  | shapes, as of :mod:`mitt.robot.shapes`                           |      | (m, 8)|
| ``pairs``  | those to be kept apart                                           |      | (p, 2)|
| ``reach``  | farthest of any point from each joint                            | m    | (n,)  |
| ``seen``   | at each instant the pose last looked at, and its smallest gap    |      | (K, .)|
| ``excess`` | by how much a gap is below what is kept, over ``_SCALE``         | 1    |       |
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mitt.generator.horizon import INSTANTS, Course
from mitt.generator.qp import Programme, spread
from mitt.generator.tangent import Scratch, Tangent
from mitt.generator.utilization import Plant, Work, positions_at
from mitt.jit import kernel
from mitt.robot import kinematics
from mitt.robot.arm import Arm
from mitt.robot.kinematics import Vec, cross, dot, minus, plus, row, times
from mitt.robot.shapes import FLOOR, Surroundings, clearance, gap, nearest_shares, shapes_of
from mitt.signals import Array

#: Gap missing that weighs as much as a limit exceeded by all of it [m], and gap beyond what is
#: kept from which a row begins to count [m].
_SCALE, _NEAR = 0.05, 0.05


class Space(NamedTuple):
    """What is to be kept apart, and where its shapes are; see the module's table."""

    table: Array
    ends: Array  # (2 m, 3) of the shapes in the world [m]
    reach: Array
    seen: Array
    pairs: NDArray[np.int64]


def space_of(arm: Arm, around: Surroundings) -> Space:
    """Return the shapes of an arm and of what stands around it, with buffers."""
    shapes, seen = shapes_of(arm, around), np.full((INSTANTS, arm.n + 1), -np.inf)
    return Space(shapes.table, shapes.ends, shapes.reach, seen, shapes.pairs)


@kernel
def keep_clear(
    p: Plant, g: Tangent, space: Space, least: float, c: Course, alpha: Array, out: Programme,
    w: Work, s: Scratch, at: int,
) -> tuple[int, float]:  # fmt: skip
    """Write the rows of small gaps after the first ``at`` rows, where ``at`` is not negative.

    Args:
        p: The arm.
        g: Its tangent map, for the axes of the joints.
        space: What is to be kept apart.
        least: Gap that is kept [m].
        c: The course.
        alpha: Coefficients [rad], shape (m, n).
        out: Result.
        w: Buffers.
        s: Buffers of the tangent map.
        at: How many rows there are; negative to write none.

    Returns:
        How many rows there are now, and the sum of the squared excesses.
    """
    total, enough = 0.0, least + (_NEAR if at >= 0 else 0.0)
    for k in range(len(c.after)):
        positions_at(c, k, alpha, w.motion[0])
        if _far(space, k, w.motion[0], enough):
            continue
        _look(p, space, k, w.motion[0])
        if space.seen[k, -1] > enough:
            continue
        kinematics.place(g.chain, w.motion[0], s.motion)
        for x in range(len(space.pairs)):
            a, b = space.pairs[x, 0], space.pairs[x, 1]
            room = (gap(space.table, space.ends, a, b) - least) / _SCALE
            total += max(-room, 0.0) ** 2
            if at >= 0 and room < _NEAR / _SCALE:
                gap_slope(p, g, space, a, b, s, w.drive)
                spread(c.phi, k, w.drive, out.A, at)
                out.room[at] = room
                at += 1
    return at, total


@kernel
def _far(space: Space, k: int, q: Array, enough: float) -> bool:
    """Say whether a gap must be larger than enough [m], by what was seen at instant k."""
    room = space.seen[k, -1]
    for j in range(len(q)):
        room -= space.reach[j] * abs(q[j] - space.seen[k, j])
    return bool(room > enough)


@kernel
def _look(p: Plant, space: Space, k: int, q: Array) -> None:
    """Place the shapes, and note pose and smallest gap as what was seen at instant k."""
    space.seen[k, -1] = clearance(p.bodies, q, space.table, space.pairs, space.ends)
    for j in range(len(q)):
        space.seen[k, j] = q[j]


@kernel
def gap_slope(p: Plant, g: Tangent, space: Space, a: int, b: int, s: Scratch, out: Array) -> None:
    """Write how fast the gap of two placed shapes shrinks with q, over ``_SCALE``, shape (3, n).

    Where two axes meet no direction leads apart: the slope is 0 there.
    """
    one, other = _nearest(space, a, b)
    apart = minus(other, one)
    size = np.sqrt(dot(apart, apart))
    toward = times(1.0 / (_SCALE * size), apart) if size > 1e-9 else times(0.0, apart)
    out[:] = 0.0
    for j in range(out.shape[1]):
        axis, origin = row(s.motion.line[0], j), row(s.motion.origin[0], j)
        for shape, point, sign in ((a, one, 1.0), (b, other, -1.0)):
            if space.table[shape, 0] >= p.joints[j]:
                slides = g.chain.prismatic[j] > 0.0
                moved = axis if slides else cross(axis, minus(point, origin))
                out[0, j] += sign * dot(toward, moved)


@kernel
def _nearest(space: Space, a: int, b: int) -> tuple[Vec, Vec]:
    """Return the nearest points of two shapes' axes [m]; of the floor, the one below."""
    c, d = row(space.ends, 2 * b), row(space.ends, 2 * b + 1)
    if space.table[a, 0] == FLOOR:
        low = c if c[2] < d[2] else d
        return (low[0], low[1], space.table[a, 3]), low
    e, f = row(space.ends, 2 * a), row(space.ends, 2 * a + 1)
    x, y = nearest_shares(e, f, c, d)
    return plus(e, times(x, minus(f, e))), plus(c, times(y, minus(d, c)))
