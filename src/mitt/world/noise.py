"""Banks of noise and of background that image sensors read from, drawn once for a sensor.

Fresh normal numbers for an image cost fifty times as much as a look into a bank, and a bank for
each trial as much as a third of the trial. So the banks follow from the sensor alone, and a
trial's own source of noise only says where each frame begins to read.
"""

from dataclasses import dataclass
from functools import lru_cache
from math import sqrt

import numpy as np

from mitt.signals import Array, Image

#: Numbers in each bank of noise.
NOISE_SIZE = 1 << 20
#: Side of the background before it repeats, and with the margin for the largest image [px].
PERIOD, SIDE = 1024, 1024 + 1024
#: Size of the background's patches [px] and the share of it that is a slow gradient.
_PATCH, _GRADIENT = 8.0, 0.6

_SEED = 2002


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class NoiseBank:
    """Noise to read from; not to be written to.

    Attributes:
        ground: Noise of the ground [grey levels], modulo 256, shape (NOISE_SIZE,); wall or body
            plus noise stays within 0 to 255, so that bytes add without a care.
        normal: Standard normal numbers, shape (NOISE_SIZE,).
        wall: The background as it would look without noise, period PERIOD, shape (SIDE, SIDE).
    """

    ground: Image
    normal: Array
    wall: Image


@lru_cache(maxsize=8)
def noise_bank(
    *,
    background: float,
    texture: float,
    body: float,
    read_noise: float,
    electrons: float,
    pattern: tuple[float, float] = (0.0, 1.0),
) -> NoiseBank:
    """Return the banks of a sensor; the same object for the same settings.

    Args:
        background: Mean grey level of the ground.
        texture: Standard deviation of the ground, gradients and patches [grey levels].
        body: Grey level of arm and hand.
        read_noise: Standard deviation of the Gaussian read noise [grey levels].
        electrons: Photo-electrons a grey level.
        pattern: Contrast [grey levels] and size [px] of squares on the background.
    """
    rng = np.random.default_rng(_SEED)
    sigma = sqrt(read_noise**2 + background / electrons)
    noise = np.rint(sigma * rng.standard_normal(NOISE_SIZE, dtype=np.float32))
    normal, wall = rng.standard_normal(NOISE_SIZE), _wall(background, texture, rng)
    if pattern[0] > 0.0:
        wall = _squares(wall, *pattern)
    low, high = min(int(body), int(wall.min())), max(int(body), int(wall.max()))
    ground = np.clip(noise, -low, 255 - high).astype(np.int16).astype(np.uint8)
    return NoiseBank(ground=ground, normal=normal, wall=wall)


def _wall(background: float, texture: float, rng: np.random.Generator) -> Image:
    """Return the background: patches on a slow gradient, periodic both ways."""
    k = np.fft.fftfreq(PERIOD)
    smooth = np.exp(-0.5 * (2.0 * np.pi * _PATCH) ** 2 * (k[:, None] ** 2 + k[None, :] ** 2))
    patches = np.fft.ifft2(np.fft.fft2(rng.standard_normal((PERIOD, PERIOD))) * smooth).real
    wave = 2.0 * np.pi / PERIOD * np.arange(PERIOD)
    slope = np.sin(2.0 * wave)[:, None] + np.cos(3.0 * wave)[None, :]
    shape = sqrt(1.0 - _GRADIENT) * patches / patches.std() + sqrt(_GRADIENT) * slope / slope.std()
    tile = np.clip(np.rint(background + texture * shape), 0.0, 255.0).astype(np.uint8)
    return np.ascontiguousarray(np.tile(tile, (2, 2)))


def _squares(wall: Image, contrast: float, size: float) -> Image:
    """Return a wall with squares in turn brighter and darker by half a contrast."""
    k = np.arange(SIDE) % PERIOD // max(round(size), 1)
    sign = 1.0 - 2.0 * ((k[:, None] + k[None, :]) % 2)
    return np.clip(np.rint(wall + 0.5 * contrast * sign), 0.0, 255.0).astype(np.uint8)
