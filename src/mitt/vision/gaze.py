"""The gaze law: each head keeps the ball in the middle of its image.

While the filter follows the ball, a head looks where the ball will be at the next exposure, and
turns as fast as it will pass. Before that, and where its own image contradicts the filter, it
follows its own image: the ball's direction and rate by an alpha-beta filter (Benedict and Bordner
1962). A head that sees nothing looks where the line of sight of the other is at the distance at
which balls come into sight; when none sees a ball they nod and sway over where throws come from.

| here       | meaning                                                    | unit       | shape     |
|------------|------------------------------------------------------------|------------|-----------|
| ``gaze``   | the ball's pan, tilt and their rates as each head sees it, | rad, rad/s | (n, GAZE) |
|            | sightings in this row, time of the last                    | 1, s       |           |
| ``desired``| pan, tilt and their rates                                  | rad, rad/s | (n, 4)    |
"""

from math import cos, pi, sin, sqrt

import numpy as np

from mitt.jit import kernel
from mitt.signals import Array
from mitt.vision.head import aim_one, bearing
from mitt.vision.target import GOOD, STATE

GAZE = 6
"""Numbers that the gaze law remembers of a head."""

ALPHA, BETA = 0.5, 0.15
FRESH, STALE = 0.006, 0.03
"""Ages up to which an image contradicts the filter, and up to which it leads a head [s]."""
DOUBT = 0.04
"""Angle between image and filter above which a head follows its image [rad]."""
NOD, SWAY, BREADTH = 0.052, 0.069, 1.375
"""Periods in which a waiting head nods and sways [s]; how far it sways, over the pan at which
it waits: two heads that wait on either side look outwards and inwards together."""


@kernel
def _observe(
    head: Array, camera: Array, memory: Array, track: Array, te: float, away: float, work: Array
) -> None:
    """Update a head's row of ``gaze`` by the target's direction in its image.

    ``te`` is the time of the exposure [s], ``away`` the distance of the ball, or a guess [m].
    """
    x, y = (memory[0] - camera[4, 1]) / camera[4, 0], (memory[1] - camera[4, 2]) / camera[4, 0]
    far, seen = away / sqrt(x * x + y * y + 1.0), track[GAZE : GAZE + 4]
    for i in range(3):
        work[0, i] = camera[3, i] + far * (camera[i, 0] * x + camera[i, 1] * y + camera[i, 2])
        work[1, i] = 0.0
    bearing(head, work[0], work[1], seen)
    elapsed = te - track[5]
    if track[4] == 0.0 or not 0.0 < elapsed < STALE:
        track[0], track[1], track[2], track[3], track[4] = seen[0], seen[1], 0.0, 0.0, 1.0
    else:
        first = track[4] == 1.0
        for axis in range(2):
            error = seen[axis] - track[axis] - elapsed * track[axis + 2]
            track[axis] = seen[axis] if first else seen[axis] - (1.0 - ALPHA) * error
            track[axis + 2] += (1.0 if first else BETA) * error / elapsed
        track[4] += 1.0
    track[5] = te


@kernel
def _along(head: Array, track: Array, t: float, camera: Array, point: Array) -> None:
    """Write the point that a head's line of sight reaches at the expected range at ``t``."""
    later = t - track[5]
    aim_one(head, track[0] + later * track[2], track[1] + later * track[3], camera)
    for i in range(3):
        point[i] = camera[3, i] + head[20] * camera[i, 2]


@kernel
def _from_others(heads: Array, gaze: Array, n: int, t: float, work: Array, desired: Array) -> bool:
    """Write where head ``n`` looks to meet the line of sight of another; False if none sees."""
    now, rate, h = work[5], work[6], 1e-3
    for m in range(heads.shape[0]):
        if m == n or gaze[m, 4] < 1.0 or t - gaze[m, 5] > STALE:
            continue
        _along(heads[m], gaze[m], t, work[:5], now)
        _along(heads[m], gaze[m], t + h, work[:5], rate)
        for i in range(3):
            rate[i] = (rate[i] - now[i]) / h
        bearing(heads[n], now, rate, desired)
        return True
    return False


@kernel
def lead(
    heads: Array, cameras: Array, memory: Array, gaze: Array, motion: Array, tracked: bool,
    te: float, t: float, work: Array, desired: Array,
) -> None:  # fmt: skip
    """Write where the heads are to look.

    Args:
        heads: As in :mod:`mitt.vision.head`.
        cameras: As they stood at the exposure.
        memory: Of the eyes, after ``localize``; its last row is the rig's.
        gaze: As in the module's table, overwritten, shape (n, GAZE + 4).
        motion: Position [m] and velocity [m/s] of the ball at ``t``, rows 0 and 1.
        tracked: Whether ``motion`` is known.
        te: Time of the last exposure [s].
        t: Time at which the heads are to be there [s].
        work: Scratch, shape (7, 3).
        desired: Result.
    """
    count, rig = heads.shape[0], memory[heads.shape[0]]
    for n in range(count):
        if memory[n, STATE] != GOOD or te == gaze[n, 5]:
            continue
        away = heads[n, 20]
        if rig[3] > 0.0:
            c = cameras[n, 3]
            away = sqrt((rig[0] - c[0]) ** 2 + (rig[1] - c[1]) ** 2 + (rig[2] - c[2]) ** 2)
        _observe(heads[n], cameras[n], memory[n], gaze[n], te, away, work[5:])
    for n in range(count):
        head, track, goal = heads[n], gaze[n], desired[n]
        later = t - track[5]
        sees = track[4] >= 1.0
        if tracked:
            bearing(head, motion[0], motion[1], goal)
            off = max(abs(goal[0] - track[0] - later * track[2]),
                      abs(goal[1] - track[1] - later * track[3]))  # fmt: skip
            if not (sees and later < FRESH and off > DOUBT):
                continue
        if sees and later < STALE:
            goal[0], goal[1] = track[0] + later * track[2], track[1] + later * track[3]
            goal[2], goal[3] = track[2], track[3]
        elif not _from_others(heads, gaze, n, t, work, goal):
            nod, sway, breadth = 2.0 * pi / NOD, 2.0 * pi / SWAY, BREADTH * head[21]
            goal[0], goal[2] = head[21] + breadth * sin(sway * t), breadth * sway * cos(sway * t)
            goal[1] = head[22] + head[23] * sin(nod * t)
            goal[3] = head[23] * nod * cos(nod * t)


def empty_gaze(n: int) -> Array:
    """Return what the gaze law remembers before it has seen anything, shape (n, GAZE + 4)."""
    gaze = np.zeros((n, GAZE + 4))
    gaze[:, 5] = -np.inf
    return gaze
