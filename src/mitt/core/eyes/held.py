"""The ball in the hand: a disc of known size and light, of which palm and fingers hide a part.

The centroid of what is bright would lie off the ball's centre by what is hidden. So the disc is
laid over the image where it explains best what is bright, and pixels that are much darker than it
count as hidden. Only what is about as bright as the ball in flight is
taken for it: the hand has to be darker.
"""

from math import ceil, floor, sqrt

import numpy as np
from numpy.typing import NDArray

from mitt.core.eyes.camera import in_camera
from mitt.core.eyes.localization import EyesMemory
from mitt.core.eyes.segmentation import LOST
from mitt.core.eyes.triangulation import on_ray, triangulate
from mitt.core.kernels import Fields, kernel
from mitt.core.signals import Array, Image

Edges = tuple[int, int, int, int]
"""First and last row, first and last column [px]."""

REACH = 0.1
"""How far from the catch point a held ball is looked for [m]: 40 mm in the hand, and what a hand of
6 m/s goes in a clock's error of 10 ms."""
HAND = 0.45
HIDDEN = 0.4
"""Shares of the ball's contrast: what is less bright is none of it, and by how much a pixel falls
short of the disc that is hidden."""
IN_SIGHT = 0.6
FINE = 6.0
"""Least share of the disc that is in sight; radius from twice which pixels are left out [px]."""
FINEST = 0.1
"""Step at which the search for the disc ends [px]."""
ERROR = 0.1
MORE = 0.5
"""Standard deviation of the centre of a disc in full sight, and what its hidden share adds [px]: of
rendered catches, at radii of 3 px."""


@kernel
def window_about(
    camera: Fields,
    r: Array,
    radius: float,
    slack: float,
    shape: tuple[int, ...],
    window: NDArray[np.int64],
) -> float:
    """Write where in an image a held ball is looked for.

    Args:
        camera: A record of ``CAMERA``.
        r: Where the hand's catch point is at the exposure [m], shape (3,).
        radius: Radius of the ball [m].
        slack: What is added on all sides [px].
        shape: Height and width of the image [px].
        window: Result, rows and columns, first and last, shape (4,).

    Returns:
        Radius of the ball in the image [px]; 0 where it is not in front of the camera or not in
        the image.
    """
    x, y, z = in_camera(camera, r)
    if not z > 2.0 * radius:
        return 0.0
    scale = camera.f_px / z
    u, v, size = camera.cu + scale * x, camera.cv + scale * y, scale * radius
    around = size + scale * REACH + 1.0 + slack
    if not (abs(u) < 1e6 and abs(v) < 1e6):
        return 0.0
    window[0], window[1] = max(floor(v - around), 0), min(ceil(v + around), shape[0] - 1)
    window[2], window[3] = max(floor(u - around), 0), min(ceil(u + around), shape[1] - 1)
    return float(size) if window[0] < window[1] and window[2] < window[3] else 0.0


@kernel
def _middle(
    pixels: Image, window: Edges, light: tuple[float, float], stride: int, point: Fields
) -> bool:
    """Write the middle of what is bright in a window; return whether anything is."""
    level, gain = light
    mass, mu, mv = 0.0, 0.0, 0.0
    for v in range(window[0], window[1] + 1, stride):
        for u in range(window[2], window[3] + 1, stride):
            bright = (float(pixels[v, u]) - level) / gain - HAND
            if bright > 0.0:
                mass += bright
                mu += bright * u
                mv += bright * v
    if not mass > 0.0:
        return False
    point.u, point.v = mu / mass, mv / mass
    return True


@kernel
def _misfit(
    pixels: Image,
    about: Edges,
    light: tuple[float, float],
    radius: float,
    stride: int,
    at: tuple[float, float],
    least: float,
) -> tuple[float, float]:
    """Return how badly a disc explains what is bright about it, and what share of it is in sight.

    Its edge is a pixel wide. What is brighter than the disc counts in full, what is darker up to
    ``HIDDEN``: there something hides it. A disc that is no better than ``least`` is not looked at
    to its end.
    """
    u_0, v_0 = at
    dark, scale = light[0] + HAND * light[1], 1.0 / (light[1] * (1.0 - HAND))
    inner, outer = max(radius - 0.5, 0.0) ** 2, (radius + 0.5 - HAND) ** 2
    cost, seen, whole = 0.0, 0.0, 1e-9
    for v in range(about[0], about[1] + 1, stride):
        for u in range(about[2], about[3] + 1, stride):
            square, disc = (u - u_0) ** 2 + (v - v_0) ** 2, 1.0
            if square >= outer:
                disc = 0.0
            elif square > inner:
                disc = (radius - sqrt(square) + 0.5 - HAND) / (1.0 - HAND)
            e = min(max((float(pixels[v, u]) - dark) * scale, 0.0), 1.2) - disc
            whole += disc
            if e > -HIDDEN:
                cost += e * e
                seen += disc
            else:
                cost += HIDDEN * HIDDEN
        if cost >= least:
            break
    return cost, seen / whole


@kernel
def _lay_disc(
    pixels: Image,
    window: Edges,
    light: tuple[float, float],
    radius: float,
    stride: int,
    point: Fields,
) -> float:
    """Move a disc from the middle of what is bright to where it explains that best.

    By a search about it whose steps are halved; return what share of the disc is in sight.
    """
    around = 1.5 * radius + 2.0
    about = (
        max(floor(point.v - around), window[0]),
        min(ceil(point.v + around), window[1]),
        max(floor(point.u - around), window[2]),
        min(ceil(point.u + around), window[3]),
    )
    step, reach = 0.5 * radius, 2
    best, in_sight = _misfit(pixels, about, light, radius, stride, (point.u, point.v), np.inf)
    while step > FINEST:
        u_0, v_0 = point.u, point.v
        for i in range(-reach, reach + 1):
            for k in range(-reach, reach + 1):
                u, v = u_0 + i * step, v_0 + k * step
                cost, share = _misfit(pixels, about, light, radius, stride, (u, v), best)
                if cost < best:
                    best, in_sight, point.u, point.v = cost, share, u, v
        step, reach = 0.5 * step, 1
    return float(in_sight)


@kernel
def find_held(
    images: tuple[Image, ...], apart: int, eyes: EyesMemory, hand: Array, r: Array, P: Array
) -> bool:
    """Find a held ball in the images, then in the world.

    Args:
        images: As for :func:`mitt.core.eyes.localization.localize`.
        apart: As for ``localize``.
        eyes: As for ``localize``: what the cameras have learned of the ball's light in flight;
            where it was is forgotten.
        hand: Where the hand's catch point was at the exposure [m], shape (3,).
        r: Result, centre of the ball [m], shape (3,).
        P: Result, its covariance [m^2], shape (3, 3).

    Returns:
        Whether two or more cameras agree on the ball, or one alone sees it, on its ray.
    """
    ball, window, count, one = eyes.ball[0], eyes.segment_work[0].window, 0, 0
    for n in range(len(images)):
        pixels, own, point = images[n], eyes.targets[n], eyes.points[n]
        point.sigma, own.state = -1.0, LOST
        if pixels.size == 0 or apart >> n & 1 or own.weighed == 0.0 or not own.gain > 0.0:
            continue
        size = window_about(eyes.cameras[n], hand, ball.radius, 0.0, pixels.shape, window)
        if size == 0.0:
            continue
        stride, light = max(floor(size / FINE), 1), (own.level, own.gain)
        edges = window[0], window[1], window[2], window[3]
        if not _middle(pixels, edges, light, stride, point):
            continue
        in_sight = _lay_disc(pixels, edges, light, size, stride, point)
        if in_sight > IN_SIGHT:
            error = stride * (ERROR + MORE * (1.0 - in_sight))
            point.sigma, count, one = sqrt(ball.floor + error * error), count + 1, n
    if count == 1:
        return bool(on_ray(eyes.cameras[one], eyes.points[one], ball.radius, hand, r, P))
    if count == 0:
        return False
    residual = triangulate(eyes.cameras, eyes.points, ball.radius, r, P, eyes.solve_work[0])
    return bool(residual <= ball.max_residual)
