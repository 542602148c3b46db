"""The eyes of the catcher: images in, ball position out, in one compiled call."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum
from math import inf, isfinite, pi, sqrt
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from mitt.errors import InputError, ShapeError
from mitt.signals import Array, BallState, Frame, Image, Sighting
from mitt.vision import segmentation, triangulation
from mitt.vision.camera import Rig
from mitt.vision.gaze import empty_gaze, lead
from mitt.vision.head import HEAD, aim, pack_heads
from mitt.vision.moments import Box
from mitt.vision.segmentation import (
    EXPECTED,
    GAIN,
    GOOD,
    MERGED,
    STATE,
    WEIGHED,
    WEIGHTS,
    SegmenterConfig,
    forget,
    pack_segmenter,
    watch,
)
from mitt.vision.triangulation import (
    TriangulatorConfig,
    note,
    on_ray,
    pack_belief,
    pack_cameras,
    triangulate,
    unseen,
)

KNOWN, SINCE, ODDS, STATUS, SPEED = range(3, 8)
AGE = 10
"""Places in the rig's row of the memory, after the position: sightings that it rests on, looks
since both eyes saw the ball, looks at odds in a row, status, motion a look, looks since the
position was corrected."""
BLIND, ONE, BOTH, AT_ODDS = range(4)

ALONG = 1.0
"""Standard deviation along the ray of a ball that one camera alone sees [m]: a thousand times what
is known of it, and few enough digits away from what is seen across."""
FORGET, STUBBORN = 100.0, 20.0
"""Looks without both eyes after which a place is old; looks at odds that are no accident."""
SURE, MISFIT, SMALL, DRIFT, SLOWLY = 0.002, 0.01, 0.05, 0.0005, 20.0
"""Share of the ball's mass by which a target differs by noise; by which it may differ; what
patches of the ground add to that, over the radius [px]; what each look without both eyes adds;
looks over which the contrast may change."""
ALPHA, BETA, RESTART = 0.5, 0.1, 20.0
"""Gains of position and motion from look to look; looks after which motion is estimated anew."""


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
def _judge(memory: Array, since: float, point: Array) -> bool:
    """Tell by its mass whether a target is the whole ball and nothing else.

    The mass over the area that the ball should have is its contrast, which changes slowly; a
    ball that is hidden in part has less, long before its shape gives it away. A rim that hides a
    share s of the disc moves the centroid by up to s radii: its error widens by that.

    Args:
        memory: Of the camera.
        since: Looks since both eyes saw the ball.
        point: Row of ``points``; its standard deviation is overwritten.
    """
    if memory[EXPECTED] == 0.0 or memory[WEIGHED] == 0.0:
        return True
    lacking = abs(memory[WEIGHTS] / (memory[GAIN] * memory[EXPECTED]) - 1.0)
    radius = sqrt(memory[EXPECTED] / pi)
    off = max(lacking - SURE - 0.5 * SMALL / radius, 0.0) * radius
    point[2] = sqrt(point[2] * point[2] + off * off)
    return bool(lacking < MISFIT + SMALL / radius + DRIFT * since)


@njit(cache=True)
def _learn_contrast(memory: Array) -> None:
    """Take the mass of a target that was believed into the contrast of the ball."""
    if memory[EXPECTED] > 0.0:
        memory[WEIGHED] = min(memory[WEIGHED] + 1.0, SLOWLY)
        gain = memory[WEIGHTS] / memory[EXPECTED]
        memory[GAIN] += (gain - memory[GAIN]) / memory[WEIGHED]


@njit(cache=True)
def _expect(memory: Array, cameras: Array, radius: float, r: Array) -> None:
    """Write what area the ball should have in each image where it is believed to be."""
    for n in range(cameras.shape[0]):
        z, far = 0.0, 0.0
        for i in range(3):
            d = r[i] - cameras[n, 3, i]
            z += cameras[n, i, 2] * d
            far += d * d
        far = sqrt(max(far - radius * radius, radius * radius))
        sine = radius / far
        memory[n, EXPECTED] = pi * (cameras[n, 4, 0] * sine) ** 2 * (far / max(z, radius)) ** 3


@njit(cache=True)
def _foresee(rig: Array) -> None:
    """Move the last position on by one look; forget it where it is old."""
    rig[SINCE] += 1.0
    rig[AGE] += 1.0
    if rig[SINCE] > FORGET:
        rig[KNOWN] = 0.0
    for i in range(3):
        rig[i] += rig[SPEED + i] if rig[KNOWN] > 0.0 else 0.0


@njit(cache=True)
def _remember(rig: Array, r: Array) -> None:
    """Correct position and motion from look to look by an alpha-beta filter."""
    looks = max(rig[AGE], 1.0)
    count = rig[KNOWN] if looks < RESTART else 0.0
    for i in range(3):
        error = r[i] - rig[i]
        rig[i] = r[i] if count < 2.0 else rig[i] + ALPHA * error
        if count == 0.0:
            rig[SPEED + i] = 0.0
        else:
            rig[SPEED + i] += (1.0 if count == 1.0 else BETA) * error / looks
    rig[KNOWN], rig[AGE] = min(count + 1.0, SLOWLY), 0.0


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
        memory: What is remembered of each camera, and in the last row of the rig: last position
            [m], and what ``KNOWN`` and its likes say; overwritten, shape (n + 1, MEMORY).
        settings: Numbers of the segmenter, shape (6,).
        boxes: Scratch, shape (segmentation.WORK, 4).
        cameras: As in the table of :mod:`mitt.vision.triangulation`, shape (n, 5, 3).
        belief: As of :func:`mitt.vision.triangulation.pack_belief`, shape (4,).
        work: Scratch, shape (triangulation.WORK + n, 3).
        r: Result, centre of the ball [m], shape (3,).
        P: Result, its covariance [m^2], shape (3, 3).

    Returns:
        Whether two or more cameras agree on the ball, or one alone sees it go on; one does not
        count while something comes between the ball and the other, as before a catch: what is
        hidden from one is soon half hidden from both, and the flight model knows better.
    """
    points, count, one, rig = work[triangulation.WORK :], 0, -1, memory[len(images)]
    hidden = False
    _foresee(rig)
    if rig[KNOWN] > 0.0:
        _expect(memory, cameras, belief[0], rig)
    else:
        memory[: len(images), EXPECTED] = 0.0
        memory[: len(images), WEIGHED] = 0.0
    for n in range(len(images)):
        points[n, 2] = -1.0
        if images[n].size == 0:
            continue
        area, clipped = watch(images[n], memory[n], settings, boxes)
        hidden |= memory[n, STATE] >= MERGED
        if not (together[n] and area > 0 and memory[n, STATE] == GOOD):
            continue
        u, v = memory[n, 0], memory[n, 1]
        if note(points[n], u, v, float(area), clipped, belief[1], belief[2]) == 0:
            continue
        if _judge(memory[n], rig[SINCE], points[n]):
            count, one = count + 1, n
        else:
            points[n, 2], hidden = -1.0, True
    rig[STATUS] = float(BLIND)
    if count >= 2:
        if triangulate(cameras, points, belief[0], r, P, work) <= belief[3]:
            _remember(rig, r)
            rig[SINCE], rig[ODDS], rig[STATUS] = 0.0, 0.0, float(BOTH)
            for n in range(len(images)):
                if points[n, 2] > 0.0:
                    _learn_contrast(memory[n])
            return True
        rig[ODDS] += 1.0
        rig[STATUS] = float(AT_ODDS if rig[ODDS] >= STUBBORN else BLIND)
        return False
    if (
        count == 1
        and not hidden
        and rig[KNOWN] > 0.0
        and on_ray(cameras[one], points[one], belief[0], rig[:3], r, P, ALONG)
    ):
        _remember(rig, r)
        rig[STATUS] = float(ONE)
        return True
    return False


class EyesStatus(Enum):
    """What the eyes can say of the ball."""

    BLIND = BLIND
    ONE = ONE
    BOTH = BOTH
    AT_ODDS = AT_ODDS


LET_GO = 0.1
"""Time without a sighting after which the heads no longer follow the filter [s]."""

_PARTS = (
    "memory", "settings", "boxes", "cameras", "belief", "work", "heads", "angles", "gaze",
    "gaze_work",
)  # fmt: skip
"""Arrays of the eyes that the compiled tick takes over."""


class Eyes:
    """Segmentation for each camera of a rig, triangulation, and the gaze of its heads.

    The kernels are those of ``Segmenter`` and ``Triangulator``, composed.

    Attributes:
        heads: Number of heads; 0 where the cameras stand still.
    """

    def __init__(self, rig: Rig, config: EyesConfig | None = None) -> None:
        """Open the eyes; the first frames tell them the ground."""
        config = config or EyesConfig()
        n = len(rig.cameras)
        self._max_skew = config.triangulator.max_skew
        self._settings = pack_segmenter(config.segmenter)
        self._cameras = pack_cameras(rig)
        self._belief = pack_belief(config.triangulator, config.ball_radius, rig)
        self._memory = np.empty((n + 1, segmentation.MEMORY))
        self.heads = len(rig.heads)
        rows = max(self.heads, 1)  # a rig that stands still has a row that is not used
        self._heads, self._angles = np.zeros((rows, HEAD)), np.zeros((rows, 2))
        self._heads[: self.heads] = pack_heads(rig)
        self._gaze, self._gaze_work = empty_gaze(rows), np.zeros((7, 3))
        self._numbers, self._t = [-1] * n, 0.0
        self._boxes = np.zeros((segmentation.WORK, 4), dtype=np.int64)
        self._work = np.empty((triangulation.WORK + n, 3))
        self._none = [np.empty((0, 0), dtype=np.uint8)] * n
        self._still = (True,) * n
        self._nothing = tuple(self._none), self._still, 0.0
        self.reset()

    def reset(self) -> None:
        """Forget the last ball, as before a new throw."""
        forget(self._memory)
        self._memory[-1] = 0.0
        self._gaze[:] = empty_gaze(len(self._gaze))
        self._numbers = [-1] * len(self._none)

    @property
    def status(self) -> EyesStatus:
        """What the last look said.

        AT_ODDS: both cameras see a target, but for ``STUBBORN`` looks and more their lines of
        sight have not met: two different things, cameras that are swapped, or a calibration that
        is not theirs.
        """
        return EyesStatus(int(self._memory[-1, STATUS]))

    def gaze(self, ball: BallState, t: float) -> Array | None:
        """Return where the heads are to look at ``t`` [s]: pan, tilt, rates, shape (n, 4).

        None for cameras that stand still.

        Args:
            ball: Estimate of the ball, at a time near ``t``.
            t: Time at which the heads are to be there [s].
        """
        if not self.heads:
            return None
        wanted, motion = np.empty((self.heads, 4)), np.zeros((2, 3))
        if ball.tracked:
            motion[0], motion[1] = ball.r_o + (t - ball.t) * ball.dr_o, ball.dr_o
        lead(
            self._heads,
            self._cameras,
            self._memory,
            self._gaze,
            motion,
            ball.tracked and ball.t - ball.t_seen < LET_GO,
            self._t,
            t,
            self._gaze_work,
            wanted,
        )
        return wanted

    def parts(self) -> dict[str, NDArray[Any]]:
        """Return the arrays of :func:`look` and of the gaze, for whoever composes them."""
        return {name: vars(self)[f"_{name}"] for name in _PARTS}

    def move_to(self, parts: Mapping[str, NDArray[Any]]) -> None:
        """Use other arrays from now on, named and shaped as :meth:`parts`; values as they are."""
        for name in _PARTS:
            vars(self)[f"_{name}"] = parts[name]

    def step(self, frames: tuple[Frame, ...]) -> Sighting:
        """Return where the ball is in frames exposed together.

        Args:
            frames: One a camera, in any order; a camera may be missing, and a frame that was
                seen before, by its number, counts as missing.

        Raises:
            InputError: A frame comes from a camera that the rig does not have.
            ShapeError: A frame is not a two-dimensional image.
        """
        images, together, t = self.arrange(frames)
        self._t = t
        if self.heads:
            aim(self._heads, self._angles, self._cameras)
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

        Their instant is the newest: a camera that lags or repeats itself is left out, no other.

        Args:
            frames: As for :meth:`step`.
        """
        if not frames:
            return self._nothing
        t = -inf
        for frame in frames:
            if t < frame.t < inf:
                t = frame.t
        images, together, numbers = self._none.copy(), self._still, self._numbers
        for frame in frames:
            k = frame.camera
            if not 0 <= k < len(images):
                raise InputError("frame.camera", f"0 to {len(images) - 1}", k)
            if frame.number == numbers[k]:
                continue
            if self.heads and not (isfinite(frame.pan) and isfinite(frame.tilt)):
                continue  # nobody knows where it looks
            numbers[k] = frame.number
            pixels = frame.pixels
            plain = pixels.size > 0 and pixels.ndim == 2 and pixels.flags.carray
            images[k] = pixels if plain else _plain(pixels)
            if frame.t != t:
                near = abs(frame.t - t) <= self._max_skew
                together = (*together[:k], near, *together[k + 1 :])
            if self.heads:
                self._angles[k] = frame.pan, frame.tilt
        return tuple(images), together, t


def _plain(pixels: Image) -> Image:
    """Return a copy, as the kernels take it, of an image that is a window or write-protected."""
    if pixels.ndim != 2 or pixels.size == 0:
        raise ShapeError("frame.pixels", "(height, width)", pixels.shape)
    return np.array(pixels, dtype=np.uint8, order="C")
