"""A world as compiled code plays on it: see :mod:`mitt.study.play`."""

from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from mitt.signals import Array
from mitt.world.engine import Views
from mitt.world.imaging import Imager
from mitt.world.scene import Scene
from mitt.world.truth import Tape

Plant: TypeAlias = tuple[Views, NDArray[np.int32], NDArray[np.bool_], Array]
Body: TypeAlias = tuple[Array, Array, Array, Array, Array]


@dataclass(frozen=True, slots=True)
class Stage:
    """What a trial plays on.

    Attributes:
        plant: Views, kinds of the geoms, which touch, and state: see
            :func:`mitt.world.motion.move`.
        tape: The trace, whose row of a tick has its number.
        body: As of :func:`mitt.world.silhouettes.lay_capsules`.
        imager: The cameras, two that see images of one size and do not turn.
        scene: Settings.
    """

    plant: Plant
    tape: Tape
    body: Body
    imager: Imager
    scene: Scene
