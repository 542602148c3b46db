"""Studies of meetings: what their files may say, and how their trials are run.

A generator that plans is tried at each rate; one that follows a belt's encoder only where there is
a belt.
"""

from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from threading import get_ident
from typing import Annotated, ClassVar, Literal

import numpy as np
from pydantic import Field

from mitt.core.arm.tools import TOOLS, Jaw, Suction
from mitt.io.arm_file import joint_names
from mitt.io.reading import noted
from mitt.io.schema import FileSettings
from mitt.lab.rivals.meeting import LINES, MEETERS, PLANNERS
from mitt.lab.trials.meeting import MEET, MeetRunner
from mitt.lab.trials.scored_task import ScoredTask
from mitt.lab.trials.station import Station, arm_with_tool, station
from mitt.lab.trials.study import Chunk, Condition, Player, RunnerStudy, check_files
from mitt.lab.trials.study_file import (
    ConditionSettings,
    Names,
    StudySettings,
    head_of,
    once,
    read_settings,
    spelled,
)

Speed = Annotated[float, Field(ge=0.01, le=5.0)]
"""Mean speed of a belt, or largest of a hand [m/s]."""
ToolSpeed = Annotated[float, Field(ge=0.01, le=20.0)]
"""Largest speed of a tool [m/s]."""


class MeetConditionSettings(ConditionSettings):
    """What comes by.

    Attributes:
        target: What moves the part.
        speed: Mean speed of the belt, or largest of the hand [m/s].
        tool_speed: Largest speed of the tool [m/s]; any if left out.
    """

    target: Literal["belt", "hand"]
    speed: Speed
    tool_speed: ToolSpeed | None = None


class MeetCondition(Condition):
    """What comes by, with everything in its place; the fields are those of the file."""

    target: Literal["belt", "hand"]
    speed: Speed
    tool_speed: ToolSpeed | None = None


class MeetChoice(FileSettings):
    """What moves, and with what it takes parts: keys of the file of a study of meetings.

    Attributes:
        rates: Plans a second, of those that plan [Hz].
        arm: The arm: a name, an arm file, or a URDF or MJCF file.
        tip: Frame of the file at which the tool is mounted.
        joints: Joints of the file that move, as A,B,C.
        limits: Limit set; that of the arm if left out.
        tool: What it takes parts with.
        gripper_delay: Time from the command until the tool acts [s].
    """

    rates: Annotated[
        tuple[Annotated[float, Field(ge=1.0, le=1000.0)], ...], Field(strict=False, min_length=1)
    ] = (100.0,)
    arm: str = "ur5e"
    tip: str | None = None
    joints: str | None = None
    limits: str | None = None
    tool: Literal["suction", "jaw"] = "suction"
    gripper_delay: Annotated[float, Field(ge=0.0, le=2.0)] = 0.05

    @property
    def gripper(self) -> Suction | Jaw:
        """The tool."""
        return replace(TOOLS[self.tool], delay=self.gripper_delay)


class MeetStudySettings(MeetChoice, StudySettings):
    """The file of a study of meetings.

    Attributes:
        task: Says that it is one.
        generators: Names of the generators.
        conditions: Conditions one by one.
    """

    task: Literal["meet"]
    generators: Names = MEETERS
    conditions: Annotated[tuple[MeetConditionSettings, ...], Field(strict=False)] = ()


class MeetStudy(MeetChoice, RunnerStudy):
    """A study of meetings that can run."""

    kind: ClassVar[ScoredTask] = MEET

    conditions: Annotated[tuple[MeetCondition, ...], Field(strict=False)]

    @property
    def setting(self) -> str:
        """What its page says of arm and tool, in words."""
        return f"{self.arm}, {self.tool}"

    def players(self, condition: MeetCondition) -> tuple[Player, ...]:
        """Return the generators that meet what comes by."""
        out: list[Player] = []
        for name in condition.counts:
            if name in PLANNERS:
                out += [Player(name, rate) for rate in self.rates]
            elif name not in LINES or condition.target == "belt":
                out.append(Player(name))
        return tuple(out)

    def runner(self, chunk: Chunk, *, keeps: bool = False) -> MeetRunner:  # noqa: ARG002 (always)
        """Return a fresh runner for a chunk."""
        of = chunk.condition
        at = _station_of(
            self.model_dump_json(include=set(MeetChoice.model_fields)),
            of.model_dump_json(),
            get_ident(),
        )
        generator = at.generator(chunk.player.name, rate=chunk.player.rate or 1.0)
        return MeetRunner(at, seed=self.seed, speed=of.speed, generator=generator)


@lru_cache(maxsize=8)
def _station_of(text: str, condition: str, thread: int) -> Station:  # noqa: ARG001
    """Return the arm where it meets what comes by; kept for a thread."""
    of, at = MeetChoice.model_validate_json(text), MeetCondition.model_validate_json(condition)
    speed = np.inf if at.tool_speed is None else at.tool_speed
    with noted() as files:
        found = station(
            of.arm,
            of.gripper,
            at.target,
            at.scene,
            tip=of.tip,
            joints=joint_names(of.joints),
            limits=of.limits,
            speed=speed,
        )
    check_files(at, files)
    return found


def read_meet_study(path: Path) -> MeetStudy:
    """Read the file of a study of meetings, or one that ships, by name.

    Raises:
        FileError: The file cannot be read or is no TOML.
        InputError: A key is unknown or its value cannot be used.
    """
    path, settings = read_settings(path, MeetStudySettings, MEETERS)
    once(f"{path} key rates", settings.rates)
    given = spelled(settings, MeetConditionSettings, path)
    with noted() as files:
        arm_with_tool(
            settings.arm,
            TOOLS[settings.tool],
            tip=settings.tip,
            joints=joint_names(settings.joints),
            limits=settings.limits,
        )
    conditions = [
        MeetCondition(
            **x.common,
            **x.given.model_dump(include={"target", "speed", "tool_speed"}),
            scene=x.world(),
            arm_files=files,
        )
        for x in given
    ]
    choice = settings.model_dump(include=set(MeetChoice.model_fields))
    return MeetStudy(**head_of(settings, path, conditions), **choice)
