"""Ranges that default throws are drawn from, as study and arm files state them."""

from typing import Annotated, Self

from pydantic import ConfigDict, Field, field_validator, model_validator

from mitt.files.schema import Part

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
