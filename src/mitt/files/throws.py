"""Ranges of throws and of their arrivals, as study and arm files state them."""

from typing import Annotated, Self

import numpy as np
from pydantic import ConfigDict, Field, field_validator, model_validator

from mitt.files.schema import Part
from mitt.signals import Array

Range = Annotated[tuple[float, float], Field(strict=False)]
Coordinate = Annotated[float, Field(ge=-100.0, le=100.0)]
Width = Annotated[float, Field(ge=0.0, le=10.0)]


class ThrowSettings(Part):
    """Ranges that the default throws are drawn from; what is left out stays as it is.

    Attributes:
        duration: Time of flight to the aim point [s].
        speed: Speed at release [m/s].
        distance: Horizontal distance of the release from the aim point [m].
        azimuth: Direction of the release [rad].
        height: Height of the release above the shoulder [m].
        spread: Factor on the width of the box that is aimed at.
        at: Centre of a box in space to aim at, world frame [m], in the place of that of the arm.
        around: Its half-widths [m].
    """

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)

    duration: Range | None = None
    speed: Range | None = None
    distance: Range | None = None
    azimuth: Range | None = None
    height: Range | None = None
    spread: Annotated[float, Field(gt=0.0, le=10.0)] = 1.0
    at: Annotated[tuple[Coordinate, Coordinate, Coordinate], Field(strict=False)] | None = None
    around: Annotated[tuple[Width, Width, Width], Field(strict=False)] | None = None

    @field_validator("duration", "speed", "distance", "azimuth", "height")
    @classmethod
    def _ordered(cls, value: tuple[float, float] | None) -> tuple[float, float] | None:
        """Refuse a range whose ends are the wrong way round."""
        if value is not None and value[0] > value[1]:
            raise ValueError("a lower end and then an upper end")
        return value

    @model_validator(mode="after")
    def _whole(self) -> Self:
        """Refuse half a box."""
        if (self.at is None) != (self.around is None):
            raise ValueError("at and around, or neither")
        return self


#: What balls can arrive as: speed [m/s], descent and azimuth [rad], time of flight [s].
ARRIVALS = {
    "speed": (0.5, 30.0), "descent": (-1.5, 1.5), "azimuth": (-1.0, 1.0), "flight": (0.1, 3.0),
}  # fmt: skip


class ArrivalSettings(Part):
    """How balls arrive at the box that is aimed at: the ranges that maps are learned for.

    Attributes:
        speed: Speed of the ball [m/s].
        descent: Angle by which it comes down [rad].
        azimuth: Where it comes from, off +x [rad].
        flight: Time of flight before that [s].
    """

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)

    speed: Range
    descent: Range
    flight: Range
    azimuth: Range = (-0.15, 0.15)

    @model_validator(mode="after")
    def _possible(self) -> Self:
        """Refuse ranges that no ball can have."""
        for name, (least, most) in ARRIVALS.items():
            low, high = getattr(self, name)
            if not least <= low <= high <= most:
                raise ValueError(f"{name}: a lower and an upper end in {least:g}..{most:g}")
        return self

    @property
    def rows(self) -> Array:
        """Speed, descent, azimuth and time of flight, least and most, shape (4, 2)."""
        return np.array([self.speed, self.descent, self.azimuth, self.flight])
