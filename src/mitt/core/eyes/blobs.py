"""Bright pixels that hang together: as runs of a mask, and their moments.

| here          | meaning                                                     | unit | shape  |
|---------------|-------------------------------------------------------------|------|--------|
| ``runs``      | first and last column of each row; first > last: empty row  | px   | (2, k) |
| ``top, rows`` | row of the image in which runs begin, and how many they are | px   |        |
| ``threshold`` | level that bright pixels exceed                             | grey |        |
| ``moments``   | record of ``MOMENTS``                                       |      |        |

Images are of shape (height, width).
"""

from math import pi, sqrt

import numpy as np
from numpy.typing import NDArray

from mitt.core.kernels import Fields, kernel
from mitt.core.signals import Image

Ints = NDArray[np.int64]

ROWS = 256
"""Rows of the tallest target [px]."""

MOMENTS = np.dtype([(name, float) for name in ("mass", "u", "v", "uu", "uv", "vv", "area")])
"""Mass [grey levels], centroid [px], central second moments [px^2] and area [px^2] of a target."""

STRETCH = 2.2
SPREAD = 1.35
JUDGED = 20.0
"""Ratio of the principal second moments, and their sum over that of a disc of the same area, above
which a target is no ball alone (a smear of one radius gives 1.33 and 1.01); area below which pixels
say too little about a shape [px^2]."""
EMPTY = 1 << 30
"""First column of an empty run, beyond every column [px]."""


@kernel
def dilate(old: Ints, rows: int, reach: int, shift: int, width: int, new: Ints) -> None:
    """Write the runs of a mask dilated by ``reach`` every way and shifted along the rows.

    They are ``rows + 2 reach`` rows, the first ``reach`` rows above that of ``old``, cut to the
    width of the image.
    """
    for row in range(rows + 2 * reach):
        new[0, row], new[1, row] = EMPTY, -1
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
    pixels: Image, threshold: int, top: int, rows: int, runs: Ints, u0: int
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
    pixels: Image, row: int, threshold: int, near: tuple[int, int], bounds: tuple[int, int]
) -> tuple[int, int]:
    """Return the bright run of a row, within bounds, that touches another; an empty one if none."""
    first, last = bounds
    u, w = max(near[0], first), min(near[1], last)
    while u <= w and pixels[row, u] <= threshold:
        u += 1
    if u > w:
        return EMPTY, -1
    while pixels[row, w] <= threshold:
        w -= 1
    while u > first and pixels[row, u - 1] > threshold:
        u -= 1
    while w < last and pixels[row, w + 1] > threshold:
        w += 1
    return u, w


@kernel
def connect(pixels: Image, threshold: int, top: int, rows: int, runs: Ints, u0: int) -> int:
    """Cut runs back to the bright pixels that hang together, from their middle on.

    They begin near column ``u0``; rows outside the image become empty. Nothing is changed where
    nothing is bright.

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
                bounds = runs[0, k], runs[1, k]
                a, b = _spread(pixels, top + k, threshold, (a - 1, b + 1), bounds)
            else:
                a, b = EMPTY, -1
            runs[0, k], runs[1, k] = a, b
            filled += a <= b
            k += way
    return filled


@kernel
def trim(top: int, rows: int, runs: Ints) -> tuple[int, int]:
    """Drop empty rows above and below the runs; return their first row and how many are left."""
    first, last = rows, -1
    for k in range(rows):
        if runs[0, k] <= runs[1, k]:
            first, last = min(first, k), k
    for k in range(first, last + 1):
        runs[0, k - first], runs[1, k - first] = runs[0, k], runs[1, k]
    return top + first, max(last - first + 1, 0)


@kernel
def touches_border(shape: tuple[int, int], top: int, rows: int, runs: Ints) -> bool:
    """Return whether a target touches the border of the image."""
    if top <= 0 or top + rows >= shape[0] or rows == ROWS:
        return True
    for k in range(rows):
        if runs[0, k] <= runs[1, k] and (runs[0, k] <= 0 or runs[1, k] >= shape[1] - 1):
            return True
    return False


@kernel
def _around(pixels: Image, top: int, rows: int, runs: Ints, threshold: int, level: float) -> float:
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
    pixels: Image, top: int, rows: int, runs: Ints, threshold: int, level: float, moments: Fields
) -> bool:
    """Write the grey-weighted moments of runs, widened by a pixel every way.

    Pixels below the threshold count as they are, so that noise has no bias. ``level`` is that of
    the background, used where none is seen beside the target.

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
    moments.mass, moments.u, moments.v, moments.area = mass, origin + mu, top + mv, area
    moments.uu, moments.uv = uu / mass - mu * mu, uv / mass - mu * mv
    moments.vv = vv / mass - mv * mv
    return True


@kernel
def is_merged(moments: Fields) -> bool:
    """Tell by its second moments whether a target is more than one disc."""
    if moments.area < JUDGED:
        return False
    half = 0.5 * (moments.uu + moments.vv)
    gap = sqrt((0.5 * (moments.uu - moments.vv)) ** 2 + moments.uv**2)
    stretched = half + gap > STRETCH * max(half - gap, 1e-9)
    return bool(stretched or 4.0 * pi * half > SPREAD * moments.area)
