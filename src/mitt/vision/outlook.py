"""Where in the next image the eyes of one camera will look first.

A simulated camera need draw no more than that, as long as the target is found there again: what
the eyes then know is the same to the last bit.
"""

import numpy as np
from numpy.typing import NDArray

from mitt.jit import kernel
from mitt.signals import Array, Image
from mitt.views import view
from mitt.vision.background import subtract
from mitt.vision.moments import Box
from mitt.vision.segmentation import found_again
from mitt.vision.target import masks


@kernel
def suffices(
    pixels: Image,
    background: Image,
    difference: Image,
    window: NDArray[np.int64],
    memory: Array,
    settings: Array,
    work: Box,
    weights: Array,
) -> bool:
    """Say whether the target will be found in a window.

    If so, :func:`mitt.vision.segmentation.watch` looks nowhere else. Only scratch is changed.

    Args:
        pixels: Image, true within that window, shape (height, width).
        background: As for :func:`mitt.vision.segmentation.segment`.
        difference: As there.
        window: As :func:`mitt.vision.target.field` has cut it, shape (4,).
        memory: As in the table of :mod:`mitt.vision.target`.
        settings: As of :func:`mitt.vision.segmentation.pack_segmenter`, shape (6,).
        work: Scratch, shape (WORK, 4).
        weights: Scratch, shape (7,).
    """
    old, new = masks(work)
    shown = pixels
    if background.size == pixels.size and difference.size >= pixels.size:
        shown = view(difference, 0, pixels.shape)
        subtract(pixels, background, window, False, memory, shown)
    return bool(found_again(shown, memory, settings, old, new, weights)[1] > 0)
