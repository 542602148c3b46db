"""What files of studies of tasks have in common: meeting, batting.

The same targets or balls come for every generator: those of the seed.
"""

from abc import abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, ClassVar, NamedTuple, TypeVar, final

from pydantic import Field

import mitt
from mitt.clock import Stopwatch
from mitt.errors import FileError, InputError, UnknownNameError
from mitt.files.schema import FileSettings, validated
from mitt.files.writing import json_digest
from mitt.reading import changed_file, noted, read_toml
from mitt.trials.study_file import Name, Table, study_path, without_places
from mitt.world.scene import Scene, scene_of

Row = Mapping[str, Any]
"""A trial, by the columns of the table."""


class Measure(NamedTuple):
    """What is measured in each trial.

    Attributes:
        words: What it is, with its unit.
        of: Returns it from a row of the table; None where the row has none.
        digits: Digits in tables.
        more: Whether more of it is better.
    """

    words: str
    of: Callable[[Row], float | None]
    digits: int
    more: bool = False


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Task:
    """What a study is of.

    Attributes:
        schema: Of its summary.
        trial: Its trials, a dataclass.
        statuses: How they end.
        success: The status of one that did what it was to do.
        rate: Name of the share of these.
        counted: In words, what succeeded.
        measures: What is measured in each trial, by name.
    """

    schema: str
    trial: type
    statuses: tuple[str, ...]
    success: str
    rate: str
    counted: str
    measures: Mapping[str, Measure]


class TaskCondition(FileSettings):
    """What comes by.

    Attributes:
        name: What it is called.
    """

    name: Name


class TaskStudySettings(FileSettings):
    """What the file of a study of whatever task may say.

    Attributes:
        name: What it is called.
        about: What it asks, for the page.
        seed: Seed of targets or balls, plant and noise; the same for all generators.
        trials: Trials of each generator in each condition.
        limits: Limit set; that of the arm if left out.
        scene: Settings of the world.
        generators: Names of the generators.
        chunk: Trials of one piece of work.
    """

    name: Name
    about: Annotated[str, Field(max_length=2000)] = ""
    seed: Annotated[int, Field(ge=0, lt=2**63)] = 8000
    trials: Annotated[int, Field(ge=1, le=1_000_000)] = 30
    generators: Annotated[tuple[str, ...], Field(strict=False, min_length=1)]
    limits: str | None = None
    scene: Table = Field(default_factory=dict)
    chunk: Annotated[int, Field(ge=1, le=1000)] = 5


class Player(FileSettings):
    """A generator, at a rate where it plans.

    Attributes:
        name: Its name.
        rate: Plans a second [Hz]; None where it does not plan at a rate.
    """

    name: str
    rate: float | None = None

    @property
    def label(self) -> str:
        """What tables call it."""
        return self.name if self.rate is None else f"{self.name} {self.rate:g} Hz"


class TaskStudy(FileSettings):
    """A study of a task that can run.

    Attributes:
        task_of: The task.
        name: As of :class:`TaskStudySettings`, and ``about``, ``seed``, ``trials``, ``chunk``.
        about: See ``name``.
        seed: See ``name``.
        trials: See ``name``.
        chunk: See ``name``.
        conditions: What comes by.
        world: The world, spelled out.
        version: Version of mitt.
        arm_files: Digests of what the arm was read from, by name.
        flights: None are thrown.
    """

    task_of: ClassVar[Task]

    name: Name
    about: str
    seed: int
    trials: int
    chunk: int
    conditions: tuple[Any, ...]
    world: Scene
    version: str
    arm_files: dict[str, str] = Field(default_factory=dict)
    flights: dict[str, str] = Field(default_factory=dict)

    @property
    def digest(self) -> str:
        """SHA-256 of all that decides the results; of files what they hold, not where they lie."""
        decisive = self.model_dump(mode="json", exclude={"about"})
        decisive["arm_files"] = list(self.arm_files.values())
        without_places(decisive)
        return json_digest(decisive)

    @property
    @abstractmethod
    def setting(self) -> str:
        """What its page says of arm and tool, in words."""

    @abstractmethod
    def players(self, condition: Any) -> tuple[Player, ...]:  # noqa: ANN401 (one of its own)
        """Return the generators that are tried in a condition."""

    def count(self, condition: Any) -> int:  # noqa: ANN401, ARG002 (one of its own)
        """Return the number of trials of each generator in a condition."""
        return self.trials

    @abstractmethod
    def played(
        self,
        player: Player,
        condition: Any,  # noqa: ANN401 (one of its own)
        trials: range,
    ) -> tuple[list[Any], Stopwatch]:
        """Run trials of a generator in a condition; return them, and the times of the ticks."""

    def answer_more(self, rows: Sequence[Row]) -> list[str]:  # noqa: ARG002
        """Return what else rows of the summary say, a sentence each."""
        return []


def task_of_file(path: Path) -> object:
    """Return the task that a study file, or one that ships, names; None of throws.

    Raises:
        FileError: It cannot be read or is no TOML.
    """
    return read_toml(study_path(path)).get("task")


_Said = TypeVar("_Said", bound=TaskStudySettings)


def read_settings(path: Path, said: type[_Said], known: Sequence[str]) -> tuple[Path, _Said]:
    """Read the file of a study, or one that ships, by name.

    Args:
        path: The file.
        said: What it may say.
        known: Names of the generators.

    Returns:
        Where the file is, and what it says.

    Raises:
        FileError: The file cannot be read or is no TOML.
        InputError: A key is unknown or its value cannot be used.
    """
    path = study_path(path)
    settings = validated(said, read_toml(path), place=str(path))
    check_generators(f"{path} key generators", settings.generators, known)
    return path, settings


def check_generators(place: str, names: Sequence[str], known: Sequence[str]) -> None:
    """Refuse names of generators that are unknown or stand there twice.

    Args:
        place: What an error calls them: the file, and where in it.
        names: The names.
        known: Those that there are.
    """
    for name in names:
        if name not in known:
            raise UnknownNameError(place, name, known)
    once(place, names)


def once(place: str, values: Sequence[object]) -> None:
    """Refuse a value that stands there twice; ``place`` is what an error calls them."""
    if doubled := [x for x in values if values.count(x) > 1]:
        raise InputError(place, "each once", f"{doubled[0]!r} twice")


_Made = TypeVar("_Made", bound=TaskStudy)


def study_of(
    kind: type[_Made],
    path: Path,
    settings: TaskStudySettings,
    conditions: Sequence[TaskCondition],
    arm: Callable[[], object],
) -> _Made:
    """Return the study that follows from a file.

    Args:
        kind: What study.
        path: The file.
        settings: What it says, both as of :func:`read_settings`.
        conditions: What comes by.
        arm: Reads the arm, so that it is known from which files.

    Raises:
        InputError: Two conditions have one name, or the scene cannot be used.
    """
    once(f"{path} key conditions", [condition.name for condition in conditions])
    world = scene_of(settings.scene, place=f"{path} key scene")
    with noted() as files:
        arm()
    given = settings.model_dump() | {"conditions": tuple(conditions)}
    return kind(**given, world=world, version=mitt.__version__, arm_files=files)


def check_files(study: TaskStudy, files: Mapping[str, str]) -> None:
    """Refuse an arm that was read from other files than those of a study."""
    if name := changed_file(study.arm_files, dict(files)):
        raise FileError(
            name,
            "the file that the study was made with",
            "another content",
            do="put it back, or begin the study anew",
        )
