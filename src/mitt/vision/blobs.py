"""Targets anywhere in an image: groups of touching pixels above a threshold.

Their moments: :mod:`mitt.vision.window`.
"""

import numpy as np
from numpy.typing import NDArray

from mitt.jit import kernel
from mitt.signals import Image

Box = NDArray[np.int64]

MAX_BLOBS = 16
"""Groups looked at in one image; more is noise, not a ball."""


@kernel
def _row_has(pixels: Image, row: int, u0: int, u1: int, threshold: int) -> bool:
    """Return whether a pixel of columns u0..u1 of ``row`` lies above the threshold."""
    line = pixels[row, u0 : u1 + 1]  # a slice, so that the loop below becomes vector code
    top = np.uint8(0)
    for k in range(line.shape[0]):
        top = max(top, line[k])
    return bool(top > threshold)


@kernel
def _grow(pixels: Image, threshold: int, box: Box) -> None:
    """Widen ``box`` (u0, v0, u1, v1) until no pixel around it lies above the threshold."""
    height, width = pixels.shape
    grown = True
    while grown:
        grown = False
        u0, u1 = max(box[0] - 1, 0), min(box[2] + 1, width - 1)
        v0, v1 = max(box[1] - 1, 0), min(box[3] + 1, height - 1)
        if v0 < box[1] and _row_has(pixels, v0, u0, u1, threshold):
            box[1], grown = v0, True
        if v1 > box[3] and _row_has(pixels, v1, u0, u1, threshold):
            box[3], grown = v1, True
        for v in range(v0, v1 + 1):
            if u0 < box[0] and pixels[v, u0] > threshold:
                box[0], grown = u0, True
            if u1 > box[2] and pixels[v, u1] > threshold:
                box[2], grown = u1, True


@kernel
def _area(pixels: Image, threshold: int, box: Box) -> int:
    """Return the number of pixels of ``box`` above the threshold."""
    area = 0
    for v in range(box[1], box[3] + 1):
        for u in range(box[0], box[2] + 1):
            area += pixels[v, u] > threshold
    return area


@kernel
def find_targets(pixels: Image, threshold: int, boxes: Box) -> int:
    """Write the boxes of all targets of an image into ``boxes``, from row 1 on.

    Args:
        pixels: Image, shape (height, width).
        threshold: Grey value that a target exceeds.
        boxes: Result [px], shape (MAX_BLOBS + 1, 4).

    Returns:
        Their number.
    """
    count, (height, width) = 0, pixels.shape
    for v in range(height):
        if count == MAX_BLOBS or not _row_has(pixels, v, 0, width - 1, threshold):
            continue
        u = 0
        while u < width and count < MAX_BLOBS:
            inside = False
            for k in range(1, count + 1):
                if boxes[k, 1] <= v <= boxes[k, 3] and boxes[k, 0] <= u <= boxes[k, 2]:
                    inside, u = True, boxes[k, 2]
            if not inside and pixels[v, u] > threshold:
                count += 1
                box = boxes[count]
                box[0], box[1], box[2], box[3] = u, v, u, v
                _grow(pixels, threshold, box)
                u = box[2]
            u += 1
    return count


@kernel
def find_target(
    pixels: Image, threshold: int, min_area: int, boxes: Box, expected: float,
    place: tuple[float, float, float],
) -> int:  # fmt: skip
    """Write the box of the best target of an image into ``boxes[0]``.

    Args:
        pixels: Image, shape (height, width).
        threshold: Grey value that a target exceeds.
        min_area: Least number of pixels of a target.
        boxes: Result in row 0, scratch behind it [px], shape (MAX_BLOBS + 1, 4).
        expected: Area that the ball should have [px^2]: the nearest to it wins; the largest, the
            round ones before the long, if it is 0.
        place: Where the ball should be and how far from there it may be [px]; anywhere if that
            is 0.

    Returns:
        Pixels of the target above the threshold; 0 if there is none.
    """
    best, best_area = -np.inf, 0
    for k in range(1, find_targets(pixels, threshold, boxes) + 1):
        box = boxes[k]
        area = _area(pixels, threshold, box)
        sides = box[2] - box[0] + 1, box[3] - box[1] + 1
        score = area * min(sides) / max(sides)
        if expected > 0.0:
            score = min(score / expected, expected / score)
        du, dv = 0.5 * (box[0] + box[2]) - place[0], 0.5 * (box[1] + box[3]) - place[1]
        far = place[2] > 0.0 and max(abs(du), abs(dv)) > place[2]
        if area >= min_area and score > best and not far:
            best, best_area = score, area
            boxes[0] = box
    return best_area
