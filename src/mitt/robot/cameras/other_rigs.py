"""Whether what a rig shows falls, and which rig is meant where it does not.

What two cameras saw of a flight is triangulated with the poses that a file may hold in the place of
T_world_cam in metres, as other programs write them. With the right one the lines of sight meet, and
the ball falls.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from mitt.core.errors import MittError
from mitt.core.eyes.camera import inverse
from mitt.core.eyes.triangulation import Triangulator, TriangulatorConfig
from mitt.core.signals import GRAVITY, Array, Moments
from mitt.io.rig import CalibratedRig

FALL = 5.0
"""Error of the acceleration beyond which it is no fall [m/s^2]; drag makes 2 at 7 m/s."""
#: Share of the instants at which the cameras agree with the rig that is meant.
_AGREE = 0.8
#: Most instants that are tried, and the area of a target that is taken for their noise [px^2].
_MOST = 400
_AREA = 100.0
#: Axes of OpenGL (y up, z backwards), and of a camera's body in ROS (x forward, z up), as columns
#: in the optical frame.
_OPENGL = np.diag((1.0, -1.0, -1.0, 1.0))
_BODY = np.array(((0, -1, 0, 0), (0, 0, -1, 0), (1, 0, 0, 0), (0, 0, 0, 1.0)))

Change = Callable[[Array], Array]


def _transposed(T: Array) -> Array:
    """Return a pose with its rotation the other way round, its place kept."""
    out = T.copy()
    out[:3, :3] = T[:3, :3].T
    return out


def _scaled(T: Array, unit: float) -> Array:
    """Return a pose whose place was given in another unit [m]."""
    out = T.copy()
    out[:3, 3] *= unit
    return out


#: What a pose may be instead, in words, what to do about it, and the pose that is meant.
_TURNS: tuple[tuple[str, str, Change], ...] = (
    ("", "", lambda T: T),
    (
        "poses of the world seen from the cameras, as of OpenCV and Kalibr",
        "write the inverses",
        inverse,
    ),
    (
        "poses with the axes of OpenGL, y up and z backwards",
        "turn the signs of the second and third column",
        lambda T: T @ _OPENGL,
    ),
    (
        "poses of the world in cameras with the axes of OpenGL",
        "turn the signs of the second and third row, then write the inverses",
        lambda T: inverse(_OPENGL @ T),
    ),
    (
        "poses of the cameras' bodies in ROS, x forward and z up",
        "write those of their optical frames",
        lambda T: T @ _BODY.T,
    ),
    ("poses whose rotations are transposed", "transpose the upper left 3 x 3", _transposed),
)
_UNITS = (("", 1.0), ("mm", 1e-3), ("cm", 1e-2), ("inches", 0.0254))


def meant_rig(points: Array, rig: CalibratedRig, radius: float, config: TriangulatorConfig) -> str:
    """Return which poses the rig's seem to be, and what to do; empty where none is right.

    Args:
        points: Time [s] and image point of the ball in the left and in the right image without
            distortion [px], of each instant at which both see it, shape (n, 5).
        rig: The rig as it was given, with which the lines of sight do not meet, or nothing falls.
        radius: Radius of the ball [m].
        config: When the cameras agree.
    """
    for unit, size in _UNITS:
        for what, do, change in _TURNS:
            if (unit or what) and _falls(
                points,
                rig,
                lambda T: change(_scaled(T, size)),  # noqa: B023
                radius,
                config,
            ):
                words = " and ".join(x for x in (what, unit and f"lengths in {unit}") if x)
                todo = ", and ".join(x for x in (do, unit and "write metres") if x)
                return f"T_world_cam holds {words}, as it seems: {todo}"
    return ""


def _falls(
    points: Array, rig: CalibratedRig, change: Change, radius: float, config: TriangulatorConfig
) -> bool:
    """Say whether the cameras agree on a ball that falls once their poses are changed."""
    cameras = tuple(replace(c, T_world_cam=change(c.T_world_cam)) for c in rig.cameras)
    try:
        triangulator = Triangulator(replace(rig, cameras=cameras).rig(), radius, config)
    except MittError:
        return False
    found = []
    for t, *uv in points[:_MOST]:
        moments = tuple(
            Moments(t=t, camera=k, found=True, area=_AREA, u=uv[2 * k], v=uv[2 * k + 1])
            for k in range(2)
        )
        sighting = triangulator.step(moments)
        if sighting.found:
            found.append(np.array((t, *sighting.r_o)))
    error = fall_error(found)
    return len(found) >= _AGREE * len(points[:_MOST]) and error is not None and error < FALL


def fall_error(points: Sequence[Array]) -> float | None:
    """Return how far from gravity the acceleration of the points is [m/s^2].

    The median over pieces of 0.15 s of |a - g|, a from a parabola; drag makes it 1 to 2 m/s^2 at
    the speeds of a throw. None where no piece has 8 points. It tells a wrong rig, or left and
    right exchanged.
    """
    errors, start = [], 0
    for n in range(len(points)):
        if points[n][0] - points[start][0] < 0.15:
            continue
        piece = np.array(points[start : n + 1])
        start = n + 1 if n + 1 < len(points) else n
        if len(piece) < 8:
            continue
        t = piece[:, 0] - piece[:, 0].mean()
        a = 2.0 * np.polyfit(t, piece[:, 1:], 2)[0]
        errors.append(float(np.linalg.norm(a - np.array((0.0, 0.0, -GRAVITY)))))
    return float(np.median(errors)) if errors else None
