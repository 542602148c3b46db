"""The eyes of the catcher: images in, ball position out, in one compiled call."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from mitt.errors import InputError, ShapeError
from mitt.signals import Array, Frame, Image, Sighting
from mitt.vision import segmentation, triangulation
from mitt.vision.camera import Rig
from mitt.vision.moments import Box
from mitt.vision.segmentation import SegmenterConfig, forget, pack_segmenter, watch
from mitt.vision.triangulation import (
    TriangulatorConfig,
    note,
    pack_belief,
    pack_cameras,
    triangulate,
    unseen,
)


@dataclass(frozen=True, slots=True, kw_only=True)
class EyesConfig:
    """What the catcher knows of its ball and its images.

    Attributes:
        ball_radius: Radius of the ball [m]; the default is that of facts.md, section 4.
        segmenter: How targets are found in an image.
        triangulator: What is believed of their centroids.
    """

    ball_radius: float = 0.04
    segmenter: SegmenterConfig = field(default_factory=SegmenterConfig)
    triangulator: TriangulatorConfig = field(default_factory=TriangulatorConfig)


@njit(cache=True)
def look(
    images: tuple[Image, ...],
    together: tuple[bool, ...],
    memory: Array,
    settings: Array,
    boxes: Box,
    cameras: Array,
    belief: Array,
    work: Array,
    r: Array,
    P: Array,
) -> bool:
    """Find the ball in the images of all cameras, then in the world.

    Args:
        images: One a camera, each shape (height, width); empty where there is none.
        together: Whether each image was exposed at the instant that is asked for.
        memory: What is remembered of each camera, overwritten, shape (n, segmentation.MEMORY).
        settings: Numbers of the segmenter, shape (5,).
        boxes: Scratch, shape (segmentation.WORK, 4).
        cameras: As in the table of :mod:`mitt.vision.triangulation`, shape (n, 5, 3).
        belief: As of :func:`mitt.vision.triangulation.pack_belief`, shape (4,).
        work: Scratch, shape (triangulation.WORK + n, 3).
        r: Result, centre of the ball [m], shape (3,).
        P: Result, its covariance [m^2], shape (3, 3).

    Returns:
        Whether two or more cameras agree on the ball.
    """
    points, count = work[triangulation.WORK :], 0
    for n in range(len(images)):
        points[n, 2] = -1.0
        if images[n].size == 0:
            continue
        area, clipped = watch(images[n], memory[n], settings, boxes)
        if together[n]:
            u, v = memory[n, 0], memory[n, 1]
            count += note(points[n], u, v, float(area), clipped, belief[1], belief[2])
    return bool(count >= 2 and triangulate(cameras, points, belief[0], r, P, work) <= belief[3])


class Eyes:
    """Segmentation for each camera of a rig, and triangulation.

    The kernels are those of ``Segmenter`` and ``Triangulator``, composed.
    """

    def __init__(self, rig: Rig, config: EyesConfig | None = None) -> None:
        """Open the eyes; the first frames tell them the ground."""
        config = config or EyesConfig()
        n = len(rig.cameras)
        self._max_skew = config.triangulator.max_skew
        self._settings = pack_segmenter(config.segmenter)
        self._cameras = pack_cameras(rig)
        self._belief = pack_belief(config.triangulator, config.ball_radius)
        self._memory = np.empty((n, segmentation.MEMORY))
        self._boxes = np.zeros((segmentation.WORK, 4), dtype=np.int64)
        self._work = np.empty((triangulation.WORK + n, 3))
        self._none = [np.empty((0, 0), dtype=np.uint8)] * n
        self._still = (True,) * n
        self._nothing = tuple(self._none), self._still, 0.0
        self.reset()

    def reset(self) -> None:
        """Forget the last ball, as before a new throw."""
        forget(self._memory)

    def parts(self) -> dict[str, NDArray[Any]]:
        """Return the arrays that :func:`look` takes, by name, for whoever composes it."""
        return {
            "memory": self._memory,
            "settings": self._settings,
            "boxes": self._boxes,
            "cameras": self._cameras,
            "belief": self._belief,
            "work": self._work,
        }

    def move_to(self, parts: Mapping[str, NDArray[Any]]) -> None:
        """Use other arrays from now on, named and shaped as :meth:`parts`; values as they are."""
        self._memory, self._settings = parts["memory"], parts["settings"]
        self._boxes, self._cameras = parts["boxes"], parts["cameras"]
        self._belief, self._work = parts["belief"], parts["work"]

    def step(self, frames: tuple[Frame, ...]) -> Sighting:
        """Return where the ball is in frames exposed together.

        Args:
            frames: One a camera, in any order; a camera may be missing.

        Raises:
            InputError: A frame comes from a camera that the rig does not have.
            ShapeError: A frame is not a two-dimensional image.
        """
        images, together, t = self.arrange(frames)
        r_o, covariance = np.empty(3), np.empty((3, 3))
        if look(
            images,
            together,
            self._memory,
            self._settings,
            self._boxes,
            self._cameras,
            self._belief,
            self._work,
            r_o,
            covariance,
        ):
            return Sighting(t=t, found=True, r_o=r_o, covariance=covariance)
        return unseen(t)

    def arrange(
        self, frames: tuple[Frame, ...]
    ) -> tuple[tuple[Image, ...], tuple[bool, ...], float]:
        """Return images, whether they belong together, and their instant, as :func:`look` takes it.

        Args:
            frames: As for :meth:`step`.
        """
        if not frames:
            return self._nothing
        t = frames[0].t
        images, together = self._none.copy(), self._still
        for frame in frames:
            k = frame.camera
            if not 0 <= k < len(images):
                raise InputError("frame.camera", f"0 to {len(images) - 1}", k)
            pixels = frame.pixels
            plain = pixels.size > 0 and pixels.ndim == 2 and pixels.flags.carray
            images[k] = pixels if plain else _plain(pixels)
            if frame.t != t:
                near = abs(frame.t - t) <= self._max_skew
                together = (*together[:k], near, *together[k + 1 :])
        return tuple(images), together, t


def _plain(pixels: Image) -> Image:
    """Return a copy, as the kernels take it, of an image that is a window or write-protected."""
    if pixels.ndim != 2 or pixels.size == 0:
        raise ShapeError("frame.pixels", "(height, width)", pixels.shape)
    return np.array(pixels, dtype=np.uint8, order="C")
