"""A ball's outline drawn over an image: how much of each pixel it covers while it moves.

The outline of a sphere is the cone of rays that touch it, cut by the image plane: exactly an
ellipse. Each pixel row is cut into lines; along a line the covered interval follows from a
quadratic, so coverage is exact across columns and a midpoint rule down the rows. Motion blur:
the lines take turns at the instants of the exposure, so it costs nothing more.
"""

from math import ceil, floor, sqrt

import numpy as np
from numba import njit
from numpy.typing import NDArray

from mitt.signals import Array, Image

LINES, SMALL = 16, 12.0
"""Lines a pixel row, half as many for discs above that radius [px]; the centroid of a 1 px disc
is then that of exact areas to 0.005 px."""

INSTANTS = 8
"""Most instants that stand for an exposure; one stands for a smear of 0.25 px or less."""


@njit(cache=True)
def cover(
    coverage: Array, full: Array, row: int, lens: Array, path: Array, k: int, lines: int
) -> tuple[int, int]:
    """Write the covered share of each pixel of one row; return the first and last column touched.

    A ray (a, b, 1) meets the ball, centre c, where ((a, b, 1) . c)^2 >= (a^2 + b^2 + 1) D: on a
    line of constant b, between the roots of a quadratic in a.

    Args:
        coverage: Result, zero outside the columns returned and at entry [1], shape (width,).
        full: Scratch, zero at entry and exit, shape (width + 1,).
        row: Row of the image.
        lens: f_px, cu, cv [px], shape (3,).
        path: Ball centre in the optical frame [m], D, A = D - x^2 and f_px / A, a row an instant,
            shape (>= k, 6).
        k: Number of instants.
        lines: Lines in the row, a multiple of k.
    """
    share, width = 1.0 / lines, coverage.shape[0]
    start, pace = (row - 0.5 + 0.5 * share - lens[2]) / lens[0], share / lens[0]
    first, last, j = width, -1, 0
    for line in range(lines):
        x, y, z, D = path[j, 0], path[j, 1], path[j, 2], path[j, 3]
        A, scale = path[j, 4], path[j, 5]
        j = j + 1 if j + 1 < k else 0
        b = start + line * pace
        s = b * y + z
        disc = x * x * s * s + A * (s * s - (b * b + 1.0) * D)
        if disc <= 0.0:
            continue
        root = sqrt(disc)
        left = max((x * s - root) * scale + lens[1], -0.5)
        right = min((x * s + root) * scale + lens[1], width - 0.5)
        if right <= left:
            continue
        u0, u1 = int(left + 0.5), min(int(right + 0.5), width - 1)
        if u0 == u1:
            coverage[u0] += share * (right - left)
        else:
            coverage[u0] += share * (u0 + 0.5 - left)
            coverage[u1] += share * (right - u1 + 0.5)
            full[u0 + 1] += share
            full[u1] -= share
        first, last = min(first, u0), max(last, u1)
    inside = 0.0
    for u in range(first, last + 1):
        inside += full[u]
        coverage[u] += inside
        full[u] = 0.0
    return first, last


@njit(cache=True)
def _lay_path(lens: Array, ball: Array, path: Array) -> tuple[int, float, float, float]:
    """Write the ball's places during the exposure.

    Returns:
        Their number, 0 for a ball that is not in front of the camera, the first and last row
        they span, and the radius of the disc [px].
    """
    R = ball[6]
    near = min(ball[2], ball[5])
    if not near > 1.001 * R:
        return 0, 0.0, 0.0, 0.0
    smear = lens[0] / near * sqrt((ball[3] - ball[0]) ** 2 + (ball[4] - ball[1]) ** 2)
    k = 1 if smear < 0.25 else int(min(1 + ceil(2.0 * smear), float(INSTANTS)))
    low, high = np.inf, -np.inf
    for j in range(k):
        share = (j + 0.5) / k
        x = ball[0] + share * (ball[3] - ball[0])
        y = ball[1] + share * (ball[4] - ball[1])
        z = ball[2] + share * (ball[5] - ball[2])
        path[j, 0], path[j, 1], path[j, 2] = x, y, z
        D = x * x + y * y + z * z - R * R
        path[j, 3], path[j, 4], path[j, 5] = D, D - x * x, lens[0] / (D - x * x)
        side, depth = R * sqrt(y * y + z * z - R * R), z * z - R * R
        low = min(low, lens[2] + lens[0] * (y * z - side) / depth)
        high = max(high, lens[2] + lens[0] * (y * z + side) / depth)
    return k, low, high, lens[0] * R / near


@njit(cache=True)
def _paint(
    pixels: Image, row: int, first: int, last: int, coverage: Array, noise: Array, light: Array
) -> None:
    """Mix a ball into pixels it covers in part or whole, with the noise of what they then hold."""
    level, read, shot = light[0], light[1] * light[1], 1.0 / light[2]
    line, at = np.uint64(row), np.uint64(row * pixels.shape[1])  # unsigned: none counts backwards
    for u in range(np.uint64(first), np.uint64(last + 1)):
        c = coverage[u]
        ground = float(pixels[line, u])
        rest = (1.0 - c) * (1.0 - c)
        mean = (1.0 - c) * ground + c * level
        variance = read * (1.0 - rest) + shot * (mean - rest * ground)
        value = mean + sqrt(max(variance, 0.0)) * noise[at + u]
        pixels[line, u] = np.uint8(min(max(value + 0.5, 0.0), 255.0))
        coverage[u] = 0.0


@njit(cache=True)
def draw_ball(
    pixels: Image,
    lens: Array,
    ball: Array,
    light: Array,
    noise: Array,
    window: NDArray[np.int64],
    work: Array,
) -> None:
    """Draw a ball over an image of what is behind it.

    Args:
        pixels: Image, overwritten where the ball is, shape (height, width).
        lens: f_px, cu, cv [px], shape (3,).
        ball: Centre in the optical frame at the begin and the end of the exposure, and radius
            [m], shape (7,).
        light: Level of the ball and read noise [grey levels], electrons a level, shape (3,).
        noise: Standard normal numbers, one a pixel of the image at least, shape (n,).
        window: First and last row that are drawn, and two more numbers [px], shape (4,).
        work: Scratch, zero at entry and exit but for its tail, shape (2 width + 1 + 6 INSTANTS,).
    """
    width = pixels.shape[1]
    path = work[2 * width + 1 : 2 * width + 1 + 6 * INSTANTS].reshape(INSTANTS, 6)
    k, low, high, radius = _lay_path(lens, ball, path)
    if k == 0:
        return
    first_row = int(min(max(floor(low), float(window[0])), float(window[1] + 1)))
    last_row = int(min(max(ceil(high), -1.0), float(window[1])))
    coverage, full = work[:width], work[width : 2 * width + 1]
    lines = (LINES if radius < SMALL else LINES // 2) // k * k
    lines = max(lines, k)
    for row in range(first_row, last_row + 1):
        first, last = cover(coverage, full, row, lens, path, k, lines)
        if last >= first:
            _paint(pixels, row, first, last, coverage, noise, light)
