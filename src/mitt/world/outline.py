"""A ball's outline drawn over an image: how much of each pixel it covers.

The outline of a sphere is the cone of rays that touch it, cut by the image plane: exactly an
ellipse. Each pixel row is cut into ``SUBROWS`` lines; along a line the covered interval follows
from a quadratic, so coverage is exact across columns and a midpoint rule down the rows.
"""

from math import ceil, floor, sqrt

import numpy as np
from numba import njit

from mitt.signals import Array, Image

SUBROWS = 16
"""Lines a pixel row; the centroid of a 1 px disc is then that of exact areas to 0.005 px."""


@njit(cache=True)
def cover(coverage: Array, full: Array, row: int, lens: Array, ball: Array) -> tuple[int, int]:
    """Write the covered share of each pixel of one row; return the first and last column touched.

    A ray (a, b, 1) meets the ball, centre c, where ((a, b, 1) . c)^2 >= (a^2 + b^2 + 1) D: on a
    line of constant b, between the roots of a quadratic in a.

    Args:
        coverage: Result, zero outside the columns returned and at entry [1], shape (width,).
        full: Scratch, zero at entry and exit, shape (width + 1,).
        row: Row of the image.
        lens: f_px, cu, cv [px], shape (3,).
        ball: Centre in the optical frame and radius [m], shape (4,).
    """
    x, y, z = ball[0], ball[1], ball[2]
    D = x * x + y * y + z * z - ball[3] * ball[3]
    A = D - x * x
    scale, share, width = lens[0] / A, 1.0 / SUBROWS, coverage.shape[0]
    start, pace = (row - 0.5 + 0.5 * share - lens[2]) / lens[0], share / lens[0]
    first, last = width, -1
    for sub in range(SUBROWS):
        b = start + sub * pace
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
def draw_ball(
    pixels: Image, lens: Array, ball: Array, light: Array, noise: Array, work: Array
) -> None:
    """Draw a ball over an image of the ground.

    Args:
        pixels: Image, overwritten where the ball is, shape (height, width).
        lens: f_px, cu, cv [px], shape (3,).
        ball: Centre in the optical frame and radius [m], shape (4,).
        light: Brightness, background and read noise [grey levels], electrons a level, shape (4,).
        noise: Standard normal numbers, at least as many as the ball has pixels, shape (n,).
        work: Scratch, zero at entry and exit, shape (>= 2 width + 1,).
    """
    height, width = pixels.shape
    y, z, R = ball[1], ball[2], ball[3]
    if z <= R * 1.001:
        return
    side = R * sqrt(y * y + z * z - R * R)
    low = lens[2] + lens[0] * (y * z - side) / (z * z - R * R)
    high = lens[2] + lens[0] * (y * z + side) / (z * z - R * R)
    first_row = int(min(max(floor(low), 0.0), float(height)))
    last_row = int(min(max(ceil(high), -1.0), float(height - 1)))
    next_noise = 0
    coverage, full = work[:width], work[width : 2 * width + 1]
    read, shot = light[2] * light[2], 1.0 / light[3]
    for row in range(first_row, last_row + 1):
        first, last = cover(coverage, full, row, lens, ball)
        for u in range(first, last + 1):
            mean = light[1] + light[0] * coverage[u]
            sigma = sqrt(read + mean * shot)
            value = mean + sigma * noise[next_noise]
            pixels[row, u] = np.uint8(min(max(value + 0.5, 0.0), 255.0))
            coverage[u] = 0.0
            next_noise = next_noise + 1 if next_noise + 1 < noise.shape[0] else 0
