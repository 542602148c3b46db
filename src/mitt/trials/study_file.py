"""What a study file may say, key by key, and the study that follows from it."""

import hashlib
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field

import mitt
from mitt import checks
from mitt.errors import FileError, InputError, UnknownNameError, meant
from mitt.files.arm_file import ArmSpec, ThrowSettings
from mitt.files.csv_table import MAX_BYTES
from mitt.files.schema import FileSettings, merged, validated
from mitt.files.writing import json_digest
from mitt.reading import read_bytes, read_toml, shipped, shipped_path
from mitt.trials.registry import origin_of
from mitt.world.overlap import check_scene
from mitt.world.scene import DEFAULT_SCENE, Scene, scene_of

SCHEMA = "mitt.study/1"

#: The generator that all others are compared with.
REFERENCE = "direct"

#: Most throws in a study.
_MOST_THROWS = 10_000_000

Name = Annotated[str, Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9 ._%+=/-]{0,63}$")]
Table = dict[str, Any]
Number = Annotated[float, Field(ge=-1e6, le=1e6)]


class Overrides(FileSettings):
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
    values: Annotated[tuple[Number, ...], Field(strict=False, min_length=1, max_length=200)]
    factor: float = 1.0


class StudySettings(FileSettings):
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
    arm: ArmSpec = ArmSpec()
    vision: Literal["pixels", "points"] = "pixels"
    scene: Table = Field(default_factory=dict)
    conditions: Annotated[tuple[ConditionSettings, ...], Field(strict=False)] = ()
    sweeps: Annotated[tuple[SweepSettings, ...], Field(strict=False)] = ()
    chunk: Annotated[int, Field(ge=1, le=1000)] = 25
    record: Annotated[int, Field(ge=0, le=100)] = 1


class Condition(FileSettings):
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
    arm: ArmSpec
    scene: Scene
    vision: Literal["pixels", "points"]
    flights: str | None = None
    throws: ThrowSettings = ThrowSettings()
    arm_files: dict[str, str] = Field(default_factory=dict)


class Study(FileSettings):
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
            without_places(condition["arm"])
        return json_digest(decisive)


def without_places(said: dict[str, Any]) -> None:
    """Replace an arm and limits that are files by their kind: what they hold is said elsewhere."""
    for name in {"arm", "limits"} & said.keys():
        if isinstance(said[name], str):
            said[name] = Path(said[name]).suffix or said[name]


def extent(study: Study, throws: int) -> str:
    """Return how large a study is: ``9 generators, 1 condition, 2,700 throws``."""
    counts = {
        "generator": len(study.generators),
        "condition": len(study.conditions),
        "throw": throws,
    }
    return ", ".join(f"{n:,} {what}{'s' * (n != 1)}" for what, n in counts.items())


#: Most conditions in a study.
_MOST_CONDITIONS = 1000


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


def read_study(path: Path, *, generators: tuple[str, ...]) -> Study:
    """Read a study file, or one of the studies that ship, by name.

    Args:
        path: The file, or the name of a study that ships.
        generators: Names that are available.

    Raises:
        FileError: The file cannot be read or is no TOML.
        InputError: A key is unknown or its value cannot be used.
        UnknownNameError: A generator is not available; InputError: one does not load.
    """
    path = study_path(path)
    settings = validated(StudySettings, read_toml(path), place=str(path))
    chosen = generators if settings.generators == ("all",) else settings.generators
    for name in (*chosen, *settings.throws_of):
        if name not in generators:
            raise UnknownNameError(f"{path} key generators", name, generators)
    conditions = _with_files(_conditions(settings, path))
    names = [condition.name for condition in conditions]
    doubled = {name for name in names if names.count(name) > 1}
    if doubled or not 1 <= len(names) <= _MOST_CONDITIONS:
        wanted = f"1 to {_MOST_CONDITIONS} conditions, each with a name of its own"
        given = f"{sorted(doubled)[0]!r} twice" if doubled else f"{len(names)} conditions"
        raise InputError(f"{path} key conditions", wanted, given)
    return Study(
        name=settings.name,
        about=settings.about,
        seed=settings.seed,
        counts={g: settings.throws_of.get(g, settings.throws) for g in chosen},
        conditions=tuple(conditions),
        chunk=settings.chunk,
        record=settings.record,
        version=mitt.__version__,
        flights={
            c.flights: _digest(Path(c.flights))
            for c in conditions
            if c.flights is not None and c.flights != "builtin"
        },
        plugins={name: origin for name in chosen if (origin := origin_of(name))},
    )


def _digest(path: Path) -> str:
    """Return the SHA-256 of a file."""
    content = read_bytes(path, max_bytes=MAX_BYTES, wanted="a readable CSV file")
    return hashlib.sha256(content).hexdigest()


def _conditions(settings: StudySettings, path: Path) -> list[Condition]:
    """Return all conditions of a study file."""
    out = [
        _condition(settings, single, path, name=single.name, disturbance=single.name)
        for single in settings.conditions
    ]
    for sweep in settings.sweeps:
        for value in sweep.values:
            name = f"{sweep.name} {value:g} {sweep.unit}".strip()
            place = f"{path} sweep {sweep.name!r} key set"
            changed = _with(sweep, sweep.set.split("."), value * sweep.factor, place)
            one = _condition(settings, changed, path, name=name, disturbance=sweep.name)
            out.append(one.model_copy(update={"value": value, "unit": sweep.unit}))
    return out


def _with_files(conditions: list[Condition]) -> list[Condition]:
    """Return conditions with the digests of what their arms are read from; each is read once."""
    chosen = {spec: spec.read() for spec in dict.fromkeys(c.arm for c in conditions)}
    for c in conditions:
        check_scene(chosen[c.arm].arm, c.scene)
    return [c.model_copy(update={"arm_files": chosen[c.arm].files}) for c in conditions]


def _condition(
    settings: StudySettings, given: Overrides, path: Path, *, name: str, disturbance: str
) -> Condition:
    """Return a condition with the study's settings under its own."""
    place = f"{path} condition {name!r}"
    arm = settings.arm.model_dump() | given.arm
    flights, table = given.flights, merged(dict(settings.scene), dict(given.scene))
    recorded = flights is not None
    scene = scene_of(table, place=f"{place} scene", base=DEFAULT_SCENE, flights=recorded)
    if flights is not None and flights != "builtin":
        flights = str((path.parent / flights).resolve())
    return Condition(
        name=name,
        disturbance=disturbance,
        arm=validated(ArmSpec, arm, place=f"{place} arm"),
        scene=scene,
        vision=given.vision or settings.vision,
        flights=flights,
        throws=given.throws,
    )


def _with(sweep: SweepSettings, address: list[str], value: float, place: str) -> Overrides:
    """Return a sweep's overrides with one number in its place."""
    tables: Table = sweep.model_dump(include={"arm", "scene", "throws"}, exclude_unset=True)
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
    at[address[-1]] = int(value) if value.is_integer() and _counts(address) else value
    rest = {"vision": sweep.vision, "flights": sweep.flights}
    return validated(Overrides, tables | rest, place=place)


def _counts(address: list[str]) -> bool:
    """Say whether an address holds a whole number."""
    return address[-1] in {"latency", "catch_joint", "order", "joint", "camera"}
