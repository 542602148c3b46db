"""Where the shapes of an arm are in a pose, and how far they are from one another, as kernels.

| here     | meaning                                                            | unit | shape  |
|----------|--------------------------------------------------------------------|------|--------|
| ``table``| shapes, as of :mod:`mitt.robot.shapes`: those that stand still,    | m    | (m, 8) |
|          | then by link                                                       |      |        |
| ``ends`` | both ends of every shape in the world                              | m    | (2m, 3)|
"""

import numpy as np
from numpy.typing import NDArray

from mitt.jit import kernel
from mitt.robot.segments import segment_distance
from mitt.robot.vectors import (
    IDENTITY,
    ZERO,
    compose,
    plus,
    put,
    rotate,
    row,
    times,
    turn,
)
from mitt.signals import Array

#: What stands in the place of a link's index.
STILL, FLOOR = -1, -2
#: Gap that two shapes keep in every pose if they never meet [m], and the most boxes of poses that
#: are looked at to find that out.
LEAST_GAP, MOST_BOXES = 0.012, 20000


@kernel
def place(bodies: Array, q: Array, table: Array, ends: Array) -> None:
    """Write where both ends of every shape are in the world.

    Args:
        bodies: Table of :mod:`mitt.robot.dynamics`, shape (N, 31).
        q: Active joint positions [rad], shape (n,).
        table: Shapes, those that stand still first, then by link, shape (m, 8).
        ends: Result [m], shape (2 m, 3).
    """
    R, p, at = IDENTITY, ZERO, 0
    for link in range(-1, len(bodies)):
        if link >= 0:
            axis, j = (bodies[link, 12], bodies[link, 13], bodies[link, 14]), int(bodies[link, 30])
            p = plus(p, rotate(R, (bodies[link, 9], bodies[link, 10], bodies[link, 11])))
            R = compose(R, (
                bodies[link, 0], bodies[link, 1], bodies[link, 2],
                bodies[link, 3], bodies[link, 4], bodies[link, 5],
                bodies[link, 6], bodies[link, 7], bodies[link, 8],
            ))  # fmt: skip
            if j >= 0 and bodies[link, 15] > 0.0:
                p = plus(p, rotate(R, times(q[j], axis)))
            elif j >= 0:
                R = compose(R, turn(axis, q[j]))
        while at < len(table) and table[at, 0] <= link:
            put(ends, 2 * at, plus(p, rotate(R, (table[at, 1], table[at, 2], table[at, 3]))))
            put(ends, 2 * at + 1, plus(p, rotate(R, (table[at, 4], table[at, 5], table[at, 6]))))
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
        bodies: Table of :mod:`mitt.robot.dynamics`, shape (N, 31).
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
        place(bodies, q, table, ends)
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
        bodies: Table of :mod:`mitt.robot.dynamics`, shape (N, 31).
        q: Active joint positions [rad], shape (n,).
        table: ``Shapes.table``.
        pairs: ``Shapes.pairs``.
        ends: Scratch, shape (2 m, 3).
    """
    place(bodies, q, table, ends)
    nearest = np.inf
    for k in range(len(pairs)):
        nearest = min(nearest, gap(table, ends, pairs[k, 0], pairs[k, 1]))
    return float(nearest)
