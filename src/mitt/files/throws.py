"""Ranges that default throws are drawn from, as study and arm files state them."""

from typing import Annotated

from pydantic import ConfigDict, Field, field_validator

from mitt.files.schema import Part

Range = Annotated[tuple[float, float], Field(strict=False)]


class ThrowSettings(Part):
    """Ranges that the default throws are drawn from; what is left out stays as it is.

    Attributes:
        duration: Time of flight to the aim point [s].
        speed: Speed at release [m/s].
        distance: Horizontal distance of the release from the aim point [m].
        azimuth: Direction of the release [rad].
        height: Height of the release above the shoulder [m].
        spread: Factor on the width of the box of joint angles that is aimed at.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)

    duration: Range | None = None
    speed: Range | None = None
    distance: Range | None = None
    azimuth: Range | None = None
    height: Range | None = None
    spread: Annotated[float, Field(gt=0.0, le=10.0)] = 1.0

    @field_validator("duration", "speed", "distance", "azimuth", "height")
    @classmethod
    def _ordered(cls, value: tuple[float, float] | None) -> tuple[float, float] | None:
        """Refuse a range whose ends are the wrong way round."""
        if value is not None and value[0] > value[1]:
            raise ValueError("a lower end and then an upper end")
        return value
