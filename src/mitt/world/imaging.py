"""What the image sensors give: a bright ball on a grey ground, with the noise of photons.

The ball is drawn by ``outline``. Noise comes from banks (``noise``); each frame starts to read
them at an offset drawn from the generator. All images of an instant are drawn in one call.
"""

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from mitt.errors import InputError
from mitt.signals import Array, Frame, Image
from mitt.vision.camera import Rig
from mitt.world.noise import GROUND_SIZE, NORMAL_SIZE, noise_bank
from mitt.world.outline import draw_ball

_BLOCK = 512
"""Frames whose offsets into the noise banks are drawn at once."""

_NOWHERE = np.full(3, np.nan)


@dataclass(frozen=True, slots=True, kw_only=True)
class ImageSensor:
    """Settings of the image sensors; the exposure is short, so nothing smears.

    The defaults give 3.2 grey levels of noise on the ball and 2.2 on the ground, a signal to
    noise ratio of 50: a fast sensor with some gain.

    Attributes:
        brightness: Grey levels of the ball above the ground, without noise.
        background: Grey level of the ground.
        read_noise: Standard deviation of the Gaussian read noise [grey levels].
        electrons: Photo-electrons a grey level; shot noise has the variance value / electrons.
    """

    brightness: float = 160.0
    background: float = 24.0
    read_noise: float = 2.0
    electrons: float = 30.0

    def __post_init__(self) -> None:
        """Refuse values that no 8-bit sensor has."""
        values = {
            "brightness": self.brightness,
            "background": self.background,
            "read_noise": self.read_noise,
            "electrons": self.electrons,
        }
        for name, value in values.items():
            if not 0.0 <= value < float("inf"):
                raise InputError(name, "a finite number, not negative", value)
        if self.electrons == 0.0 or self.background + self.brightness > 255.0:
            raise InputError(
                "image sensor", "electrons > 0 and background + brightness <= 255", self
            )


@njit(cache=True)
def expose(
    images: tuple[Image, ...],
    optics: Array,
    r_o: Array,
    radius: float,
    light: Array,
    ground: Image,
    noise: Array,
    starts: NDArray[np.int64],
    work: Array,
) -> None:
    """Draw what all cameras of a rig see.

    Args:
        images: Results, one a camera, each shape (height, width).
        optics: Rotation in rows 0 to 2, centre [m], and f_px, cu, cv [px], shape (n, 5, 3).
        r_o: Ball centre in the world [m], shape (3,); an empty scene where it is not finite.
        radius: Ball radius [m].
        light: As for :func:`draw_ball`, shape (4,).
        ground: Bank of pixels of the ground, shape (b,).
        noise: Bank of standard normal numbers, shape (c,).
        starts: Offsets of each camera into both banks, shape (n, 2).
        work: Scratch, zero at entry and exit but for its last four, shape (2 widest + 5,).
    """
    ball, scratch = work[-4:], work[:-4]
    for n in range(len(images)):
        pixels = images[n].reshape(images[n].size)
        source = ground[starts[n, 0] : starts[n, 0] + pixels.size]
        for k in range(pixels.size):  # a loop becomes vector code; pixels[:] = ... does not
            pixels[k] = source[k]
        pose = optics[n]
        for i in range(3):
            ball[i] = (
                pose[0, i] * (r_o[0] - pose[3, 0])
                + pose[1, i] * (r_o[1] - pose[3, 1])
                + pose[2, i] * (r_o[2] - pose[3, 2])
            )
        ball[3] = radius
        if np.isfinite(ball[0] + ball[1] + ball[2]):
            draw_ball(images[n], pose[4], ball, light, noise[starts[n, 1] :], scratch)


class Imager:
    """The cameras of a rig as sensors: renders one ``Frame`` a camera at each call."""

    def __init__(self, rig: Rig, sensor: ImageSensor, rng: np.random.Generator) -> None:
        """Lay the cameras out in arrays.

        Args:
            rig: Cameras to see with.
            sensor: Light and noise.
            rng: Source of every frame's offset into the noise banks.

        Raises:
            InputError: An image is larger than the bank of ground.
        """
        largest = max(c.height * c.width for c in rig.cameras)
        if largest >= GROUND_SIZE:
            raise InputError("rig", f"images of less than {GROUND_SIZE} pixels", largest)
        self._shapes = [(c.height, c.width) for c in rig.cameras]
        self._optics = np.array(
            [(*c.rotation, c.centre, (c.f_px, c.cu, c.cv)) for c in rig.cameras]
        )
        self._light = np.array(
            (sensor.brightness, sensor.background, sensor.read_noise, sensor.electrons)
        )
        self._bank = noise_bank(sensor.background, sensor.read_noise, sensor.electrons)
        self._work = np.zeros(2 * max(c.width for c in rig.cameras) + 5)
        self._rng = rng
        self._number = 0
        self._starts = self._draw_starts()

    def render(self, t: float, r_o: Array | None, radius: float) -> tuple[Frame, ...]:
        """Return what the cameras see at ``t``.

        Args:
            t: Middle of the exposure [s].
            r_o: Ball centre [m], shape (3,); None for an empty scene.
            radius: Ball radius [m].
        """
        number, row = self._number, self._number % _BLOCK
        if row == 0 and number > 0:
            self._starts = self._draw_starts()
        images = tuple([np.empty(shape, np.uint8) for shape in self._shapes])
        expose(
            images,
            self._optics,
            _NOWHERE if r_o is None else r_o,
            radius,
            self._light,
            self._bank.ground,
            self._bank.normal,
            self._starts[row],
            self._work,
        )
        self._number = number + 1
        return tuple(
            [
                Frame(t=t, camera=camera, number=number, pixels=pixels)
                for camera, pixels in enumerate(images)
            ]
        )

    def _draw_starts(self) -> NDArray[np.int64]:
        """Return offsets of the next frames into both banks, shape (block, n, 2)."""
        most = [(GROUND_SIZE - height * width, NORMAL_SIZE // 2) for height, width in self._shapes]
        return self._rng.integers(0, most, size=(_BLOCK, len(most), 2))
