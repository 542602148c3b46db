"""What the image sensors give: a bright ball before a wall, arm and hand, with noise and smear.

Noise and wall come from banks (``noise``); each frame starts to read the noise at an offset drawn
from the generator. The drawing itself is in ``exposure``.
"""

from collections.abc import Sequence
from dataclasses import asdict, dataclass, fields
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from mitt.errors import InputError
from mitt.signals import Array, Frame, Image
from mitt.vision.camera import Rig, pack_cameras
from mitt.world.exposure import Bank, Cameras, render_images
from mitt.world.heads import Heads
from mitt.world.noise import NOISE_SIZE, PERIOD, SIDE, noise_bank
from mitt.world.outline import SCRATCH
from mitt.world.painting import Light
from mitt.world.scene import Scene

BLOCK = 512
"""Frames whose offsets into the noise banks are drawn at once."""

Film: TypeAlias = tuple[Cameras, Bank, NDArray[np.int64]]
"""What :func:`mitt.world.exposure.render_images` takes: cameras, banks, offsets of a block."""

BEFORE = 0.008
"""Time between looks before a throw [s]: ten of them see a lamp of 100 Hz in all its phases."""
_DARK = 64.0
"""Grey level up to which arm and hand may take their noise from the background's."""
_NOTHING = np.zeros((0, 8))
_NOWHERE, _STILL = np.full(3, np.nan), np.zeros(3)


@dataclass(frozen=True, slots=True, kw_only=True)
class ImageSensor:
    """Settings of the image sensors and of what they see beside the ball.

    The defaults give 3.2 grey levels of noise on the ball and 2.2 on the ground, a signal to
    noise ratio of 50: a fast sensor with some gain.

    Attributes:
        brightness: Grey levels of the ball above the mean of the ground, without noise.
        background: Mean grey level of the ground.
        texture: Standard deviation of the ground, gradients and patches [grey levels].
        body: Grey level of arm and hand.
        read_noise: Standard deviation of the Gaussian read noise [grey levels].
        electrons: Photo-electrons a grey level; shot noise has the variance value / electrons.
        exposure: How long the shutter is open [s].
        hand: Grey level of the hand; that of the arm if None.
        shading: Relative difference between the middle of arm and hand and their lit side.
        grain: Relative amplitude of the texture of arm and hand.
        blur: Standard deviation of the blur of the lens [px].
        pattern: Contrast [grey levels] and size [px] of squares on the background.
        light: Relative amplitude and frequency [Hz] of the illumination; its phase is random.
        shadow: Relative depth of a soft shadow, and the speed of its edge [px/s]; at a random
            place as the ball is released.
    """

    brightness: float = 160.0
    background: float = 24.0
    texture: float = 3.0
    body: float = 12.0
    read_noise: float = 2.0
    electrons: float = 30.0
    exposure: float = 5e-4
    hand: float | None = None
    shading: float = 0.0
    grain: float = 0.0
    blur: float = 0.0
    pattern: tuple[float, float] = (0.0, 8.0)
    light: tuple[float, float] = (0.0, 100.0)
    shadow: tuple[float, float] = (0.0, 0.0)

    def __post_init__(self) -> None:
        """Refuse values that no 8-bit sensor has."""
        values = asdict(self) | {
            "hand": self.hand_level,
            "pattern": min(self.pattern),
            "light": min(self.light),
            "shadow": self.shadow[0],
        }
        for name, value in values.items():
            if not 0.0 <= value < float("inf"):
                raise InputError(name, "a finite number, not negative", value)
        brightest = max(self.background + self.brightness, self.body, self.hand_level)
        if self.electrons == 0.0 or brightest > 255.0:
            raise InputError(
                "image sensor", "electrons > 0, background + brightness, body, hand <= 255", self
            )
        if self.blur > 3.0 or max(self.light[0], self.shadow[0], self.shading, self.grain) > 0.9:
            raise InputError("image sensor", "blur <= 3 px, relative amplitudes <= 0.9", self)

    @property
    def hand_level(self) -> float:
        """Grey level of the hand."""
        return self.body if self.hand is None else self.hand

    @property
    def painted(self) -> bool:
        """Whether images need :mod:`mitt.world.painting`.

        Without, noise is that of the background wherever the ball is not.
        """
        shares = self.shading, self.grain, self.blur, self.pattern[0], self.light[0], self.shadow[0]
        return max(shares) > 0.0 or self.hand_level != self.body or self.body > _DARK


def sensor_of(scene: Scene) -> ImageSensor:
    """Return the image sensors of a scene: of its ``sensing`` what a sensor has by that name."""
    own = {x.name: getattr(scene.sensing, x.name) for x in fields(ImageSensor)
           if hasattr(scene.sensing, x.name)}  # fmt: skip
    return ImageSensor(brightness=scene.ball.brightness, **own)


def whole_images(shapes: Sequence[tuple[int, int]]) -> NDArray[np.int64]:
    """Return windows that are whole images, for :func:`mitt.world.exposure.draw_images`."""
    return np.array([(0, height - 1, 0, width - 1) for height, width in shapes], dtype=np.int64)


def _light(sensor: ImageSensor, side: int, rng: np.random.Generator) -> Light:
    """Return light and noise as in :mod:`mitt.world.painting`.

    Args:
        sensor: Settings.
        side: Pixels of the largest image.
        rng: Not drawn from; what moves has a stream of its own.
    """
    phase, place = rng.spawn(1)[0].random(2)
    return Light(
        float(sensor.read_noise), float(sensor.electrons), float(sensor.body),
        float(sensor.hand_level), float(sensor.shading), float(sensor.grain), float(sensor.blur),
        float(sensor.light[0]), float(sensor.light[1]), phase=float(2.0 * np.pi * phase),
        shadow=float(sensor.shadow[0]), shadow_speed=float(sensor.shadow[1]),
        shadow_start=float(side * place), painted=sensor.painted,
    )  # fmt: skip


class Imager:
    """The cameras of a rig as sensors: renders one ``Frame`` a camera at each call."""

    def __init__(
        self,
        rig: Rig,
        sensor: ImageSensor,
        rng: np.random.Generator,
        *,
        second: tuple[float, float, float, float] | None = None,
        second_velocity: tuple[float, float, float] = (0.0, 0.0, 0.0),
    ) -> None:
        """Lay the cameras out in arrays.

        Args:
            rig: Cameras to see with; their heads begin where they wait for a ball.
            sensor: Light and noise.
            rng: Source of every frame's offset into the noise banks.
            second: A second bright ball: its centre as the first is released, its radius [m].
            second_velocity: Its velocity [m/s].

        Raises:
            InputError: An image is larger than the banks.
        """
        largest = max(max(c.height, c.width) for c in rig.cameras)
        if largest > SIDE - PERIOD:
            raise InputError("rig", f"images of at most {SIDE - PERIOD} pixels a side", largest)
        self._shapes = [(c.height, c.width) for c in rig.cameras]
        optics = np.repeat(pack_cameras(rig)[:, None], 2, axis=1)
        self._heads = Heads(rig)
        self._packed, self._state = self._heads.packed, self._heads.state
        self._turnable, self._half = len(self._state) > 0, 0.5 * sensor.exposure
        light = _light(sensor, largest, rng)
        level = sensor.background + sensor.brightness
        balls = np.full((1 if second is None else 2, 14), level)
        if second is not None:
            balls[1, :7] = (*second[:3], *second)
            balls[1, 8:] = (*second[:3], *second_velocity)
        bank = noise_bank(
            background=sensor.background, texture=sensor.texture, body=sensor.body,
            read_noise=sensor.read_noise, electrons=sensor.electrons, pattern=sensor.pattern,
        )  # fmt: skip
        self._whole = whole_images(self._shapes)
        work = np.zeros(SCRATCH + 2 * max(c.width for c in rig.cameras) + 1)
        self._rng, self._early = rng, rng.spawn(1)[0]
        self._number = 0
        self._starts = self._draw_starts(rng)
        canvas = np.zeros(2 * largest * largest if sensor.painted else 0, np.float32)
        self._camera: Cameras = (
            self._packed, self._state, optics, np.zeros((len(optics), 2)), balls, light, work,
            canvas,
        )  # fmt: skip
        self._banks: Bank = bank.wall, bank.ground, bank.normal

    @property
    def film(self) -> Film:
        """What compiled code needs to expose as :meth:`render` does, for the block at hand."""
        return self._camera, self._banks, self._starts

    @property
    def a_pair(self) -> bool:
        """Whether these are two cameras that do not turn, with images of one size."""
        return len(self._shapes) == 2 and len(set(self._shapes)) == 1 and not self._turnable

    @property
    def shape(self) -> tuple[int, int]:
        """Height and width of the first camera's images [px]."""
        return self._shapes[0]

    @property
    def half(self) -> float:
        """Half the time that the shutter is open [s]."""
        return self._half

    def advance(self, frames: int) -> None:
        """Count frames that compiled code has exposed; no more than are left of a block."""
        self._number += frames
        if self._number % BLOCK == 0 and frames > 0:
            self._starts = self._draw_starts(self._rng)

    def turn(self, gaze: Array | None, duration: float) -> None:
        """Let the heads, if there are any, follow ``gaze`` for ``duration`` [s].

        Args:
            gaze: Pan, tilt [rad] and their rates [rad/s] for the end of that time, shape (n, 4).
            duration: Time to pass [s].
        """
        if self._turnable:
            self._heads.turn(gaze, duration)

    def before(self, count: int, capsules: Array) -> list[tuple[Frame, ...]]:
        """Return looks at the scene before the release, as :meth:`render` without a ball.

        Args:
            count: Number of looks, BEFORE apart.
            capsules: As for :meth:`render`.
        """
        starts, views = self._draw_starts(self._early), []
        for k in range(count):
            t, images = BEFORE * (k - count), [np.empty(shape, np.uint8) for shape in self._shapes]
            render_images(
                tuple(images), self._camera, self._banks, starts[k], self._half, 0.0, _NOWHERE,
                _STILL, capsules, self._whole, t,
            )  # fmt: skip
            views.append(_frames(t, k - count, images))
        return views

    def render(
        self,
        t: float,
        r_o: Array | None,
        radius: float,
        *,
        dr_o: Array | None = None,
        capsules: Array = _NOTHING,
    ) -> tuple[Frame, ...]:
        """Return what the cameras see at ``t``.

        Args:
            t: Middle of the exposure [s].
            r_o: Ball centre [m], shape (3,); None for an empty scene.
            radius: Ball radius [m].
            dr_o: Ball velocity [m/s], shape (3,); at rest if left out.
            capsules: Arm and hand, as in :mod:`mitt.world.painting`.
        """
        number, row = self._number, self._number % BLOCK
        images = tuple([np.empty(shape, np.uint8) for shape in self._shapes])
        r_o, dr_o = _NOWHERE if r_o is None else r_o, _STILL if dr_o is None else dr_o
        render_images(
            images, self._camera, self._banks, self._starts[row], self._half, radius, r_o, dr_o,
            capsules, self._whole, t,
        )  # fmt: skip
        self.advance(1)
        heads = [self._heads.read(n) for n in range(len(images))] if self._turnable else None
        return _frames(t, number, images, heads)

    def _draw_starts(self, rng: np.random.Generator) -> NDArray[np.int64]:
        """Return offsets of the next frames into both banks, shape (block, n, 2)."""
        most = [[NOISE_SIZE - height * width] * 2 for height, width in self._shapes]
        return rng.integers(0, most, size=(BLOCK, len(most), 2))


def _frames(
    t: float, number: int, images: Sequence[Image], heads: list[tuple[float, float]] | None = None
) -> tuple[Frame, ...]:
    """Return images as frames; ``heads`` are pan and tilt of each camera [rad]."""
    angles = heads or [(0.0, 0.0)] * len(images)
    return tuple(
        Frame(t=t, camera=n, number=number, pixels=pixels, pan=angles[n][0], tilt=angles[n][1])
        for n, pixels in enumerate(images)
    )
