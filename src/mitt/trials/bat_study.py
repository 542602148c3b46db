"""Studies of batting: generators side by side, and a map of the miss by target and ball speed.

Trials of a chunk follow one another, and what a hit tells of the restitution is known in the next;
each chunk begins with what the catcher is told.
"""

from collections.abc import Sequence
from functools import lru_cache
from pathlib import Path
from threading import get_ident
from typing import Annotated, ClassVar, Final, Literal

import numpy as np
from pydantic import Field, field_validator

from mitt.arm.tools import Paddle
from mitt.clock import Stopwatch
from mitt.errors import InputError
from mitt.files.arm_file import Coordinate
from mitt.files.schema import FileSettings
from mitt.reading import noted
from mitt.rivals.batting import BATTERS
from mitt.trials.bat_station import (
    TARGET,
    BatStation,
    arm_with_paddle,
    bat_station,
    coming,
    throw_ranges,
)
from mitt.trials.batting import STATUSES, BatRunner, BatTrial
from mitt.trials.source import source_of
from mitt.trials.study_file import REFERENCE
from mitt.trials.task_study import (
    Measure,
    Player,
    Row,
    Task,
    TaskCondition,
    TaskStudy,
    TaskStudySettings,
    check_files,
    check_generators,
    read_settings,
    study_of,
)

BAT: Final = Task(
    schema="mitt.bat-study/1",
    trial=BatTrial,
    statuses=STATUSES,
    success="hit",
    rate="hit_rate",
    counted="balls hit",
    measures={
        "miss_cm": Measure("miss at the target [cm]", lambda row: _times(100.0, row["miss_m"]), 1),
        "off_middle_mm": Measure(
            "off the paddle's middle [mm]", lambda row: row["off_middle_mm"], 1
        ),
        "acceleration": Measure(
            "peak acceleration [rad/s^2]",
            lambda row: max(row["peak_acceleration"], default=None),
            0,
        ),
        "force_n": Measure("force on the ball [N]", lambda row: row["peak_contact_force_n"], 0),
    },
)
"""The task."""

AXES: Final = ("away", "to the left", "up")
"""Directions in which the target is moved: x, y, z."""

#: Share of hits from which a cell of the map counts as good.
_GOOD = 0.9

Speed = Annotated[float, Field(ge=1.0, le=20.0)]
"""Speed of a ball at release [m/s]."""

Offset = Annotated[float, Field(ge=-2.0, le=2.0)]
"""How far a target is moved [m]."""


def _times(factor: float, value: float | None) -> float | None:
    """Return a product; None of None."""
    return None if value is None else factor * value


class BatCondition(TaskCondition):
    """What comes by, and where it is sent.

    Attributes:
        target: Where balls are sent [m].
        speed: Least and largest speed of the balls at release [m/s]; those of default throws
            where None.
        trials: Trials of each generator; as of the study where None.
        generators: Names of the generators; as of the study where None.
        moved: The axis along which a map has moved the target, 0 to 2, and how far [m]; -1 and 0
            where it is the usual one; None where it is no cell of a map.
    """

    target: Annotated[tuple[Coordinate, Coordinate, Coordinate], Field(strict=False)] = TARGET
    speed: Annotated[tuple[Speed, Speed], Field(strict=False)] | None = None
    trials: Annotated[int, Field(ge=1, le=1_000_000)] | None = None
    generators: Annotated[tuple[str, ...], Field(strict=False, min_length=1)] | None = None
    moved: (
        Annotated[tuple[Annotated[int, Field(ge=-1, le=2)], Offset], Field(strict=False)] | None
    ) = None

    @field_validator("speed")
    @classmethod
    def _ordered(cls, value: tuple[float, float] | None) -> tuple[float, float] | None:
        """Refuse speeds whose least is above their largest."""
        if value is not None and value[0] > value[1]:
            raise ValueError("the least speed and then the largest")
        return value


class MapSettings(FileSettings):
    """A map of the miss: the target moved along each axis, balls of each speed.

    Attributes:
        offsets: How far the target is moved [m]; 0 is there anyway.
        speeds: Speeds at release that bound the rows of the map [m/s], rising.
        trials: Trials of each cell.
    """

    offsets: Annotated[tuple[Offset, ...], Field(strict=False, min_length=1)]
    speeds: Annotated[tuple[Speed, ...], Field(strict=False, min_length=2)]
    trials: Annotated[int, Field(ge=1, le=1_000_000)] = 20

    @field_validator("speeds")
    @classmethod
    def _rising(cls, value: tuple[float, ...]) -> tuple[float, ...]:
        """Refuse speeds that do not rise."""
        if list(value) != sorted(set(value)):
            raise ValueError("speeds that rise")
        return value


class BatStudySettings(TaskStudySettings):
    """The file of a study of batting.

    Attributes:
        task: Says that it is one.
        generators: Names of the generators.
        arm: The arm, one with a stance, or an arm file of one.
        vision: What the catcher sees.
        chunk: Trials that follow one another.
        conditions: What comes by.
        map: A map of the miss besides; none if left out.
    """

    task: Literal["bat"]
    generators: Annotated[tuple[str, ...], Field(strict=False, min_length=1)] = BATTERS
    arm: str = "wam"
    vision: Literal["pixels", "points"] = "points"
    chunk: Annotated[int, Field(ge=1, le=1000)] = 100
    conditions: Annotated[tuple[BatCondition, ...], Field(strict=False)] = ()
    map: MapSettings | None = None


class BatStudy(BatStudySettings, TaskStudy):
    """A study of batting that can run; cells of its map are among its conditions."""

    task_of: ClassVar[Task] = BAT

    @property
    def setting(self) -> str:
        """What its page says of arm and limits, in words."""
        return f"{self.arm}, {self.limits or 'its own limits'}, {self.vision}"

    def players(self, condition: BatCondition) -> tuple[Player, ...]:
        """Return the generators that are tried in a condition."""
        return tuple(Player(name=x) for x in condition.generators or self.generators)

    def count(self, condition: BatCondition) -> int:
        """Return the number of trials of each generator in a condition."""
        return condition.trials or self.trials

    def played(
        self, player: Player, condition: BatCondition, trials: range
    ) -> tuple[list[BatTrial], Stopwatch]:
        """Run trials of a generator in a condition; return them, and the times of the ticks."""
        at = _station_of(self.model_dump_json(), condition, get_ident())
        source = source_of(
            at.arm,
            seed=self.seed,
            drag=at.scene.ball.drag,
            count=trials.stop,
            ranges=throw_ranges(condition.speed, at),
        )
        runner = BatRunner(at, source, pixels=self.vision == "pixels", generator=player.name)
        return [runner.trial(k) for k in trials], runner.stopwatch

    def cells(self, rows: Sequence[Row]) -> list[tuple[BatCondition, Row]]:
        """Return the cells of the map with what the summary says of them."""
        found = {r["condition"]: r for r in rows if r["generator"] == REFERENCE}
        return [(c, found[c.name]) for c in self.conditions if c.moved and c.name in found]

    def answer_more(self, rows: Sequence[Row]) -> list[str]:
        """Return what the map says: where balls are hit, how near, and what refuses the others."""
        cells = [(c, row) for c, row in self.cells(rows) if row["trials"]]
        if not cells:
            return []
        good = [row for _, row in cells if row["hit_rate"] >= _GOOD and row["miss_cm"]]
        out = [
            f"Map: in {len(good)} of {len(cells)} cells at least "
            f"{100.0 * _GOOD:.0f} % of the balls are hit"
        ]
        if good:
            misses = sorted(row["miss_cm"]["median"] for row in good)
            out[0] += (
                f"; there the median miss is {misses[0]:.1f} to {misses[-1]:.1f} cm, in "
                f"half of them at most {misses[(len(misses) - 1) // 2]:.1f} cm"
            )
        out[0] += "."
        refused = [row for _, row in cells if row["unreachable"]]
        if refused:
            most = max(refused, key=lambda row: row["unreachable"] / row["trials"])
            why = sorted({str(row["refused_by"]) for row in refused})
            out.append(
                f"Map: balls are refused in {len(refused)} cells, by {', '.join(why)}; most in "
                f"{most['condition']}, {most['unreachable']} of {most['trials']}."
            )
        return out


@lru_cache(maxsize=4)
def _station_of(text: str, condition: BatCondition, thread: int) -> BatStation:  # noqa: ARG001
    """Return the arm, its map learned for a condition; kept for a thread."""
    study = BatStudy.model_validate_json(text)
    with noted() as files:
        at = bat_station(
            study.arm,
            scene=study.world,
            target=np.array(condition.target),
            limits=study.limits,
            around=coming(condition.speed),
        )
    check_files(study, files)
    return at


def _mapped(of: MapSettings) -> list[BatCondition]:
    """Return the cells of a map as conditions: for each speed the usual target, then the others."""
    out = list[BatCondition]()
    moved = [(k, x) for k in range(3) for x in sorted({*of.offsets} - {0.0})]
    for low, high in zip(of.speeds[:-1], of.speeds[1:], strict=True):
        for axis, off in [(-1, 0.0), *moved]:
            target = np.array(TARGET) + off * np.eye(3)[axis]
            place = "usual target" if axis < 0 else f"target {off:+g} m {AXES[axis]}"
            out.append(
                BatCondition(
                    name=f"{place} {low:g} to {high:g} m/s",
                    target=tuple(target.tolist()),
                    speed=(low, high),
                    trials=of.trials,
                    generators=(REFERENCE,),
                    moved=(axis, off),
                )
            )
    return out


def read_bat_study(path: Path) -> BatStudy:
    """Read the file of a study of batting; errors as of :func:`read_settings`."""
    path, settings = read_settings(path, BatStudySettings, BATTERS)
    for k, condition in enumerate(settings.conditions):
        check_generators(
            f"{path} key conditions.{k}.generators", condition.generators or (), BATTERS
        )
    conditions = [*settings.conditions, *(_mapped(settings.map) if settings.map else ())]
    if not conditions:
        raise InputError(f"{path} key conditions", "a condition, or a map", "neither")
    return study_of(
        BatStudy,
        path,
        settings,
        conditions,
        lambda: arm_with_paddle(settings.arm, Paddle(), limits=settings.limits),
    )
