"""The eyes of the catcher: images in, position of the ball out, in one compiled call."""

from collections.abc import Sequence
from copy import deepcopy
from dataclasses import dataclass, field
from enum import Enum
from math import inf, isfinite
from typing import Annotated, Any

import numpy as np

from mitt.core import checks
from mitt.core.errors import InputError
from mitt.core.eyes import head, localization, segmentation, triangulation
from mitt.core.eyes.background import (
    SWEPT,
    keep_background,
    keep_faults,
    mean_background,
    remember_turned,
)
from mitt.core.eyes.camera import Rig, fixed_rig, pack_cameras
from mitt.core.eyes.localization import EyesHandle, EyesMemory, eyes_handle, localize
from mitt.core.eyes.panorama import PANORAMA
from mitt.core.eyes.segmentation import SegmenterConfig, forget, pack_segmenter
from mitt.core.eyes.triangulation import TriangulatorConfig, no_sighting, pack_ball
from mitt.core.fields import Range, Settings
from mitt.core.signals import Array, BallState, Frame, Image, Sighting


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class EyesConfig(Settings):
    """What the catcher knows of its ball and its images.

    Attributes:
        ball_radius: Radius of the ball [m]; a choice of this project.
        segmenter: How targets are found in an image.
        triangulator: How exact their centroids are.
    """

    ball_radius: Annotated[float, Range(1e-3, 1.0)] = 0.04
    segmenter: SegmenterConfig = field(default_factory=SegmenterConfig)
    triangulator: TriangulatorConfig = field(default_factory=TriangulatorConfig)


class EyesStatus(Enum):
    """What the eyes can say of the ball."""

    BLIND = localization.BLIND
    ONE = localization.ONE
    BOTH = localization.BOTH
    AT_ODDS = localization.AT_ODDS


#: Type of an image.
_GREY = np.dtype(np.uint8)


def _memory_of(rig: Rig, config: EyesConfig) -> EyesMemory:
    """Return what eyes know before they have seen anything."""
    n, rows = len(rig.cameras), max(len(rig.heads), 1)
    heads = head.pack_heads(rig)
    return EyesMemory(
        targets=np.zeros(n, segmentation.TARGET),
        rig=np.zeros(1, localization.RIG),
        segmenter=pack_segmenter(config.segmenter),
        ball=pack_ball(config.triangulator, config.ball_radius, rig),
        cameras=pack_cameras(rig),
        heads=heads if len(heads) else np.zeros(1, head.HEAD),
        angles=np.zeros((rows, 2)),
        gaze=head.fresh_gaze(rows),
        points=np.zeros(n, triangulation.POINT),
        corrected=np.zeros(n, triangulation.POINT),
        segment_work=np.zeros(1, segmentation.WORK),
        solve_work=np.zeros(1, triangulation.WORK),
        match_work=np.zeros(1, localization.WORK),
        gaze_work=np.zeros(1, head.WORK),
    )


class Eyes:
    """Segmentation for each camera of a rig, triangulation, and the gaze of its heads.

    The kernels are those of ``Segmenter`` and ``Triangulator``, composed.

    Attributes:
        heads: Number of heads; 0 where the cameras stand still.
        memory: What the eyes know and remember, which the compiled tick shares.
        backgrounds: As of :func:`mitt.core.eyes.localization.localize`; what was seen of late until
            they are learned.
    """

    backgrounds: tuple[Image, ...]

    def __init__(self, rig: Rig, config: EyesConfig | None = None) -> None:
        """Open the eyes; the first frames tell them the background."""
        checks.instance("rig", rig, Rig)
        config = EyesConfig() if config is None else checks.instance("config", config, EyesConfig)
        n, self._closed = len(rig.cameras), False
        self._max_skew = config.triangulator.max_skew
        self.heads, self.memory = len(rig.heads), _memory_of(rig, config)
        self._handle: EyesHandle = eyes_handle(self.memory)
        self._numbers, self._t = [-1] * n, 0.0
        self._none = [np.empty((0, 0), dtype=np.uint8)] * n
        self._shapes = [(camera.height, camera.width) for camera in rig.cameras]
        self.reset()

    def close(self) -> None:
        """Take no image from now on: a frame is refused."""
        self._closed = True

    def __getstate__(self) -> dict[str, Any]:
        """Return what is known, without the handle to it."""
        return {name: value for name, value in vars(self).items() if name != "_handle"}

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Take what :meth:`__getstate__` returned."""
        vars(self).update(state)
        self._handle = eyes_handle(self.memory)

    def __copy__(self) -> "Eyes":
        """Return eyes that know the same, with memory of their own."""
        return deepcopy(self)

    def reset(self) -> None:
        """Forget the last ball and the background, as before a new throw."""
        forget(self.memory.targets)
        rows, columns = np.max(self._shapes, axis=0)
        whole = (PANORAMA, PANORAMA)
        shapes = [whole] * len(self._shapes) if self.heads else self._shapes
        seen = [np.zeros(shape, np.uint8) for shape in shapes]
        room = 3 * rows if self.heads else rows
        self.backgrounds = (*seen, np.zeros((room, columns), np.uint8))
        self.memory.rig[...] = np.zeros((), localization.RIG)
        self.memory.gaze[...] = head.fresh_gaze(1)
        self._numbers = [-1] * len(self._none)

    def learn_background(self, views: Sequence[tuple[Frame, ...]]) -> None:
        """Learn what the cameras see without the thrown ball; best from ten instants or more.

        The arm is to be where it waits, and what rests may be in view. It holds until ``reset``.
        Cameras that turn learn what lies in the directions that these show: best all in which they
        look for balls, as what they see elsewhere has to move before they turn to it.

        Args:
            views: Frames of each instant, one a camera.

        Raises:
            InputError: A camera was not shown.
            ShapeError: A frame is not as large as the images of its camera.
        """
        if not isinstance(views, tuple | list):
            raise InputError("views", "a list of tuples of frames", checks.shown(views))
        shown = [frame for frames in views for frame in checks.instance("views", frames, tuple)]
        for frame in shown:
            self._check(frame)
        if self.heads:
            self._learn_directions(shown)
            return
        means = []
        for n in range(len(self._shapes)):
            seen = [frame.pixels for frame in shown if frame.camera == n]
            if not seen:
                raise InputError("views", f"a frame of camera {n}", "none")
            means.append(np.rint(np.mean(seen, axis=0)).astype(np.uint8))
        self.backgrounds = (*means, self.backgrounds[-1])
        for target, mean in zip(self.memory.targets, means, strict=True):
            keep_background(target, mean)

    def _learn_directions(self, frames: list[Frame]) -> None:
        """Learn what frames of cameras that turn show where they look, and their faulty pixels."""
        window = self.memory.segment_work[0]["window"]
        for k, own in enumerate(self.memory.targets):
            seen = [f for f in frames if f.camera == k and isfinite(f.pan) and isfinite(f.tilt)]
            if len(seen) > 2:
                keep_faults(own, mean_background([frame.pixels for frame in seen]))
            for frame in seen:
                self.memory.angles[k] = frame.pan, frame.tilt
                head.aim_heads(self._handle)
                pixels = np.ascontiguousarray(frame.pixels)
                remember_turned(pixels, self.backgrounds[k], self.backgrounds[-1], own, window)
            own["looks"] = SWEPT + 1 if seen else own["looks"]

    @property
    def left_out(self) -> int:
        """Bright things beyond those that were looked at in the last search, of the worst camera.

        Those that are least like a ball are left out.
        """
        return int(self.memory.targets["left_out"].max())

    @property
    def status(self) -> EyesStatus:
        """What the last frames said.

        AT_ODDS: both cameras see a target, but for 20 frames and more their lines of sight have not
        met: two different things, cameras that are swapped, or a calibration that
        is not theirs.
        """
        return EyesStatus(int(self.memory.rig["status"][0]))

    def gaze(self, ball: BallState, t: float) -> Array | None:
        """Return where the heads are to look at ``t`` [s]: pan, tilt, rates, shape (n, 4).

        None for cameras that stand still.

        Args:
            ball: Estimate of the ball, at a time near ``t``.
            t: Time at which the heads are to be there [s].
        """
        ball = checks.instance("ball", ball, BallState)
        t = checks.number("t", t, finite=True)
        if not self.heads:
            return None
        desired, motion = np.empty((self.heads, 4)), np.zeros((2, 3))
        if ball.tracked:
            motion[0], motion[1] = ball.r_o + (t - ball.t) * ball.dr_o, ball.dr_o
        t_seen = ball.t_seen if ball.tracked else -inf
        head.lead(self._handle, motion, t_seen, self._t, t, desired)
        return desired

    def guide(self, ball: BallState, t: float, *, alone: bool) -> None:
        """Say where the ball should be; where both cameras see it, that changes nothing.

        Args:
            ball: Estimate of the ball, at a time near ``t``; it counts if its position is known to
                60 mm.
            t: Time of the frames that come next [s].
            alone: Whether one camera counts while something hides the ball from the other.

        Raises:
            InputError: One of them is not what it should be.
        """
        ball = checks.instance("ball", ball, BallState)
        t, alone = checks.number("t", t, finite=True), checks.flag("alone", alone)
        sigma = np.sqrt(np.trace(ball.covariance[:3, :3]) / 3.0) if ball.tracked else np.inf
        localization.guide(self.memory.rig[0], ball.r_o, ball.dr_o, t - ball.t, t, sigma, alone)

    def step(self, frames: tuple[Frame, ...]) -> Sighting:
        """Return where the ball is in frames exposed together.

        Args:
            frames: One a camera, in any order; a camera may be missing, and a frame that was
                seen before, by its number, counts as missing.

        Raises:
            InputError: A frame comes from a camera that the rig does not have, or its image is
                not of type uint8.
            ShapeError: An image has not the size of its camera.
        """
        images, apart, t = self.arrange(frames)
        rig = self.memory.rig[0]
        if frames:
            self._t = t
        if self.heads:
            head.aim_heads(self._handle)
        r_o, covariance = np.empty(3), np.empty((3, 3))
        if localize(images, self.backgrounds, apart, t, self._handle, r_o, covariance):
            return Sighting(t=t + float(rig["late"]), found=True, r_o=r_o, covariance=covariance)
        return no_sighting(t)

    def arrange(self, frames: tuple[Frame, ...]) -> tuple[tuple[Image, ...], int, float]:
        """Return images, which are apart, and the instant of the others, for ``localize``.

        Their instant is the newest: a camera that lags or repeats itself is left out, no other.

        Args:
            frames: As for :meth:`step`.
        """
        images, apart = self._none.copy(), 0
        for frame in checks.instance("frames", frames, tuple):
            self._check(frame)
        if not frames:
            return tuple(images), apart, 0.0
        t = max((frame.t for frame in frames if abs(frame.t) < inf), default=-inf)
        for frame in frames:
            k = frame.camera
            if frame.number == self._numbers[k]:
                continue
            if self.heads and not (isfinite(frame.pan) and isfinite(frame.tilt)):
                continue  # nobody knows where it looks
            self._numbers[k] = frame.number
            pixels = frame.pixels
            images[k] = pixels if pixels.flags.carray else pixels.copy(order="C")
            apart &= ~(1 << k)
            if not abs(frame.t - t) <= self._max_skew:
                apart |= 1 << k
            if self.heads:
                self.memory.angles[k] = frame.pan, frame.tilt
        return tuple(images), apart, t

    def _check(self, frame: Frame) -> None:
        """Refuse a frame of a camera that is not there, or an image that is not of its size."""
        camera = checks.instance("frame", frame, Frame).camera
        if self._closed:
            raise InputError(
                "frames",
                "none where there are no eyes",
                "an image",
                do="give the catcher mitt.Eyes(rig)",
            )
        if not 0 <= camera < len(self._shapes):
            raise InputError("frame.camera", f"0 to {len(self._shapes) - 1}", camera)
        pixels, shape = frame.pixels, self._shapes[camera]
        if pixels.shape != shape or pixels.dtype != _GREY:
            checks.image("frame.pixels", pixels, shape)


def closed_eyes() -> Eyes:
    """Return eyes of a catcher that is given points alone."""
    eyes = Eyes(fixed_rig())
    eyes.close()
    return eyes
