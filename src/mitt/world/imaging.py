"""What the image sensors give: a bright ball before a wall, arm and hand, with noise and smear.

The balls are drawn by ``outline``, arm and hand by ``silhouettes``. Noise and wall come from banks
(``noise``); each frame starts to read the noise at an offset drawn from the generator. All images
of an instant are drawn in one call. The wall turns with the camera, to whole pixels, and is as
good as infinitely far away; it does not smear, nor do arm and hand.

| here     | meaning                                                        | unit | shape        |
|----------|----------------------------------------------------------------|------|--------------|
| optics   | cameras at begin and end of the exposure, each as in           | m    | (n, 2, 5, 3) |
|          | :mod:`mitt.vision.triangulation`                               | px   |              |
| balls    | centre in the world at begin and end, radius; then grey level  | m    | (k, 8)       |
"""

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from mitt.errors import InputError
from mitt.signals import Array, Frame, Image, frame_of
from mitt.vision.camera import Rig
from mitt.world.heads import Heads, open_and_shut
from mitt.world.noise import NOISE_SIZE, PERIOD, SIDE, noise_bank
from mitt.world.outline import INSTANTS, draw_ball
from mitt.world.silhouettes import draw_capsule, in_front, seen_from

_BLOCK = 512
"""Frames whose offsets into the noise banks are drawn at once."""

_NOTHING = np.zeros((0, 7))
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
    """

    brightness: float = 160.0
    background: float = 24.0
    texture: float = 3.0
    body: float = 12.0
    read_noise: float = 2.0
    electrons: float = 30.0
    exposure: float = 5e-4

    def __post_init__(self) -> None:
        """Refuse values that no 8-bit sensor has."""
        values = {
            "brightness": self.brightness,
            "background": self.background,
            "texture": self.texture,
            "body": self.body,
            "read_noise": self.read_noise,
            "electrons": self.electrons,
            "exposure": self.exposure,
        }
        for name, value in values.items():
            if not 0.0 <= value < float("inf"):
                raise InputError(name, "a finite number, not negative", value)
        if self.electrons == 0.0 or max(self.background + self.brightness, self.body) > 255.0:
            raise InputError(
                "image sensor", "electrons > 0, background + brightness and body <= 255", self
            )


@njit(cache=True)
def _hang(pixels: Image, camera: Array, wall: Image, place: Array, noise: Image) -> None:
    """Fill an image with the wall as it lies before a camera turned to ``place`` (pan, tilt)."""
    height, width = pixels.shape
    column = round(camera[4, 0] * place[0]) % PERIOD
    row = round(-camera[4, 0] * place[1]) % PERIOD
    for v in range(height):
        line, source = pixels[v], wall[row + v, column : column + width]
        numbers = noise[v * width : (v + 1) * width]
        for u in range(width):
            line[u] = np.uint8(source[u] + numbers[u])


@njit(cache=True)
def _into(camera: Array, ball: Array, start: int, local: Array) -> None:
    """Write the ball in the optical frame."""
    for i in range(3):
        local[start + i] = (
            camera[0, i] * (ball[start] - camera[3, 0])
            + camera[1, i] * (ball[start + 1] - camera[3, 1])
            + camera[2, i] * (ball[start + 2] - camera[3, 2])
        )


@njit(cache=True)
def expose(
    images: tuple[Image, ...],
    optics: Array,
    places: Array,
    balls: Array,
    capsules: Array,
    light: Array,
    wall: Image,
    ground: Image,
    normal: Array,
    starts: NDArray[np.int64],
    work: Array,
) -> None:
    """Draw what all cameras of a rig see.

    Args:
        images: Results, one a camera, each shape (height, width).
        optics: As in the module's table.
        places: Pan and tilt of each camera [rad], shape (n, 2).
        balls: As in the module's table; one that is not finite is left out.
        capsules: Arm and hand, as in :mod:`mitt.world.silhouettes`.
        light: Read noise [grey levels], electrons a level, grey level of arm and hand, shape (3,).
        wall: The background.
        ground: Noise of the ground, modulo 256, shape (b,).
        normal: Standard normal numbers, shape (c,).
        starts: Offsets of each camera into both banks, shape (n, 2).
        work: Scratch, zero at entry, shape (2 widest + 1 + 4 INSTANTS + 17,).
    """
    local, seen, paint, scratch = work[-7:], work[-14:-7], work[-17:-14], work[:-17]
    paint[1], paint[2] = light[0], light[1]
    body = int(light[2])
    for n in range(len(images)):
        pixels, begin, end = images[n], optics[n, 0], optics[n, 1]
        noise = ground[starts[n, 0] :]
        _hang(pixels, begin, wall, places[n], noise)
        _into(begin, balls[0], 0, local)
        x, y, z = local[0], local[1], local[2]
        nowhere = not np.isfinite(x + y + z)
        before = 0
        for k in range(capsules.shape[0]):
            if not seen_from(begin, capsules[k], seen):
                continue
            if nowhere or not in_front(seen, x, y, z):
                draw_capsule(pixels, begin[4], seen, body, noise)
            else:
                before += 1
        for k in range(balls.shape[0] - 1, -1, -1):
            _into(begin, balls[k], 0, local)
            _into(end, balls[k], 3, local)
            local[6], paint[0] = balls[k, 6], balls[k, 7]
            if np.isfinite(local[0] + local[1] + local[2] + local[3] + local[4] + local[5]):
                draw_ball(pixels, begin[4], local, paint, normal[starts[n, 1] :], scratch)
        for k in range(capsules.shape[0] if before > 0 else 0):
            if seen_from(begin, capsules[k], seen) and in_front(seen, x, y, z):
                draw_capsule(pixels, begin[4], seen, body, noise)


@njit(cache=True)
def snap(
    images: tuple[Image, ...],
    heads: Array,
    state: Array,
    half: float,
    optics: Array,
    places: Array,
    balls: Array,
    r_o: Array,
    dr_o: Array,
    radius: float,
    capsules: Array,
    light: Array,
    wall: Image,
    ground: Image,
    normal: Array,
    starts: NDArray[np.int64],
    work: Array,
) -> None:
    """Place cameras and ball as the shutter opens and as it closes, and draw what is seen.

    Args:
        images: As for :func:`expose`, as what follows unless it is named here.
        heads: As in :mod:`mitt.vision.head`.
        state: Of the heads in the middle of the exposure.
        half: Half the exposure [s].
        optics: Overwritten.
        places: Overwritten.
        balls: Its first row is overwritten.
        r_o: Ball centre in the middle of the exposure [m], shape (3,); not finite for no ball.
        dr_o: Its velocity [m/s], shape (3,).
        radius: Its radius [m].
        capsules: See :func:`expose`.
        light: See :func:`expose`.
        wall: See :func:`expose`.
        ground: See :func:`expose`.
        normal: See :func:`expose`.
        starts: See :func:`expose`.
        work: See :func:`expose`.
    """
    for i in range(3):
        balls[0, i], balls[0, 3 + i] = r_o[i] - half * dr_o[i], r_o[i] + half * dr_o[i]
    balls[0, 6] = radius
    open_and_shut(heads, state, half, optics, places)
    expose(images, optics, places, balls, capsules, light, wall, ground, normal, starts, work)


class Imager:
    """The cameras of a rig as sensors: renders one ``Frame`` a camera at each call."""

    def __init__(
        self,
        rig: Rig,
        sensor: ImageSensor,
        rng: np.random.Generator,
        *,
        second: tuple[float, float, float, float] | None = None,
    ) -> None:
        """Lay the cameras out in arrays.

        Args:
            rig: Cameras to see with; their heads begin where they wait for a ball.
            sensor: Light and noise.
            rng: Source of every frame's offset into the noise banks.
            second: A second bright ball that stands still: its centre and its radius [m].

        Raises:
            InputError: An image is larger than the banks.
        """
        largest = max(max(c.height, c.width) for c in rig.cameras)
        if largest > SIDE - PERIOD:
            raise InputError("rig", f"images of at most {SIDE - PERIOD} pixels a side", largest)
        self._shapes = [(c.height, c.width) for c in rig.cameras]
        cameras = [(*c.rotation, c.centre, (c.f_px, c.cu, c.cv)) for c in rig.cameras]
        self._optics = np.repeat(np.array(cameras)[:, None], 2, axis=1)
        self._heads, self._places = Heads(rig), np.zeros((len(cameras), 2))
        self._packed, self._state = self._heads.packed, self._heads.state
        self._turnable, self._half = len(self._state) > 0, 0.5 * sensor.exposure
        self._light = np.array((sensor.read_noise, sensor.electrons, sensor.body))
        level = sensor.background + sensor.brightness
        self._balls = np.full((1 if second is None else 2, 8), level)
        if second is not None:
            self._balls[1, :7] = (*second[:3], *second)
        self._bank = noise_bank(
            background=sensor.background,
            texture=sensor.texture,
            body=sensor.body,
            read_noise=sensor.read_noise,
            electrons=sensor.electrons,
        )
        self._work = np.zeros(2 * max(c.width for c in rig.cameras) + 1 + 4 * INSTANTS + 17)
        self._rng = rng
        self._number = 0
        self._starts = self._draw_starts()

    def turn(self, gaze: Array | None, duration: float) -> None:
        """Let the heads, if there are any, follow ``gaze`` for ``duration`` [s].

        Args:
            gaze: Pan, tilt [rad] and their rates [rad/s] for the end of that time, shape (n, 4).
            duration: Time to pass [s].
        """
        if self._turnable:
            self._heads.turn(gaze, duration)

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
            capsules: Arm and hand, as in :mod:`mitt.world.silhouettes`.
        """
        number, row = self._number, self._number % _BLOCK
        if row == 0 and number > 0:
            self._starts = self._draw_starts()
        images = tuple([np.empty(shape, np.uint8) for shape in self._shapes])
        snap(
            images,
            self._packed,
            self._state,
            self._half,
            self._optics,
            self._places,
            self._balls,
            _NOWHERE if r_o is None else r_o,
            _STILL if dr_o is None else dr_o,
            radius,
            capsules,
            self._light,
            self._bank.wall,
            self._bank.ground,
            self._bank.normal,
            self._starts[row],
            self._work,
        )
        self._number = number + 1
        if self._turnable:
            read = self._heads.read
            return tuple([frame_of(t, n, number, x, read(n)) for n, x in enumerate(images)])
        return tuple([frame_of(t, n, number, x) for n, x in enumerate(images)])

    def _draw_starts(self) -> NDArray[np.int64]:
        """Return offsets of the next frames into both banks, shape (block, n, 2)."""
        most = [[NOISE_SIZE - height * width] * 2 for height, width in self._shapes]
        return self._rng.integers(0, most, size=(_BLOCK, len(most), 2))
