"""What the folder of a finished study holds, read back."""

from dataclasses import dataclass
from typing import Annotated, Any

from pydantic import Field

from mitt.errors import FileError
from mitt.link.files import read_json
from mitt.study.sweep.folder import Folder, read_manifest
from mitt.study.sweep.study import SCHEMA, Study
from mitt.world.settings import Settings, validated

Count = Annotated[int, Field(ge=0)]
Share = Annotated[float, Field(ge=0.0, le=1.0)]


class _Pairs(Settings):
    """How a generator differs from the direct map."""

    pairs: Count
    only_direct: Count
    only_this: Count
    p: Share
    p_holm: Share


class _Median(Settings):
    """Medians of a row."""

    position_error_mm: float | None
    velocity_error_m_s: float | None
    peak_contact_force_n: float | None
    energy_j: float | None
    demand_cost: float | None
    peak_torque_ratio: float | None
    peak_speed_ratio: float | None


class _Row(Settings):
    """A row of the summary, as :func:`mitt.study.sweep.summary.cell_of` makes it."""

    generator: str
    condition: str
    throws: Count
    caught: Count
    catch_rate: Share
    ci95: Annotated[tuple[Share, Share], Field(strict=False)]
    dropped: Count
    missed: Count
    unreachable: Count
    stopped: Count
    aborted: Count
    stopped_by: dict[str, Count]
    complete: bool
    disturbance: str
    value: float | None
    unit: str
    violating_throws: Count
    median: _Median
    against_direct: _Pairs | None


class _Summary(Settings):
    """What ``summary.json`` says."""

    schema_: Annotated[str, Field(alias="schema")]
    rows: Annotated[tuple[_Row, ...], Field(strict=False)]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class StudyResult:
    """What the folder of a study holds.

    Attributes:
        study: The study.
        folder: The folder.
        rows: Rows of the summary.
    """

    study: Study
    folder: Folder
    rows: list[dict[str, Any]]


def read_result(folder: Folder) -> StudyResult:
    """Read the folder of a study.

    Raises:
        FileError: It holds no study, one without a summary, or one that was altered.
        InputError: A key of a file is unknown or its value cannot be used.
    """
    study = read_manifest(folder.path)
    if not folder.summary.exists() or not folder.trials.exists():
        raise FileError(str(folder.path), "a study with a summary", "one that is not over",
                        do="finish it with mitt study --resume")  # fmt: skip
    raw = read_json(folder.summary)
    if not isinstance(raw, dict) or raw.get("schema") != SCHEMA:
        raise FileError(str(folder.summary), f"schema {SCHEMA}", "another")
    rows = validated(_Summary, raw, place=str(folder.summary)).rows
    cells = {(c.name, generator) for c in study.conditions for generator in study.generators}
    if len(rows) != len(cells) or {(row.condition, row.generator) for row in rows} != cells:
        raise FileError(str(folder.summary), "a row for each generator in each condition", "others")
    return StudyResult(study=study, folder=folder, rows=[row.model_dump() for row in rows])
