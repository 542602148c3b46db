"""How a part that was met is put down: on a tray beside the station, or at a place of a cell.

The tray's place is that of the station, turned about the arm's first axis, or below that: the pose
in which its inverse starts is the one in which the arm waits for parts, turned by the same angle.
The tool points down there, so that the part lies flat.
"""

from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from mitt.core.arm.arm import Arm, tool_speeds
from mitt.core.arm.description import rotation
from mitt.core.errors import InputError
from mitt.core.map.meeting import MeetingMap
from mitt.core.signals import Array
from mitt.lab.trials.slow_motion import slow_motion
from mitt.lab.trials.station import Station
from mitt.lab.world.scene import Scene, Tray

#: Angles about the first axis and heights of the tray below the station's place that are tried
#: [rad, m], and the tray's least distance from the middle of a belt, beyond half its width [m].
_ANGLES = (1.57, -1.57, 1.2, -1.2, 2.0, -2.0, 2.6, -2.6)
_LOWER = (0.0, 0.15, 0.3)
_BESIDE = 0.17
#: How far above its place a part comes down from, and is let go over a tray [m].
_ABOVE = 0.1
_DROP = 0.003
#: How far back the tool goes along its axis from where it has met a part [m].
_BACK = 0.1
#: Share of the joints' speeds with which a part is carried.
_SHARE = 0.4
#: Steps in which the tool is tilted and brought above a place, in turn: the pose in which it waits
#: may be where it cannot point down.
_TILTS = (1, 8)
#: Most slow motions that are tried until the tool is slow enough.
_TRIES = 4


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Placing:
    """Where a part is put.

    Attributes:
        tray: The tray.
        place: Where the part's middle is when it lies there [m], shape (3,).
        over: Pose above the tray [rad], shape (n,).
        down: Pose in which the part is let go [rad], shape (n,).
    """

    tray: Tray
    place: Array
    over: Array
    down: Array


def placing_of(s: Station) -> Placing | None:
    """Return where a station puts its parts; None where no place is clear of its belt."""
    arm = s.arm
    for lower, angle in product(_LOWER, _ANGLES):
        turned = rotation(np.array([0.0, 0.0, 1.0]), angle)
        over, place = _turned_by(arm, turned, angle), turned @ s.place - [0.0, 0.0, lower]
        room = 0.02 * (arm.q_max[0] - arm.q_min[0])
        if over is None or _crosses(s.scene, place):
            continue
        if not arm.q_min[0] + room < over[0] < arm.q_max[0] - room:
            continue
        poses = poses_at(s.map, angle, place, over, drop=_DROP)
        if poses is not None:
            sides = s.scene.ball.sides
            low = float(place[2]) - (s.scene.ball.radius if sides is None else 0.5 * sides[2])
            tray = Tray(middle=(float(place[0]), float(place[1])), height=low)
            return Placing(tray=tray, place=place, over=poses[0], down=poses[1])
    return None


def _turned_by(arm: Arm, turned: Array, angle: float) -> Array | None:
    """Return the ready pose turned about a vertical first axis; None where it is another."""
    for sign in (1.0, -1.0):
        q = arm.q_ready.copy()
        q[0] += sign * angle
        if np.allclose(arm.position(q), turned @ arm.position(arm.q_ready), atol=1e-6):
            return q
    return None


def poses_at(
    f: MeetingMap, angle: float, place: Array, start: Array, *, drop: float = 0.0
) -> tuple[Array, Array] | None:
    """Return the poses above a place and at it, the tool pointing down; None where there are none.

    Args:
        f: The meeting map.
        angle: By which the tool is turned about the vertical [rad].
        place: Where the middle of a part is put [m], shape (3,).
        start: Pose in which the inverse starts [rad], shape (n,).
        drop: How far above the place the part is let go [m].
    """
    x, down = f.frame[:, 0] * [1.0, 1.0, 0.0], np.array([0.0, 0.0, -1.0])
    x = x / np.linalg.norm(x)
    frame = np.column_stack([x, np.cross(down, x), down])
    turned = rotation(np.array([0.0, 0.0, 1.0]), angle)
    g, over = replace(f, frame=turned @ frame), place + np.array([0.0, 0.0, _ABOVE])
    for steps in _TILTS:
        q = _tilted(g, turned @ f.frame[:, 2], over, start, steps)
        end = None if q is None else _brought(g, place + np.array([0.0, 0.0, drop]), q)
        if q is not None and end is not None:
            both = np.array([q, end])
            if np.all((both > f.arm.q_min) & (both < f.arm.q_max)):
                return q, end
    return None


def _tilted(f: MeetingMap, z: Array, place: Array, start: Array, steps: int) -> Array | None:
    """Return the pose that brings the tool to a place; None where there is none.

    In so many steps, in which the tool's axis turns from ``z`` in the start to that of the map.
    """
    at, axis, q = f.arm.position(start), np.cross(z, f.frame[:, 2]), start
    length = float(np.linalg.norm(axis))
    tilt, axis = np.arctan2(length, z @ f.frame[:, 2]), axis / max(length, 1e-12)
    for left in (1.0 - np.arange(1, steps + 1) / steps).tolist():
        g = replace(f, frame=rotation(axis, -left * tilt) @ f.frame)
        found = _brought(g, place + left * (at - place), q)
        if found is None:
            return None
        q = found
    return q


def backed(f: MeetingMap, q: Array) -> Array:
    """Return the pose from which the tool has gone back along its axis; q itself if there is none.

    q is the pose in which a part was met [rad], shape (n,).
    """
    back = _brought(f, f.arm.position(q) - _BACK * f.frame[:, 2], q)
    return q if back is None else back


def _brought(f: MeetingMap, place: Array, start: Array) -> Array | None:
    """Return the pose that brings the tool to a place, from a start; None where there is none."""
    inside, rows = f.virtual(np.array([place, np.zeros(3), np.zeros(3)]), start)
    return rows[0].copy() if inside else None


def _crosses(scene: Scene, place: Array) -> bool:
    """Say whether a tray about a place would be on the scene's belt, or too near to it."""
    belt = scene.belt
    if belt is None:
        return False
    across = np.array([-belt.along[1], belt.along[0]])
    return abs(float(across @ (place[:2] - belt.middle))) < 0.5 * belt.width + _BESIDE


def carried(arm: Arm, start: Array, end: Array, speed: float, share: float = _SHARE) -> Array:
    """Return a motion from rest to rest whose tool is no faster than ``speed`` [m/s].

    q, dq, ddq each tick, shape (k, 3, n). ``share`` of the joints' speeds is used at most.

    Raises:
        InputError: There is none.
    """
    for _ in range(_TRIES):
        rows = slow_motion(arm, start, end, share)
        fastest = float(tool_speeds(arm, rows[::10]).max())
        if fastest <= speed:
            return rows
        share *= 0.95 * speed / fastest
    raise InputError("a motion with the part", f"a tool of at most {speed:g} m/s", "a faster one")
