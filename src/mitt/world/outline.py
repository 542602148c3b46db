"""A ball's outline drawn over an image: how much of each pixel it covers while it moves.

The outline of a sphere is the cone of rays that touch it, cut by the image plane: exactly an
ellipse. Each pixel row is cut into lines; along a line the covered interval follows from a
quadratic, so coverage is exact across columns and a midpoint rule down the rows. Motion blur:
the lines take turns at the instants of the exposure, so it costs nothing more.

| here | meaning                                                                | unit | shape |
|------|------------------------------------------------------------------------|------|-------|
| lens | f_px, cu, cv                                                           | px   | 3     |
| ball | centre in the optical frame at begin and end of the exposure, radius   | m    | 7     |
| work | scratch: SCRATCH numbers, where lines begin and end to be covered [px], |      |       |
|      | and a row an instant: centre, D, A = D - x^2 and f_px / A; then the    |      |       |
|      | covered share of each pixel of a row, zero at entry and exit, and what | 1    |       |
|      | begins and ends to cover whole pixels, the same                        |      |       |

What has a number for a shape is a tuple.
"""

from math import ceil, floor, sqrt
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from mitt.jit import kernel
from mitt.signals import Array, Image
from mitt.world.capsules import Edges, Point, Seen

Place: TypeAlias = tuple[float, float, float, float, float, float]

LINES, SMALL = 16, 12.0
"""Lines a pixel row, half as many for discs above that radius [px]; the centroid of a 1 px disc
is then that of exact areas to 0.005 px."""

INSTANTS = 8
"""Most instants that stand for an exposure; one stands for a smear of 0.25 px or less."""

SCRATCH = 2 * LINES + 6 * INSTANTS
_PATH = 2 * LINES

#: The outline is where it is to far better than this [px].
_SLACK = 1e-3


@kernel
def _intersect(
    work: Array, at: int, lens: Point, far: float, place: Place, row: int, lines: int, k: int,
    j: int,
) -> None:  # fmt: skip
    """Write where the lines of a row that have the same instant begin and end to be covered.

    A ray (a, b, 1) meets the ball, centre c, where ((a, b, 1) . c)^2 >= (a^2 + b^2 + 1) D: on a
    line of constant b, between the roots of a quadratic in a; -1 is the end where there are none.

    The lines of an instant lie side by side in ``work``, their begins from ``at`` on, their ends
    LINES further; ``far`` is the right end of the image, ``place`` a row of the ball's path.
    """
    (f, cu, cv), (x, y, z, D, A, scale), share = lens, place, 1.0 / lines
    start, pace = (row - 0.5 + 0.5 * share - cv) / f, share / f
    left, right = np.uint64(at), np.uint64(at + LINES)
    for i in range(np.uint64(lines // k)):
        b = start + (np.int64(i) * k + j) * pace
        s = b * y + z
        disc = x * x * s * s + A * (s * s - (b * b + 1.0) * D)
        root = sqrt(max(disc, 0.0))
        work[left + i] = max((x * s - root) * scale + cu, -0.5)
        work[right + i] = min((x * s + root) * scale + cu, far) if disc > 0.0 else -1.0


@kernel
def _cover(work: Array, width: int, lens: Point, row: int, lines: int, k: int) -> tuple[int, int]:
    """Write the covered share of each pixel of a row; return its first and last column."""
    part, full, per, share = SCRATCH, SCRATCH + width, lines // k, 1.0 / lines
    edge = 0
    for j in range(k):
        p = _PATH + 6 * j
        place = work[p], work[p + 1], work[p + 2], work[p + 3], work[p + 4], work[p + 5]
        _intersect(work, j * per, lens, width - 0.5, place, row, lines, k, j)
    first, last = width, -1
    for _ in range(lines):
        left, right = work[edge], work[edge + LINES]
        # As the lines come down the row, whose instants take turns.
        edge = edge + per if edge + per < lines else edge + per - lines + 1
        if right <= left:
            continue
        u0, u1 = int(left + 0.5), min(int(right + 0.5), width - 1)
        if u0 == u1:
            work[part + u0] += share * (right - left)
        else:
            work[part + u0] += share * (u0 + 0.5 - left)
            work[part + u1] += share * (right - u1 + 0.5)
            work[full + u0 + 1] += share
            work[full + u1] -= share
        first, last = min(first, u0), max(last, u1)
    return first, last


@kernel
def _lay_path(lens: Point, ball: Seen, work: Array, window: Edges) -> tuple[int, int, int, int]:
    """Write the ball's places during the exposure; lens, ball and work as in the module's table.

    Returns:
        Their number, how many lines a row is cut into, and the first and last row of the window
        that they span; none for a ball that is not in front of the camera.
    """
    (f, _, cv), (x0, y0, z0, x1, y1, z1, R) = lens, ball
    near = min(z0, z1)
    if not near > 1.001 * R:
        return 0, 0, 0, -1
    smear = f / near * sqrt((x1 - x0) ** 2 + (y1 - y0) ** 2)
    k = 1 if smear < 0.25 else int(min(1 + ceil(2.0 * smear), float(INSTANTS)))
    lines = (LINES if f * R / near < SMALL else LINES // 2) // k * k
    low, high = np.inf, -np.inf
    for j in range(k):
        share, p = (j + 0.5) / k, _PATH + 6 * j
        x, y, z = x0 + share * (x1 - x0), y0 + share * (y1 - y0), z0 + share * (z1 - z0)
        D = x * x + y * y + z * z - R * R
        work[p], work[p + 1], work[p + 2] = x, y, z
        work[p + 3], work[p + 4], work[p + 5] = D, D - x * x, f / (D - x * x)
        side, depth = R * sqrt(y * y + z * z - R * R), z * z - R * R
        low = min(low, cv + f * (y * z - side) / depth)
        high = max(high, cv + f * (y * z + side) / depth)
    low, high = floor(low + 0.5 - _SLACK), ceil(high - 0.5 + _SLACK)
    first = int(min(max(low, float(window[0])), float(window[1] + 1)))
    return k, max(lines, k), first, int(min(max(high, -1.0), float(window[1])))


@kernel
def _paint(
    pixels: Image, row: int, columns: tuple[int, int], work: Array, noise: Array, start: int,
    light: Point,
) -> None:  # fmt: skip
    """Mix a ball into pixels it covers in part or whole, with the noise of what they then hold."""
    level, read, shot = light[0], light[1] * light[1], 1.0 / light[2]
    line, part = np.uint64(row), np.uint64(SCRATCH)  # unsigned: none counts backwards
    full = np.uint64(SCRATCH + pixels.shape[1])
    at, inside = np.uint64(start + row * pixels.shape[1]), 0.0
    for u in range(np.uint64(columns[0]), np.uint64(columns[1] + 1)):
        inside += work[full + u]
        c = work[part + u] + inside
        work[part + u], work[full + u] = 0.0, 0.0
        ground = float(pixels[line, u])
        rest = (1.0 - c) * (1.0 - c)
        mean = (1.0 - c) * ground + c * level
        variance = read * (1.0 - rest) + shot * (mean - rest * ground)
        value = mean + sqrt(max(variance, 0.0)) * noise[at + u]
        pixels[line, u] = np.uint8(min(max(value + 0.5, 0.0), 255.0))


@kernel
def draw_ball(
    pixels: Image, lens: Point, ball: Seen, light: Point, noise: Array, start: int, window: Edges,
    work: Array,
) -> None:  # fmt: skip
    """Draw a ball over an image of what is behind it.

    Args:
        pixels: Image, overwritten where the ball is, shape (height, width).
        lens: As in the module's table.
        ball: As in the module's table.
        light: Level of the ball and read noise [grey levels], electrons a level.
        noise: Standard normal numbers, shape (n,).
        start: Where in it the image begins, which takes one number a pixel.
        window: First and last row that are drawn, and two more numbers [px].
        work: As in the module's table, shape (SCRATCH + 2 width + 1,).
    """
    width = pixels.shape[1]
    k, lines, first, last = _lay_path(lens, ball, work, window)
    for row in range(first, last + 1):
        columns = _cover(work, width, lens, row, lines, k)
        if columns[1] >= columns[0]:
            _paint(pixels, row, columns, work, noise, start, light)


@kernel
def _blend(
    canvas: NDArray[np.float32], row: int, columns: tuple[int, int], work: Array, level: float
) -> None:
    """Mix a ball into pixels it covers in part or whole, without noise."""
    part, full, inside = SCRATCH, SCRATCH + canvas.shape[1], 0.0
    for u in range(columns[0], columns[1] + 1):
        inside += work[full + u]
        c = work[part + u] + inside
        work[part + u], work[full + u] = 0.0, 0.0
        canvas[row, u] = np.float32((1.0 - c) * canvas[row, u] + c * level)


@kernel
def blend_ball(
    canvas: NDArray[np.float32], lens: Point, ball: Seen, level: float, window: Edges, work: Array
) -> None:
    """As :func:`draw_ball`, on an image of real numbers without noise."""
    width = canvas.shape[1]
    k, lines, first, last = _lay_path(lens, ball, work, window)
    for row in range(first, last + 1):
        columns = _cover(work, width, lens, row, lines, k)
        if columns[1] >= columns[0]:
            _blend(canvas, row, columns, work, level)
