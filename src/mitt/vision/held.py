"""The ball in the hand: a disc of known size and light, of which palm and fingers hide a part.

The centroid of what is bright would lie off the ball's centre by what is hidden. So the disc is
laid over the image where it explains best what is bright, and pixels that are much darker than it
count as hidden. Only what is about as bright as the ball in flight is
taken for it: the hand has to be darker.
"""

from math import ceil, floor, sqrt

import numpy as np
from numpy.typing import NDArray

from mitt.jit import kernel
from mitt.signals import Array, Image
from mitt.views import view
from mitt.vision import triangulation
from mitt.vision.camera import in_camera
from mitt.vision.localization import ALONG
from mitt.vision.target import GAIN, LEVEL, LOST, STATE, WEIGHED
from mitt.vision.triangulation import on_ray, triangulate

REACH = 0.1
"""How far from the catch point a held ball is looked for [m]: 40 mm in the hand, and what a hand of
6 m/s goes in a clock's error of 10 ms."""
HAND, HIDDEN = 0.45, 0.4
"""Shares of the ball's contrast: what is less bright is none of it, and by how much a pixel falls
short of the disc that is hidden."""
IN_SIGHT, FINE = 0.6, 6.0
"""Least share of the disc that is in sight; radius from twice which pixels are left out [px]."""
FINEST = 0.1
"""Step at which the search for the disc ends [px]."""
ERROR, MORE = 0.1, 0.5
"""Standard deviation of the centre of a disc in full sight, and what its hidden share adds [px]: of
rendered catches, at radii of 3 px."""


@kernel
def window_about(
    camera: Array, r: Array, radius: float, slack: float, shape: tuple[int, ...],
    window: NDArray[np.int64],
) -> float:  # fmt: skip
    """Write where in an image a held ball is looked for.

    Args:
        camera: A row of ``cameras``.
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
    scale = camera[4, 0] / z
    u, v, size = camera[4, 1] + scale * x, camera[4, 2] + scale * y, scale * radius
    around = size + scale * REACH + 1.0 + slack
    if not (abs(u) < 1e6 and abs(v) < 1e6):
        return 0.0
    window[0], window[1] = max(floor(v - around), 0), min(ceil(v + around), shape[0] - 1)
    window[2], window[3] = max(floor(u - around), 0), min(ceil(u + around), shape[1] - 1)
    return float(size) if window[0] < window[1] and window[2] < window[3] else 0.0


@kernel
def _middle(
    pixels: Image, window: NDArray[np.int64], light: tuple[float, float], stride: int, uv: Array
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
    uv[0], uv[1] = mu / mass, mv / mass
    return True


@kernel
def _misfit(
    pixels: Image, about: NDArray[np.int64], light: tuple[float, float], radius: float,
    stride: int, u_0: float, v_0: float,
) -> tuple[float, float]:  # fmt: skip
    """Return how badly a disc explains what is bright about it, and what share of it is in sight.

    Its edge is a pixel wide. What is brighter than the disc counts in full, what is darker up to
    ``HIDDEN``: there something hides it.
    """
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
    return cost, seen / whole


@kernel
def _lay_disc(
    pixels: Image, window: NDArray[np.int64], light: tuple[float, float], radius: float,
    stride: int, point: Array,
) -> float:  # fmt: skip
    """Move a disc from the middle of what is bright to where it explains that best.

    By a search about it whose steps are halved; return what share of the disc is in sight.
    """
    around, about = 1.5 * radius + 2.0, np.empty(4, np.int64)
    about[0], about[1] = (
        max(floor(point[1] - around), window[0]),
        min(ceil(point[1] + around), window[1]),
    )
    about[2], about[3] = (
        max(floor(point[0] - around), window[2]),
        min(ceil(point[0] + around), window[3]),
    )
    step, reach = 0.5 * radius, 2
    best, in_sight = _misfit(pixels, about, light, radius, stride, point[0], point[1])
    while step > FINEST:
        u_0, v_0 = point[0], point[1]
        for i in range(-reach, reach + 1):
            for k in range(-reach, reach + 1):
                u, v = u_0 + i * step, v_0 + k * step
                cost, share = _misfit(pixels, about, light, radius, stride, u, v)
                if cost < best:
                    best, in_sight, point[0], point[1] = cost, share, u, v
        step, reach = 0.5 * step, 1
    return float(in_sight)


@kernel
def find_held(
    images: tuple[Image, ...], apart: int, memory: Array, cameras: Array, ball: Array, work: Array,
    hand: Array, r: Array, P: Array,
) -> bool:  # fmt: skip
    """Find a held ball in the images, then in the world.

    Args:
        images: As for :func:`mitt.vision.localization.localize`, as are ``apart``, ``cameras``,
            ``ball`` and ``work``.
        apart: See ``images``.
        memory: What the cameras have learned of the ball's light in flight; its place is forgotten.
        cameras: See ``images``.
        ball: See ``images``.
        work: See ``images``.
        hand: Where the hand's catch point was at the exposure [m], shape (3,).
        r: Result, centre of the ball [m], shape (3,).
        P: Result, its covariance [m^2], shape (3, 3).

    Returns:
        Whether two or more cameras agree on the ball, or one alone sees it, on its ray.
    """
    eyes, count, one = len(images), 0, 0
    points, window = view(work, 3 * triangulation.WORK, (eyes, 3)), np.empty(4, np.int64)
    for n in range(eyes):
        pixels, own, point = images[n], memory[n], points[n]
        point[2], own[STATE] = -1.0, float(LOST)
        if pixels.size == 0 or apart >> n & 1 or own[WEIGHED] == 0.0 or not own[GAIN] > 0.0:
            continue
        size = window_about(cameras[n], hand, ball[0], 0.0, pixels.shape, window)
        if size == 0.0:
            continue
        stride = max(floor(size / FINE), 1)
        light = own[LEVEL], own[GAIN]
        if not _middle(pixels, window, light, stride, point):
            continue
        in_sight = _lay_disc(pixels, window, light, size, stride, point)
        if in_sight > IN_SIGHT:
            error = stride * (ERROR + MORE * (1.0 - in_sight))
            point[2], count, one = sqrt(ball[1] + error * error), count + 1, n
    if count == 1:
        return bool(on_ray(cameras[one], points[one], ball[0], hand, r, P, ALONG))
    return count > 1 and bool(triangulate(cameras, points, ball[0], r, P, work) <= ball[3])
