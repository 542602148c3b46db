"""Finding the ball in the images of one camera, first where it was, then everywhere."""

from dataclasses import dataclass

import numpy as np
from numba import njit

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
    pixels: Image, centroid: Array, ground: Array, limits: Box, boxes: Box
) -> tuple[int, bool]:
    """Find the target, first around the last ``centroid``, then in the whole image.

    Args:
        pixels: Image, shape (height, width).
        centroid: Last centroid, NaN if there is none; overwritten by the new one, shape (2,).
        ground: Level of the ground [grey levels] and threshold, shape (2,).
        limits: Least area, half the window's side [px], shape (2,).
        boxes: Scratch, shape (MAX_BLOBS + 2, 4).

    Returns:
        Pixels of the target, 0 if there is none, and whether it touches the border.
    """
    height, width = pixels.shape
    window = boxes[MAX_BLOBS + 1]
    threshold = int(ground[1])
    area = 0
    if np.isfinite(centroid[0]):
        u, v, half = round(centroid[0]), round(centroid[1]), limits[1]
        window[0], window[2] = max(u - half, 0), min(u + half, width - 1)
        window[1], window[3] = max(v - half, 0), min(v + half, height - 1)
        area = find_target(pixels, window, threshold, limits[0], boxes, True)
    if area == 0:
        window[0], window[1], window[2], window[3] = 0, 0, width - 1, height - 1
        area = find_target(pixels, window, threshold, limits[0], boxes, False)
    if area == 0 or not grey_moments(pixels, boxes[0], ground[0], centroid):
        centroid[0] = np.nan
        return 0, False
    u0, v0, u1, v1 = boxes[0]
    return area, bool(u0 == 0 or v0 == 0 or u1 == width - 1 or v1 == height - 1)


class Segmenter:
    """Finds the ball in the frames of one camera; remembers where it was and the ground."""

    def __init__(self, config: SegmenterConfig | None = None) -> None:
        """Start without a target and without an idea of the ground."""
        self._config = config or SegmenterConfig()
        self._limits = np.array((self._config.min_area, self._config.half_window))
        self._boxes = np.zeros((MAX_BLOBS + 2, 4), dtype=np.int64)
        self._counts = np.zeros(256, dtype=np.int64)
        self._noise = np.zeros(2)
        self._ground = np.zeros(2)
        self._centroid = np.zeros(2)
        self.reset()

    def reset(self) -> None:
        """Forget the target and the ground."""
        self._centroid[:] = np.nan
        self._age = 0

    def step(self, frame: Frame) -> Moments:
        """Return the moments of the target in ``frame``.

        Raises:
            ShapeError: The frame is not a two-dimensional image.
        """
        pixels = frame.pixels
        if pixels.ndim != 2 or pixels.size == 0:
            raise ShapeError("frame.pixels", "(height, width)", pixels.shape)
        if self._age == 0:
            self._measure_ground(pixels)
        self._age = (self._age + 1) % self._config.background_period
        centroid = self._centroid
        area, clipped = segment(pixels, centroid, self._ground, self._limits, self._boxes)
        if area == 0:
            return Moments(t=frame.t, camera=frame.camera, found=False)
        return Moments(
            t=frame.t,
            camera=frame.camera,
            found=True,
            area=float(area),
            u=float(centroid[0]),
            v=float(centroid[1]),
            clipped=clipped,
        )

    def _measure_ground(self, pixels: Image) -> None:
        """Set level and threshold from the image."""
        estimate_ground(pixels, self._counts, self._noise)
        level, sigma = self._noise
        rise = max(self._config.min_contrast, self._config.noise_factor * sigma)
        self._ground[0] = level
        self._ground[1] = min(level + rise, 255.0)
