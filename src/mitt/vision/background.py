"""What an image shows beyond the background: the ball, whatever stands behind it and lights it.

A camera that stands still learns its background from images without the thrown ball, resting arm
included. A difference image is the image, divided by the light of the instant relative to that of
the background, minus the background, so a pattern, a resting ball and a bright arm at rest vanish.
A pixel that the ball covers in part shows a mixture of both; scaled by contrast / (ball - here), a
difference is that share, so the ball weighs the same before any background darker than itself.

| here           | meaning                                                    | unit   | shape  |
|----------------|------------------------------------------------------------|--------|--------|
| ``background`` | mean image without the ball; empty where none was learned  | levels | (h, w) |
| ``window``     | first and last row, first and last column                  | px     | (4,)   |
| ``memory``     | as in :mod:`mitt.vision.target`                            |        |        |
"""

import numpy as np
from numpy.typing import NDArray

from mitt.jit import kernel
from mitt.signals import Array, Image
from mitt.vision.target import EXPECTED, GAIN, LIGHT, MEAN, WEIGHED

OFFSET = 24.0
"""Grey level that stands for no difference; a choice of this project."""

RIM, APART = 4, 16
"""Rows at the upper and lower rim of a window whose light is measured, and every how many rows of a
whole image [px]."""

LEAST = 0.25
"""Share of the ball's contrast with the mean background that it must have with the background at a
pixel; where it has less, as before a lamp or a white arm at rest, the pixel says nothing."""

_ONE, _STRAY, _ODD, _FAINT = 256, 77, 24, 40_000
"""Steps of a relative light of 1; how many a pixel may be off, and beyond that how many grey
levels, to tell the light; sum of squares below which the background is too dark to tell it."""


@kernel
def _sums(
    pixels: Image, background: Image, row: int, left: int, right: int, light: int
) -> tuple[int, int]:
    """Return products of image and background, and squares of the background, in sum of a row."""
    both, own, line = 0, 0, np.uint64(row)  # unsigned: none counts from the end
    for u in range(np.uint64(left), np.uint64(right + 1)):
        b, p = int(background[line, u]), int(pixels[line, u])
        off = abs(_ONE * p - light * b)
        tells = off < _STRAY * b + _ONE * _ODD
        both += p * b if tells else 0
        own += b * b if tells else 0
    return both, own


@kernel
def light_of(
    pixels: Image, background: Image, window: NDArray[np.int64], whole: bool, memory: Array
) -> float:
    """Return the light of an image over that of the background [1].

    By least squares on the rim of a window, where the target is not, or on some rows of an image.
    """
    top, bottom, left, right = window[0], window[1], window[2], window[3]
    before = memory[LIGHT] if memory[LIGHT] > 0.0 else 1.0
    both, own, row, expected = 0, 0, top, round(_ONE * before)
    while row <= bottom:
        if not whole and top + RIM <= row <= bottom - RIM:
            row = bottom - RIM + 1
        more = _sums(pixels, background, row, left, right, expected)
        both, own = both + more[0], own + more[1]
        row += APART if whole else 1
    if own < _FAINT:
        return float(before)
    return float(min(max(both / own, 0.3), 3.0))


@kernel
def subtract(
    pixels: Image, background: Image, window: NDArray[np.int64], whole: bool, memory: Array,
    difference: Image,
) -> float:  # fmt: skip
    """Write the difference image within a window; return the light.

    Args:
        pixels: Image, true within the window.
        background: Of the camera, as large as the image.
        window: As in the module's table.
        whole: Whether that is the whole image.
        memory: As in the module's table, not changed.
        difference: Result, as large as the image.
    """
    light: float = light_of(pixels, background, window, whole, memory)
    known = memory[WEIGHED] > 0.0 and memory[EXPECTED] > 0.0
    contrast = memory[GAIN] if known else 0.0
    scale, offset = np.float32(1.0 / light), np.float32(OFFSET + 0.5)
    zero, top = np.float32(0.0), np.float32(255.0)
    full, ball = np.float32(contrast), np.float32(contrast + memory[MEAN])
    least = np.float32(LEAST * contrast)
    for v in range(np.uint64(window[0]), np.uint64(window[1] + 1)):
        for u in range(np.uint64(window[2]), np.uint64(window[3] + 1)):
            b = np.float32(background[v, u])
            d = np.float32(pixels[v, u]) * scale - b
            if known:
                room = ball - b  # np.divide: as IEEE does, without a test for zero
                d = np.divide(d * full, room) if room > least else zero
            difference[v, u] = np.uint8(min(max(d + offset, zero), top))
    return light


@kernel
def mean_of(background: Image) -> float:
    """Return the mean of some rows of a background [grey levels]."""
    total, count = 0, 0
    for v in range(0, background.shape[0], APART):
        for u in range(background.shape[1]):
            total += background[v, u]
        count += background.shape[1]
    return total / max(count, 1)
