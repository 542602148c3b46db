"""Reading a study file, or one of the studies that ship."""

import hashlib
from importlib.resources import files
from pathlib import Path
from typing import Any

import mitt
from mitt import checks
from mitt.errors import FileError, InputError, UnknownNameError, meant
from mitt.reading import noted, read_bytes, read_toml
from mitt.sweep.study import (
    ArmSettings,
    Condition,
    Overrides,
    Study,
    StudySettings,
    SweepSettings,
    Table,
)
from mitt.trials.registry import origin_of
from mitt.trials.run import arm_of
from mitt.world.scenes import DEFAULT, scene_of
from mitt.world.settings import merged, validated
from mitt.world.tables import MAX_BYTES

#: Most conditions in a study.
_MOST_CONDITIONS = 1000


def shipped() -> tuple[str, ...]:
    """Return the names of the studies that come with the package."""
    folder = files("mitt") / "data" / "studies"
    return tuple(sorted(p.name.removesuffix(".toml") for p in folder.iterdir()))


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
    path = checks.path("study", path)
    if not path.is_file() and path.name == str(path) and str(path) in shipped():
        path = Path(str(files("mitt") / "data" / "studies" / f"{path}.toml"))
    elif path.suffix == "" and not path.exists():
        raise FileError(str(path), f"a study file, or one of {', '.join(shipped())}", "neither",
                        do=meant(str(path), shipped()))  # fmt: skip
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
        flights={c.flights: _digest(Path(c.flights)) for c in conditions
                 if c.flights is not None and c.flights != "builtin"},
        plugins={name: origin for name in chosen if (origin := origin_of(name))},
    )  # fmt: skip


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
    files: dict[ArmSettings, dict[str, str]] = {}
    for settings in dict.fromkeys(c.arm for c in conditions):
        with noted() as files[settings]:
            arm_of(settings)
    return [c.model_copy(update={"arm_files": files[c.arm]}) for c in conditions]


def _condition(
    settings: StudySettings, given: Overrides, path: Path, *, name: str, disturbance: str
) -> Condition:
    """Return a condition with the study's settings under its own."""
    place = f"{path} condition {name!r}"
    arm = settings.arm.model_dump() | given.arm
    flights, table = given.flights, merged(dict(settings.scene), dict(given.scene))
    scene = scene_of(table, place=f"{place} scene", base=DEFAULT, flights=flights is not None)
    if flights is not None and flights != "builtin":
        flights = str((path.parent / flights).resolve())
    return Condition(
        name=name,
        disturbance=disturbance,
        arm=validated(ArmSettings, arm, place=f"{place} arm"),
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
