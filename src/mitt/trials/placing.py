"""Where a part that was met is put: on a tray beside the station.

The place is that of the station, turned about the arm's first axis: the pose that waits over it is
the one in which the arm waits for parts, turned by the same angle, and as clear of the arm itself.
The tool points down there, so that the part lies flat.
"""

from dataclasses import dataclass, replace

import numpy as np

from mitt.arm.arm import Arm
from mitt.arm.description import rotation
from mitt.control.slow_motion import slow_motion
from mitt.errors import InputError
from mitt.map.meeting import MeetingMap
from mitt.signals import Array
from mitt.trials.station import Station
from mitt.world.scene import Scene, Tray

#: Angles about the first axis that are tried [rad], and the tray's least distance from the middle
#: of a belt, beyond half its width [m].
_ANGLES = (1.57, -1.57, 1.2, -1.2, 2.0, -2.0, 2.6, -2.6)
_BESIDE = 0.17
#: How far above the tray a part comes down from, and is let go [m].
_ABOVE, _DROP = 0.1, 0.003
#: Share of the joints' speeds with which a part is carried.
_SHARE = 0.4
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
    arm, f = s.arm, s.map
    frame = pointing_down(f.frame)
    for angle in _ANGLES:
        turned = rotation(np.array([0.0, 0.0, 1.0]), angle)
        over, place = _turned_by(arm, turned, angle), turned @ s.place
        room = 0.02 * (arm.q_max[0] - arm.q_min[0])
        if over is None or _crosses(s.scene, place):
            continue
        if not arm.q_min[0] + room < over[0] < arm.q_max[0] - room:
            continue
        poses = [over]
        for above in (_ABOVE, _DROP):
            q = brought(f, turned @ frame, place + np.array([0.0, 0.0, above]), poses[-1])
            if q is None or np.any((q <= arm.q_min) | (q >= arm.q_max)):
                break
            poses.append(q)
        else:
            sides = s.scene.ball.sides
            low = float(place[2]) - (s.scene.ball.radius if sides is None else 0.5 * sides[2])
            tray = Tray(middle=(float(place[0]), float(place[1])), height=low)
            return Placing(tray=tray, place=place, over=poses[1], down=poses[2])
    return None


def _turned_by(arm: Arm, turned: Array, angle: float) -> Array | None:
    """Return the ready pose turned about a vertical first axis; None where it is another."""
    for sign in (1.0, -1.0):
        q = arm.q_ready.copy()
        q[0] += sign * angle
        if np.allclose(arm.position(q), turned @ arm.position(arm.q_ready), atol=1e-6):
            return q
    return None


def pointing_down(frame: Array) -> Array:
    """Return a tool's frame whose z axis points down and whose x axis is level, shape (3, 3)."""
    x, down = frame[:, 0] * [1.0, 1.0, 0.0], np.array([0.0, 0.0, -1.0])
    x = x / np.linalg.norm(x)
    return np.column_stack([x, np.cross(down, x), down])


def brought(f: MeetingMap, frame: Array, place: Array, start: Array) -> Array | None:
    """Return the pose that brings the tool to a place [rad], (n,); None where there is none.

    Args:
        f: The meeting map.
        frame: Columns: where the tool's axes are to point, shape (3, 3).
        place: The place [m], shape (3,).
        start: Pose in which the inverse starts [rad], shape (n,).
    """
    target = np.array([place, np.zeros(3), np.zeros(3)])
    inside, rows = replace(f, frame=frame).virtual(target, start)
    return rows[0].copy() if inside else None


def _crosses(scene: Scene, place: Array) -> bool:
    """Say whether a tray about a place would be on the scene's belt, or too near to it."""
    belt = scene.belt
    if belt is None:
        return False
    across = np.array([-np.sin(belt.direction), np.cos(belt.direction)])
    return abs(float(across @ (place[:2] - belt.middle))) < 0.5 * belt.width + _BESIDE


def carried(arm: Arm, start: Array, end: Array, speed: float, share: float = _SHARE) -> Array:
    """Return a motion from rest to rest whose tool is no faster than ``speed`` [m/s].

    q, dq, ddq each tick, shape (k, 3, n). ``share`` of the joints' speeds is used at most.

    Raises:
        InputError: There is none.
    """
    for _ in range(_TRIES):
        rows = slow_motion(arm, start, end, share)
        fastest = max(float(np.linalg.norm(arm.jacobian(q) @ dq)) for q, dq, _ in rows[::10])
        if fastest <= speed:
            return rows
        share *= 0.95 * speed / fastest
    raise InputError("a motion with the part", f"a tool of at most {speed:g} m/s", "a faster one")
