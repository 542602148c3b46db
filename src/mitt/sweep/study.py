"""What a study file may say, key by key, and the study that follows from it."""

import hashlib
import json
from typing import Annotated, Any, Literal

from pydantic import Field, field_validator

from mitt.files.limit_files import known_limits
from mitt.files.throws import ThrowSettings
from mitt.world.scene import Scene
from mitt.world.settings import Settings

SCHEMA = "mitt.study/1"

#: Most throws in a study, and most values of one sweep.
_MOST_THROWS, _MOST_VALUES = 10_000_000, 200

Name = Annotated[str, Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9 ._%+=/-]{0,63}$")]
Table = dict[str, Any]
Number = Annotated[float, Field(ge=-1e6, le=1e6)]


class ArmSettings(Settings):
    """Which arm and which map, as the options of the same names of ``mitt catch``."""

    arm: str = "wam"
    tip: str | None = None
    joints: str | None = None
    limits: str | None = None
    catch_joint: int | None = None
    q_catch: float | None = None
    kappa: float | None = None
    inward: float | None = None
    order: int | None = None

    @field_validator("limits")
    @classmethod
    def _known(cls, value: str | None) -> str | None:
        """Refuse a name that is none of a limit set, before anything is learned."""
        if value is not None and not value.endswith(".toml") and value not in known_limits():
            raise ValueError(f"one of {', '.join(known_limits())}, or a .toml file")
        return value


class Overrides(Settings):
    """What a condition may change.

    Attributes:
        arm: Settings of arm and map, over those of the study.
        scene: Settings of the world, as in a scene file, over those of the study.
        vision: What the catcher sees.
        flights: Recorded flights instead of throws: ``builtin`` or a CSV file.
        throws: Ranges of the default throws.
    """

    arm: Table = Field(default_factory=dict)
    scene: Table = Field(default_factory=dict)
    vision: Literal["pixels", "points"] | None = None
    flights: str | None = None
    throws: ThrowSettings = ThrowSettings()


class ConditionSettings(Overrides):
    """One condition of a study file.

    Attributes:
        name: What it is called.
    """

    name: Name


class SweepSettings(Overrides):
    """A row of conditions that differ in one number.

    Attributes:
        name: What the number is.
        unit: Its unit, for people.
        set: Address of the number, as ``scene.sensing.latency`` or ``scene.faults.0.magnitude``.
        values: Its values, each a condition.
        factor: What a value is multiplied by before it is set: 0.001 for milliseconds.
    """

    name: Name
    unit: Annotated[str, Field(max_length=16)] = ""
    set: Annotated[str, Field(pattern=r"^(scene|arm|throws)(\.[a-z0-9_]+)+$")]
    values: Annotated[
        tuple[Number, ...], Field(strict=False, min_length=1, max_length=_MOST_VALUES)
    ]
    factor: float = 1.0


class StudySettings(Settings):
    """A study file.

    Attributes:
        name: What the study is called.
        about: What it asks, for the page.
        seed: Seed of throws, plant and noise; the same throws for all generators and conditions.
        throws: Throws of each generator in each condition.
        throws_of: Another number for some generators.
        generators: Names of the generators; ``all`` alone stands for all that there are.
        arm: Arm and map.
        vision: What the catcher sees.
        scene: Settings of the world.
        conditions: Conditions one by one.
        sweeps: Rows of conditions.
        chunk: Throws of one piece of work.
        record: Most failures to record, of each generator in each condition.
    """

    name: Name
    about: Annotated[str, Field(max_length=2000)] = ""
    seed: Annotated[int, Field(ge=0, lt=2**63)] = 8000
    throws: Annotated[int, Field(ge=1, le=_MOST_THROWS)] = 100
    throws_of: dict[str, Annotated[int, Field(ge=1, le=_MOST_THROWS)]] = Field(default_factory=dict)
    generators: Annotated[tuple[str, ...], Field(strict=False, min_length=1, max_length=64)]
    arm: ArmSettings = ArmSettings()
    vision: Literal["pixels", "points"] = "pixels"
    scene: Table = Field(default_factory=dict)
    conditions: Annotated[tuple[ConditionSettings, ...], Field(strict=False)] = ()
    sweeps: Annotated[tuple[SweepSettings, ...], Field(strict=False)] = ()
    chunk: Annotated[int, Field(ge=1, le=1000)] = 25
    record: Annotated[int, Field(ge=0, le=100)] = 1


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
        arm_files: Digests of what the arm was read from, by name, in the order of reading: an arm
            file, its description, meshes, limits.
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
    arm_files: dict[str, str] = Field(default_factory=dict)


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
        plugins: Package, version and digest of the generators that other packages add.
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
    plugins: dict[str, str] = Field(default_factory=dict)

    @property
    def generators(self) -> tuple[str, ...]:
        """Names of the generators."""
        return tuple(self.counts)

    @property
    def digest(self) -> str:
        """SHA-256 of all that decides the results; of files what they hold, not where they lie."""
        less = {"about", "record", "flights"} | (set() if self.plugins else {"plugins"})
        decisive = self.model_dump(mode="json", exclude=less)
        for condition in decisive["conditions"]:
            condition["flights"] = self.flights.get(condition["flights"], condition["flights"])
            if files := condition.pop("arm_files"):
                condition["arm_files"] = list(files.values())
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
