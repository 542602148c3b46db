"""Finding the ball in the images of one camera, first where it was, then everywhere.

The memory of a camera: :mod:`mitt.vision.target`.
"""

from dataclasses import dataclass
from math import sqrt

import numpy as np
from numpy.typing import NDArray

from mitt.errors import ShapeError
from mitt.jit import kernel
from mitt.signals import Array, Frame, Image, Moments
from mitt.views import lent, view
from mitt.vision.background import mean_of, subtract
from mitt.vision.moments import MAX_BLOBS, Box, estimate_ground, find_target
from mitt.vision.target import (
    AREA,
    AT_U,
    AT_V,
    DU,
    DUE,
    DV,
    EXPECTED,
    FROZEN,
    GOOD,
    HEIGHT,
    LEVEL,
    LIGHT,
    LOST,
    MARK,
    MASS,
    MEAN,
    MEMORY,
    MERGED,
    NEAR,
    RUNS,
    STATE,
    THRESHOLD,
    TOP,
    WEIGHTS,
    WILD,
    WORK,
    field,
    forget,
    keep,
    masks,
    pace,
    trim,
)
from mitt.vision.window import ROWS, Runs, connect, dilate, is_merged, weigh

KEPT, PATIENCE, STEADY = 0.85, 40, 0.6
"""Share of its area below which a target is looked for anew; frames that a merged one is kept;
share of a new motion in the motion kept."""


GROWN, RAGGED = 1.08, 0.5
"""Growth of its mass in one frame, and what noise adds to that over the root of its area [px],
above which a target is the ball and something else."""


_NONE = np.empty((0, 0), np.uint8)
"""No background."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SegmenterConfig:
    """How a target is told from the ground.

    Attributes:
        min_area: Pixels above the threshold that a target has at least; 2 keeps a ball of
            20 mm radius at 6 m (0.7 px of radius) and drops single hot pixels [px^2].
        min_contrast: Least threshold above the ground [grey levels].
        noise_factor: Threshold above the ground in standard deviations of the ground; at 6 a
            128 x 128 image has a false pixel once in 60 000 frames.
        reach: Pixels by which the last target is dilated: how far its edge may get in a frame
            beyond where its last motion takes it [px].
        background_period: Frames between two estimates of the ground.
        frozen: Frames that an image may be the same, noise and all, before its camera counts
            as blind; 0 turns the test off, as for drawn images without noise.
    """

    min_area: int = 2
    min_contrast: float = 12.0
    noise_factor: float = 6.0
    reach: int = 3
    background_period: int = 64
    frozen: int = 3


@kernel
def _window(
    pixels: Image, memory: Array, reach: int, old: Runs, new: Runs, weights: Array
) -> tuple[int, int]:
    """Find the target in the dilated mask of the last; return first row and rows, 0 if lost."""
    rows = int(memory[HEIGHT])
    if rows + 2 * max(reach, WILD) > ROWS:
        return 0, 0
    if memory[DU] == 0.0 and memory[DV] == 0.0:
        reach = max(reach, WILD)
    du, dv = pace(memory[0], memory[DU]), pace(memory[1], memory[DV])
    for k in range(rows):
        old[0, k] = int(memory[RUNS + k])
        old[1, k] = int(memory[RUNS + ROWS + k])
    dilate(old, rows, reach, du, pixels.shape[1], new)
    top, rows = int(memory[TOP]) + dv - reach, rows + 2 * reach
    if connect(pixels, int(memory[THRESHOLD]), top, rows, new, round(memory[0]) + du) == 0:
        return 0, 0
    top, rows = trim(top, rows, new)
    if not weigh(pixels, top, rows, new, int(memory[THRESHOLD]), memory[LEVEL], weights):
        return 0, 0
    return top, rows


@kernel
def found_again(
    pixels: Image, memory: Array, settings: Array, old: Runs, new: Runs, weights: Array
) -> tuple[int, int]:
    """As :func:`_window`, but 0 rows as well where too little of the target is left."""
    top, rows = _window(pixels, memory, int(settings[1]), old, new, weights)
    if not weights[6] >= max(settings[0], KEPT * memory[AREA]):
        return top, 0
    return top, rows


@kernel
def outline(pixels: Image, memory: Array, box: Box, runs: Runs, weights: Array) -> int:
    """Write runs and moments of the target in a box; return its rows, 0 if there is none."""
    rows, threshold = min(box[3] - box[1] + 1, ROWS), int(memory[THRESHOLD])
    for k in range(rows):
        runs[0, k], runs[1, k] = box[0], box[2]
    if connect(pixels, threshold, box[1], rows, runs, (box[0] + box[2]) // 2) == 0:
        return 0
    if not weigh(pixels, box[1], rows, runs, threshold, memory[LEVEL], weights):
        return 0
    return int(rows)


@kernel
def _everywhere(
    pixels: Image, memory: Array, min_area: int, boxes: Box, new: Runs, weights: Array
) -> tuple[int, int]:
    """Find the target in the whole image; return first row and rows, 0 if there is none."""
    height, width = pixels.shape
    window, threshold = boxes[MAX_BLOBS + 1], int(memory[THRESHOLD])
    window[0], window[1], window[2], window[3] = 0, 0, width - 1, height - 1
    place = memory[AT_U], memory[AT_V], memory[NEAR]
    if find_target(pixels, window, threshold, min_area, boxes, memory[EXPECTED], place) == 0:
        return 0, 0
    return boxes[0, 1], outline(pixels, memory, boxes[0], new, weights)


@kernel
def _touches_border(shape: tuple[int, int], top: int, rows: int, runs: Runs) -> bool:
    """Tell whether a target touches the border of the image."""
    if top <= 0 or top + rows >= shape[0] or rows == ROWS:
        return True
    touches = False
    for k in range(rows):
        if runs[0, k] <= runs[1, k]:
            touches |= runs[0, k] <= 0 or runs[1, k] >= shape[1] - 1
    return touches


@kernel
def _has_grown(memory: Array) -> bool:
    """Tell whether a target is heavier than the ball was: something bright touches it."""
    return bool(memory[WEIGHTS] > (GROWN + RAGGED / sqrt(memory[AREA])) * memory[MASS])


@kernel
def show(
    pixels: Image, background: Image, difference: Image, memory: Array, window: NDArray[np.int64],
    whole: bool,
) -> Image:  # fmt: skip
    """Return what of an image is looked at within a window: its difference from the background.

    The image itself where no background was learned. Light and mean go into the memory.
    """
    if background.size != pixels.size or difference.size < pixels.size:
        return pixels
    shown = view(difference, 0, pixels.shape)
    if whole:
        window[0], window[1], window[2], window[3] = 0, pixels.shape[0] - 1, 0, pixels.shape[1] - 1
        memory[MEAN] = mean_of(background)
    memory[LIGHT] = subtract(pixels, background, window, whole, memory, shown)
    return shown


@kernel
def measure_if_due(shown: Image, memory: Array, settings: Array, work: Box) -> None:
    """Measure level and threshold of the ground where that is due."""
    if memory[DUE] == 0.0:
        counts, ground = view(work, 4 * (MAX_BLOBS + 2), (256,)), view(memory, LEVEL, (2,))
        measure_ground(shown, settings[2], settings[3], counts, ground)
    memory[DUE] = (memory[DUE] + 1.0) % settings[4]


@kernel
def segment(
    pixels: Image,
    background: Image,
    difference: Image,
    memory: Array,
    settings: Array,
    work: Box,
) -> tuple[int, bool]:
    """Find the target in the dilated mask of the last, or else in the whole image.

    A merged target is flagged in ``memory[STATE]`` and keeps the mask of the ball that went into
    it, moved on as it last moved, so that the ball is found where the two part.

    Args:
        pixels: Image, shape (height, width).
        background: As in :mod:`mitt.vision.background`.
        difference: Scratch as large as the image, if there is a background.
        memory: As in the module's table, overwritten.
        settings: As of :func:`pack_segmenter`, shape (6,).
        work: Scratch, shape (WORK, 4).

    Returns:
        Pixels of the target, 0 if there is none, and whether it touches the border.
    """
    pixels, background, memory, work = lent((pixels, background, memory, work))
    difference, window = lent(difference), view(work, 4 * (MAX_BLOBS + 1), (4,))
    window[0], window[1], window[2], window[3] = 0, pixels.shape[0] - 1, 0, pixels.shape[1] - 1
    part = field(memory, settings, window)
    shown = show(pixels, background, difference, memory, window, not part)
    measure_if_due(shown, memory, settings, work)
    old, new = masks(work)
    weights = view(memory, WEIGHTS, (7,))
    u, v, top, rows = memory[0], memory[1], 0, 0
    if memory[STATE] != LOST:
        top, rows = found_again(shown, memory, settings, old, new, weights)
    again = rows > 0
    if not again:
        if part:
            shown = show(pixels, background, difference, memory, window, True)
        top, rows = _everywhere(shown, memory, int(settings[0]), work, new, weights)
    if rows == 0:
        memory[0], memory[1], memory[STATE] = np.nan, np.nan, float(LOST)
        return 0, False
    clipped = _touches_border(pixels.shape, top, rows, new)
    if not clipped and (is_merged(weights) or (again and _has_grown(memory))):
        merged = memory[STATE] - MERGED + 1.0 if memory[STATE] >= MERGED else 0.0
        if again and merged < PATIENCE:
            memory[STATE] = MERGED + merged
            memory[TOP] += pace(v, memory[DV])
            memory[RUNS : RUNS + 2 * ROWS] += pace(u, memory[DU])
            memory[0], memory[1] = u + memory[DU], v + memory[DV]
            return int(weights[6]), clipped
        memory[0], memory[1], memory[STATE] = np.nan, np.nan, float(LOST)
        return 0, False
    steady = again and memory[STATE] == GOOD
    share = STEADY if memory[DU] != 0.0 or memory[DV] != 0.0 else 1.0
    memory[DU] = memory[DU] + share * (weights[1] - u - memory[DU]) if steady else 0.0
    memory[DV] = memory[DV] + share * (weights[2] - v - memory[DV]) if steady else 0.0
    memory[0], memory[1], memory[STATE] = weights[1], weights[2], float(GOOD)
    memory[MASS] = weights[0]
    keep(memory, top, rows, new, weights[6])
    return int(weights[6]), clipped


@kernel
def is_frozen(pixels: Image, memory: Array, patience: int) -> bool:
    """Tell whether a target has been the same, noise and all, for more than ``patience`` frames.

    The pixels of one frame under the mask, each weighted by its place, are never those of the
    next to the last bit in sum.
    """
    mark = 0
    for k in range(int(memory[HEIGHT])):
        row = int(memory[TOP]) + k
        first, last = int(memory[RUNS + k]), int(memory[RUNS + ROWS + k])
        if 0 <= row < pixels.shape[0]:
            for u in range(max(first, 0), min(last + 1, pixels.shape[1])):
                mark += pixels[row, u] * (1 + 31 * u + 17 * row)
    same = patience > 0 and float(mark) == memory[MARK]
    memory[FROZEN] = memory[FROZEN] + 1.0 if same else 0.0
    memory[MARK] = float(mark)
    return bool(memory[FROZEN] >= patience > 0)


@kernel
def measure_ground(
    pixels: Image, contrast: float, noise_factor: float, counts: NDArray[np.int64], ground: Array
) -> None:
    """Write level and threshold of the ground, shape (2,), as an image shows it."""
    estimate_ground(pixels, counts, ground)
    rise = max(contrast, noise_factor * ground[1])
    ground[1] = min(ground[0] + rise, 255.0)


@kernel
def watch(
    pixels: Image,
    background: Image,
    difference: Image,
    memory: Array,
    settings: Array,
    work: Box,
) -> tuple[int, bool]:
    """Take one frame of one camera in: measure the ground when it is due, find the target.

    Args:
        pixels: Image, shape (height, width).
        background: As for :func:`segment`.
        difference: As for :func:`segment`.
        memory: As in the module's table, overwritten, shape (MEMORY,).
        settings: As of :func:`pack_segmenter`, shape (6,).
        work: Scratch, shape (WORK, 4).

    Returns:
        As :func:`segment`; the centroid is in the memory. Nothing in a frozen image.
    """
    area, clipped = segment(pixels, background, difference, memory, settings, work)
    if area > 0 and is_frozen(pixels, memory, int(settings[5])):
        return 0, False
    return area, clipped


def pack_segmenter(config: SegmenterConfig) -> Array:
    """Return the numbers of a segmenter in the order in which :func:`watch` takes them."""
    c = config
    settings = (c.min_area, c.reach, c.min_contrast, c.noise_factor, c.background_period, c.frozen)
    return np.array(settings, dtype=np.float64)


class Segmenter:
    """Finds the ball in the frames of one camera; remembers where it was and the ground."""

    def __init__(self, config: SegmenterConfig | None = None) -> None:
        """Start without a target and without an idea of the ground."""
        self._settings = pack_segmenter(config or SegmenterConfig())
        self._memory = np.empty(MEMORY)
        self._work = np.zeros((WORK, 4), dtype=np.int64)
        self.reset()

    def reset(self) -> None:
        """Forget the target and the ground."""
        forget(self._memory)

    def step(self, frame: Frame) -> Moments:
        """Return the moments of the target in ``frame``.

        Raises:
            ShapeError: The frame is not a two-dimensional image.
        """
        pixels = frame.pixels
        if pixels.ndim != 2 or pixels.size == 0:
            raise ShapeError("frame.pixels", "(height, width)", pixels.shape)
        pixels = np.ascontiguousarray(pixels)
        area, clipped = watch(pixels, _NONE, _NONE, self._memory, self._settings, self._work)
        if area == 0:
            return Moments(t=frame.t, camera=frame.camera, found=False)
        return Moments(
            t=frame.t,
            camera=frame.camera,
            found=True,
            area=float(area),
            u=float(self._memory[0]),
            v=float(self._memory[1]),
            clipped=clipped,
            merged=bool(self._memory[STATE] >= MERGED),
        )
