"""A study that can run: every condition of its grid spelled out."""

import hashlib
import json
from typing import Annotated, Literal

from pydantic import Field

from mitt.sweep.settings import ArmSettings, ThrowSettings
from mitt.world.scene import Scene
from mitt.world.settings import Settings

SCHEMA = "mitt.study/1"


class Condition(Settings):
    """One condition with everything in its place.

    Attributes:
        name: What it is called, unique in a study.
        disturbance: The sweep that it belongs to, or its own name.
        value: Its value in the sweep.
        unit: Unit of the value.
        arm: Arm and map.
        scene: The world.
        vision: What the catcher sees.
        flights: Recorded flights instead of throws, a file's address or ``builtin``.
        throws: Ranges of the default throws.
    """

    name: str
    disturbance: str
    value: float | None = None
    unit: str = ""
    arm: ArmSettings
    scene: Scene
    vision: Literal["pixels", "points"]
    flights: str | None = None
    throws: ThrowSettings = ThrowSettings()


class Study(Settings):
    """A study that can run: all conditions spelled out.

    Attributes:
        name: What it is called.
        about: What it asks.
        seed: Seed of throws, plant and noise.
        counts: Throws of each generator in each condition, in the order of the generators.
        conditions: All conditions.
        chunk: Throws of one piece of work.
        record: Most failures to record, of each generator in each condition.
        version: Version of mitt.
        flights: Digests of the files of recorded flights, by their address.
    """

    name: str
    about: str
    seed: int
    counts: dict[str, int]
    conditions: Annotated[tuple[Condition, ...], Field(strict=False)]
    chunk: int
    record: int
    version: str
    flights: dict[str, str]

    @property
    def generators(self) -> tuple[str, ...]:
        """Names of the generators."""
        return tuple(self.counts)

    @property
    def digest(self) -> str:
        """SHA-256 of all that decides the results; of files what they hold, not where they lie."""
        decisive = self.model_dump(mode="json", exclude={"about", "record", "flights"})
        for condition in decisive["conditions"]:
            condition["flights"] = self.flights.get(condition["flights"], condition["flights"])
        canonical = json.dumps(decisive, sort_keys=True, separators=(",", ":"))
        return hashlib.sha256(canonical.encode()).hexdigest()


def extent(study: Study, throws: int) -> str:
    """Return how large a study is: ``9 generators, 1 condition, 2,700 throws``."""
    counts = {
        "generator": len(study.generators),
        "condition": len(study.conditions),
        "throw": throws,
    }
    return ", ".join(f"{n:,} {what}{'s' * (n != 1)}" for what, n in counts.items())
