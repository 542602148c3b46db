"""Finding the ball in the images of one camera, first where it was, then everywhere."""

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from mitt.errors import ShapeError
from mitt.signals import Array, Frame, Image, Moments
from mitt.vision.moments import MAX_BLOBS, Box, estimate_ground, find_target, grey_moments


@dataclass(frozen=True, slots=True, kw_only=True)
class SegmenterConfig:
    """How a target is told from the ground.

    Attributes:
        min_area: Pixels above the threshold that a target has at least; 2 keeps a ball of
            20 mm radius at 6 m (0.7 px of radius) and drops single hot pixels [px^2].
        min_contrast: Least threshold above the ground [grey levels].
        noise_factor: Threshold above the ground in standard deviations of the ground; at 6 a
            128 x 128 image has a false pixel once in 60 000 frames.
        half_window: Half the side of the window that is searched around the last centroid [px].
        background_period: Frames between two estimates of the ground.
    """

    min_area: int = 2
    min_contrast: float = 12.0
    noise_factor: float = 6.0
    half_window: int = 14
    background_period: int = 64


@njit(cache=True)
def segment(
    pixels: Image, centroid: Array, ground: Array, min_area: int, half: int, boxes: Box
) -> tuple[int, bool]:
    """Find the target, first around the last ``centroid``, then in the whole image.

    Args:
        pixels: Image, shape (height, width).
        centroid: Last centroid, NaN if there is none; overwritten by the new one, shape (2,).
        ground: Level of the ground [grey levels] and threshold, shape (2,).
        min_area: Least area [px^2].
        half: Half the window's side [px].
        boxes: Scratch, shape (MAX_BLOBS + 2, 4).

    Returns:
        Pixels of the target, 0 if there is none, and whether it touches the border.
    """
    height, width = pixels.shape
    window = boxes[MAX_BLOBS + 1]
    threshold = int(ground[1])
    area = 0
    if np.isfinite(centroid[0]):
        u, v = round(centroid[0]), round(centroid[1])
        window[0], window[2] = max(u - half, 0), min(u + half, width - 1)
        window[1], window[3] = max(v - half, 0), min(v + half, height - 1)
        area = find_target(pixels, window, threshold, min_area, boxes, True)
    if area == 0:
        window[0], window[1], window[2], window[3] = 0, 0, width - 1, height - 1
        area = find_target(pixels, window, threshold, min_area, boxes, False)
    if area == 0 or not grey_moments(pixels, boxes[0], ground[0], centroid):
        centroid[0] = np.nan
        return 0, False
    u0, v0, u1, v1 = boxes[0]
    return area, bool(u0 == 0 or v0 == 0 or u1 == width - 1 or v1 == height - 1)


@njit(cache=True)
def measure_ground(
    pixels: Image, contrast: float, noise_factor: float, counts: NDArray[np.int64], ground: Array
) -> None:
    """Write level and threshold of the ground, shape (2,), as an image shows it."""
    estimate_ground(pixels, counts, ground)
    rise = max(contrast, noise_factor * ground[1])
    ground[1] = min(ground[0] + rise, 255.0)


@njit(cache=True)
def watch(pixels: Image, memory: Array, settings: Array, work: Box) -> tuple[int, bool]:
    """Take one frame of one camera in: measure the ground when it is due, find the target.

    Args:
        pixels: Image, shape (height, width).
        memory: Last centroid [px], level of the ground and threshold [grey levels], frames since
            the ground was measured; overwritten, shape (MEMORY,).
        settings: As of :func:`pack_segmenter`, shape (5,).
        work: Scratch, shape (WORK, 4).

    Returns:
        As :func:`segment`; the centroid is in the memory.
    """
    boxes, counts = work[: MAX_BLOBS + 2], work[MAX_BLOBS + 2 :].reshape(256)
    if memory[4] == 0.0:
        measure_ground(pixels, settings[2], settings[3], counts, memory[2:4])
    memory[4] = (memory[4] + 1.0) % settings[4]
    min_area, half = int(settings[0]), int(settings[1])
    area, clipped = segment(pixels, memory[0:2], memory[2:4], min_area, half, boxes)
    return area, clipped


MEMORY, WORK = 5, MAX_BLOBS + 2 + 64
"""Sizes of a camera's memory and of the scratch array."""


def pack_segmenter(config: SegmenterConfig) -> Array:
    """Return the numbers of a segmenter in the order in which :func:`watch` takes them."""
    c = config
    settings = (c.min_area, c.half_window, c.min_contrast, c.noise_factor, c.background_period)
    return np.array(settings, dtype=np.float64)


def forget(memory: Array) -> None:
    """Forget target and ground, in the memory of one camera or of many, shape (..., MEMORY)."""
    memory[...] = (np.nan, np.nan, 0.0, 0.0, 0.0)


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
        area, clipped = watch(pixels, self._memory, self._settings, self._work)
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
        )
