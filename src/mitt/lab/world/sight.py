"""What a camera sees of a ball, a part or a thing in a hand, and what hides it.

Points come from a camera that looks at a place from another one. Whatever stands between hides it:
arm and tool, as the capsules of :mod:`mitt.lab.world.capsules`, and the forearm of who hands it
over. A thing is seen where its middle and its whole outline are: of one that is half covered a
part finder finds another middle, or none.
"""

from math import cos, pi, sin, sqrt
from typing import NamedTuple

import numpy as np

from mitt.core.arm.kinematics import Vec, plus, times
from mitt.core.arm.shapes import segment_distance
from mitt.core.kernels import kernel
from mitt.core.signals import Array
from mitt.lab.world.scene import Scene

#: Rays to the outline of a thing.
_RAYS = 8
#: Height of a camera above belt or hand, and how far upstream one is that sees parts come [m]:
#: choices of this project.
_ABOVE = 1.0
_UPSTREAM = 0.7
#: Half the angle of view of the latter [rad]: it sees 0.5 m of the belt.
_NARROW = 0.25
#: Where a camera is that sees what a person hands over [m], in the arm's base frame: beside.
_BESIDE = (0.4, 1.0, 0.6)
#: The forearm of a person: from where on behind the thing, to where, and its radius [m].
_WRIST = 0.08
_ELBOW = 0.35
_FOREARM = 0.04


class Viewpoint(NamedTuple):
    """From where points are seen.

    Attributes:
        place: The camera [m], shape (3,).
        narrow: Cosine of half its angle of view, about straight down; -1 where it sees all around.
        size: Radius of the outline that has to be seen [m].
        behind: Where the forearm of who holds the thing leads from it, a unit vector, shape (3,);
            zero where nobody does.
    """

    place: Array
    narrow: float
    size: float
    behind: Array


def viewpoint_of(scene: Scene, radius: float, behind: Array | None) -> Viewpoint | None:
    """Return from where a scene's points are seen; None where nothing ever hides them.

    Args:
        scene: The scene.
        radius: Radius of its ball [m]; of a part the shorter of its upper sides counts.
        behind: As of :class:`Viewpoint`; None where nobody holds the thing.
    """
    view, belt, sides = scene.sensing.viewpoint, scene.belt, scene.ball.sides
    if view == "around":
        return None
    narrow = -1.0
    if isinstance(view, str):
        place = np.array(_BESIDE)
        if belt is not None:
            place = np.array([*belt.middle, belt.height + _ABOVE])
        if belt is not None and view == "upstream":
            place, narrow = place - _UPSTREAM * belt.along, cos(_NARROW)
    else:
        place = np.array(view)
    size = radius if sides is None else 0.5 * min(sides[:2])
    return Viewpoint(place, narrow, size, np.zeros(3) if behind is None else behind)


@kernel
def is_seen(sight: Viewpoint, r: Array, capsules: Array) -> bool:
    """Say whether a thing is in view, and nothing covers its middle or its outline.

    Args:
        sight: From where.
        r: Its middle [m], shape (3,).
        capsules: Both ends of their axes and their radii [m], shape (k, 7 or more).
    """
    away = (r[0] - sight.place[0], r[1] - sight.place[1], r[2] - sight.place[2])
    far = sqrt(away[0] * away[0] + away[1] * away[1] + away[2] * away[2])
    if not far > sight.size:
        return False
    x, y, z = away[0] / far, away[1] / far, away[2] / far
    if -z < sight.narrow:
        return False
    # Two directions across the line of sight: with the axis that is least along it.
    if abs(x) < 0.6:
        wide = sqrt(y * y + z * z)
        ux, uy, uz = 0.0, z / wide, -y / wide
    else:
        wide = sqrt(x * x + z * z)
        ux, uy, uz = -z / wide, 0.0, x / wide
    vx, vy, vz = y * uz - z * uy, z * ux - x * uz, x * uy - y * ux
    middle = (r[0], r[1], r[2])
    if not _is_open(sight, middle, middle, capsules):
        return False
    for i in range(_RAYS):
        c, s = sight.size * cos(2.0 * pi * i / _RAYS), sight.size * sin(2.0 * pi * i / _RAYS)
        edge = (r[0] + c * ux + s * vx, r[1] + c * uy + s * vy, r[2] + c * uz + s * vz)
        if not _is_open(sight, edge, middle, capsules):
            return False
    return True


@kernel
def _is_open(sight: Viewpoint, to: Vec, middle: Vec, capsules: Array) -> bool:
    """Say whether nothing stands between the camera and a point of a thing [m]."""
    eye, b = (sight.place[0], sight.place[1], sight.place[2]), sight.behind
    for k in range(capsules.shape[0]):
        start = (capsules[k, 0], capsules[k, 1], capsules[k, 2])
        end = (capsules[k, 3], capsules[k, 4], capsules[k, 5])
        if segment_distance(eye, to, start, end) < capsules[k, 6]:
            return False
    if b[0] == 0.0 and b[1] == 0.0 and b[2] == 0.0:
        return True
    held = (b[0], b[1], b[2])
    wrist, elbow = plus(middle, times(_WRIST, held)), plus(middle, times(_ELBOW, held))
    return bool(segment_distance(eye, to, wrist, elbow) >= _FOREARM)
