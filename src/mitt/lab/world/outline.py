"""A ball's outline painted on a canvas: how much of each pixel it covers while it moves.

The outline of a sphere is the cone of rays that touch it, cut by the image plane: exactly an
ellipse. Each pixel row is cut into lines; along a line the covered interval follows from a
quadratic, so coverage is exact across columns and a midpoint rule down the rows. Motion blur:
the lines take turns at the instants of the exposure, so it costs nothing more.

| here   | meaning                                                              | unit | shape |
|--------|----------------------------------------------------------------------|------|-------|
| lens   | f_px, cu, cv                                                         | px   | 3     |
| ball   | centre in the optical frame at begin and end of the exposure, radius | m    | 7     |
| window | first and last row, first and last column that are drawn             | px   | 4     |

What has a number for a shape is a tuple.
"""

from math import ceil, floor, sqrt
from typing import NamedTuple

import numpy as np

from mitt.core.kernels import kernel
from mitt.core.signals import Array
from mitt.lab.world.capsules import Canvas, Edges, Point, Seen

LINES = 16
SMALL = 12.0
"""Lines a pixel row, half as many for discs above that radius [px]; the centroid of a 1 px disc
is then that of exact areas to 0.005 px."""

INSTANTS = 8
"""Most instants that stand for an exposure; one stands for a smear of 0.25 px or less."""

#: The outline is where it is to far better than this [px].
_SLACK = 1e-3


class PaintScratch(NamedTuple):
    """Scratch of :func:`paint_ball` for images up to a width w.

    Attributes:
        left, right: Where the lines of a row begin and end to be covered [px], those of an instant
            side by side, shape (LINES,).
        path: A row an instant: centre [m], D = its square less that of the radius, A = D - x^2
            [m^2], f_px / A, shape (INSTANTS, 6).
        part: Covered share of each pixel of a row, zero at entry and exit, shape (w,).
        full: What begins and ends to cover whole pixels, the same.
    """

    left: Array
    right: Array
    path: Array
    part: Array
    full: Array


def scratch_for(width: int) -> PaintScratch:
    """Return scratch for images up to a width [px]."""
    lines, pixels = (LINES,), (width,)
    path = np.zeros((INSTANTS, 6))
    return PaintScratch(np.zeros(lines), np.zeros(lines), path, np.zeros(pixels), np.zeros(pixels))


@kernel
def _intersect(
    work: PaintScratch, j: int, k: int, lens: Point, far: float, row: int, lines: int
) -> None:
    """Write where the lines of a row that have the j-th of k instants begin and end to be covered.

    A ray (a, b, 1) meets the ball, centre c, where ((a, b, 1) . c)^2 >= (a^2 + b^2 + 1) D: on a
    line of constant b, between the roots of a quadratic in a; -1 is the end where there are none.
    ``far`` is the right end of the image.
    """
    path, left, right, share, per = work.path, work.left, work.right, 1.0 / lines, lines // k
    x, y, z, D, A, scale = path[j, 0], path[j, 1], path[j, 2], path[j, 3], path[j, 4], path[j, 5]
    f, cu, cv = lens
    start, pace, first = (row - 0.5 + 0.5 * share - cv) / f, share / f, np.uint64(j * per)
    for i in range(np.uint64(per)):
        b = start + (np.int64(i) * k + j) * pace
        s = b * y + z
        disc = x * x * s * s + A * (s * s - (b * b + 1.0) * D)
        root = sqrt(max(disc, 0.0))
        left[first + i] = max((x * s - root) * scale + cu, -0.5)
        right[first + i] = min((x * s + root) * scale + cu, far) if disc > 0.0 else -1.0


@kernel
def _cover(
    work: PaintScratch, width: int, lens: Point, row: int, lines: int, k: int
) -> tuple[int, int]:
    """Write the covered share of each pixel of a row; return its first and last column."""
    part, full, begins, ends = work.part, work.full, work.left, work.right
    per, share, edge = lines // k, 1.0 / lines, 0
    for j in range(k):
        _intersect(work, j, k, lens, width - 0.5, row, lines)
    first, last = width, -1
    for _ in range(lines):
        left, right = begins[edge], ends[edge]
        # As the lines come down the row, whose instants take turns.
        edge = edge + per if edge + per < lines else edge + per - lines + 1
        if right <= left:
            continue
        u0, u1 = int(left + 0.5), min(int(right + 0.5), width - 1)
        if u0 == u1:
            part[u0] += share * (right - left)
        else:
            part[u0] += share * (u0 + 0.5 - left)
            part[u1] += share * (right - u1 + 0.5)
            full[u0 + 1] += share
            full[u1] -= share
        first, last = min(first, u0), max(last, u1)
    return first, last


@kernel
def _lay_path(lens: Point, ball: Seen, path: Array, window: Edges) -> tuple[int, int, int, int]:
    """Write the ball's places during the exposure, as of ``Scratch``.

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
        share = (j + 0.5) / k
        x, y, z = x0 + share * (x1 - x0), y0 + share * (y1 - y0), z0 + share * (z1 - z0)
        D = x * x + y * y + z * z - R * R
        path[j, 0], path[j, 1], path[j, 2] = x, y, z
        path[j, 3], path[j, 4], path[j, 5] = D, D - x * x, f / (D - x * x)
        side, depth = R * sqrt(y * y + z * z - R * R), z * z - R * R
        low = min(low, cv + f * (y * z - side) / depth)
        high = max(high, cv + f * (y * z + side) / depth)
    low, high = floor(low + 0.5 - _SLACK), ceil(high - 0.5 + _SLACK)
    first = int(min(max(low, float(window[0])), float(window[1] + 1)))
    return k, max(lines, k), first, int(min(max(high, -1.0), float(window[1])))


@kernel
def paint_ball(
    canvas: Canvas, lens: Point, ball: Seen, level: float, window: Edges, work: PaintScratch
) -> None:
    """Mix a ball of a grey level into the pixels that it covers in part or whole.

    Args:
        canvas: An image without noise, overwritten where the ball is, shape (height, width).
        lens: As in the module's table, as are ``ball`` and ``window``.
        ball: The ball.
        level: Its grey level.
        window: Its rows alone count.
        work: Scratch.
    """
    width, part, full = canvas.shape[1], work.part, work.full
    k, lines, first, last = _lay_path(lens, ball, work.path, window)
    for row in range(first, last + 1):
        left, right = _cover(work, width, lens, row, lines, k)
        inside = 0.0
        for u in range(left, right + 1):
            inside += full[u]
            c = part[u] + inside
            part[u], full[u] = 0.0, 0.0
            canvas[row, u] = np.float32((1.0 - c) * canvas[row, u] + c * level)
