"""A world as compiled code plays on it: see :mod:`mitt.trials.play`."""

from dataclasses import dataclass
from typing import TypeAlias

from mitt.signals import Array
from mitt.world.engine import Plant
from mitt.world.imaging import Imager
from mitt.world.scene import Scene
from mitt.world.sensors import Sensors
from mitt.world.truth import TraceBuffer

Body: TypeAlias = tuple[Array, Array, Array, Array, Array]


@dataclass(frozen=True, slots=True)
class Stage:
    """What a trial plays on.

    Attributes:
        plant: As of :class:`mitt.world.engine.Plant`.
        trace_buffer: The trace, whose row of a tick has its number.
        body: As of :func:`mitt.world.capsules.lay_capsules`.
        sensors: What reaches the catcher.
        imager: The cameras, two that see images of one size and do not turn; None where the ball
            is seen as points.
        scene: Settings.
        radius: Radius of the ball [m].
    """

    plant: Plant
    trace_buffer: TraceBuffer
    body: Body
    sensors: Sensors
    imager: Imager | None
    scene: Scene
    radius: float
