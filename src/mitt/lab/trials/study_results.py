"""The trials of a study as tables, and what they come to: rates, medians, pairs.

Pages of the tables carry checksums, and the metadata say which study, seed and version a part
belongs to.
"""

import io
import json
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, fields
from functools import cache
from pathlib import Path
from types import UnionType
from typing import Any, Final, Union, final, get_args, get_origin

import numpy as np

from mitt.core import checks
from mitt.core.errors import FileError, MissingPackageError
from mitt.lab.trials.score import reason_of
from mitt.lab.trials.scored_task import Row, ScoredTask
from mitt.lab.trials.statistics import (
    holm,
    mcnemar,
    paired_difference,
    ratio_of_means,
    spread_of,
    wilson,
)
from mitt.lab.trials.study import REFERENCE, Condition, Player, Study
from mitt.lab.trials.study_folder import Folder
from mitt.lab.trials.tasks import study_of_folder

try:
    import pyarrow as pa
    import pyarrow.parquet as pq
except ImportError as error:
    raise MissingPackageError("mitt study", "pyarrow", "study") from error

#: Fields of ``stopped_by``, each a column of its own, by type.
_STOP_WORDS = ("state", "reason", "joint", "hint")
_STOP_ROWS = (
    "q",
    "dq",
    "q_read",
    "dq_read",
    "command_q",
    "command_dq",
    "command_ddq",
    "command_tau",
)
#: Types of columns, by those of fields.
_TYPES: Final = {
    str: pa.string(),
    int: pa.int64(),
    float: pa.float64(),
    bool: pa.bool_(),
    list[float]: pa.list_(pa.float64()),
}


@cache
def columns_of(trial: type, extra: tuple[str, ...] = ()) -> Any:  # noqa: ANN401 (pyarrow has no types)
    """Return the columns of a table of trials: names of the cell, and all that has a type.

    Args:
        trial: The class of the trials, a dataclass.
        extra: Numbers that a study adds to its fields.
    """
    out = [pa.field("generator", pa.string()), pa.field("condition", pa.string())]
    for field in fields(trial):
        kinds = get_args(field.type) if get_origin(field.type) in (Union, UnionType) else ()
        kind = next((x for x in kinds if x is not type(None)), field.type)
        if kind in _TYPES:
            out.append(pa.field(field.name, _TYPES[kind]))
    out += [pa.field(f"stopped_by_{name}", pa.string()) for name in _STOP_WORDS]
    out += [pa.field("stopped_by_t_s", pa.float64()), pa.field("stopped_by_brakes", pa.bool_())]
    out += [pa.field(f"stopped_by_{name}", pa.list_(pa.float64())) for name in _STOP_ROWS]
    return pa.schema([*out, *(pa.field(name, pa.float64()) for name in extra)])


def row_of(place: tuple[str, str], trial: Mapping[str, Any], columns: Any) -> dict[str, Any]:  # noqa: ANN401
    """Return a trial by columns.

    Args:
        place: Names of the generator and of the condition.
        trial: The trial by its fields, with what its study adds.
        columns: The columns, as of :func:`columns_of`.
    """
    known = set(columns.names)
    row = {key: value for key, value in trial.items() if key in known}
    row |= {f"stopped_by_{name}": x for name, x in (trial["stopped_by"] or {}).items()}
    return row | {"generator": place[0], "condition": place[1]}


def write_rows(rows: Sequence[Row], notes: dict[str, str], columns: Any) -> bytes:  # noqa: ANN401
    """Return a part as the bytes of a Parquet file."""
    out, schema = io.BytesIO(), _schema(notes, columns)
    with pq.ParquetWriter(out, schema, write_page_checksum=True) as writer:
        writer.write_table(pa.Table.from_pylist(list(rows), schema=schema))
    return out.getvalue()


def _schema(notes: dict[str, str], columns: Any) -> Any:  # noqa: ANN401 (pyarrow has no types)
    """Return columns with metadata."""
    return columns.with_metadata(dict(sorted(notes.items())))


def read_part(path: Path, columns: Any) -> tuple[list[dict[str, Any]], dict[str, str]]:  # noqa: ANN401
    """Return rows and metadata of a part, or of a whole table.

    Raises:
        FileError: The file is missing, cut short or altered.
    """
    path = checks.path("part", path)
    table = _table(path, "part")
    if set(table.schema.names) != set(columns.names):
        raise FileError(str(path), "the columns of this version", "others")
    notes = {k.decode(): v.decode() for k, v in (table.schema.metadata or {}).items()}
    return table.to_pylist(), notes


def read_trials(
    path: Path,
    columns: Any,  # noqa: ANN401
    names: Sequence[str],
    filters: Sequence[tuple[str, str, str]],
) -> Any:  # noqa: ANN401
    """Return some columns of the whole table, of the rows that pass all filters.

    Raises:
        FileError: The file is missing, cut short or altered.
    """
    path = checks.path("table", path)
    table = _table(path, "table", columns=list(names), filters=list(filters))
    if any(table.schema.field(name).type != columns.field(name).type for name in names):
        raise FileError(str(path), "the columns of this version", "others")
    return table


def _table(path: Path, what: str, **of: Any) -> Any:  # noqa: ANN401
    """Return what a Parquet file holds, its checksums looked at."""
    try:
        return pq.read_table(path, page_checksum_verification=True, **of)
    except (OSError, pa.ArrowException) as error:
        said = str(error)[:100].strip() or type(error).__name__  # it may say a blank name alone
        raise FileError(str(path), f"a whole {what} of a study", said) from None


def merge(parts: Sequence[Path], out: Path, notes: dict[str, str], columns: Any) -> None:  # noqa: ANN401
    """Write all parts as one table, in their order, a few thousand rows in memory at a time."""
    schema = _schema(notes, columns)
    with pq.ParquetWriter(out, schema, write_page_checksum=True) as writer:
        for group in _groups(parts):
            writer.write_table(group.replace_schema_metadata(schema.metadata))


def _groups(parts: Sequence[Path]) -> Iterator[Any]:
    """Yield the rows of all parts in groups."""
    held: list[Any] = []
    for path in parts:
        held.append(
            pq.read_table(path, page_checksum_verification=True).replace_schema_metadata(None)
        )
        if sum(table.num_rows for table in held) >= 4096:
            yield pa.concat_tables(held).combine_chunks()
            held = []
    if held:
        yield pa.concat_tables(held).combine_chunks()


def timing_of(path: Path) -> dict[str, float]:
    """Return the wall-clock figures of a part."""
    notes = pq.read_schema(path).metadata or {}
    found: dict[str, float] = json.loads(notes.get(b"timing", b"{}"))
    return found


Place = tuple[str, str]
"""Generator and condition."""
Pair = dict[str, Any]
"""How two generators differ on the same trials."""


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class CellResult:
    """The trials of one generator in one condition, as far as they are done.

    Attributes:
        row: Their row of the summary, without how the generator compares.
        good: Whether each succeeded, by its index.
        values: What is known of what was measured in each, by its index and the measure's name.
    """

    row: dict[str, Any]
    good: Mapping[int, bool]
    values: Mapping[int, Mapping[str, float]]

    @property
    def place(self) -> Place:
        """Names of the generator and of the condition."""
        return self.row["generator"], self.row["condition"]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class StudyResult:
    """What the folder of a study holds.

    Attributes:
        study: The study.
        folder: The folder.
        rows: A row for each generator in each condition.
    """

    study: Study
    folder: Folder
    rows: list[dict[str, Any]]


def read_result(folder: Folder) -> StudyResult:
    """Read the folder of a study.

    Raises:
        FileError: It holds no study, one without a table of trials, or one that was altered.
    """
    study = study_of_folder(folder.path)
    if not folder.summary.exists() or not folder.trials.exists():
        raise FileError(
            str(folder.path),
            "a study with a summary",
            "one that is not over",
            do="finish it with mitt study --resume",
        )
    return StudyResult(study=study, folder=folder, rows=study_summary(study, folder))


def study_summary(study: Study, folder: Folder) -> list[dict[str, Any]]:
    """Return the rows of a study's summary, from its table of trials.

    Raises:
        FileError: The table is missing, cut short or altered.
    """
    task, cells = study.kind, []
    columns = columns_of(task.trial, task.extra)
    names = _needed(task, columns.names)
    for condition in study.conditions:
        for player in study.players(condition):
            cell = [("generator", "=", player.label), ("condition", "=", condition.name)]
            trials = read_trials(folder.trials, columns, names, cell).to_pylist()
            cells.append(cell_result(task, player, condition, trials))
    return compared(task, cells)


def _needed(task: ScoredTask, known: Sequence[str]) -> list[str]:
    """Return the columns that a summary needs."""
    used = ["index", "status", "binding_limit", "limit_violations", "over_force"]
    used += ["stopped_by_reason", "stopped_by_joint", *(x.column for x in task.figures.values())]
    return [name for name in dict.fromkeys(used) if name in known]


def cell_result(
    task: ScoredTask, player: Player, condition: Condition, trials: Sequence[Row]
) -> CellResult:
    """Return the trials of one generator in one condition, as far as they are done.

    Args:
        task: Their task.
        player: The generator.
        condition: The condition.
        trials: Rows of the table.
    """
    counts = {status: sum(t["status"] == status for t in trials) for status in task.statuses}
    good = counts[task.success]
    stops, refused = Counter[str](), Counter[str]()
    values: dict[int, dict[str, float]] = {}
    for t in trials:
        found = {name: x.of(t) for name, x in task.figures.items()}
        values[t["index"]] = {name: x for name, x in found.items() if x is not None}
        if t["stopped_by_reason"] is not None:
            named = {"reason": t["stopped_by_reason"], "joint": t["stopped_by_joint"]}
            stops[reason_of(named)] += 1
        if t["status"] == "unreachable":
            refused[t["binding_limit"]] += 1
    known = {name: [x[name] for x in values.values() if name in x] for name in task.figures}
    row = {
        "generator": player.label,
        "rate_hz": player.rate,
        "condition": condition.name,
        task.trials: len(trials),
        task.success: good,
        task.rate: good / len(trials) if trials else 0.0,
        "ci95": list(wilson(good, len(trials))),
        **{name: spread_of(known[name], x.percent) for name, x in task.measures.items()},
        "over_force": sum(t.get("over_force") is True for t in trials),
        **{status: counts[status] for status in task.statuses[1:]},
        "stopped_by": dict(sorted(stops.items())),
        "refused_by": refused.most_common(1)[0][0] if refused else None,
        "complete": len(trials) == condition.counts[player.name],
        "disturbance": condition.disturbance,
        "value": condition.value,
        "unit": condition.unit,
        f"violating_{task.trials}": sum(t["limit_violations"] > 0 for t in trials),
        "median": {
            name: float(np.median(x)) if (x := known[name]) else None for name in task.medians
        },
    }
    hits = {t["index"]: t["status"] == task.success for t in trials}
    return CellResult(row=row, good=hits, values=values)


def compared(task: ScoredTask, cells: Sequence[CellResult]) -> list[dict[str, Any]]:
    """Return the rows; each rival is compared with the map on the same trials.

    Who succeeded by McNemar's test; of the trials in which both did, what one took over what the
    other took, and whose measure was better by the sign test. Each measure is corrected after Holm
    over the whole table.
    """
    of = {cell.place: cell for cell in cells}
    pairs = against({place: cell.good for place, cell in of.items()}, REFERENCE)
    for place, pair in pairs.items():
        mine, other = of[REFERENCE, place[1]], of[place]
        both = [k for k, good in mine.good.items() if good and other.good.get(k)]
        ours, theirs = [mine.values[k] for k in both], [other.values[k] for k in both]
        pair["ratio"] = _ratios(task.medians, ours, theirs)
        pair |= {name: _signs(name, x.more, ours, theirs) for name, x in task.measures.items()}
    for name in task.measures:
        _correct([pair[name] for pair in pairs.values()])
    return [cell.row | {"against_direct": pairs.get(cell.place)} for cell in cells]


def _known(
    name: str, ours: Sequence[Mapping[str, float]], theirs: Sequence[Mapping[str, float]]
) -> list[tuple[float, float]]:
    """Return the pairs of values that both have."""
    return [
        (a[name], b[name]) for a, b in zip(ours, theirs, strict=True) if name in a and name in b
    ]


def _ratios(
    names: Iterable[str],
    ours: Sequence[Mapping[str, float]],
    theirs: Sequence[Mapping[str, float]],
) -> dict[str, list[float]]:
    """Return what a generator took over what the map took, in the trials in which both succeeded.

    The ratio of geometric means and its 95 % interval, by name.
    """
    out = {}
    for name in names:
        known = _known(name, ours, theirs)
        found = ratio_of_means([a for a, _ in known], [b for _, b in known])
        if found is not None:
            out[name] = list(found)
    return out


def _signs(
    name: str,
    more: bool,
    ours: Sequence[Mapping[str, float]],
    theirs: Sequence[Mapping[str, float]],
) -> Pair:
    """Return how often the map's value is the better of a pair, how often the other's, and p."""
    sign = -1.0 if more else 1.0
    known = [(sign * a, sign * b) for a, b in _known(name, ours, theirs)]
    direct, this = sum(a < b for a, b in known), sum(b < a for a, b in known)
    return {"direct": direct, "this": this, "p": mcnemar(direct, this)}


def against(good: Mapping[Place, Mapping[int, bool]], reference: str) -> dict[Place, Pair]:
    """Return how others differ from a reference generator on the trials that both had.

    McNemar's test, ``p``, and the same after Holm's correction over the whole table, ``p_holm``.
    ``good`` says of each generator in each condition whether each trial succeeded, by its index.
    """
    out = {
        (generator, condition): _paired(good[reference, condition], hits)
        for (generator, condition), hits in good.items()
        if generator != reference and (reference, condition) in good
    }
    _correct(list(out.values()))
    return out


def _correct(pairs: Sequence[Pair]) -> None:
    """Give tests of one family their ``p_holm``, corrected for their number after Holm."""
    for pair, p in zip(pairs, holm([pair["p"] for pair in pairs]), strict=True):
        pair["p_holm"] = p


def _paired(first: Mapping[int, bool], second: Mapping[int, bool]) -> Pair:
    """Return how two generators differ on the trials that both had."""
    both = first.keys() & second.keys()
    only_direct = sum(first[k] and not second[k] for k in both)
    only_this = sum(second[k] and not first[k] for k in both)
    difference, low, high = paired_difference(only_direct, only_this, len(both))
    return {
        "pairs": len(both),
        "only_direct": only_direct,
        "only_this": only_this,
        "difference": difference,
        "difference_ci95": [low, high],
        "p": mcnemar(only_direct, only_this),
    }
