"""From the moments of two or more images to the ball's centre in the world.

Maximum likelihood on the image points: Gauss-Newton steps from the point nearest to the rays.

| here        | meaning                                                  | shape  |
|-------------|----------------------------------------------------------|--------|
| ``cameras`` | records of ``CAMERA``                                    | (n,)   |
| ``points``  | records of ``POINT``, what each camera sees              | (n,)   |
| ``ball``    | record of ``BALL``                                       |        |
| ``work``    | record of ``WORK``: scratch                              |        |
| ``r, P``    | centre of the ball [m], and its covariance [m^2]         | (3,), (3, 3) |
"""

from dataclasses import dataclass, replace
from math import pi, sqrt
from typing import Annotated

import numpy as np

from mitt.core.ball.motion_models import invert_positive
from mitt.core.errors import InputError
from mitt.core.eyes.camera import Rig, in_camera, late_by_row, pack_cameras, ray_of, sphere_centroid
from mitt.core.fields import Range, Settings
from mitt.core.kernels import Fields, Record, kernel
from mitt.core.signals import Array, Moments, Sighting

POINT = np.dtype([("u", float), ("v", float), ("sigma", float)])
"""Centroid and its standard deviation [px]; a negative one says that nothing was seen."""

BALL = np.dtype(
    [
        ("radius", float),  # [m]
        ("floor", float),  # squared error of a centroid that no disc falls below [px^2]
        ("spread", float),  # squared error of a disc's centroid times its area^1.5 [px^5]
        ("max_residual", float),  # at which cameras disagree [px]
        ("fixed", np.int64),  # whether the cameras stand still
    ]
)
"""What is known of the ball and of the cameras' errors."""

WORK = np.dtype(
    [
        ("H", float, (3, 3)),
        ("inverse", float, (3, 3)),
        ("b", float, (3,)),
        ("axis_u", float, (3,)),
        ("axis_v", float, (3,)),
    ]
)
"""Scratch of a triangulation."""

ALONG = 1.0
"""Standard deviation along the ray of a ball that one camera alone sees [m]: a thousand times what
is known of it, and few enough digits away from what is seen across."""
FITTED_NOISE = 0.016
"""Noise of a pixel over the contrast of the disc [1] up to which the error of a centroid is the
fitted one: it was fitted with 0.014 and is on the safe side there."""
NEAR = 1.01
"""Depth over the radius below which a ball is not in front of a camera."""


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class TriangulatorConfig(Settings):
    """How exact the centroids are.

    The standard deviation of a centroid is sqrt(floor^2 + (spread / r^1.5)^2), r the radius of
    a disc of the target's area; fitted to rendered discs of 0.6 to 6 px with 2 grey levels of
    read noise under 160 of signal. Where there is more noise, over the contrast, than
    ``FITTED_NOISE``, as before a bright wall, the spread grows as it does. A real rig adds its
    calibration error to the floor.

    Attributes:
        sigma_floor: Error that no disc falls below [px].
        sigma_spread: Error of a disc with an area of pi px^2 [px].
        max_residual: Distance of centroid and projected ball at which the cameras disagree [px].
        max_skew: Largest difference of the exposures' times [s].
    """

    sigma_floor: Annotated[float, Range(0.0, 1e3)] = 0.0075
    sigma_spread: Annotated[float, Range(0.0, 1e3)] = 0.058
    max_residual: Annotated[float, Range(0.0, 1e6)] = 2.0
    max_skew: Annotated[float, Range(0.0, 1.0)] = 1e-4


def pack_ball(config: TriangulatorConfig, ball_radius: float, rig: Rig) -> Record:
    """Return what is known of ball and cameras as a record of ``BALL``, shape (1,).

    The floor holds what the encoders of the heads add: a step, uniformly distributed, through the
    focal length.

    Raises:
        InputError: The radius is not that of a ball, or there are fewer than two cameras.
    """
    if len(rig.cameras) < 2:
        raise InputError("rig", "at least two cameras", len(rig.cameras))
    if not 0.0 < ball_radius < 1.0:
        raise InputError("ball_radius", "a length between 0 and 1 m", ball_radius)
    pairs = zip(rig.heads, rig.cameras, strict=False)
    steps = max((h.encoder_step * camera.f_px for h, camera in pairs), default=0.0)
    floor = config.sigma_floor**2 + steps**2 / 12.0
    spread, fixed = config.sigma_spread**2 * pi**1.5, not rig.heads
    return np.array([(ball_radius, floor, spread, config.max_residual, fixed)], BALL)


@kernel
def note(
    point: Fields, u: float, v: float, area: float, noise: float, clipped: bool, ball: Fields
) -> bool:
    """Write what one camera sees into its record of ``points``; return whether it counts.

    A centroid [px] of a target of an area [px^2], whose pixels have a noise over their contrast [1]
    (0 if unknown); one that touches the border does not count, and then nothing is written.
    """
    if clipped or not area > 0.0 or not np.isfinite(u + v):
        return False
    point.u, point.v = u, v
    grown = max(noise / FITTED_NOISE, 1.0)
    point.sigma = sqrt(ball.floor + grown * grown * ball.spread / (area * sqrt(area)))
    return True


@kernel
def _nearest(cameras: Record, points: Record, r: Array, work: Fields) -> bool:
    """Write the point with the least squared distance to all rays; False if they are parallel."""
    H, inverse, b = work.H, work.inverse, work.b
    H[:, :] = 0.0
    b[:] = 0.0
    for n in range(len(cameras)):
        if points[n].sigma < 0.0:
            continue
        R, centre = cameras[n].R, cameras[n].centre
        x, y = ray_of(cameras[n], points[n].u, points[n].v)
        norm = sqrt(x * x + y * y + 1.0)
        for i in range(3):
            ray_i = (R[i, 0] * x + R[i, 1] * y + R[i, 2]) / norm
            for j in range(3):
                ray_j = (R[j, 0] * x + R[j, 1] * y + R[j, 2]) / norm
                projector = (1.0 if i == j else 0.0) - ray_i * ray_j
                H[i, j] += projector
                b[i] += projector * centre[j]
    if not invert_positive(H, inverse):
        return False
    for i in range(3):
        r[i] = inverse[i, 0] * b[0] + inverse[i, 1] * b[1] + inverse[i, 2] * b[2]
    return True


@kernel
def _refine(
    cameras: Record, points: Record, radius: float, r: Array, P: Array, work: Fields
) -> float:
    """Move ``r`` by one Gauss-Newton step, write its covariance into ``P``.

    Returns:
        The largest residual before the step [px], infinite where a camera cannot see ``r``.
    """
    H, b, axis_u, axis_v, worst = work.H, work.b, work.axis_u, work.axis_v, 0.0
    H[:, :] = 0.0
    b[:] = 0.0
    for n in range(len(cameras)):
        if points[n].sigma < 0.0:
            continue
        camera, place = cameras[n], in_camera(cameras[n], r)
        R, (x, y, z) = camera.R, place
        if not z > NEAR * radius:
            return np.inf
        u, v = sphere_centroid(camera, place, radius)
        du, dv = points[n].u - u, points[n].v - v
        worst = max(worst, sqrt(du * du + dv * dv))
        weight = 1.0 / (points[n].sigma * points[n].sigma)
        for i in range(3):
            axis_u[i] = camera.f_px / z * (R[i, 0] - x / z * R[i, 2])
            axis_v[i] = camera.f_px / z * (R[i, 1] - y / z * R[i, 2])
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
    cameras: Record, points: Record, radius: float, r: Array, P: Array, work: Fields
) -> float:
    """Write the ball's centre and its covariance, as in the module's table.

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
def on_ray(camera: Fields, point: Fields, radius: float, known: Array, r: Array, P: Array) -> bool:
    """Write where one camera alone sees the ball: on its ray, nearest to where it was known [m].

    The covariance is true across the ray, and ``ALONG``^2 along it.

    Returns:
        Whether the known place is in front of the camera.
    """
    x, y = ray_of(camera, point.u, point.v)
    c, z = camera.centre, in_camera(camera, known)[2]
    if not z > NEAR * radius:
        return False
    shrink = 1.0 - radius * radius / (z * z)
    x, y = shrink * x, shrink * y
    norm = sqrt(x * x + y * y + 1.0)
    depth = 0.0
    for i in range(3):
        r[i] = (camera.R[i, 0] * x + camera.R[i, 1] * y + camera.R[i, 2]) / norm
        depth += r[i] * (known[i] - c[i])
    if not depth > NEAR * radius:
        return False
    across = depth * point.sigma / camera.f_px
    for i in range(3):
        for j in range(3):
            own = across * across if i == j else 0.0
            P[i, j] = own + (ALONG * ALONG - across * across) * r[i] * r[j]
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
        self._ball = pack_ball(config, ball_radius, rig)[0]
        self._points = np.empty(len(rig.cameras), POINT)
        self._before: dict[int, tuple[float, float, float]] = {}
        self._work = np.empty(1, WORK)

    def step(self, moments: tuple[Moments, ...]) -> Sighting:
        """Return where the ball is; ``found`` is False unless two or more cameras agree on it.

        Moments without a target, clipped by the border or not finite do not count. Those of rolling
        shutters are brought to one instant by their motion since the moments before.
        """
        t, ball, count = moments[0].t if moments else 0.0, self._ball, 0
        moments, late = self._together(moments)
        self._points["sigma"] = -1.0
        for m in moments:
            if m.found and not m.merged and abs(m.t - t) <= self._max_skew:
                count += note(self._points[m.camera], m.u, m.v, m.area, 0.0, m.clipped, ball)
        if count >= 2:
            r_o, P = np.empty(3), np.empty((3, 3))
            worst = triangulate(self._cameras, self._points, ball["radius"], r_o, P, self._work[0])
            if worst <= ball["max_residual"]:
                return Sighting(t=t + late, found=True, r_o=r_o, covariance=P)
        return no_sighting(t)

    def _together(self, moments: tuple[Moments, ...]) -> tuple[tuple[Moments, ...], float]:
        """Return moments as if exposed together, and how much later that is than their images [s].

        Where a camera saw no ball in the images before, it does not count yet.
        """
        if not self._cameras["readout"].any():
            return moments, 0.0
        seen = [m for m in moments if m.found]
        own = [late_by_row(self._cameras[m.camera], m.v) for m in seen]
        late, moved = float(np.mean(own)) if own else 0.0, list[Moments]()
        for m, its in zip(seen, own, strict=True):
            before, self._before[m.camera] = self._before.get(m.camera), (m.t + its, m.u, m.v)
            if before is None or not m.t + its > before[0]:
                continue
            ahead = (late - its) / (m.t + its - before[0])
            u, v = m.u + ahead * (m.u - before[1]), m.v + ahead * (m.v - before[2])
            moved.append(replace(m, u=u, v=v))
        return tuple(moved), late


def no_sighting(t: float) -> Sighting:
    """Return the sighting of no ball at ``t`` [s]."""
    return Sighting(t=t, found=False, r_o=np.zeros(3), covariance=np.zeros((3, 3)))
