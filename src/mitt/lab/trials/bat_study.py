"""Studies of batting: what their files may say, and how their trials are run.

Besides generators side by side a file may ask for a map of the landing error by target and ball
speed. Trials of a chunk follow one another, and what a hit tells of the restitution is known in the
next; each chunk begins with what the catcher is told.
"""

from collections.abc import Sequence
from functools import lru_cache
from pathlib import Path
from threading import get_ident
from typing import Annotated, ClassVar, Final, Literal

import numpy as np
from pydantic import Field, field_validator

from mitt.core.arm.tools import Paddle
from mitt.core.errors import InputError
from mitt.io.arm_file import Coordinate
from mitt.io.reading import noted
from mitt.io.recordings import Recording
from mitt.io.schema import FileSettings
from mitt.lab.rivals.batting import BATTERS
from mitt.lab.trials.bat_station import (
    TARGET,
    BatStation,
    arm_with_paddle,
    bat_station,
    coming,
    throw_ranges,
)
from mitt.lab.trials.batting import BAT, bat_trials
from mitt.lab.trials.prepared import Trials
from mitt.lab.trials.scored_task import Row, ScoredTask
from mitt.lab.trials.source import source_of
from mitt.lab.trials.study import REFERENCE, Chunk, Condition, RunnerStudy, check_files
from mitt.lab.trials.study_file import (
    ConditionSettings,
    Count,
    Names,
    Spelled,
    StudySettings,
    head_of,
    read_settings,
    spelled,
    spelled_as,
)

AXES: Final = ("away", "to the left", "up")
"""Directions in which the target is moved: x, y, z."""

#: Share of balls returned from which a cell of the map counts as good.
_GOOD: Final = 0.9

BallSpeed = Annotated[float, Field(ge=1.0, le=20.0)]
"""Speed of a ball at release [m/s]."""

Offset = Annotated[float, Field(ge=-2.0, le=2.0)]
"""How far a target is moved [m]."""


class BatConditionSettings(ConditionSettings):
    """What comes by, and where it is sent.

    Attributes:
        target: Where balls are sent [m].
        speed: Least and largest speed of the balls at release [m/s]; those of default throws
            where None.
    """

    target: Annotated[tuple[Coordinate, Coordinate, Coordinate], Field(strict=False)] = TARGET
    speed: Annotated[tuple[BallSpeed, BallSpeed], Field(strict=False)] | None = None

    @field_validator("speed")
    @classmethod
    def _ordered(cls, value: tuple[float, float] | None) -> tuple[float, float] | None:
        """Refuse speeds whose least is above their largest."""
        if value is not None and value[0] > value[1]:
            raise ValueError("the least speed and then the largest")
        return value


class BatCondition(Condition):
    """What comes by, with everything in its place.

    Attributes:
        target: As in the file, and ``speed``.
        speed: See ``target``.
        moved: The axis along which a map has moved the target, 0 to 2, and how far [m]; -1 and 0
            where it is the usual one; None where it is no cell of a map.
    """

    target: Annotated[tuple[float, float, float], Field(strict=False)]
    speed: Annotated[tuple[float, float], Field(strict=False)] | None = None
    moved: Annotated[tuple[int, float], Field(strict=False)] | None = None


class MapSettings(FileSettings):
    """A map of the landing error: the target moved along each axis, balls of each speed.

    Attributes:
        offsets: How far the target is moved [m]; 0 is there anyway.
        speeds: Speeds at release that bound the rows of the map [m/s], rising.
        trials: Trials of each cell.
    """

    offsets: Annotated[tuple[Offset, ...], Field(strict=False, min_length=1)]
    speeds: Annotated[tuple[BallSpeed, ...], Field(strict=False, min_length=2)]
    trials: Count = 20

    @field_validator("speeds")
    @classmethod
    def _rising(cls, value: tuple[float, ...]) -> tuple[float, ...]:
        """Refuse speeds that do not rise."""
        if list(value) != sorted(set(value)):
            raise ValueError("speeds that rise")
        return value


class BatChoice(FileSettings):
    """What moves and what it sees: keys of the file of a study of batting.

    Attributes:
        arm: The arm, one with a stance, or an arm file of one.
        limits: Limit set; that of the arm if left out.
        vision: What the catcher sees.
    """

    arm: str = "wam"
    limits: str | None = None
    vision: Literal["pixels", "points"] = "points"


class BatStudySettings(BatChoice, StudySettings):
    """The file of a study of batting.

    Attributes:
        task: Says that it is one.
        generators: Names of the generators.
        chunk: Trials that follow one another.
        conditions: Conditions one by one.
        map: A map of the landing error besides; none if left out.
    """

    task: Literal["bat"]
    generators: Names = BATTERS
    chunk: Annotated[int, Field(ge=1, le=1000)] = 100
    conditions: Annotated[tuple[BatConditionSettings, ...], Field(strict=False)] = ()
    map: MapSettings | None = None


class BatStudy(BatChoice, RunnerStudy):
    """A study of batting that can run; cells of its map are among its conditions."""

    kind: ClassVar[ScoredTask] = BAT

    conditions: Annotated[tuple[BatCondition, ...], Field(strict=False)]

    @property
    def setting(self) -> str:
        """What its page says of arm, limits and vision, in words."""
        return f"{self.arm}, {self.limits or 'its own limits'}, {self.vision}"

    def recorded(self, chunk: Chunk, index: int) -> Recording:
        """Run the trials of a chunk up to one once more: each learns from those before."""
        runner = self.runner(chunk, keeps=True)
        trial = [runner.trial(k) for k in range(chunk.start, index + 1)][-1]
        return runner.recording(trial)

    def runner(self, chunk: Chunk, *, keeps: bool = False) -> Trials:
        """Return a fresh runner for a chunk, which has learned nothing yet."""
        choice = self.model_dump_json(include=set(BatChoice.model_fields))
        of = chunk.condition
        at = _station_of(choice, of.model_dump_json(), get_ident())
        source = source_of(
            at.arm,
            seed=self.seed,
            drag=at.scene.ball.drag,
            spinning=at.scene.ball.spinning,
            count=chunk.stop,
            ranges=throw_ranges(of.speed, at),
        )
        name = chunk.player.name
        return bat_trials(at, source, vision=self.vision, generator=name, keeps=keeps)

    def cells(self, rows: Sequence[Row]) -> list[tuple[BatCondition, Row]]:
        """Return the cells of the map with what the summary says of them."""
        found = {r["condition"]: r for r in rows if r["generator"] == REFERENCE}
        return [(c, found[c.name]) for c in self.conditions if c.moved and c.name in found]

    def answer(self, rows: Sequence[Row]) -> list[str]:
        """Return what the rows of the summary say, those of the map last."""
        return super().answer(rows) + self.answer_of_map(rows)

    def answer_of_map(self, rows: Sequence[Row]) -> list[str]:
        """Return where balls are returned, how near they land, and what refuses the others."""
        cells = [(c, row) for c, row in self.cells(rows) if row["trials"]]
        if not cells:
            return []
        good = [row for _, row in cells if row["return_rate"] >= _GOOD and row["landing_cm"]]
        out = [
            f"Map: in {len(good)} of {len(cells)} cells at least "
            f"{100.0 * _GOOD:.0f} % of the balls are returned"
        ]
        if good:
            errors = sorted(row["landing_cm"]["median"] for row in good)
            out[0] += (
                f"; there the median landing error is {errors[0]:.1f} to {errors[-1]:.1f} cm, in "
                f"half of them at most {errors[(len(errors) - 1) // 2]:.1f} cm"
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
def _station_of(text: str, condition: str, thread: int) -> BatStation:  # noqa: ARG001
    """Return the arm, its map learned for a condition; kept for a thread."""
    of, at = BatChoice.model_validate_json(text), BatCondition.model_validate_json(condition)
    with noted() as files:
        found = bat_station(
            of.arm,
            scene=at.scene,
            target=np.array(at.target),
            limits=of.limits,
            around=coming(at.speed),
        )
    check_files(at, files)
    return found


def _mapped(of: MapSettings) -> list[tuple[BatConditionSettings, tuple[int, float]]]:
    """Return the cells of a map as conditions, and the axis and offset that have moved the target.

    For each speed the usual target, then the others.
    """
    out = list[tuple[BatConditionSettings, tuple[int, float]]]()
    moved = [(k, x) for k in range(3) for x in sorted({*of.offsets} - {0.0})]
    for low, high in zip(of.speeds[:-1], of.speeds[1:], strict=True):
        for axis, off in [(-1, 0.0), *moved]:
            target = np.array(TARGET) + off * np.eye(3)[axis]
            place = "usual target" if axis < 0 else f"target {off:+g} m {AXES[axis]}"
            given = BatConditionSettings(
                name=f"{place} {low:g} to {high:g} m/s",
                target=tuple(target.tolist()),
                speed=(low, high),
                trials=of.trials,
                generators=(REFERENCE,),
            )
            out.append((given, (axis, off)))
    return out


def read_bat_study(path: Path) -> BatStudy:
    """Read the file of a study of batting; errors as of :func:`read_settings`."""
    path, settings = read_settings(path, BatStudySettings, BATTERS)
    given = spelled(settings, BatConditionSettings, path)
    cells = [] if settings.map is None else _mapped(settings.map)
    if not given and not cells:
        raise InputError(f"{path} key conditions", "a condition, a sweep, or a map", "none")
    with noted() as files:
        arm_with_paddle(settings.arm, Paddle(), limits=settings.limits)

    def whole(x: Spelled[BatConditionSettings], moved: tuple[int, float] | None) -> BatCondition:
        of = x.given.model_dump(include={"target", "speed"})
        return BatCondition(**x.common, **of, moved=moved, scene=x.world(), arm_files=files)

    conditions = [whole(x, None) for x in given]
    conditions += [
        whole(spelled_as(settings, x, path, disturbance=x.name), moved) for x, moved in cells
    ]
    choice = settings.model_dump(include=set(BatChoice.model_fields))
    return BatStudy(**head_of(settings, path, conditions), **choice)
