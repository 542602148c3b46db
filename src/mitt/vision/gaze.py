"""The gaze law: each head keeps the ball in the middle of its image.

While the filter follows the ball, a head looks where the ball will be at the next exposure, and
turns as fast as it will pass. Where an image contradicts the filter, as after a bounce, its head
follows the image: the ball's direction and rate by an alpha-beta filter (Benedict and Bordner
1962). A head that sees nothing then looks where the line of sight of the other is at the ball's
distance, or before there is a track at the distance at which balls come into sight.

Where exposures show no ball any more, it may have bounced, at any height: nobody knows of a table.
Both heads look at what that makes of its way (``_search``). Before any ball is seen, and long
after the last, they nod and sway over where throws come from.

| here       | meaning                                                    | unit       | shape     |
|------------|------------------------------------------------------------|------------|-----------|
| ``gaze``   | the ball's pan, tilt and their rates as each head sees it, | rad, rad/s | (n, GAZE) |
|            | sightings in this row, time of the last; of the last       | 1, s; s    |           |
|            | exposure, and how far that of a sighting lies behind       | s          |           |
| ``desired``| pan, tilt and their rates                                  | rad, rad/s | (n, 4)    |
"""

from math import cos, pi, sin, sqrt

import numpy as np

from mitt.ball.flight import change_by_bounce
from mitt.jit import kernel
from mitt.signals import Array
from mitt.vision.head import aim_one, bearing
from mitt.vision.localization import LARGE
from mitt.vision.target import EXPECTED, GAIN, GOOD, STATE, WEIGHED, WEIGHTS

SHOWN, LAG = 6, 7
GAZE = 8
"""Numbers that the gaze law remembers of a head; the last two are in the first row, for all."""

ALPHA, BETA = 0.5, 0.15
FRESH, STALE = 0.006, 0.03
"""Ages up to which an image contradicts the filter, beyond how old the newest always are, and up to
which it leads a head while there is no track [s]."""
LET_GO = 0.15
"""Time without a sighting after which the heads no longer follow the filter [s]."""
DOUBT = 0.04
"""Angle between image and filter above which a head follows its image [rad]."""
NOD, SWAY, BREADTH = 0.052, 0.069, 1.375
"""Periods in which a waiting head nods and sways [s]; how far it sways, over the pan at which
it waits: two heads that wait on either side look outwards and inwards together."""
BORDER = 6.0
"""What is left between a ball and the border of its image [px]: it moves on before the next."""
SWEEP = 0.06
"""Period of a search that does not fit into the image [s]: heads at 9 rad/s can follow 0.17 rad."""


@kernel
def _is_ball(memory: Array) -> bool:
    """Return whether a camera follows what may be the ball: no more than twice as heavy as it."""
    ball = memory[GAIN] * memory[EXPECTED]
    light = memory[WEIGHED] == 0.0 or ball == 0.0 or memory[WEIGHTS] < LARGE * ball
    return bool(light and memory[STATE] == GOOD)


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
def _along(head: Array, track: Array, t: float, far: float, camera: Array, point: Array) -> None:
    """Write the point that a head's line of sight reaches at a distance at ``t``."""
    later = t - track[5]
    aim_one(head, track[0] + later * track[2], track[1] + later * track[3], camera)
    for i in range(3):
        point[i] = camera[3, i] + far * camera[i, 2]


@kernel
def _distance(head: Array, r: Array) -> float:
    """Return how far a point is from a head [m]."""
    x, y, z = r[0] - head[9], r[1] - head[10], r[2] - head[11]
    return float(sqrt(x * x + y * y + z * z))


@kernel
def _from_others(
    heads: Array, gaze: Array, n: int, t: float, oldest: float, known: bool, r: Array, work: Array,
    desired: Array,
) -> bool:  # fmt: skip
    """Write where head ``n`` looks to meet the line of sight of another; False if none sees.

    Args:
        heads: As for :func:`lead`.
        gaze: As for :func:`lead`.
        n: The head.
        t: As for :func:`lead`.
        oldest: Greatest age of what the other sees [s].
        known: Whether they meet as far off as ``r``; else as far as balls come into sight.
        r: About where the ball is [m], shape (3,).
        work: Scratch, shape (7, 3).
        desired: Result, shape (4,).
    """
    now, rate, h = work[5], work[6], 1e-3
    for m in range(heads.shape[0]):
        if m == n or gaze[m, 4] < 1.0 or t - gaze[m, 5] > oldest:
            continue
        far = _distance(heads[m], r) if known else heads[m, 20]
        _along(heads[m], gaze[m], t, far, work[:5], now)
        _along(heads[m], gaze[m], t + h, far, work[:5], rate)
        for i in range(3):
            rate[i] = (rate[i] - now[i]) / h
        bearing(heads[n], now, rate, desired)
        return True
    return False


@kernel
def _search(
    head: Array, motion: Array, silence: float, area: float, change: Array, sought: Array
) -> None:
    """Write where a ball that is not seen any more is looked for.

    If it bounced a time T ago, it is off its flight by what the bounce changed of its velocity,
    times T; and T is anything from 0 to the silence. From a head that is a line. All of it is held
    in the image as long as it fits; then the gaze goes to and fro along it, from its far end on: a
    ball is most likely lost as it bounces. A ball that rises does not bounce.

    Args:
        head: That the size of the line is seen from.
        motion: As for :func:`lead`.
        silence: Time for which the ball was not seen though it should have been [s].
        area: Of its image [px^2].
        change: Scratch, shape (3,).
        sought: Result: position [m] and velocity [m/s], shape (2, 3).
    """
    for i in range(3):
        sought[0, i], sought[1, i] = motion[0, i], motion[1, i]
    if not (silence > 0.0 and change_by_bounce(motion[1], silence, change)):
        return
    speed = sqrt(change[0] ** 2 + change[1] ** 2 + change[2] ** 2)
    held = max(min(head[16], head[17]) - BORDER - sqrt(area / pi), 0.0) / head[15]
    fits = 2.0 * held * _distance(head, motion[0]) / speed
    share, drift, swept = 0.5 * silence, 0.5, silence - fits
    if swept > 0.0:
        phase = 2.0 * pi * swept / SWEEP
        share += 0.5 * swept * cos(phase)
        drift += 0.5 * cos(phase) - pi * swept / SWEEP * sin(phase)
    for i in range(3):
        sought[0, i] += share * change[i]
        sought[1, i] += drift * change[i]


@kernel
def _look_at(
    heads: Array, gaze: Array, n: int, sought: Array, silent: bool, t: float, work: Array,
    goal: Array,
) -> None:  # fmt: skip
    """Write where head ``n`` looks for a ball that is followed.

    Its own image knows better where it contradicts the filter, and any image where that is silent.
    """
    track = gaze[n]
    later = t - track[5]
    bearing(heads[n], sought[0], sought[1], goal)
    oldest = gaze[0, LAG] + FRESH
    if track[4] >= 1.0 and later < oldest:
        u, v = track[0] + later * track[2], track[1] + later * track[3]
        if silent or max(abs(goal[0] - u), abs(goal[1] - v)) > DOUBT:
            goal[0], goal[1], goal[2], goal[3] = u, v, track[2], track[3]
    elif silent:
        _from_others(heads, gaze, n, t, oldest, True, sought[0], work, goal)


@kernel
def _wait(heads: Array, gaze: Array, n: int, t: float, work: Array, goal: Array) -> None:
    """Write where head ``n`` looks while no ball is followed: at what it sees, or for a throw."""
    head, track = heads[n], gaze[n]
    later = t - track[5]
    if track[4] >= 1.0 and later < STALE:
        goal[0], goal[1] = track[0] + later * track[2], track[1] + later * track[3]
        goal[2], goal[3] = track[2], track[3]
    elif not _from_others(heads, gaze, n, t, STALE, False, head[9:12], work, goal):
        nod, sway, breadth = 2.0 * pi / NOD, 2.0 * pi / SWAY, BREADTH * head[21]
        goal[0], goal[2] = head[21] + breadth * sin(sway * t), breadth * sway * cos(sway * t)
        goal[1] = head[22] + head[23] * sin(nod * t)
        goal[3] = head[23] * nod * cos(nod * t)


@kernel
def lead(
    heads: Array, cameras: Array, memory: Array, gaze: Array, motion: Array, t_seen: float,
    te: float, t: float, work: Array, desired: Array,
) -> None:  # fmt: skip
    """Write where the heads are to look.

    Args:
        heads: As in :mod:`mitt.vision.head`.
        cameras: As they stood at the exposure.
        memory: Of the eyes, after ``localize``; its last row is the rig's.
        gaze: As in the module's table, overwritten, shape (n, GAZE + 4).
        motion: Position [m] and velocity [m/s] of the ball at ``t``, rows 0 and 1.
        t_seen: When the ball was last seen that ``motion`` is known of [s]; -infinity: unknown.
        te: Time of the newest exposure [s].
        t: Time at which the heads are to be there [s].
        work: Scratch, shape (9, 3).
        desired: Result.
    """
    count, rig, sought, silence = heads.shape[0], memory[heads.shape[0]], work[7:], 0.0
    for n in range(count):
        if te == gaze[n, 5] or not _is_ball(memory[n]):
            continue
        away = heads[n, 20]
        if rig[3] > 0.0:
            away = sqrt(
                (rig[0] - cameras[n, 3, 0]) ** 2
                + (rig[1] - cameras[n, 3, 1]) ** 2
                + (rig[2] - cameras[n, 3, 2]) ** 2
            )
        _observe(heads[n], cameras[n], memory[n], gaze[n], te, away, work[5:])
    follows = t - t_seen < LET_GO
    if follows:
        if te != gaze[0, SHOWN] and t_seen == te:
            gaze[0, LAG] = t - te
        gaze[0, SHOWN] = te
        silence = t - t_seen - gaze[0, LAG]
        _search(heads[0], motion, silence, memory[0, EXPECTED], work[0], sought)
    for n in range(count):
        if follows:
            _look_at(heads, gaze, n, sought, silence > FRESH, t, work, desired[n])
        else:
            _wait(heads, gaze, n, t, work, desired[n])


def empty_gaze(n: int) -> Array:
    """Return what the gaze law remembers before it has seen anything, shape (n, GAZE + 4)."""
    gaze = np.zeros((n, GAZE + 4))
    gaze[:, 5] = -np.inf
    return gaze
