"""What is remembered of the target in the images of one camera, and where it is looked for next.

One row of numbers a camera; the names are their places.

| here                   | meaning                                              | unit        |
|------------------------|------------------------------------------------------|-------------|
| 0, 1                   | last centroid (u, v); NaN if there is none           | px          |
| ``LEVEL``, ``THRESHOLD`` | of the background, of a target                      | grey levels |
| ``DUE``                | frames since the background was measured               |             |
| ``DU``, ``DV``         | motion of the centroid                               | px a frame  |
| ``AREA``               | of the last target                                   | px^2        |
| ``STATE``              | LOST, GOOD, or MERGED and more: frames since merging |             |
| ``TOP``, ``HEIGHT``    | first row of the mask and its rows                   | px          |
| ``MARK``, ``FROZEN``   | mark of the last target, frames it has been the same |             |
| ``EXPECTED``           | area that the ball should have; 0 if unknown         | px^2        |
| ``MASS``               | of the last target that was the ball alone           | grey levels |
| ``GAIN``, ``WEIGHED``  | mass of the ball over that area, from how many frames| grey levels |
| ``AT_U``, ``AT_V``     | where the ball should be                             | px          |
| ``NEAR``               | how far from there it may be; 0 if unknown           | px          |
| ``LIGHT``, ``MEAN``    | of :mod:`mitt.vision.background`                     | 1, levels   |
| ``WEIGHTS``            | moments of the last target (:mod:`mitt.vision.window`) |           |
| ``OFF_U``, ``OFF_V``   | centroid less that of the ball where all cameras see it | px       |
| ``RUNS``               | the mask, first columns and then last columns        | px          |
"""

from math import pi, sqrt

import numpy as np
from numba.extending import register_jitable
from numpy.typing import NDArray

from mitt.jit import kernel
from mitt.signals import Array
from mitt.views import view
from mitt.vision.blobs import MAX_BLOBS, Box
from mitt.vision.camera import in_camera
from mitt.vision.window import ROWS, Runs

LEVEL, THRESHOLD, DUE, DU, DV, AREA, STATE, TOP, HEIGHT, MARK, FROZEN = range(2, 13)
EXPECTED, GAIN, WEIGHED, MASS, AT_U, AT_V, NEAR, LIGHT, MEAN, WEIGHTS = range(13, 23)
OFF_U, OFF_V, RUNS = 29, 30, 31
LOST, GOOD, MERGED = 0, 1, 2

MEMORY, WORK = RUNS + 2 * ROWS, MAX_BLOBS + 66 + ROWS
"""Sizes of a camera's memory and of the scratch array."""

WILD = 8
"""Reach while no motion is known, as on the first frame that a turning head gets [px]."""

_EDGE = float(1 << 30)
"""Beyond every column [px]."""


@kernel
def keep(memory: Array, top: int, rows: int, runs: Runs, area: float) -> None:
    """Keep a target's mask and area for the next frame."""
    memory[AREA], memory[TOP], memory[HEIGHT] = area, float(top), float(rows)
    for k in range(rows):
        memory[RUNS + k], memory[RUNS + ROWS + k] = float(runs[0, k]), float(runs[1, k])


@kernel
def pace(place: float, motion: float) -> int:
    """Return the whole pixels by which a motion moves a place; they add up over the frames."""
    return round(place + motion) - round(place)


@kernel
def region_of_interest(memory: Array, settings: Array, window: NDArray[np.int64]) -> bool:
    """Cut a window down to what will be searched first in the next image.

    Args:
        memory: As in the module's table.
        settings: As of :func:`mitt.vision.segmentation.pack_segmenter`, shape (6,).
        window: First and last row, first and last column, at entry of the image [px], shape (4,).

    Returns:
        Whether it has: not where the target is lost or the background is to be measured.
    """
    rows, reach = int(memory[HEIGHT]), max(int(settings[1]), WILD)
    if memory[STATE] == LOST or memory[DUE] == 0.0 or rows + 2 * reach > ROWS:
        return False
    du, dv = pace(memory[0], memory[DU]), pace(memory[1], memory[DV])
    first, last = _EDGE, -_EDGE
    for k in range(rows):
        if memory[RUNS + k] <= memory[RUNS + ROWS + k]:
            first, last = min(first, memory[RUNS + k]), max(last, memory[RUNS + ROWS + k])
    if first > last:
        return False
    # The target is weighed a pixel beyond its rows, the background three beyond its columns.
    top, left, right = int(memory[TOP]) + dv, int(first) + du, int(last) + du
    window[0] = max(window[0], top - reach - 1)
    window[1] = min(window[1], top + rows + reach)
    window[2] = max(window[2], left - reach - 3)
    window[3] = min(window[3], right + reach + 3)
    return True


@kernel
def expect(memory: Array, cameras: Array, radius: float, r: Array, reach: float) -> None:
    """Write where in each image the ball should be, and how large.

    Args:
        memory: A row a camera, as in the module's table; more rows are left alone.
        cameras: As in :mod:`mitt.vision.camera`.
        radius: Radius of the ball [m].
        r: Where it is estimated to be [m], shape (3,) or more.
        reach: How far from there it may be [m].
    """
    for n in range(cameras.shape[0]):
        x, y, z = in_camera(cameras[n], r)
        scale = cameras[n, 4, 0] / max(z, radius)
        memory[n, AT_U] = cameras[n, 4, 1] + scale * x
        memory[n, AT_V] = cameras[n, 4, 2] + scale * y
        memory[n, NEAR] = scale * reach
        far = sqrt(max(x * x + y * y + z * z - radius * radius, radius * radius))
        sine = radius / far
        memory[n, EXPECTED] = pi * (cameras[n, 4, 0] * sine) ** 2 * (far / max(z, radius)) ** 3


@register_jitable
def masks(work: Box) -> tuple[Runs, Runs]:
    """Return scratch for the masks of the last frame and of this one, shapes (2, ROWS)."""
    at = 4 * (WORK - ROWS)
    return view(work, at, (2, ROWS)), view(work, at + 2 * ROWS, (2, ROWS))


def forget(memory: Array) -> None:
    """Forget target and background, in the memory of one camera or of many, shape (..., MEMORY)."""
    memory[...] = 0.0
    memory[..., :2] = np.nan
