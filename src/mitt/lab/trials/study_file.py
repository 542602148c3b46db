"""What the file of a study may say, whatever its task, and the conditions that follow from it."""

import copy
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any, Final, Generic, TypeVar

from pydantic import ConfigDict, Field

import mitt
from mitt.core import checks
from mitt.core.errors import FileError, InputError, UnknownNameError, meant
from mitt.io.reading import read_toml, shipped, shipped_path
from mitt.io.schema import FileSettings, merged, validated
from mitt.lab.trials.study import Condition
from mitt.lab.world.scene import Scene, SceneName, scene_of

Name = Annotated[str, Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9 ._%+=/-]{0,63}$")]
Table = dict[str, Any]
Count = Annotated[int, Field(ge=1, le=10_000_000)]
"""Trials of each generator in a condition."""
Names = Annotated[tuple[str, ...], Field(strict=False, min_length=1, max_length=64)]
"""Names of generators."""

#: Most conditions in a study.
_MOST_CONDITIONS: Final = 1000
#: Keys of a scene that are whole numbers, and those of an arm.
_WHOLE: Final = {"latency", "catch_joint", "order", "joint", "camera"}


class ConditionSettings(FileSettings):
    """What a condition of whatever task may say; what a task adds stands in a derived class.

    Attributes:
        name: What it is called.
        scene: Settings of the world, as in a scene file, over those of the study.
        generators: Names of its generators; those of the study if left out.
        trials: Trials of each of them; those of the study if left out.
    """

    name: Name
    scene: Table = Field(default_factory=dict)
    generators: Names | None = None
    trials: Count | None = None


class SweepSettings(FileSettings):
    """A row of conditions that differ in one number; it has the keys of a condition besides.

    Attributes:
        name: What the number is.
        unit: Its unit, for people.
        set: Address of the number, as ``scene.sensing.latency`` or ``scene.faults.0.magnitude``.
        values: Its values, each a condition.
        factor: What a value is multiplied by before it is set: 0.001 for milliseconds.
    """

    model_config = ConfigDict(extra="allow")

    name: Name
    unit: Annotated[str, Field(max_length=16)] = ""
    set: Annotated[str, Field(pattern=r"^[a-z][a-z0-9_]*(\.[a-z0-9_]+)*$")]
    values: Annotated[
        tuple[Annotated[float, Field(ge=-1e6, le=1e6)], ...],
        Field(strict=False, min_length=1, max_length=200),
    ]
    factor: float = 1.0


class StudySettings(FileSettings):
    """What the file of a study of whatever task may say; a task adds its own in a derived class.

    Attributes:
        name: What the study is called.
        about: What it asks, for the page.
        seed: Seed of targets or balls, plant and noise; the same for all generators and conditions.
        trials: Trials of each generator in each condition.
        trials_of: Another number for some generators.
        generators: Names of the generators; ``all`` alone stands for all that there are.
        scene: Settings of the world.
        conditions: Conditions one by one.
        sweeps: Rows of conditions.
        chunk: Trials of one piece of work.
        record: Most failures to record, of each generator in each condition.
    """

    name: Name
    about: Annotated[str, Field(max_length=2000)] = ""
    seed: Annotated[int, Field(ge=0, lt=2**63)] = 8000
    trials: Count = 30
    trials_of: dict[str, Count] = Field(default_factory=dict)
    generators: Names
    scene: Table = Field(default_factory=dict)
    conditions: Annotated[tuple[Any, ...], Field(strict=False)] = ()
    sweeps: Annotated[tuple[SweepSettings, ...], Field(strict=False)] = ()
    chunk: Annotated[int, Field(ge=1, le=1000)] = 5
    record: Annotated[int, Field(ge=0, le=100)] = 0


def study_path(path: Path) -> Path:
    """Return the study file that a path names, or one of those that ship.

    Raises:
        FileError: It names neither.
    """
    path, known = checks.path("study", path), shipped("studies")
    if not path.is_file() and path.name == str(path) and str(path) in known:
        return shipped_path("studies", str(path))
    if path.suffix == "" and not path.exists():
        raise FileError(
            str(path),
            f"a study file, or one of {', '.join(known)}",
            "neither",
            do=meant(str(path), known),
        )
    return path


_Said = TypeVar("_Said", bound=StudySettings)


def read_settings(path: Path, said: type[_Said], known: Sequence[str]) -> tuple[Path, _Said]:
    """Read the file of a study, or one that ships, by name.

    Args:
        path: The file.
        said: What it may say.
        known: Names of the generators.

    Returns:
        Where the file is, and what it says, its generators by their names.

    Raises:
        FileError: The file cannot be read or is no TOML.
        InputError: A key is unknown or its value cannot be used.
        UnknownNameError: A generator is not available.
    """
    path = study_path(path)
    settings = validated(said, read_toml(path), place=str(path))
    if settings.generators == ("all",):
        settings = settings.model_copy(update={"generators": tuple(known)})
    check_generators(f"{path} key generators", (*settings.trials_of,), known)
    check_generators(f"{path} key generators", settings.generators, known)
    for k, condition in enumerate(settings.conditions):
        place = f"{path} key conditions.{k}.generators"
        check_generators(place, condition.generators or (), known)
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


_Given = TypeVar("_Given", bound=ConditionSettings)


@dataclass(frozen=True, slots=True, kw_only=True)
class Spelled(Generic[_Given]):
    """A condition as the file says it, the number of a sweep in its place.

    Attributes:
        given: What it says.
        place: What errors call it.
        common: What every condition has but world and arm: its name and place in a sweep, and the
            trials of its generators.
        scene: Settings of the world, over those of the study.
    """

    given: _Given
    place: str
    common: Mapping[str, Any]
    scene: Table

    def world(self, base: SceneName = "ideal", *, flights: bool = False) -> Scene:
        """Return the world, spelled out; arguments are those of :func:`scene_of`."""
        return scene_of(self.scene, place=f"{self.place} scene", base=base, flights=flights)


def spelled(settings: StudySettings, kind: type[_Given], path: Path) -> list[Spelled[_Given]]:
    """Return all conditions of a file: those that stand there, and those of its sweeps.

    Args:
        settings: What the file says.
        kind: What a condition may say.
        path: The file.

    Raises:
        InputError: A number of a sweep has no place, or its condition cannot be used.
    """
    out = [spelled_as(settings, x, path, disturbance=x.name) for x in settings.conditions]
    for sweep in settings.sweeps:
        place = f"{path} sweep {sweep.name!r} key set"
        for value in sweep.values:
            tables = _with(sweep, value * sweep.factor, place) | {"name": sweep.name}
            given = validated(kind, tables, place=place)
            name = f"{sweep.name} {value:g} {sweep.unit}".strip()
            given = given.model_copy(update={"name": name})
            one = spelled_as(settings, given, path, disturbance=sweep.name)
            check_generators(f"{one.place} generators", given.generators or (), settings.generators)
            more = {"value": value, "unit": sweep.unit}
            out.append(replace(one, common={**one.common, **more}))
    return out


def spelled_as(
    settings: StudySettings, given: _Given, path: Path, *, disturbance: str
) -> Spelled[_Given]:
    """Return a condition with the settings of a study under its own."""
    counts = {
        name: given.trials or settings.trials_of.get(name, settings.trials)
        for name in given.generators or settings.generators
    }
    return Spelled(
        given=given,
        place=f"{path} condition {given.name!r}",
        common={"name": given.name, "disturbance": disturbance, "counts": counts},
        scene=merged(dict(settings.scene), dict(given.scene)),
    )


def _with(sweep: SweepSettings, value: float, place: str) -> Table:
    """Return the tables of a sweep with one number in its place."""
    tables: Table = copy.deepcopy(sweep.model_extra or {})
    address = sweep.set.split(".")
    at: Any = tables  # descends into it
    for part in address[:-1]:
        if isinstance(at, list) and part in map(str, range(len(at))):
            at = at[int(part)]
        elif isinstance(at, dict):
            at = at.setdefault(part, {})
        else:
            raise InputError(place, "an address that the sweep's tables have", sweep.set[:60])
    if not isinstance(at, dict):
        raise InputError(place, "the address of a number", sweep.set[:60])
    at[address[-1]] = int(value) if value.is_integer() and address[-1] in _WHOLE else value
    return tables


def head_of(settings: StudySettings, path: Path, conditions: Sequence[Condition]) -> dict[str, Any]:
    """Return what every study says, for the class of one.

    Args:
        settings: What its file says.
        path: The file.
        conditions: All conditions.

    Raises:
        InputError: Two conditions have one name, or there are none or too many.
    """
    names = [condition.name for condition in conditions]
    once(f"{path} key conditions", names)
    if not 1 <= len(names) <= _MOST_CONDITIONS:
        raise InputError(
            f"{path} key conditions", f"1 to {_MOST_CONDITIONS} conditions", len(names)
        )
    said = settings.model_dump(include={"task", "name", "about", "seed", "chunk", "record"})
    return {**said, "conditions": tuple(conditions), "version": mitt.__version__}
