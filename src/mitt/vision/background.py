"""What an image shows beyond the background: the ball, whatever is behind it and lights it.

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
from mitt.views import view
from mitt.vision.blobs import MAX_BLOBS, Box
from mitt.vision.target import DUE, EXPECTED, GAIN, LEVEL, LIGHT, MEAN, THRESHOLD, WEIGHED

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
def light_of(
    pixels: Image, background: Image, window: NDArray[np.int64], whole: bool, memory: Array
) -> float:
    """Return the light of an image over that of the background [1].

    By least squares on the rim of a window, where the target is not, or on some rows of an image.
    """
    top, bottom = window[0], window[1]
    before = memory[LIGHT] if memory[LIGHT] > 0.0 else 1.0
    both, own, row, expected = 0, 0, top, round(_ONE * before)
    while row <= bottom:
        if not whole and top + RIM <= row <= bottom - RIM:
            row = bottom - RIM + 1
        for u in range(window[2], window[3] + 1):
            b, p = int(background[row, u]), int(pixels[row, u])
            if abs(_ONE * p - expected * b) < _STRAY * b + _ONE * _ODD:
                both += p * b
                own += b * b
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
    least, first, end = np.float32(LEAST * contrast), window[2], window[3] + 1
    for v in range(window[0], window[1] + 1):
        seen, behind, out = pixels[v, first:end], background[v, first:end], difference[v, first:end]
        for k in range(len(out)):
            b = np.float32(behind[k])
            d = np.float32(seen[k]) * scale - b
            if known:  # np.divide does not test for zero
                d = np.divide(d * full, ball - b) if ball - b > least else zero
            out[k] = np.uint8(min(max(d + offset, zero), top))
    return light


@kernel
def show(
    pixels: Image, background: Image, difference: Image, memory: Array, window: NDArray[np.int64],
    whole: bool,
) -> Image:  # fmt: skip
    """Return what of an image is searched within a window: its difference from the background.

    The image itself where no background was learned. Light and mean go into the memory.
    """
    if background.size != pixels.size or difference.size < pixels.size:
        return pixels
    shown = view(difference, 0, pixels.shape)
    if whole:
        window[0], window[1], window[2], window[3] = 0, pixels.shape[0] - 1, 0, pixels.shape[1] - 1
        memory[MEAN] = np.mean(background[::APART])
    memory[LIGHT] = subtract(pixels, background, window, whole, memory, shown)
    return shown


@kernel
def measure_background(pixels: Image, counts: NDArray[np.int64], measured: Array) -> None:
    """Write level and noise of the background, from every third pixel of every third row.

    Mean and standard deviation of the values near the median: a ball or lamp does not count.

    Args:
        pixels: Image, shape (height, width).
        counts: Scratch, shape (256,).
        measured: Result: level and standard deviation [grey levels], shape (2,).
    """
    counts[:] = 0
    total = 0
    for v in range(min(1, pixels.shape[0] - 1), pixels.shape[0], 3):
        for u in range(min(1, pixels.shape[1] - 1), pixels.shape[1], 3):
            counts[pixels[v, u]] += 1
            total += 1
    low, middle, high, seen = 0, 0, 0, 0
    for value in range(256):
        if seen * 6 < total:
            low = value
        if seen * 2 < total:
            middle = value
        if seen * 6 < 5 * total:
            high = value
        seen += counts[value]
    reach = 2 * (high - low) + 2
    n, first, second = 0.0, 0.0, 0.0
    for value in range(max(middle - reach, 0), min(middle + reach, 255) + 1):
        d = float(value - middle)
        n += counts[value]
        first += counts[value] * d
        second += counts[value] * d * d
    measured[0] = middle + first / n
    measured[1] = np.sqrt(max(second / n - (first / n) ** 2, 0.0))


@kernel
def measure_if_due(shown: Image, memory: Array, settings: Array, work: Box) -> None:
    """Measure level and threshold of the background where that is due."""
    if memory[DUE] == 0.0:
        counts, measured = view(work, 4 * (MAX_BLOBS + 2), (256,)), view(memory, LEVEL, (2,))
        measure_background(shown, counts, measured)
        rise = max(settings[2], settings[3] * measured[1])
        memory[THRESHOLD] = min(measured[0] + rise, 255.0)
    memory[DUE] = (memory[DUE] + 1.0) % settings[4]
