"""Faults and disturbances as data: each with its kind, start, length and magnitude.

They act between sensor and estimator, between command and plant, and on the ball itself; what
each draws at random follows from the trial's seed. Numbers of rows are those of the
tests in ``tests/faults``, named where a kind serves one of them.
"""

from typing import Annotated

from pydantic import Field

from mitt.world.faults.acting import (
    Bounce,
    Carried,
    Command,
    Drag,
    Gust,
    Kick,
    Payload,
    Spin,
    Spring,
    Torque,
)
from mitt.world.faults.sensing import (
    Calibration,
    Clock,
    Dropout,
    Duplicate,
    Encoder,
    FrameRate,
    Frozen,
    Late,
    Latency,
    Noise,
    NotNumber,
    Outlier,
)

__all__ = [
    "Fault",
    "FaultPlan",
    "Noise",
    "Outlier",
    "FrameRate",
    "Dropout",
    "Frozen",
    "Latency",
    "Late",
    "Duplicate",
    "Calibration",
    "NotNumber",
    "Clock",
    "Encoder",
    "Torque",
    "Command",
    "Payload",
    "Drag",
    "Spin",
    "Gust",
    "Kick",
    "Bounce",
    "Spring",
    "Carried",
]

Fault = (
    Noise | Outlier | FrameRate | Dropout | Frozen | Latency | Late | Duplicate | Calibration
    | NotNumber | Clock | Encoder | Torque | Command | Payload | Drag | Spin | Gust | Kick
    | Bounce | Spring | Carried
)  # fmt: skip
"""One entry of a plan."""

FaultPlan = Annotated[
    tuple[Annotated[Fault, Field(discriminator="kind")], ...], Field(strict=False, max_length=32)
]
"""Entries in the order in which they act."""
