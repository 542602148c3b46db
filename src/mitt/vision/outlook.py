"""Where in the next image the eyes of one camera will look first.

A simulated camera need draw no more than that, as long as the target is found there again: what
the eyes then know is the same to the last bit.
"""

import numpy as np
from numpy.typing import NDArray

from mitt.jit import kernel
from mitt.signals import Array, Image
from mitt.vision.moments import Box
from mitt.vision.segmentation import (
    DU,
    DUE,
    DV,
    HEIGHT,
    LOST,
    RUNS,
    STATE,
    TOP,
    WILD,
    found_again,
    masks,
    pace,
)
from mitt.vision.window import ROWS

_EDGE = float(1 << 30)
"""Beyond every column [px]."""


@kernel
def field(memory: Array, settings: Array, window: NDArray[np.int64]) -> bool:
    """Cut a window down to what will be looked at first in the next image.

    Args:
        memory: As in the table of :mod:`mitt.vision.segmentation`.
        settings: As of :func:`mitt.vision.segmentation.pack_segmenter`, shape (6,).
        window: First and last row, first and last column, at entry of the image [px], shape (4,).

    Returns:
        Whether it has: not where the target is lost or the ground is to be measured.
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
    # The target is weighed a pixel beyond its rows, the ground seen three beyond its columns.
    top, left, right = int(memory[TOP]) + dv, int(first) + du, int(last) + du
    window[0] = max(window[0], top - reach - 1)
    window[1] = min(window[1], top + rows + reach)
    window[2] = max(window[2], left - reach - 3)
    window[3] = min(window[3], right + reach + 3)
    return True


@kernel
def suffices(pixels: Image, memory: Array, settings: Array, work: Box, weights: Array) -> bool:
    """Say whether the target will be found in the window that :func:`field` has cut.

    If so, :func:`mitt.vision.segmentation.watch` looks nowhere else. Only scratch is changed.

    Args:
        pixels: Image, true within that window, shape (height, width).
        memory: As in the table of :mod:`mitt.vision.segmentation`.
        settings: As of :func:`mitt.vision.segmentation.pack_segmenter`, shape (6,).
        work: Scratch, shape (WORK, 4).
        weights: Scratch, shape (7,).
    """
    old, new = masks(work)
    return bool(found_again(pixels, memory, settings, old, new, weights)[1] > 0)
