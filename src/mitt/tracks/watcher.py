"""The eyes behind real lenses: centroids are straightened, images are left as they are."""

from dataclasses import dataclass, replace

import numpy as np

from mitt.errors import InputError
from mitt.link.rig import CalibratedRig
from mitt.signals import Frame, Moments, Sighting
from mitt.vision.segmentation import Segmenter
from mitt.vision.triangulation import Triangulator, TriangulatorConfig

#: A real camera's error of centroid, besides what its calibration left [px].
_FLOOR = 0.05
#: Distance of centroid and projected ball at which the cameras disagree, in calibration errors
#: and at least [px].
_RESIDUAL, _LEAST = 6.0, 2.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Look:
    """What was seen in one instant.

    Attributes:
        moments: Of each camera that gave a frame, in pixels of its image.
        sighting: The ball in the world.
        exchanged: The ball if left and right were exchanged.
    """

    moments: tuple[Moments, ...]
    sighting: Sighting
    exchanged: Sighting


class Watcher:
    """Segmentation and triangulation of the catcher, on images of calibrated cameras."""

    def __init__(self, rig: CalibratedRig, *, radius: float, max_skew: float) -> None:
        """Open the eyes.

        Args:
            rig: Two cameras in a frame with z up.
            radius: Ball radius [m].
            max_skew: Largest difference of two times that are one instant [s].
        """
        worst = max(c.rms_px for c in rig.cameras)
        config = TriangulatorConfig(
            sigma_floor=float(np.hypot(_FLOOR, worst)),
            max_residual=max(_LEAST, _RESIDUAL * worst),
            max_skew=max_skew,
        )
        self._cameras = rig.cameras
        self._segmenters = [Segmenter() for _ in rig.cameras]
        self._triangulator = Triangulator(rig.rig(), radius, config)

    def step(self, frames: tuple[Frame, ...]) -> Look:
        """Return what the cameras see.

        Raises:
            InputError: An image has another size than the rig says.
        """
        moments = []
        for frame in frames:
            lens = self._cameras[frame.camera].lens
            if frame.pixels.shape != (lens.height, lens.width):
                height, width = frame.pixels.shape
                name = self._cameras[frame.camera].name
                raise InputError(f"images of camera {name}",
                                 f"{lens.width} x {lens.height} pixels as the rig says",
                                 f"{width} x {height}")  # fmt: skip
            moments.append(self._segmenters[frame.camera].step(frame))
        sighting = self._triangulator.step(tuple(self._straight(m) for m in moments))
        other = tuple(self._straight(replace(m, camera=1 - m.camera)) for m in moments)
        exchanged = self._triangulator.step(other)
        return Look(moments=tuple(moments), sighting=sighting, exchanged=exchanged)

    def _straight(self, m: Moments) -> Moments:
        """Return moments in the image of the camera without distortion."""
        if not m.found:
            return m
        ((u, v),) = self._cameras[m.camera].lens.straighten(np.array(((m.u, m.v),)))
        return replace(m, u=float(u), v=float(v), found=bool(np.isfinite(u + v)))
