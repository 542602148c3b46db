"""Limit sets of arms: those that ship, by name, and TOML files (docs/arms.md)."""

from importlib.resources import files
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from mitt import checks
from mitt.errors import FileError, MittError, UnknownNameError
from mitt.files.schema import Finite, Part, parsed
from mitt.reading import read_toml
from mitt.robot.limit_sets import KINDS, LimitSet
from mitt.robot.wam import LIMIT_SETS

SCHEMA = "mitt.limits/1"

_Row = Annotated[list[Finite], Field(min_length=1, max_length=64)]


class _Limits(Part):
    joints: Annotated[list[str], Field(min_length=1, max_length=64)]
    lower: _Row | None = None
    upper: _Row | None = None
    speed: _Row | None = None
    acceleration: _Row | None = None
    jerk: _Row | None = None
    torque: _Row | None = None
    torque_rate: _Row | None = None
    force: Annotated[float, Field(gt=0.0, le=1e6)] | None = None


class _LimitsFile(Part):
    schema_name: Literal["mitt.limits/1"] = Field(alias="schema")
    limits: _Limits


def shipped() -> tuple[str, ...]:
    """Return the names of the limit sets that come with the package."""
    folder = files("mitt") / "data" / "limits"
    return tuple(sorted(p.name.removesuffix(".toml") for p in folder.iterdir()))


def known_limits() -> tuple[str, ...]:
    """Return the names of all limit sets, those of the WAM and ``model`` first."""
    return ("model", *LIMIT_SETS, *shipped())


def read_limits(name_or_path: str | Path) -> LimitSet:
    """Return a limit set that ships, by name, or one from a TOML file.

    Raises:
        UnknownNameError: No set is called that.
        FileError: The file cannot be read, or does not say what it should.
    """
    path, ships = checks.path("limits", name_or_path), False
    if path.suffix != ".toml":
        if str(name_or_path) not in shipped():
            known = (*known_limits(), "a .toml file")
            raise UnknownNameError("limits", str(name_or_path), known)
        path = Path(str(files("mitt") / "data" / "limits" / f"{name_or_path}.toml"))
        ships = True
    content = parsed(
        _LimitsFile, read_toml(path), place=str(path), wanted=f"limits of schema {SCHEMA}",
        do="see docs/arms.md",
    ).limits  # fmt: skip
    given = {kind: content.model_dump()[kind] for kind in KINDS}
    try:
        return LimitSet(
            name=path.stem,
            joints=tuple(content.joints),
            bounds={k: np.array(x) for k, x in given.items() if x is not None},
            force=np.inf if content.force is None else content.force,
            shipped=ships,
        )
    except MittError as error:
        raise FileError(str(path), "limits that joints can have", error) from error
