"""Banks of noise that image sensors read from: drawn once for a sensor, whatever the trial.

Fresh normal numbers for an image cost fifty times as much as a look into a bank, and a bank for
each trial as much as a third of the trial. So the banks follow from the sensor alone, and a
trial's own source of noise only says where each frame begins to read.
"""

from dataclasses import dataclass
from functools import lru_cache
from math import sqrt

import numpy as np

from mitt.signals import Array, Image

#: Pixels of ground, and normal numbers for the pixels of the ball.
GROUND_SIZE, NORMAL_SIZE = 1 << 20, 1 << 18

_SEED = 2002


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class NoiseBank:
    """Noise to read from; not to be written to.

    Attributes:
        ground: Grey values of the ground, its noise included, shape (GROUND_SIZE,).
        normal: Standard normal numbers, shape (NORMAL_SIZE,).
    """

    ground: Image
    normal: Array


@lru_cache(maxsize=8)
def noise_bank(background: float, read_noise: float, electrons: float) -> NoiseBank:
    """Return the banks of a sensor; the same object for the same settings.

    Args:
        background: Grey level of the ground.
        read_noise: Standard deviation of the Gaussian read noise [grey levels].
        electrons: Photo-electrons a grey level.
    """
    rng = np.random.default_rng(_SEED)
    sigma = sqrt(read_noise**2 + background / electrons)
    level = np.rint(background + sigma * rng.standard_normal(GROUND_SIZE, dtype=np.float32))
    ground = np.clip(level, 0.0, 255.0).astype(np.uint8)
    return NoiseBank(ground=ground, normal=rng.standard_normal(NORMAL_SIZE))
