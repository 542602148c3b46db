"""What a camera sees without the ball, and what an image differs from it by.

The difference is the image, divided by the light of the instant relative to that of the background,
less the background; ``OFFSET`` stands for none. Where the ball's contrast is known, it is scaled so
that the ball weighs the same before any part of the background (:mod:`mitt.core.eyes.segmentation`,
whose table holds here). The background of a camera that turns is what its panorama has where it
looks (:mod:`mitt.core.eyes.panorama`); it goes on learning.
"""

from collections.abc import Sequence
from math import pi, sqrt

import numpy as np
from numpy.typing import NDArray

from mitt.core.eyes.blobs import EMPTY, Ints
from mitt.core.eyes.panorama import (
    PANORAMA,
    allow_beside,
    blank,
    cut_out,
    divided,
    fill_unseen,
    forget_directions,
    mean_ratio,
    record,
)
from mitt.core.kernels import Fields, Record, kernel, view
from mitt.core.signals import Image

MOST_FAULTS = 256
"""Faulty pixels of a camera that are mended: those that stand out most."""

OFFSET = 24.0
"""Grey level that stands for no difference; a choice of this project."""
RIM = 4
WINDOW = 24.0
APART = 16
"""Rows at the upper and lower rim of a window whose light is measured, by how much it is wider than
the ball, and every how many rows of a whole image [px]."""
LEAST = 0.25
"""Share of the ball's contrast with the mean background that it must have with the background at a
pixel; where it has less, as before a lamp or a white arm at rest, the pixel says nothing."""
PASSING = 10.0
"""Grey levels from the median of a pixel within which an image shows the background there."""
OUTSTANDING = 30.0
"""Grey levels by which a pixel of the background stands out of its neighbours that is a fault: hot
or dead, or a speck that hides what passes behind it just as well."""
ONE = 256
STRAY = 77
ODD = 24
FAINT = 40_000
"""Steps of a relative light of 1; how many a pixel may be off, and beyond that how many grey
levels, to tell the light; sum of squares below which the background is too dark to tell it."""
NEARLY = 20
CLOSE = 3.0
"""The same where the mean light is known: steps, and standard deviations of the background."""
SWEPT = 200
"""Looks after which a camera that turns has seen most of where it looks for balls."""
BESIDE = 4
"""What the panorama is not told beside a target [px]: its rim, and its smear."""
EVEN = 1e5
"""What light that is even weighs against slopes: pixels have noise, few say little [levels^2 px^2].
"""


@kernel
def whole_image(pixels: Image, window: Ints) -> None:
    """Write the window of the whole image."""
    window[0], window[1], window[2], window[3] = 0, pixels.shape[0] - 1, 0, pixels.shape[1] - 1


@kernel
def _mean_light(
    pixels: Image, background: Image, window: Ints, whole: bool, target: Fields
) -> float:
    """Return the light of an image over that of the background [1]; that of before if it is dark.

    By least squares on the rim of a window, where the target is not, or on some rows of an image.
    """
    top, bottom = window[0], window[1]
    before = target.light if target.light > 0.0 else 1.0
    both, own, row, expected = 0, 0, top, round(ONE * before)
    while row <= bottom:
        if not whole and top + RIM <= row <= bottom - RIM:
            row = bottom - RIM + 1
        for u in range(window[2], window[3] + 1):
            b, p = int(background[row, u]), int(pixels[row, u])
            if abs(ONE * p - expected * b) < STRAY * b + ONE * ODD:
                both += p * b
                own += b * b
        row += APART if whole else 1
    if own < FAINT:
        return float(before)
    return float(min(max(both / own, 0.3), 3.0))


@kernel
def light_of(
    pixels: Image, background: Image, window: Ints, whole: bool, target: Fields
) -> tuple[float, float, float]:
    """Return the light of an image over that of the background, and how it changes along u and v.

    A plane through the rim of a window, as the edge of a shadow is soft, and the rows of a rolling
    shutter see lamps that flicker one after the other; what is as far from the mean light as an arm
    that moved does not count. The light of a whole image is taken to be even.

    Returns:
        Light in the middle of the window [1] and its slopes [1/px].
    """
    mean: float = _mean_light(pixels, background, window, whole, target)
    if whole:
        return mean, 0.0, 0.0
    top, bottom = window[0], window[1]
    u0, v0 = 0.5 * (window[2] + window[3]), 0.5 * (top + bottom)
    row, expected, close = top, round(ONE * mean), round(ONE * CLOSE * target.noise)
    own, a, b, aa, ab, bb, rest, pa, pb = 0.0, 0.0, 0.0, EVEN, 0.0, EVEN, 0.0, 0.0, 0.0
    while row <= bottom:
        if top + RIM <= row <= bottom - RIM:
            row = bottom - RIM + 1
        s0, s1, s2, p0, p1 = 0, 0, 0, 0, 0
        for u in range(window[2], window[3] + 1):
            behind, x = int(background[row, u]), u - window[2]
            off = ONE * int(pixels[row, u]) - expected * behind
            if abs(off) < NEARLY * behind + close:
                square, product = behind * behind, off * behind
                s0 += square
                s1 += square * x
                s2 += square * x * x
                p0 += product
                p1 += product * x
        y, x0 = row - v0, window[2] - u0
        along, product = s1 + x0 * s0, p1 + x0 * p0
        own += s0
        a += along
        aa += s2 + x0 * (2.0 * s1 + x0 * s0)
        ab += y * along
        b += y * s0
        bb += y * y * s0
        rest += p0
        pa += product
        pb += y * p0
        row += 1
    if own < FAINT:
        return mean, 0.0, 0.0
    aa, ab, bb = aa - a * a / own, ab - a * b / own, bb - b * b / own
    pa, pb = (pa - a * rest / own) / ONE, (pb - b * rest / own) / ONE
    det = aa * bb - ab * ab
    along_u, along_v = (pa * bb - pb * ab) / det, (pb * aa - pa * ab) / det
    light = expected / ONE + rest / ONE / own - (a * along_u + b * along_v) / own
    return float(min(max(light, 0.3), 3.0)), along_u, along_v


@kernel
def background_of(pixels: Image, background: Image, difference: Image, target: Fields) -> Image:
    """Return what an image should show without the ball, within what was subtracted last."""
    if target.turns == 0:
        return background
    return view(difference, pixels.size, pixels.shape)


@kernel
def _lay_out(
    pixels: Image, panorama: Image, window: Ints, target: Fields, difference: Image
) -> None:
    """Write what a camera that turns should see, within a window; see :func:`background_of`.

    What lies where it never looked is not new, or it would turn to lamps; but for the first looks,
    and while it follows something, or a ball is expected.
    """
    part, laid = (
        view(difference, 2 * pixels.size, pixels.shape),
        view(difference, pixels.size, pixels.shape),
    )
    light = target.light if target.light > 0.0 else 1.0
    cut_out(panorama, (target.turn_v, target.turn_u), window, part)
    as_seen = target.looks > SWEPT and target.expected == 0.0 and target.state == 0
    fill_unseen(part, pixels, light, window, as_seen)
    allow_beside(part, pixels, light, window, laid)


@kernel
def error_by_light(target: Fields) -> float:
    """Return by how much noise in the slope of light moves the centroid of a ball, 1 sigma [px].

    The light is known from the rim of a window, and a slope of it brightens a side of the ball: a
    large one before a dark wall feels it most. The contrast of the ball is to be known.
    """
    radius = sqrt(target.moments.area / pi)
    wide = 2.0 * radius + WINDOW
    slope = target.noise / (max(target.mean, 1.0) * sqrt(RIM * wide * wide * wide / 6.0))
    level = abs(1.0 + target.sign * target.mean / max(target.gain, 1.0))
    return float(0.25 * slope * radius * radius * level)


@kernel
def subtract(
    pixels: Image, background: Image, window: Ints, whole: bool, target: Fields, scratch: Image
) -> float:
    """Write the difference image within a window, which may be the whole image; return the light.

    Only ``scratch``, which begins with the difference image, is changed.
    """
    difference = view(scratch, 0, pixels.shape)
    if target.turns > 0:
        _lay_out(pixels, background, window, target, scratch)
    background = background_of(pixels, background, scratch, target)
    light, along_u, along_v = light_of(pixels, background, window, whole, target)
    known = target.weighed > 0.0 and target.expected > 0.0
    contrast, side = target.gain if known else 0.0, -1.0 if target.sign < 0 else 1.0
    offset = np.float32(OFFSET + 0.5)
    zero, top, sign = np.float32(0.0), np.float32(255.0), np.float32(side)
    full, ball = np.float32(contrast), np.float32(target.mean + side * contrast)
    least, first, end = np.float32(LEAST * contrast), window[2], window[3] + 1
    either = target.sign == 0 and not known
    u0, v0 = 0.5 * (window[2] + window[3]), 0.5 * (window[0] + window[1])
    for v in range(window[0], window[1] + 1):
        seen, behind, out = pixels[v, first:end], background[v, first:end], difference[v, first:end]
        here = max(light + along_v * (v - v0), 0.1)
        change = np.float32(-along_u / (here * here))
        scale = np.float32(1.0 / here + along_u / (here * here) * (u0 - first))
        for k in range(len(out)):
            b = np.float32(behind[k])
            d = np.float32(seen[k]) * (scale + change * np.float32(k)) - b
            if known:  # np.divide does not test for zero
                d = np.divide(d * full, ball - b) if abs(ball - b) > least else zero
            else:
                d = abs(d) if either else sign * d
            out[k] = np.uint8(min(max(d + offset, zero), top))
    _mend(window, target, difference)
    return float(light)


@kernel
def _mend(window: Ints, target: Fields, difference: Image) -> None:
    """Write the mean of its neighbours into each faulty pixel of a window."""
    for k in range(target.faults):
        row, column = target.fault_v[k], target.fault_u[k]
        if not (window[0] <= row <= window[1] and window[2] <= column <= window[3]):
            continue
        total, count = 0, 0
        for v, u in (
            (row - 1, column),
            (row + 1, column),
            (row, column - 1),
            (row, column + 1),
        ):
            if window[0] <= v <= window[1] and window[2] <= u <= window[3]:
                total += difference[v, u]
                count += 1
        if count > 0:
            difference[row, column] = np.uint8(total // count)


def faulty_pixels(background: Image) -> NDArray[np.int64]:
    """Return row and column of pixels that stand out of their neighbours, shape (2, k).

    Hot and dead pixels of the sensor, one or two side by side: a pixel that is brighter, or darker,
    than all but one of those about it. Not more than ``MOST_FAULTS``, those that stand out most.
    """
    padded = np.pad(background.astype(np.float64), 1, mode="edge")
    height, width = background.shape
    around = [
        padded[1 + dv : 1 + dv + height, 1 + du : 1 + du + width]
        for dv in (-1, 0, 1)
        for du in (-1, 0, 1)
        if dv or du
    ]
    ordered = np.sort(around, axis=0)
    off = np.maximum(background - ordered[-2], ordered[1] - background)
    most = np.argsort(-off, axis=None, kind="stable")[:MOST_FAULTS]
    places = np.array(np.unravel_index(most[off.ravel()[most] > OUTSTANDING], off.shape))
    return places.astype(np.int64)


def keep_background(target: Record, background: Image) -> None:
    """Note in the record of a camera's target that its background was learned.

    Args:
        target: A record of ``TARGET``, overwritten.
        background: Mean image without the ball.
    """
    target["learned"], target["sign"] = 1, 0
    keep_faults(target, background)


def keep_faults(target: Record, background: Image) -> None:
    """Note which pixels of a camera stand out of their neighbours in an image without the ball."""
    places = faulty_pixels(background)
    target["faults"] = places.shape[1]
    target["fault_v"][: places.shape[1]], target["fault_u"][: places.shape[1]] = places


def mean_background(images: Sequence[Image]) -> Image:
    """Return what images of a scene have in common: what passes through some of them is left out.

    The mean, in each pixel, of the values near the median: a ball, or a person, that covers a pixel
    in less than half of the images does not count.

    Args:
        images: Images of one shape, at least one.
    """
    stack = np.asarray(images, dtype=np.float32)
    middle = np.median(stack, axis=0)
    near = np.abs(stack - middle) <= PASSING
    mean = np.sum(stack * near, axis=0) / np.maximum(near.sum(axis=0), 1)
    return np.asarray(np.rint(np.where(near.any(axis=0), mean, middle)), dtype=np.uint8)


@kernel
def is_learned(pixels: Image, background: Image, difference: Image, target: Fields) -> bool:
    """Return whether there is a background to subtract, and room for the difference."""
    if target.turns > 0:
        small = max(pixels.shape[0], pixels.shape[1]) <= PANORAMA
        room = difference.size >= 3 * pixels.size
        return bool(small and room and background.size == PANORAMA * PANORAMA)
    fits = background.size == pixels.size and difference.size >= pixels.size
    return bool(fits and target.learned > 0)


@kernel
def searched_difference(
    pixels: Image, background: Image, difference: Image, target: Fields, window: Ints, whole: bool
) -> Image:
    """Return what is searched of an image: within a window, or in all of it, its difference.

    The image itself where no background was learned. Light and mean go into ``target``.
    """
    if not is_learned(pixels, background, difference, target):
        return pixels
    shown = view(difference, 0, pixels.shape)
    if whole:
        whole_image(pixels, window)
    target.light = subtract(pixels, background, window, whole, target, difference)
    if whole and target.weighed == 0.0:  # what was learned of the ball refers to it
        target.mean = np.mean(background_of(pixels, background, difference, target)[::APART])
    return shown


@kernel
def _include(window: Ints, u: float, v: float, reach: float) -> None:
    """Widen a window to what lies within a reach of a place."""
    window[0], window[1] = min(window[0], int(v - reach)), max(window[1], int(v + reach))
    window[2], window[3] = min(window[2], int(u - reach)), max(window[3], int(u + reach))


@kernel
def _window_of(target: Fields, shape: tuple[int, int], window: Ints) -> None:
    """Write the part of an image in which the ball is or may be; none: empty.

    Its mask may leave a part of it out, and of what may be a ball a part may lie in directions that
    were never seen.
    """
    window[0], window[1], window[2], window[3] = EMPTY, -EMPTY, EMPTY, -EMPTY
    known = target.expected > 0.0
    rim = sqrt((target.expected if known else 4.0 * target.usual) / pi) + BESIDE
    if known:
        _include(window, target.at_u, target.at_v, rim + target.near if target.state == 0 else rim)
    if target.state != 0:
        _include(window, target.u, target.v, rim)
        for k in range(target.height):
            if target.runs[0, k] <= target.runs[1, k]:
                _include(window, target.runs[0, k], target.top + k, BESIDE)
                _include(window, target.runs[1, k], target.top + k, BESIDE)
    window[0], window[1] = max(window[0], 0), min(window[1], shape[0] - 1)
    window[2], window[3] = max(window[2], 0), min(window[3], shape[1] - 1)


@kernel
def remember_turned(
    pixels: Image, panorama: Image, scratch: Image, target: Fields, window: Ints
) -> None:
    """Let the panorama of a camera that turns follow its image, but for where its target is."""
    part, seen = view(scratch, 2 * pixels.size, pixels.shape), view(scratch, 0, pixels.shape)
    turn = target.turn_v, target.turn_u
    whole_image(pixels, window)
    cut_out(panorama, turn, window, part)
    _window_of(target, pixels.shape, window)
    blank(part, window)
    scale = 1.0 / mean_ratio(pixels, part, target.light if target.light > 0.0 else 1.0)
    for v in range(pixels.shape[0]):
        new, out = pixels[v], seen[v]
        for u in range(len(new)):
            out[u] = divided(new[u], scale)
    blank(seen, window)
    whole_image(pixels, window)
    _mend(window, target, seen)
    record(panorama, turn, seen)


@kernel
def take_for_wall(
    pixels: Image, panorama: Image, scratch: Image, target: Fields, window: Ints
) -> None:
    """Take what a camera that turns follows for what lies there: it rests."""
    _window_of(target, pixels.shape, window)
    forget_directions(panorama, (target.turn_v, target.turn_u), window)
    target.state = 0
    remember_turned(pixels, panorama, scratch, target, window)


@kernel
def level_behind(background: Image, target: Fields) -> float:
    """Return the mean level of the background where a target is, about as large as it."""
    half = int(sqrt(target.area / pi))
    row, column, total, count = round(target.v), round(target.u), 0.0, 0
    for v in range(max(row - half, 0), min(row + half + 1, background.shape[0])):
        for u in range(max(column - half, 0), min(column + half + 1, background.shape[1])):
            total += background[v, u]
            count += 1
    return total / count if count > 0 else float(target.mean)
