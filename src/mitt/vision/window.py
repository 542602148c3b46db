"""Self-windowing: the target is what is bright and lies in the dilated target of the last frame.

The vision chip of Ishii and others (IEEE ICRA 1999) works so. It keeps a mask, here kept
as one run of pixels a row, first and last column: the same for a target whose rows are unbroken, as
those of a ball are. What is beside the target is never looked at, however bright; nor is what
reaches into the dilated mask without touching the target, which the chip would include. What
touches the target shows in its moments.

| here        | meaning                                                    | unit | shape   |
|-------------|------------------------------------------------------------|------|---------|
| ``runs``    | first and last column of each row; first > last: empty row | px   | (2, k)  |
| ``weights`` | mass [grey], centroid (u, v) [px], central moments uu, uv, |      | (7,)    |
|             | vv [px^2] and area [px^2] of a target                      |      |         |
"""

from math import pi, sqrt

import numpy as np
from numpy.typing import NDArray

from mitt.jit import kernel
from mitt.signals import Array, Image

Runs = NDArray[np.int64]

ROWS = 256
"""Rows of the tallest target."""

_EMPTY = 1 << 30

STRETCH, SPREAD = 2.2, 1.35
"""Ratio of the principal second moments, and their sum over that of a disc of the same area, above
which a target is no ball alone; a smear of one radius gives 1.33 and 1.01."""

_JUDGED = 20.0
"""Area below which pixels say too little about a shape [px^2]."""


@kernel
def dilate(old: Runs, rows: int, reach: int, shift: int, width: int, new: Runs) -> None:
    """Write the runs of a mask dilated by a square and shifted along the rows.

    Args:
        old: Runs of ``rows`` rows.
        rows: Rows of the mask.
        reach: Pixels to dilate by, every way.
        shift: Columns to shift by.
        width: Columns of the image.
        new: Result, ``rows + 2 reach`` rows, the first ``reach`` rows above that of ``old``.
    """
    for row in range(rows + 2 * reach):
        new[0, row], new[1, row] = _EMPTY, -1
    for k in range(rows):
        first, last = old[0, k], old[1, k]
        if first <= last:
            for row in range(k, k + 2 * reach + 1):
                new[0, row], new[1, row] = min(new[0, row], first), max(new[1, row], last)
    for row in range(rows + 2 * reach):
        if new[1, row] >= 0:
            new[0, row] = max(new[0, row] + shift - reach, 0)
            new[1, row] = min(new[1, row] + shift + reach, width - 1)


@kernel
def _seed(
    pixels: Image, threshold: int, top: int, rows: int, runs: Runs, u0: int
) -> tuple[int, int]:
    """Return the run nearest to the middle one that holds a bright pixel, and its column.

    The pixel nearest to column ``u0`` is taken; (-1, 0) if nothing is bright.
    """
    for step in range(2 * rows):
        k = rows // 2 + (step + 1) // 2 * (1 - 2 * (step % 2))
        if k < 0 or k >= rows or top + k < 0 or top + k >= pixels.shape[0]:
            continue
        first, last = runs[0, k], runs[1, k]
        for away in range(max(u0 - first, last - u0) + 1):
            for u in (u0 - away, u0 + away):
                if first <= u <= last and pixels[top + k, u] > threshold:
                    return k, u
    return -1, 0


@kernel
def _spread(
    pixels: Image, row: int, threshold: int, a: int, b: int, first: int, last: int
) -> tuple[int, int]:
    """Return the bright run in first..last of a row that touches a..b; an empty one if none."""
    u, w = max(a, first), min(b, last)
    while u <= w and pixels[row, u] <= threshold:
        u += 1
    if u > w:
        return _EMPTY, -1
    while pixels[row, w] <= threshold:
        w -= 1
    while u > first and pixels[row, u - 1] > threshold:
        u -= 1
    while w < last and pixels[row, w + 1] > threshold:
        w += 1
    return u, w


@kernel
def connect(pixels: Image, threshold: int, top: int, rows: int, runs: Runs, u0: int) -> int:
    """Cut runs back to the bright pixels that hang together, from their middle on.

    Args:
        pixels: Image, shape (height, width).
        threshold: Grey value that a target exceeds.
        top: Row of the image in which the runs begin; rows outside the image become empty.
        rows: Rows of the runs.
        runs: Overwritten, unless nothing is bright.
        u0: Column at which the target should be.

    Returns:
        How many rows still hold something.
    """
    seed, u = _seed(pixels, threshold, top, rows, runs, u0)
    if seed < 0:
        return 0
    filled = 0
    for way in (1, -1):
        k, a, b = (seed, u, u) if way == 1 else (seed - 1, runs[0, seed], runs[1, seed])
        while 0 <= k < rows:
            if a <= b and 0 <= top + k < pixels.shape[0]:
                a, b = _spread(pixels, top + k, threshold, a - 1, b + 1, runs[0, k], runs[1, k])
            else:
                a, b = _EMPTY, -1
            runs[0, k], runs[1, k] = a, b
            filled += a <= b
            k += way
    return filled


@kernel
def trim(top: int, rows: int, runs: Runs) -> tuple[int, int]:
    """Drop empty rows above and below the runs; return their first row and how many are left."""
    first, last = rows, -1
    for k in range(rows):
        if runs[0, k] <= runs[1, k]:
            first, last = min(first, k), k
    for k in range(first, last + 1):
        runs[0, k - first], runs[1, k - first] = runs[0, k], runs[1, k]
    return top + first, max(last - first + 1, 0)


@kernel
def _around(pixels: Image, top: int, rows: int, runs: Runs, threshold: int, level: float) -> float:
    """Return the level of the background two and three pixels beside the runs, or ``level``."""
    width, total, count = pixels.shape[1], 0.0, 0
    for k in range(rows):
        if runs[0, k] > runs[1, k]:
            continue
        for u in (runs[0, k] - 3, runs[0, k] - 2, runs[1, k] + 2, runs[1, k] + 3):
            if 0 <= u < width and pixels[top + k, u] <= threshold:
                total += pixels[top + k, u]
                count += 1
    return total / count if count >= 4 else level


@kernel
def weigh(
    pixels: Image, top: int, rows: int, runs: Runs, threshold: int, level: float, weights: Array
) -> bool:
    """Write the grey-weighted moments of runs, widened by a pixel every way.

    Pixels below the threshold count as they are, so that noise has no bias.

    Args:
        pixels: Image, shape (height, width).
        top: Row of the image in which the runs begin.
        rows: Rows of the runs.
        runs: The target.
        threshold: Grey value that a target exceeds.
        level: Grey level of the background, used where none is seen beside the target.
        weights: Result, as in the module's table.

    Returns:
        Whether there is any mass, and its centroid lies in the image: that of a target as dark as
        the background may lie anywhere.
    """
    height, width = pixels.shape
    level = _around(pixels, top, rows, runs, threshold, level)
    area, mass, mu, mv, uu, uv, vv = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    origin = 0
    for k in range(-1, rows + 1):
        v = top + k
        near = min(max(k, 0), rows - 1)
        if v < 0 or v >= height or runs[0, near] > runs[1, near]:
            continue
        first, last = max(runs[0, near] - 1, 0), min(runs[1, near] + 1, width - 1)
        if area == 0.0:
            origin = first
        n, above, s0, s1, s2 = float(last - first + 1), 0, 0.0, 0.0, 0.0
        for u in range(first, last + 1):
            p, x = float(pixels[v, u]), float(u - first)
            above += pixels[v, u] > threshold
            s0 += p
            s1 += p * x
            s2 += p * x * x
        s0 -= level * n
        s1 -= level * 0.5 * n * (n - 1.0)
        s2 -= level * (n - 1.0) * n * (2.0 * n - 1.0) / 6.0
        area += above if k == near else 0.0
        x, y = float(first - origin), float(k)
        mass += s0
        mu += s1 + x * s0
        mv += y * s0
        uu += s2 + 2.0 * x * s1 + x * x * s0
        uv += y * (s1 + x * s0)
        vv += y * y * s0
    if not (mass > 0.0 and area > 0.0):
        return False
    mu, mv = mu / mass, mv / mass
    if not (0.0 <= origin + mu <= width - 1.0 and 0.0 <= top + mv <= height - 1.0):
        return False
    weights[0], weights[1], weights[2], weights[6] = mass, origin + mu, top + mv, area
    weights[3], weights[4] = uu / mass - mu * mu, uv / mass - mu * mv
    weights[5] = vv / mass - mv * mv
    return True


@kernel
def is_merged(weights: Array) -> bool:
    """Tell by its second moments whether a target is more than one disc."""
    area = weights[6]
    if area < _JUDGED:
        return False
    half = 0.5 * (weights[3] + weights[5])
    gap = sqrt((0.5 * (weights[3] - weights[5])) ** 2 + weights[4] ** 2)
    stretched = half + gap > STRETCH * max(half - gap, 1e-9)
    return bool(stretched or 4.0 * pi * half > SPREAD * area)
