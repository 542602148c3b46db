"""What the file of a study of meetings may say, and the study that follows from it.

The same targets come by for every generator: those of the seed. A generator that plans is tried at
each rate; one that follows a belt's encoder only where there is a belt.
"""

from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field

import mitt
from mitt.arm.tools import TOOLS, Jaw, Suction
from mitt.errors import InputError, UnknownNameError
from mitt.files.arm_file import load_arm
from mitt.files.schema import Settings, validated
from mitt.files.writing import json_digest
from mitt.reading import noted, read_toml
from mitt.rivals.meeting import LINES, MEETERS, PLANNERS
from mitt.trials.study_file import Name, Table, study_path
from mitt.world.scene import Scene, scene_of

MEET_SCHEMA = "mitt.meet-study/1"


class MeetCondition(Settings):
    """What comes by.

    Attributes:
        name: What it is called.
        target: What moves the part.
        speed: Mean speed of the belt, or largest of the hand [m/s].
        tool_speed: Largest speed of the tool [m/s]; any if left out.
    """

    name: Name
    target: Literal["belt", "hand"]
    speed: Annotated[float, Field(ge=0.01, le=5.0)]
    tool_speed: Annotated[float, Field(ge=0.01, le=20.0)] | None = None


class MeetStudySettings(Settings):
    """The file of a study of meetings.

    Attributes:
        task: Says that it is one.
        name: What it is called.
        about: What it asks, for the page.
        seed: Seed of targets, plant and noise; the same for all generators.
        trials: Trials of each generator with each target.
        generators: Names of the generators.
        rates: Plans a second, of those that plan [Hz].
        arm: The arm: a name or a file.
        limits: Its limit set; its own if left out.
        tool: What it takes parts with.
        gripper_delay: Time from the command until the tool acts [s].
        scene: Settings of the world.
        conditions: What comes by.
        chunk: Trials of one piece of work.
    """

    task: Literal["meet"]
    name: Name
    about: Annotated[str, Field(max_length=2000)] = ""
    seed: Annotated[int, Field(ge=0, lt=2**63)] = 8000
    trials: Annotated[int, Field(ge=1, le=1_000_000)] = 30
    generators: Annotated[tuple[str, ...], Field(strict=False, min_length=1)] = MEETERS
    rates: Annotated[
        tuple[Annotated[float, Field(ge=1.0, le=1000.0)], ...], Field(strict=False, min_length=1)
    ] = (100.0,)
    arm: str = "ur5e"
    limits: str | None = None
    tool: Literal["suction", "jaw"] = "suction"
    gripper_delay: Annotated[float, Field(ge=0.0, le=2.0)] = 0.05
    scene: Table = Field(default_factory=dict)
    conditions: Annotated[tuple[MeetCondition, ...], Field(strict=False, min_length=1)]
    chunk: Annotated[int, Field(ge=1, le=1000)] = 5


class Meeter(Settings):
    """A generator, at a rate where it plans.

    Attributes:
        name: Its name.
        rate: Plans a second [Hz]; None where it does not plan.
    """

    name: str
    rate: float | None = None

    @property
    def label(self) -> str:
        """What tables call it."""
        return self.name if self.rate is None else f"{self.name} {self.rate:g} Hz"


class MeetStudy(MeetStudySettings):
    """A study of meetings that can run.

    Attributes:
        world: The world, spelled out.
        version: Version of mitt.
        arm_files: Digests of what the arm was read from, by name.
        flights: None are thrown.
    """

    world: Scene
    version: str
    arm_files: dict[str, str] = Field(default_factory=dict)
    flights: dict[str, str] = Field(default_factory=dict)

    @property
    def digest(self) -> str:
        """SHA-256 of all that decides the results."""
        return json_digest(self.model_dump(mode="json", exclude={"about"}))

    @property
    def gripper(self) -> Suction | Jaw:
        """The tool."""
        return replace(TOOLS[self.tool], delay=self.gripper_delay)

    def meeters(self, condition: MeetCondition) -> tuple[Meeter, ...]:
        """Return the generators that meet what comes by."""
        out: list[Meeter] = []
        for name in self.generators:
            if name in PLANNERS:
                out += [Meeter(name=name, rate=rate) for rate in self.rates]
            elif name not in LINES or condition.target == "belt":
                out.append(Meeter(name=name))
        return tuple(out)


def is_meet_study(path: Path) -> bool:
    """Say whether a study file, or one that ships, is of meetings.

    Raises:
        FileError: It cannot be read or is no TOML.
    """
    return read_toml(study_path(path)).get("task") == "meet"


def read_meet_study(path: Path) -> MeetStudy:
    """Read the file of a study of meetings, or one that ships, by name.

    Raises:
        FileError: The file cannot be read or is no TOML.
        InputError: A key is unknown or its value cannot be used.
    """
    path = study_path(path)
    settings = validated(MeetStudySettings, read_toml(path), place=str(path))
    for name in settings.generators:
        if name not in MEETERS:
            raise UnknownNameError(f"{path} key generators", name, MEETERS)
    names = [condition.name for condition in settings.conditions]
    if doubled := sorted({name for name in names if names.count(name) > 1}):
        raise InputError(f"{path} key conditions", "names of their own", f"{doubled[0]!r} twice")
    given: dict[str, Any] = settings.model_dump()
    with noted() as files:
        load_arm(settings.arm, hand=TOOLS[settings.tool], limits=settings.limits)
    scene = scene_of(settings.scene, place=f"{path} key scene")
    return MeetStudy(**given, world=scene, version=mitt.__version__, arm_files=files)
