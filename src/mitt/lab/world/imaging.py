"""What the image sensors give: bright balls before a wall, arm and hand, with noise and smear.

Fresh normal numbers for an image cost fifty times as much as a look into a bank, and a bank for
each trial as much as a third of the trial. So noise and wall follow from the sensor alone, and a
trial's own source of noise only says where in the bank each frame begins to read. The drawing
itself is in ``painting``. Cameras may stand on pan-tilt heads with servos, limits and encoders.
"""

from collections.abc import Sequence
from dataclasses import dataclass, fields
from functools import lru_cache
from math import sqrt
from typing import Annotated

import numpy as np
from numpy.typing import NDArray

from mitt.core import checks
from mitt.core.errors import InputError
from mitt.core.eyes.camera import Rig, pack_cameras
from mitt.core.eyes.head import BREADTH, pack_heads
from mitt.core.fields import Range, Settings, check
from mitt.core.kernels import Record, kernel
from mitt.core.signals import Array, Frame, Image
from mitt.lab.world.outline import scratch_for
from mitt.lab.world.painting import PERIOD, Exposure, Film, Optics, PaintedBalls, render_images
from mitt.lab.world.scene import Scene

BLOCK = 512
"""Frames whose offsets into the bank of noise are drawn at once."""
NOISE_SIZE = 1 << 20
"""Numbers in the bank of noise."""
_LARGEST = 1024
"""Margin of the wall for the largest image, and so its largest side [px]."""
_PATCH = 8.0
_GRADIENT = 0.6
"""Size of the wall's patches [px] and the share of its variance that is a slow gradient; choices of
this project."""
_USUAL = 128
_WINDOW = (24.0, 40.0)
_LAMP = (1.0, 5.0)
"""Side of a usual image, and sides of windows and lamps in it [px]; choices of this project."""
_HOT = (40, 200)
"""What hot pixels add [grey levels]; a choice of this project."""
_BEFORE = 0.008
"""Time between looks before a throw [s]: ten of them see a lamp of 100 Hz in all its phases."""
_BANDWIDTH = 300.0
_STEPS = 4
"""Bandwidth of the heads' servos [rad/s]; steps of integration in a tick."""

_NOTHING = np.zeros((0, 8))
_NOWHERE = np.full(3, np.nan)
_STILL = np.zeros(3)


#: Grey levels of 8 bits, and relative amplitudes.
_LEVEL = Range(0.0, 255.0)
_RELATIVE = Range(0.0, 0.9)


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class ImageSensor(Settings):
    """Settings of the image sensors and of what they see beside the ball.

    The defaults give 3.2 grey levels of noise on the ball and 2.2 on the ground, a signal to
    noise ratio of 50: a fast sensor with some gain.

    Attributes:
        brightness: Grey levels of the ball above the mean of the ground, without noise; negative
            for one that is darker.
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
        slope: Amplitude of a slow change of the background from side to side [grey levels].
        lamps: Number of small bright things in the background of an image, and their level.
        windows: Number of large ones, of a quarter of an image a side, and their level.
        hot: Hot pixels of each camera.
        readout: Time from the exposure of the first row to that of the last [s]: 0 for a global
            shutter. Images are stamped with the time of the middle one.
    """

    brightness: Annotated[float, Range(-255.0, 255.0)] = 160.0
    background: Annotated[float, _LEVEL] = 24.0
    texture: Annotated[float, _LEVEL] = 3.0
    body: Annotated[float, _LEVEL] = 12.0
    read_noise: Annotated[float, _LEVEL] = 2.0
    electrons: Annotated[float, Range(1e-6, 1e300)] = 30.0
    exposure: Annotated[float, Range(0.0, 1.0)] = 5e-4
    hand: Annotated[float | None, _LEVEL] = None
    shading: Annotated[float, _RELATIVE] = 0.0
    grain: Annotated[float, _RELATIVE] = 0.0
    blur: Annotated[float, Range(0.0, 3.0)] = 0.0
    pattern: Annotated[tuple[float, float], Range(0.0, 1e6, rises=False)] = (0.0, 8.0)
    light: Annotated[tuple[float, float], Range(0.0, 1e6, rises=False)] = (0.0, 100.0)
    shadow: Annotated[tuple[float, float], Range(-1e6, 1e6, rises=False)] = (0.0, 0.0)
    slope: Annotated[float, _LEVEL] = 0.0
    lamps: Annotated[tuple[float, float], Range(0.0, 1e3, rises=False)] = (0.0, 220.0)
    windows: Annotated[tuple[float, float], Range(0.0, 1e3, rises=False)] = (0.0, 250.0)
    hot: Annotated[int, Range(0, 10_000)] = 0
    readout: Annotated[float, Range(0.0, 0.1)] = 0.0

    def __post_init__(self) -> None:
        """Refuse values that no 8-bit sensor has."""
        check(self)
        if not 0.0 <= self.background + self.brightness <= 255.0:
            raise InputError("ImageSensor", "background + brightness in 0..255", self)
        if self.light[0] > 0.9 or not 0.0 <= self.shadow[0] <= 0.9:
            raise InputError("ImageSensor", "amplitudes of light and shadow in 0..0.9", self)

    @property
    def hand_level(self) -> float:
        """Grey level of the hand."""
        return self.body if self.hand is None else self.hand


def sensor_of(scene: Scene) -> ImageSensor:
    """Return the image sensors of a scene: of its ``sensing`` what a sensor has by that name."""
    own = {
        x.name: getattr(scene.sensing, x.name)
        for x in fields(ImageSensor)
        if hasattr(scene.sensing, x.name)
    }
    return ImageSensor(brightness=scene.ball.brightness, **own)


def _light(sensor: ImageSensor, side: int, rng: np.random.Generator) -> Optics:
    """Return light and noise; what moves on images of so many pixels has a stream of its own.

    An exposure of a whole period of the lamps sees no flicker.
    """
    phase, place = rng.spawn(1)[0].random(2)
    return Optics(
        float(sensor.read_noise),
        float(sensor.electrons),
        float(sensor.body),
        float(sensor.hand_level),
        float(sensor.shading),
        float(sensor.grain),
        float(sensor.blur),
        float(sensor.light[0] * np.sinc(sensor.light[1] * sensor.exposure)),
        float(sensor.light[1]),
        phase=float(2.0 * np.pi * phase),
        shadow=float(sensor.shadow[0]),
        shadow_speed=float(sensor.shadow[1]),
        shadow_start=float(side * place),
    )


@lru_cache(maxsize=8)
def bank_of(
    background: float,
    texture: float,
    pattern: tuple[float, float],
    slope: float = 0.0,
    lamps: tuple[float, float] = (0.0, 0.0),
    windows: tuple[float, float] = (0.0, 0.0),
) -> tuple[Image, NDArray[np.float32]]:
    """Return wall and noise; the same arrays for the same settings, not to be written to.

    Args:
        background: Mean grey level of the ground.
        texture: Standard deviation of the ground, gradients and patches [grey levels].
        pattern: Contrast [grey levels] and size [px] of squares on the background.
        slope: Amplitude of its slow change from side to side [grey levels].
        lamps: Number of small bright things an image, and their level [grey levels].
        windows: The same of large ones.

    Returns:
        The background as it would look without noise, periodic, shape (2048, 2048), and standard
        normal numbers, shape (NOISE_SIZE,).
    """
    rng = np.random.default_rng(2002)
    rng.standard_normal(NOISE_SIZE, dtype=np.float32)  # a bank that is no longer used
    normal = rng.standard_normal(NOISE_SIZE).astype(np.float32)
    wall = _wall(background, texture, slope, rng)
    wall = _squares(wall, *pattern) if pattern[0] > 0.0 else wall
    for (count, level), sides in ((windows, _WINDOW), (lamps, _LAMP)):
        wall = _bright(wall, count, level, sides, rng) if count > 0.0 else wall
    return wall, normal


def _bright(
    wall: Image,
    count: float,
    level: float,
    sides: tuple[float, float],
    rng: np.random.Generator,
) -> Image:
    """Return a wall with rectangles of a level, so many in a part as large as a usual image."""
    wall, most = wall.copy(), round(count * (PERIOD / _USUAL) ** 2)
    for row, column, high, wide in rng.uniform(
        (0, 0, sides[0], sides[0]), (PERIOD, PERIOD, sides[1], sides[1]), (most, 4)
    ).astype(int):
        rows, columns = np.arange(row, row + high), np.arange(column, column + wide)
        for down in (0, PERIOD):
            for right in (0, PERIOD):
                wall[np.ix_((rows + down) % (2 * PERIOD), (columns + right) % (2 * PERIOD))] = level
    return wall


def _wall(background: float, texture: float, slope: float, rng: np.random.Generator) -> Image:
    """Return the background: patches on a slow gradient, periodic both ways."""
    k = np.fft.fftfreq(PERIOD)
    smooth = np.exp(-0.5 * (2.0 * np.pi * _PATCH) ** 2 * (k[:, None] ** 2 + k[None, :] ** 2))
    patches = np.fft.ifft2(np.fft.fft2(rng.standard_normal((PERIOD, PERIOD))) * smooth).real
    wave = 2.0 * np.pi / PERIOD * np.arange(PERIOD)
    waves = np.sin(2.0 * wave)[:, None] + np.cos(3.0 * wave)[None, :]
    shape = sqrt(1.0 - _GRADIENT) * patches / patches.std() + sqrt(_GRADIENT) * waves / waves.std()
    level = background + texture * shape + slope * np.cos(4.0 * wave)[None, :]
    tile = np.clip(np.rint(level), 0.0, 255.0).astype(np.uint8)
    return np.ascontiguousarray(np.tile(tile, (2, 2)))


def _squares(wall: Image, contrast: float, size: float) -> Image:
    """Return a wall with squares in turn brighter and darker by half a contrast."""
    k = np.arange(PERIOD + _LARGEST) % PERIOD // max(round(size), 1)
    sign = 1.0 - 2.0 * ((k[:, None] + k[None, :]) % 2)
    return np.clip(np.rint(wall + 0.5 * contrast * sign), 0.0, 255.0).astype(np.uint8)


@kernel
def _follow(heads: Record, angles: Array, desired: Array, duration: float) -> None:
    """Let the servos follow for a while, within the limits of speed and acceleration.

    A loop of angle around a loop of rate, critically damped, with the desired rate fed forward.
    A long way is driven no faster than can be braked away, so that it does not overshoot.

    Args:
        heads: As in :mod:`mitt.core.eyes.head`.
        angles: Pan, tilt and their rates [rad, rad/s], shape (n, 4); overwritten.
        desired: The same at the end of the time, by the catcher's command.
        duration: Time to pass [s].
    """
    h = duration / _STEPS
    for n in range(angles.shape[0]):
        top, most = heads[n].max_speed, heads[n].max_accel
        for axis in range(2):
            angle, rate, drift = angles[n, axis], angles[n, axis + 2], desired[n, axis + 2]
            for k in range(_STEPS):
                gap = desired[n, axis] - drift * (duration - k * h) - angle
                reach = sqrt(1.6 * most * abs(gap))
                goal = drift + min(max(0.25 * _BANDWIDTH * gap, -reach), reach)
                accel = min(max(_BANDWIDTH * (goal - rate), -most), most)
                faster = min(max(rate + h * accel, -top), top)
                angle += 0.5 * h * (rate + faster)
                rate = faster
            angles[n, axis], angles[n, axis + 2] = angle, rate


class Heads:
    """The heads of a rig in one trial.

    Attributes:
        packed: The heads as the kernels take them; no rows for a fixed rig.
        angles: True angles [rad] and rates [rad/s], shape (n, 4).
    """

    def __init__(self, rig: Rig) -> None:
        """Begin at rest, where the heads wait for a ball."""
        self.packed = pack_heads(rig)
        self.angles = np.zeros((len(rig.heads), 4))
        for row, head in zip(self.angles, rig.heads, strict=True):
            row[:2] = head.search
        self._waiting = rig.heads
        self._steps = [head.encoder_step for head in rig.heads]

    def look_aside(self, number: int | None) -> None:
        """Stand still at one of nine places about where the heads wait; for None there."""
        for row, head in zip(self.angles, self._waiting, strict=True):
            row[:] = *head.search, 0.0, 0.0
            if number is not None:
                row[0] += (number % 3 - 1) * BREADTH * head.search[0]
                row[1] += (number // 3 % 3 - 1) * head.nod

    def turn(self, desired: Array | None, duration: float) -> None:
        """Follow ``desired`` for ``duration`` [s]; stay where there is none or it is not finite."""
        if desired is not None:
            desired = checks.array("gaze", desired, self.angles.shape)
        if desired is None or not np.all(np.isfinite(desired)):
            desired = self.angles * (1.0, 1.0, 0.0, 0.0)
        _follow(self.packed, self.angles, desired, duration)

    def read(self, n: int) -> tuple[float, float]:
        """Return pan and tilt of a head as its encoders count them [rad]."""
        pan, tilt = float(self.angles[n, 0]), float(self.angles[n, 1])
        step = self._steps[n]
        if step == 0.0:
            return pan, tilt
        return step * round(pan / step), step * round(tilt / step)


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
            rng: Source of every frame's offset into the bank of noise.
            second: A second bright ball: its centre as the first is released, its radius [m].
            second_velocity: Its velocity [m/s].

        Raises:
            InputError: An image is larger than the wall.
        """
        largest = max(max(c.height, c.width) for c in rig.cameras)
        if largest > _LARGEST:
            raise InputError("rig", f"images of at most {_LARGEST} pixels a side", largest)
        self._shapes = [(c.height, c.width) for c in rig.cameras]
        self._heads = Heads(rig)
        light = _light(sensor, largest, rng)
        wall, normal = bank_of(
            sensor.background,
            sensor.texture,
            sensor.pattern,
            sensor.slope,
            sensor.lamps,
            sensor.windows,
        )
        self._film = Film(
            half=0.5 * sensor.exposure,
            heads=self._heads.packed,
            angles=self._heads.angles,
            optics=np.repeat(pack_cameras(rig)[:, None], 2, axis=1),
            balls=_balls(sensor.background + sensor.brightness, second, second_velocity),
            light=light,
            wall=wall,
            normal=normal,
            work=scratch_for(max(c.width for c in rig.cameras)),
            canvas=np.zeros(2 * largest * largest, np.float32),
            hot=_hot_pixels(sensor.hot, self._shapes),
            readout=sensor.readout,
        )
        self._windows = np.array([(0, v - 1, 0, u - 1) for v, u in self._shapes], dtype=np.int64)
        self._rng, self._early = rng, rng.spawn(1)[0]
        self._number = 0
        self._starts = self._draw_starts(rng)

    @property
    def film(self) -> tuple[Film, NDArray[np.int64]]:
        """What compiled code needs to expose as :meth:`render` does, for the block at hand."""
        return self._film, self._starts

    @property
    def a_pair(self) -> bool:
        """Whether these are two cameras that do not turn, with images of one size."""
        return len(self._shapes) == 2 and len(set(self._shapes)) == 1 and not self._turnable

    @property
    def shape(self) -> tuple[int, int]:
        """Height and width of the first camera's images [px]."""
        return self._shapes[0]

    @property
    def _turnable(self) -> bool:
        """Whether there are heads."""
        return len(self._heads.angles) > 0

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

        Heads look in turn to all sides of where they wait for a ball.

        Args:
            count: Number of looks.
            capsules: As for :meth:`render`.
        """
        starts, views = self._draw_starts(self._early), []
        for k in range(count):
            shot = Exposure(_BEFORE * (k - count), 0.0, _NOWHERE, _STILL, capsules)
            self._heads.look_aside(k)
            read = self._read()
            views.append(_frames(shot.t, k - count, self._exposed(starts[k], shot), read))
        self._heads.look_aside(None)
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
            capsules: Arm and hand, as in :mod:`mitt.lab.world.capsules`.
        """
        r_o, dr_o = _NOWHERE if r_o is None else r_o, _STILL if dr_o is None else dr_o
        shot, number = Exposure(t, radius, r_o, dr_o, capsules), self._number
        images = self._exposed(self._starts[number % BLOCK], shot)
        self.advance(1)
        return _frames(t, number, images, self._read())

    def _read(self) -> list[tuple[float, float]] | None:
        """Return pan and tilt of each head as its encoders count them [rad]; None without."""
        return [self._heads.read(n) for n in range(len(self._shapes))] if self._turnable else None

    def _exposed(self, starts: NDArray[np.int64], shot: Exposure) -> tuple[Image, ...]:
        """Return fresh images of what is in view."""
        images = tuple([np.empty(shape, np.uint8) for shape in self._shapes])
        render_images(images, self._film, starts, shot, self._windows)
        return images

    def _draw_starts(self, rng: np.random.Generator) -> NDArray[np.int64]:
        """Return where the noise of the next frames begins, shape (BLOCK, n)."""
        most = [[NOISE_SIZE - height * width] * 2 for height, width in self._shapes]
        # The first of two is of a bank that is no longer used.
        return np.ascontiguousarray(rng.integers(0, most, size=(BLOCK, len(most), 2))[..., 1])


def _hot_pixels(count: int, shapes: Sequence[tuple[int, int]]) -> NDArray[np.int64]:
    """Return the hot pixels of each camera, the same in every trial, as of ``Film``."""
    rng, low, high = np.random.default_rng(2003), *_HOT
    rows = [
        rng.integers((n, 0, 0, low), (n + 1, *shape, high), (count, 4))
        for n, shape in enumerate(shapes)
    ]
    return np.concatenate(rows)


def _balls(
    level: float, second: tuple[float, float, float, float] | None, velocity: Sequence[float]
) -> PaintedBalls:
    """Return the thrown ball, and a second one that rolls, of a grey level."""
    count = 1 if second is None else 2
    begin, end, start, speed, centre = (np.zeros((count, 3)) for _ in range(5))
    balls = PaintedBalls(np.full(count, level), np.zeros(count), start, speed, begin, end, centre)
    if second is not None:
        balls.start[1], balls.radius[1], balls.velocity[1] = second[:3], second[3], velocity
    return balls


def _frames(
    t: float,
    number: int,
    images: Sequence[Image],
    heads: list[tuple[float, float]] | None = None,
) -> tuple[Frame, ...]:
    """Return images as frames; ``heads`` are pan and tilt of each camera [rad]."""
    angles = heads or [(0.0, 0.0)] * len(images)
    return tuple(
        Frame(t=t, camera=n, number=number, pixels=pixels, pan=angles[n][0], tilt=angles[n][1])
        for n, pixels in enumerate(images)
    )
