"""Finding the ball in the images of one camera, first where it was, then everywhere.

The memory of a camera: :mod:`mitt.vision.target`.
"""

from dataclasses import dataclass
from math import sqrt

import numpy as np
from numpy.typing import NDArray

from mitt import fields
from mitt.fields import brief
from mitt.jit import kernel
from mitt.signals import Array, Frame, Image, Moments
from mitt.views import view
from mitt.vision import target as at
from mitt.vision.background import measure_if_due, show, subtract
from mitt.vision.blobs import MAX_BLOBS, Box, find_target
from mitt.vision.target import GOOD, LOST, MERGED, RUNS, STATE, WEIGHTS, keep, masks, pace
from mitt.vision.window import ROWS, Runs, connect, dilate, is_merged, trim, weigh

KEPT, PATIENCE, STEADY = 0.85, 40, 0.6
"""Share of its area below which a target is looked for anew; frames that a merged one is kept;
share of a new motion in the motion kept."""

GROWN, RAGGED = 1.08, 0.5
"""Growth of its mass in one frame, and what noise adds to that over the root of its area [px],
above which a target is the ball and something else."""

_NONE = np.empty((0, 0), np.uint8)
"""No background."""


#: Least and largest number of each setting; choices of this project.
_RANGES = {
    "min_area": (1, 10**6), "min_contrast": (0.0, 255.0), "noise_factor": (0.0, 1e3),
    "reach": (0, 1000), "background_period": (1, 10**9), "frozen": (0, 10**6),
}  # fmt: skip


@dataclass(frozen=True, slots=True, kw_only=True)
class SegmenterConfig:
    """How a target is separated from the background.

    Attributes:
        min_area: Pixels above the threshold that a target has at least; 2 keeps a ball of
            20 mm radius at 6 m (0.7 px of radius) and drops single hot pixels [px^2].
        min_contrast: Least threshold above the background [grey levels].
        noise_factor: Threshold above the background in standard deviations of it; at 6 a
            128 x 128 image has a false pixel once in 60 000 frames.
        reach: Pixels by which the last target is dilated: how far its edge may get in a frame
            beyond where its last motion takes it [px].
        background_period: Frames between two measurements of the background.
        frozen: Frames that an image may be the same, noise and all, before its camera counts
            as blind; 0 turns the test off, as for drawn images without noise.
    """

    min_area: int = 2
    min_contrast: float = 12.0
    noise_factor: float = 6.0
    reach: int = 3
    background_period: int = 64
    frozen: int = 3

    __repr__ = brief

    def __post_init__(self) -> None:
        """Refuse what cannot be; InputError names the field."""
        fields.check(self, _RANGES)


@kernel
def _find_again(
    pixels: Image, memory: Array, settings: Array, old: Runs, new: Runs, weights: Array
) -> tuple[int, int]:
    """Find the target in the dilated mask of the last frame.

    Returns:
        First row and number of rows; no rows if it is lost, or too little of it is left.
    """
    rows, reach, threshold = int(memory[at.HEIGHT]), int(settings[1]), int(memory[at.THRESHOLD])
    if rows + 2 * max(reach, at.WILD) > ROWS:
        return 0, 0
    if memory[at.DU] == 0.0 and memory[at.DV] == 0.0:
        reach = max(reach, at.WILD)
    du, dv = pace(memory[0], memory[at.DU]), pace(memory[1], memory[at.DV])
    for k in range(rows):
        old[0, k], old[1, k] = int(memory[RUNS + k]), int(memory[RUNS + ROWS + k])
    dilate(old, rows, reach, du, pixels.shape[1], new)
    top, rows = int(memory[at.TOP]) + dv - reach, rows + 2 * reach
    if connect(pixels, threshold, top, rows, new, round(memory[0]) + du) == 0:
        return 0, 0
    top, rows = trim(top, rows, new)
    if not weigh(pixels, top, rows, new, threshold, memory[at.LEVEL], weights):
        return 0, 0
    if not weights[6] >= max(settings[0], KEPT * memory[at.AREA]):
        return 0, 0
    return top, rows


@kernel
def outline(pixels: Image, memory: Array, box: Box, runs: Runs, weights: Array) -> int:
    """Write runs and moments of the target in a box; return its rows, 0 if there is none."""
    rows, threshold = min(box[3] - box[1] + 1, ROWS), int(memory[at.THRESHOLD])
    runs[0, :rows], runs[1, :rows] = box[0], box[2]
    if connect(pixels, threshold, box[1], rows, runs, (box[0] + box[2]) // 2) == 0:
        return 0
    if not weigh(pixels, box[1], rows, runs, threshold, memory[at.LEVEL], weights):
        return 0
    return int(rows)


@kernel
def _find_anywhere(
    pixels: Image, memory: Array, min_area: int, boxes: Box, new: Runs, weights: Array
) -> tuple[int, int]:
    """Find the target in the whole image; return first row and rows, 0 if there is none."""
    place, expected = (memory[at.AT_U], memory[at.AT_V], memory[at.NEAR]), memory[at.EXPECTED]
    if find_target(pixels, int(memory[at.THRESHOLD]), min_area, boxes, expected, place) == 0:
        return 0, 0
    return boxes[0, 1], outline(pixels, memory, boxes[0], new, weights)


@kernel
def _touches_border(shape: tuple[int, int], top: int, rows: int, runs: Runs) -> bool:
    """Return whether a target touches the border of the image."""
    if top <= 0 or top + rows >= shape[0] or rows == ROWS:
        return True
    for k in range(rows):
        if runs[0, k] <= runs[1, k] and (runs[0, k] <= 0 or runs[1, k] >= shape[1] - 1):
            return True
    return False


@kernel
def _has_grown(memory: Array) -> bool:
    """Return whether a target is heavier than the ball was: something bright touches it."""
    most = (GROWN + RAGGED / sqrt(memory[at.AREA])) * memory[at.MASS]
    return bool(memory[WEIGHTS] > most)


@kernel
def suffices(
    pixels: Image, background: Image, difference: Image, window: NDArray[np.int64], memory: Array,
    settings: Array, work: Box, weights: Array,
) -> bool:  # fmt: skip
    """Return whether the target will be found in its region of interest.

    Then :func:`detect` looks nowhere else, and a simulated camera need draw no more. Only scratch
    is changed.

    Args:
        pixels: Image, true within the region, shape (height, width).
        background: As for :func:`detect`.
        difference: As for :func:`detect`.
        window: Result of :func:`mitt.vision.target.region_of_interest`, shape (4,).
        memory: As for :func:`detect`.
        settings: As for :func:`detect`.
        work: As for :func:`detect`.
        weights: Scratch, shape (7,).
    """
    old, new = masks(work)
    shown = pixels
    if background.size == pixels.size and difference.size >= pixels.size:
        shown = view(difference, 0, pixels.shape)
        subtract(pixels, background, window, False, memory, shown)
    return bool(_find_again(shown, memory, settings, old, new, weights)[1] > 0)


@kernel
def _lose(memory: Array) -> None:
    """Note that there is no target."""
    memory[0], memory[1], memory[STATE] = np.nan, np.nan, float(LOST)


@kernel
def _segment(
    pixels: Image, background: Image, difference: Image, memory: Array, settings: Array, work: Box
) -> tuple[int, bool]:
    """Find the target in the dilated mask of the last, or else in the whole image.

    A merged target is flagged in ``memory[STATE]`` and keeps the mask of the ball that went into
    it, moved on as it last moved, so that the ball is found where the two part.
    """
    window = view(work, 4 * (MAX_BLOBS + 1), (4,))
    window[0], window[1], window[2], window[3] = 0, pixels.shape[0] - 1, 0, pixels.shape[1] - 1
    part = at.region_of_interest(memory, settings, window)
    shown = show(pixels, background, difference, memory, window, not part)
    measure_if_due(shown, memory, settings, work)
    old, new = masks(work)
    weights = view(memory, WEIGHTS, (7,))
    u, v, top, rows = memory[0], memory[1], 0, 0
    if memory[STATE] != LOST:
        top, rows = _find_again(shown, memory, settings, old, new, weights)
    again = rows > 0
    if not again:
        if part:
            shown = show(pixels, background, difference, memory, window, True)
        top, rows = _find_anywhere(shown, memory, int(settings[0]), work, new, weights)
    if rows == 0:
        _lose(memory)
        return 0, False
    clipped = _touches_border(pixels.shape, top, rows, new)
    if not clipped and (is_merged(weights) or (again and _has_grown(memory))):
        merged = memory[STATE] - MERGED + 1.0 if memory[STATE] >= MERGED else 0.0
        if not again or merged >= PATIENCE:
            _lose(memory)
            return 0, False
        memory[STATE] = MERGED + merged
        memory[at.TOP] += pace(v, memory[at.DV])
        across = pace(u, memory[at.DU])
        for k in range(RUNS, RUNS + 2 * ROWS):
            memory[k] += across
        memory[0], memory[1] = u + memory[at.DU], v + memory[at.DV]
        return int(weights[6]), clipped
    steady = again and memory[STATE] == GOOD
    share = STEADY if memory[at.DU] != 0.0 or memory[at.DV] != 0.0 else 1.0
    for k, (new_place, old_place) in enumerate(((weights[1], u), (weights[2], v))):
        motion = memory[at.DU + k]
        motion += share * (new_place - old_place - motion)
        memory[at.DU + k] = motion if steady else 0.0
    memory[0], memory[1], memory[STATE] = weights[1], weights[2], float(GOOD)
    memory[at.MASS] = weights[0]
    keep(memory, top, rows, new, weights[6])
    return int(weights[6]), clipped


@kernel
def _is_frozen(pixels: Image, memory: Array, patience: int) -> bool:
    """Return whether a target has been the same, noise and all, for ``patience`` frames or more.

    The pixels of one frame under the mask, each weighted by its place, are never those of the
    next to the last bit in sum.
    """
    mark = 0
    for k in range(int(memory[at.HEIGHT])):
        row = int(memory[at.TOP]) + k
        first, last = int(memory[RUNS + k]), int(memory[RUNS + ROWS + k])
        if 0 <= row < pixels.shape[0]:
            for u in range(max(first, 0), min(last + 1, pixels.shape[1])):
                mark += pixels[row, u] * (1 + 31 * u + 17 * row)
    same = patience > 0 and float(mark) == memory[at.MARK]
    memory[at.FROZEN] = memory[at.FROZEN] + 1.0 if same else 0.0
    memory[at.MARK] = float(mark)
    return bool(memory[at.FROZEN] >= patience > 0)


@kernel
def detect(
    pixels: Image, background: Image, difference: Image, memory: Array, settings: Array, work: Box
) -> tuple[int, bool]:
    """Find the target in one frame of one camera; measure the background when that is due.

    Args:
        pixels: Image, shape (height, width).
        background: As in :mod:`mitt.vision.background`.
        difference: Scratch as large as the image, if there is a background.
        memory: As in the table of :mod:`mitt.vision.target`, overwritten, shape (MEMORY,).
        settings: As of :func:`pack_segmenter`, shape (6,).
        work: Scratch, shape (WORK, 4).

    Returns:
        Pixels of the target, 0 if there is none or the image is frozen, and whether it touches
        the border. The centroid is in the memory.
    """
    area, clipped = _segment(pixels, background, difference, memory, settings, work)
    if area > 0 and _is_frozen(pixels, memory, int(settings[5])):
        return 0, False
    return area, clipped


def pack_segmenter(config: SegmenterConfig) -> Array:
    """Return the numbers of a segmenter in the order in which :func:`detect` takes them."""
    c = config
    settings = (c.min_area, c.reach, c.min_contrast, c.noise_factor, c.background_period, c.frozen)
    return np.array(settings, dtype=np.float64)


class Segmenter:
    """Finds the ball in the frames of one camera; remembers where it was and the background."""

    def __init__(self, config: SegmenterConfig | None = None) -> None:
        """Start without a target and without an idea of the background."""
        self._settings = pack_segmenter(config or SegmenterConfig())
        self._memory, self._work = np.empty(at.MEMORY), np.zeros((at.WORK, 4), dtype=np.int64)
        self.reset()

    def reset(self) -> None:
        """Forget the target and the background."""
        at.forget(self._memory)

    def step(self, frame: Frame) -> Moments:
        """Return the moments of the target in ``frame``."""
        m, pixels = self._memory, np.ascontiguousarray(frame.pixels)
        area, clipped = detect(pixels, _NONE, _NONE, m, self._settings, self._work)
        if area == 0:
            return Moments(t=frame.t, camera=frame.camera, found=False)
        return Moments(
            t=frame.t, camera=frame.camera, found=True, area=float(area), u=float(m[0]),
            v=float(m[1]), clipped=clipped, merged=bool(m[STATE] >= MERGED),
        )  # fmt: skip
