"""Studies of meetings: what their files may say, and the study that follows from it.

A generator that plans is tried at each rate; one that follows a belt's encoder only where there is
a belt.
"""

from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from threading import get_ident
from typing import Annotated, ClassVar, Final, Literal

import numpy as np
from pydantic import Field

from mitt.arm.tools import TOOLS, Jaw, Suction
from mitt.clock import Stopwatch
from mitt.files.arm_file import joint_names
from mitt.reading import noted
from mitt.rivals.meeting import LINES, MEETERS, PLANNERS
from mitt.trials.meeting import STATUSES, MeetRunner, MeetTrial
from mitt.trials.station import Station, arm_with_tool, station
from mitt.trials.task_study import (
    Measure,
    Player,
    Task,
    TaskCondition,
    TaskStudy,
    TaskStudySettings,
    check_files,
    once,
    read_settings,
    study_of,
)

MEET: Final = Task(
    schema="mitt.meet-study/1",
    trial=MeetTrial,
    statuses=STATUSES,
    success="met",
    rate="meet_rate",
    counted="targets met",
    measures={
        "error_mm": Measure("error at the grasp [mm]", lambda row: row["position_error_mm"], 1),
        "velocity_m_s": Measure("relative speed [m/s]", lambda row: row["velocity_error_m_s"], 3),
        "acceleration": Measure(
            "peak acceleration [rad/s^2]",
            lambda row: max(row["peak_acceleration"], default=None),
            0,
        ),
        "force_n": Measure("force on the part [N]", lambda row: row["peak_contact_force_n"], 0),
        "in_sync_s": Measure("in step [s]", lambda row: row["in_sync_s"], 3, more=True),
    },
)
"""The task."""


class MeetCondition(TaskCondition):
    """What comes by.

    Attributes:
        target: What moves the part.
        speed: Mean speed of the belt, or largest of the hand [m/s].
        tool_speed: Largest speed of the tool [m/s]; any if left out.
    """

    target: Literal["belt", "hand"]
    speed: Annotated[float, Field(ge=0.01, le=5.0)]
    tool_speed: Annotated[float, Field(ge=0.01, le=20.0)] | None = None


class MeetStudySettings(TaskStudySettings):
    """The file of a study of meetings.

    Attributes:
        task: Says that it is one.
        generators: Names of the generators.
        rates: Plans a second, of those that plan [Hz].
        arm: The arm: a name, an arm file, or a URDF or MJCF file.
        tip: Frame of the file at which the tool is mounted.
        joints: Joints of the file that move, as A,B,C.
        tool: What it takes parts with.
        gripper_delay: Time from the command until the tool acts [s].
        conditions: What comes by.
    """

    task: Literal["meet"]
    generators: Annotated[tuple[str, ...], Field(strict=False, min_length=1)] = MEETERS
    rates: Annotated[
        tuple[Annotated[float, Field(ge=1.0, le=1000.0)], ...], Field(strict=False, min_length=1)
    ] = (100.0,)
    arm: str = "ur5e"
    tip: str | None = None
    joints: str | None = None
    tool: Literal["suction", "jaw"] = "suction"
    gripper_delay: Annotated[float, Field(ge=0.0, le=2.0)] = 0.05
    conditions: Annotated[tuple[MeetCondition, ...], Field(strict=False, min_length=1)]


class MeetStudy(MeetStudySettings, TaskStudy):
    """A study of meetings that can run."""

    task_of: ClassVar[Task] = MEET

    @property
    def gripper(self) -> Suction | Jaw:
        """The tool."""
        return replace(TOOLS[self.tool], delay=self.gripper_delay)

    @property
    def setting(self) -> str:
        """What its page says of arm and tool, in words."""
        return f"{self.arm}, {self.tool}"

    def players(self, condition: MeetCondition) -> tuple[Player, ...]:
        """Return the generators that meet what comes by."""
        out: list[Player] = []
        for name in self.generators:
            if name in PLANNERS:
                out += [Player(name=name, rate=rate) for rate in self.rates]
            elif name not in LINES or condition.target == "belt":
                out.append(Player(name=name))
        return tuple(out)

    def played(
        self, player: Player, condition: MeetCondition, trials: range
    ) -> tuple[list[MeetTrial], Stopwatch]:
        """Run trials of a generator in a condition; return them, and the times of the ticks."""
        at = _station_of(self.model_dump_json(), condition, get_ident())
        generator = at.generator(player.name, rate=player.rate or 1.0)
        runner = MeetRunner(at, seed=self.seed, speed=condition.speed, generator=generator)
        return [runner.trial(k) for k in trials], runner.stopwatch


@lru_cache(maxsize=8)
def _station_of(text: str, condition: MeetCondition, thread: int) -> Station:  # noqa: ARG001
    """Return the arm where it meets what comes by; kept for a thread."""
    study = MeetStudy.model_validate_json(text)
    speed = np.inf if condition.tool_speed is None else condition.tool_speed
    with noted() as files:
        at = station(
            study.arm,
            study.gripper,
            condition.target,
            study.world,
            tip=study.tip,
            joints=joint_names(study.joints),
            limits=study.limits,
            speed=speed,
        )
    check_files(study, files)
    return at


def read_meet_study(path: Path) -> MeetStudy:
    """Read the file of a study of meetings, or one that ships, by name.

    Raises:
        FileError: The file cannot be read or is no TOML.
        InputError: A key is unknown or its value cannot be used.
    """
    path, settings = read_settings(path, MeetStudySettings, MEETERS)
    once(f"{path} key rates", settings.rates)
    tool = TOOLS[settings.tool]
    return study_of(
        MeetStudy,
        path,
        settings,
        settings.conditions,
        lambda: arm_with_tool(
            settings.arm,
            tool,
            tip=settings.tip,
            joints=joint_names(settings.joints),
            limits=settings.limits,
        ),
    )
