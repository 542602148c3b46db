"""What all entries of a plan share."""

from typing import Annotated

from pydantic import Field

from mitt.world.settings import Settings

Chance = Annotated[float, Field(ge=0.0, le=1.0)]
Delay = Annotated[float, Field(ge=0.0, le=0.2)]


class Entry(Settings):
    """What all kinds share.

    Attributes:
        start: When it begins, after release [s].
        length: How long it lasts [s]; to the end if left out.
    """

    magnitude: float
    start: Annotated[float, Field(ge=0.0, le=60.0)] = 0.0
    length: Annotated[float, Field(gt=0.0, le=60.0)] | None = None

    @property
    def end(self) -> float:
        """When it is over [s]."""
        return float("inf") if self.length is None else self.start + self.length

    def holds(self, t: float) -> bool:
        """Say whether it is there at a time [s]."""
        return self.start <= t < self.end

    def rests(self, t: float, until: float) -> bool:
        """Say whether it is not there from a time until just before another [s]."""
        return until <= self.start or t >= self.end
