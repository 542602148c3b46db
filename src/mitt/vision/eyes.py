"""The eyes of the catcher: images in, ball position out."""

from dataclasses import dataclass, field

from mitt.errors import InputError
from mitt.signals import Frame, Sighting
from mitt.vision.camera import Rig
from mitt.vision.segmentation import Segmenter, SegmenterConfig
from mitt.vision.triangulation import Triangulator, TriangulatorConfig


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


class Eyes:
    """A segmenter for each camera of a rig, and the triangulator."""

    def __init__(self, rig: Rig, config: EyesConfig | None = None) -> None:
        """Open the eyes; the first frames tell them the ground."""
        config = config or EyesConfig()
        self._segmenters = tuple(Segmenter(config.segmenter) for _ in rig.cameras)
        self._triangulator = Triangulator(rig, config.ball_radius, config.triangulator)

    def reset(self) -> None:
        """Forget the last ball, as before a new throw."""
        for segmenter in self._segmenters:
            segmenter.reset()

    def step(self, frames: tuple[Frame, ...]) -> Sighting:
        """Return where the ball is in frames exposed together.

        Args:
            frames: One a camera, in any order; a camera may be missing.

        Raises:
            InputError: A frame comes from a camera that the rig does not have.
        """
        for frame in frames:
            if not 0 <= frame.camera < len(self._segmenters):
                raise InputError("frame.camera", f"0 to {len(self._segmenters) - 1}", frame.camera)
        return self._triangulator.step(
            tuple(self._segmenters[frame.camera].step(frame) for frame in frames)
        )
