"""From the moments of two or more images to the ball's centre in the world.

Maximum likelihood on the image points: two Gauss-Newton steps from the point nearest to the
rays.

| here        | meaning                                                  | unit | shape      |
|-------------|----------------------------------------------------------|------|------------|
| ``cameras`` | as in :mod:`mitt.vision.camera`                          | m    | (n, 5, 3)  |
| ``points``  | centroid and its standard deviation; negative if unseen  | px   | (n, 3)     |
"""

from dataclasses import dataclass
from math import pi, sqrt

import numpy as np

from mitt import fields
from mitt.ball.motion_models import invert_positive
from mitt.errors import InputError
from mitt.fields import brief
from mitt.jit import kernel
from mitt.signals import Array, Moments, Sighting
from mitt.vision.camera import Rig, in_camera, pack_cameras, sphere_centroid

WORK = 7
"""Rows of the scratch array."""


#: Least and largest number of each setting; choices of this project.
_RANGES = {"sigma_floor": (0.0, 1e3), "sigma_spread": (0.0, 1e3), "max_residual": (0.0, 1e6),
           "max_skew": (0.0, 1.0)}  # fmt: skip


@dataclass(frozen=True, slots=True, kw_only=True)
class TriangulatorConfig:
    """How exact the centroids are.

    The standard deviation of a centroid is sqrt(floor^2 + (spread / r^1.5)^2), r the radius of
    a disc of the target's area; fitted to rendered discs of 0.6 to 6 px with 2 grey levels of
    read noise under 160 of signal. A real rig adds its calibration error to the floor.

    Attributes:
        sigma_floor: Error that no disc falls below [px].
        sigma_spread: Error of a disc with an area of pi px^2 [px].
        max_residual: Distance of centroid and projected ball at which the cameras disagree [px].
        max_skew: Largest difference of the exposures' times [s].
    """

    sigma_floor: float = 0.0075
    sigma_spread: float = 0.058
    max_residual: float = 2.0
    max_skew: float = 1e-4

    __repr__ = brief

    def __post_init__(self) -> None:
        """Refuse what cannot be; InputError names the field."""
        fields.check(self, _RANGES)


@kernel
def _nearest(cameras: Array, points: Array, r: Array, work: Array) -> bool:
    """Write the point with the least squared distance to all rays; False if they are parallel."""
    H, inverse, b = work[:3], work[3:6], work[6]
    H[:, :] = 0.0
    b[:] = 0.0
    for n in range(cameras.shape[0]):
        if points[n, 2] < 0.0:
            continue
        pose = cameras[n]
        x = (points[n, 0] - pose[4, 1]) / pose[4, 0]
        y = (points[n, 1] - pose[4, 2]) / pose[4, 0]
        norm = sqrt(x * x + y * y + 1.0)
        for i in range(3):
            ray_i = (pose[i, 0] * x + pose[i, 1] * y + pose[i, 2]) / norm
            for j in range(3):
                ray_j = (pose[j, 0] * x + pose[j, 1] * y + pose[j, 2]) / norm
                projector = (1.0 if i == j else 0.0) - ray_i * ray_j
                H[i, j] += projector
                b[i] += projector * pose[3, j]
    if not invert_positive(H, inverse):
        return False
    for i in range(3):
        r[i] = inverse[i, 0] * b[0] + inverse[i, 1] * b[1] + inverse[i, 2] * b[2]
    return True


@kernel
def _refine(cameras: Array, points: Array, radius: float, r: Array, P: Array, work: Array) -> float:
    """Move ``r`` by one Gauss-Newton step, write its covariance into ``P``.

    Returns:
        The largest residual before the step [px], infinite where a camera cannot see ``r``.
    """
    H, b, axis_u, axis_v, uv = work[:3], work[3], work[4], work[5], work[6]
    H[:, :] = 0.0
    b[:] = 0.0
    worst = 0.0
    for n in range(cameras.shape[0]):
        if points[n, 2] < 0.0:
            continue
        R, lens, place = cameras[n], cameras[n, 4], in_camera(cameras[n], r)
        x, y, z = place
        if not z > 1.01 * radius:
            return np.inf
        sphere_centroid(lens, place, radius, uv)
        du, dv = points[n, 0] - uv[0], points[n, 1] - uv[1]
        worst = max(worst, sqrt(du * du + dv * dv))
        weight = 1.0 / (points[n, 2] * points[n, 2])
        for i in range(3):
            axis_u[i] = lens[0] / z * (R[i, 0] - x / z * R[i, 2])
            axis_v[i] = lens[0] / z * (R[i, 1] - y / z * R[i, 2])
        for i in range(3):
            b[i] += weight * (axis_u[i] * du + axis_v[i] * dv)
            for j in range(3):
                H[i, j] += weight * (axis_u[i] * axis_u[j] + axis_v[i] * axis_v[j])
    if not invert_positive(H, P):
        return np.inf
    for i in range(3):
        r[i] += P[i, 0] * b[0] + P[i, 1] * b[1] + P[i, 2] * b[2]
    return worst


@kernel
def triangulate(
    cameras: Array, points: Array, radius: float, r: Array, P: Array, work: Array
) -> float:
    """Write the ball's centre and its covariance; shapes of the inputs in the module's table.

    Args:
        cameras: Cameras in the world.
        points: What they see.
        radius: Ball radius [m].
        r: Result, centre in the world [m], shape (3,).
        P: Result, covariance [m^2], shape (3, 3).
        work: Scratch, shape (WORK, 3).

    Returns:
        The largest distance that remains between centroid and ball [px]; infinite if there is
        no answer, as for parallel rays.
    """
    if not _nearest(cameras, points, r, work):
        return np.inf
    worst = np.inf
    for _ in range(3):
        worst = _refine(cameras, points, radius, r, P, work)
        if worst == np.inf:
            return np.inf
    return worst


@kernel
def note(point: Array, u: float, v: float, area: float, clipped: bool, ball: Array) -> bool:
    """Write what one camera sees into its row of ``points``; return whether it counts.

    Args:
        point: Result, unchanged where the target does not count, shape (3,).
        u: Centroid, column [px].
        v: Centroid, row [px].
        area: Pixels of the target [px^2].
        clipped: Whether it touches the border.
        ball: As of :func:`pack_ball`.
    """
    if clipped or not area > 0.0 or not np.isfinite(u + v):
        return False
    point[0], point[1] = u, v
    point[2] = sqrt(ball[1] + ball[2] / (area * sqrt(area)))
    return True


def pack_ball(config: TriangulatorConfig, ball_radius: float, rig: Rig) -> Array:
    """Return what is known of ball and cameras, shape (5,).

    Radius [m]; squared error of a centroid that no disc falls below [px^2], and that of a disc
    times its area^1.5 [px^5]; the largest residual [px]; 1 for fixed cameras, else 0. The floor
    holds what the encoders of the heads add: a step, uniformly distributed, through the focal
    length.

    Raises:
        InputError: The radius is not that of a ball.
    """
    if not 0.0 < ball_radius < 1.0:
        raise InputError("ball_radius", "a length between 0 and 1 m", ball_radius)
    c = config
    pairs = zip(rig.heads, rig.cameras, strict=False)
    steps = max((h.encoder_step * camera.f_px for h, camera in pairs), default=0.0)
    floor = c.sigma_floor**2 + steps**2 / 12.0
    still = float(not rig.heads)
    return np.array((ball_radius, floor, c.sigma_spread**2 * pi**1.5, c.max_residual, still))


@kernel
def on_ray(
    camera: Array, point: Array, radius: float, known: Array, r: Array, P: Array, along: float
) -> bool:
    """Write where one camera alone sees the ball: on its ray, nearest to where it was known.

    Args:
        camera: A row of ``cameras``.
        point: A row of ``points``.
        radius: Ball radius [m].
        known: Last or predicted centre [m], shape (3,).
        r: Result, centre [m], shape (3,).
        P: Result, covariance [m^2], shape (3, 3): true across the ray, ``along``^2 along it.
        along: Standard deviation along the ray [m].

    Returns:
        Whether the known place is in front of the camera.
    """
    x, y = (point[0] - camera[4, 1]) / camera[4, 0], (point[1] - camera[4, 2]) / camera[4, 0]
    c, z = camera[3], in_camera(camera, known)[2]
    if not z > 1.01 * radius:
        return False
    shrink = 1.0 - radius * radius / (z * z)
    x, y = shrink * x, shrink * y
    norm = sqrt(x * x + y * y + 1.0)
    depth = 0.0
    for i in range(3):
        r[i] = (camera[i, 0] * x + camera[i, 1] * y + camera[i, 2]) / norm
        depth += r[i] * (known[i] - c[i])
    if not depth > 1.01 * radius:
        return False
    across = depth * point[2] / camera[4, 0]
    for i in range(3):
        for j in range(3):
            own = across * across if i == j else 0.0
            P[i, j] = own + (along * along - across * across) * r[i] * r[j]
    for i in range(3):
        r[i] = c[i] + depth * r[i]
    return True


class Triangulator:
    """Finds the ball in the world from what all cameras of a rig saw in one instant."""

    def __init__(
        self, rig: Rig, ball_radius: float, config: TriangulatorConfig | None = None
    ) -> None:
        """Lay the rig out in arrays.

        Args:
            rig: At least two cameras, in the order of ``Moments.camera``.
            ball_radius: Radius of the ball [m].
            config: How exact the centroids are.

        Raises:
            InputError: There are fewer than two cameras, or the radius is not positive.
        """
        config = config or TriangulatorConfig()
        self._max_skew = config.max_skew
        self._cameras = pack_cameras(rig)
        self._ball = pack_ball(config, ball_radius, rig)
        self._points = np.empty((len(rig.cameras), 3))
        self._work = np.empty((WORK, 3))

    def step(self, moments: tuple[Moments, ...]) -> Sighting:
        """Return where the ball is; ``found`` is False unless two or more cameras agree on it.

        Moments without a target, clipped by the border or not finite do not count.
        """
        t, ball, count = moments[0].t if moments else 0.0, self._ball, 0
        self._points[:, 2] = -1.0
        for m in moments:
            if m.found and not m.merged and abs(m.t - t) <= self._max_skew:
                count += note(self._points[m.camera], m.u, m.v, m.area, m.clipped, ball)
        if count >= 2:
            r_o, P = np.empty(3), np.empty((3, 3))
            worst = triangulate(self._cameras, self._points, ball[0], r_o, P, self._work)
            if worst <= ball[3]:
                return Sighting(t=t, found=True, r_o=r_o, covariance=P)
        return unseen(t)


def unseen(t: float) -> Sighting:
    """Return the sighting of no ball at ``t`` [s]."""
    return Sighting(t=t, found=False, r_o=np.zeros(3), covariance=np.zeros((3, 3)))
