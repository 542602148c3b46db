"""How a capsule of the arm is painted: a smooth edge, a lit side, a grain."""

from math import floor, sqrt
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from mitt.jit import kernel
from mitt.world.capsules import Edges, Point, Seen

Canvas: TypeAlias = NDArray[np.float32]
"""An image without noise [levels], shape (height, width)."""

LIT_FROM: Point = (-0.6, -0.8, 0.0)
"""Direction in the image, right and down, from which arm and hand are lit."""
GRAIN_SIZE = 5.0
"""Half a period of the arm's grain [px]."""


@kernel
def _wave(x: float) -> float:
    """Return a triangle wave of period 2 between -1 and 1."""
    return 2.0 * abs(x - 2.0 * floor(0.5 * x + 0.5)) - 1.0


@kernel
def _beside(
    u0: float, v0: float, du: float, dv: float, length: float, reach: float, row: int
) -> tuple[float, float]:
    """Return first and last column that may be within reach of a segment in a row."""
    begin, end = 0.0, length
    if abs(dv) > 1e-6:
        a, b = (row - reach - v0) / dv, (row + reach - v0) / dv
        begin, end = min(max(min(a, b), 0.0), length), min(max(a, b, 0.0), length)
    a, b = u0 + begin * du, u0 + end * du
    return min(a, b) - reach, max(a, b) + reach


@kernel
def paint_capsule(
    canvas: Canvas, lens: Point, seen: Seen, level: float, style: Point, window: Edges
) -> None:
    """Paint the hull of two discs with a smooth edge, a lit side and a grain.

    Args:
        canvas: Overwritten where the capsule is.
        lens: f_px, cu, cv [px].
        seen: The capsule, as in :mod:`mitt.world.capsules`.
        level: Its grey level.
        style: Relative shading, relative grain and phase of the grain [1].
        window: First and last row, first and last column [px].
    """
    f0, f1 = lens[0] / seen[2], lens[0] / seen[5]
    u0, v0, r0 = lens[1] + f0 * seen[0], lens[2] + f0 * seen[1], f0 * seen[6]
    u1, v1, r1 = lens[1] + f1 * seen[3], lens[2] + f1 * seen[4], f1 * seen[6]
    if r0 < r1:
        u0, v0, r0, u1, v1, r1 = u1, v1, r1, u0, v0, r0
    du, dv = u1 - u0, v1 - v0
    length = sqrt(du * du + dv * dv)
    if length <= r0 - r1 + 1e-6:
        length, du, dv = 0.0, 0.0, 1.0
    else:
        du, dv = du / length, dv / length
    lean = (r0 - r1) / length if length > 0.0 else 0.0
    rise = sqrt(max(1.0 - lean * lean, 0.0))
    top, bottom = min(v0 - r0, v1 - r1) - 1.0, max(v0 + r0, v1 + r1) + 1.0
    west, east = min(u0 - r0, u1 - r1) - 1.0, max(u0 + r0, u1 + r1) + 1.0
    if length == 0.0:
        top, bottom, west, east = v0 - r0 - 1.0, v0 + r0 + 1.0, u0 - r0 - 1.0, u0 + r0 + 1.0
    first, last = int(max(top, float(window[0]))), int(min(bottom, float(window[1])))
    left, right = int(max(west, float(window[2]))), int(min(east, float(window[3])))
    for v in range(first, last + 1):
        near, far = _beside(u0, v0, du, dv, length, r0 + 1.0, v)
        begin, end = int(max(near, float(left))), int(min(far, float(right)))
        for u in range(begin, end + 1):
            x, y = u - u0, v - v0
            along, aside = x * du + y * dv, x * dv - y * du
            across = abs(aside)
            at = rise * along - lean * across
            if at <= 0.0:
                cover, r = r0 - sqrt(x * x + y * y), r0
            elif at >= rise * length:
                x, y = u - u1, v - v1
                cover, r = r1 - sqrt(x * x + y * y), r1
            else:
                cover, r = r0 - rise * across - lean * along, r0 + (r1 - r0) * along / length
                x, y = aside * dv, -aside * du
            cover = min(max(cover + 0.5, 0.0), 1.0)
            if cover > 0.0:
                lit = (x * LIT_FROM[0] + y * LIT_FROM[1]) / max(r, 0.5)
                grain = _wave(along / GRAIN_SIZE + style[2]) * _wave(aside / GRAIN_SIZE)
                paint = level * (1.0 + style[0] * lit + style[1] * grain)
                paint = min(max(paint, 0.0), 255.0)
                canvas[v, u] += np.float32(cover * (paint - canvas[v, u]))
