"""The throws of a study as tables, and what they come to: rates, medians, pairs.

Pages of the tables carry checksums, and the metadata say which study, seed and version a part
belongs to.
"""

import io
import json
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from mitt import checks
from mitt.errors import FileError, MissingPackageError
from mitt.signals import Array
from mitt.trials.result import STATUSES, spread_of
from mitt.trials.score import Trial, reason_of
from mitt.trials.statistics import holm, mcnemar, paired_difference, ratio_of_means, wilson
from mitt.trials.study_file import REFERENCE, Condition, Study
from mitt.trials.study_folder import Folder, read_manifest

try:
    import pyarrow as pa
    import pyarrow.parquet as pq
except ImportError as error:
    raise MissingPackageError("mitt study", "pyarrow", "study") from error

Row = dict[str, Any]
"""A throw, by columns of the table."""

_AXES = ("x", "y", "z", "vx", "vy", "vz")
_FLOATS = (
    "t_catch_s",
    "position_error_mm",
    "velocity_error_m_s",
    "demand_cost",
    "peak_contact_force_n",
    "range_excess_rad",
    "effort_s",
    "jerk_rad_s3",
)
#: Fields of ``stopped_by``, each a column of its own.
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

COLUMNS = pa.schema(
    [
        pa.field("generator", pa.string()),
        pa.field("condition", pa.string()),
        pa.field("index", pa.int64()),
        pa.field("status", pa.string()),
        *(pa.field(name, pa.float64()) for name in _FLOATS),
        pa.field("peak_torque_ratio", pa.list_(pa.float64())),
        pa.field("peak_speed_ratio", pa.list_(pa.float64())),
        pa.field("limit_violations", pa.int64()),
        pa.field("over_force", pa.bool_()),
        pa.field("saturated_ticks", pa.int64()),
        pa.field("binding_limit", pa.string()),
        *(pa.field(f"stopped_by_{name}", pa.string()) for name in _STOP_WORDS),
        pa.field("stopped_by_t_s", pa.float64()),
        pa.field("stopped_by_brakes", pa.bool_()),
        *(pa.field(f"stopped_by_{name}", pa.list_(pa.float64())) for name in _STOP_ROWS),
        pa.field("energy_j", pa.float64()),
        *(pa.field(f"release_{axis}", pa.float64()) for axis in _AXES),
        *(pa.field(f"passing_{axis}", pa.float64()) for axis in _AXES),
    ]
)


def row_of(
    generator: str, condition: str, trial: Trial, energy_j: float, release: Array, passing: Array
) -> Row:
    """Return a throw by columns.

    Args:
        generator: Name of the generator.
        condition: Name of the condition.
        trial: Its score.
        energy_j: Mechanical work of the joints, counted positive both ways [J].
        release: Position and velocity at release [m, m/s], shape (6,).
        passing: The same where the undisturbed ball is nearest to the waiting hand, shape (6,).
    """
    known = set(COLUMNS.names)
    row: Row = {key: value for key, value in asdict(trial).items() if key in known}
    row |= {f"stopped_by_{name}": x for name, x in (trial.stopped_by or {}).items()}
    row |= {"generator": generator, "condition": condition, "energy_j": energy_j}
    for name, state in (("release", release), ("passing", passing)):
        row |= {f"{name}_{axis}": float(x) for axis, x in zip(_AXES, state, strict=True)}
    return row


def write_rows(
    rows: Sequence[Row],
    notes: dict[str, str],
    columns: Any = COLUMNS,  # noqa: ANN401
) -> bytes:
    """Return a part as the bytes of a Parquet file."""
    out, schema = io.BytesIO(), _schema(notes, columns)
    with pq.ParquetWriter(out, schema, write_page_checksum=True) as writer:
        writer.write_table(pa.Table.from_pylist(list(rows), schema=schema))
    return out.getvalue()


def _schema(notes: dict[str, str], columns: Any) -> Any:  # noqa: ANN401 (pyarrow has no types)
    """Return columns with metadata."""
    return columns.with_metadata(dict(sorted(notes.items())))


def read_part(
    path: Path,
    columns: Any = COLUMNS,  # noqa: ANN401
) -> tuple[list[dict[str, Any]], dict[str, str]]:
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


def read_columns(
    path: Path, columns: Sequence[str], filters: Sequence[tuple[str, str, str]]
) -> Any:  # noqa: ANN401
    """Return columns of the whole table, of the rows that pass all filters.

    Raises:
        FileError: The file is missing, cut short or altered.
    """
    path = checks.path("table", path)
    table = _table(path, "table", columns=list(columns), filters=list(filters))
    if any(table.schema.field(name).type != COLUMNS.field(name).type for name in columns):
        raise FileError(str(path), "the columns of this version", "others")
    return table


def _table(path: Path, what: str, **of: Any) -> Any:  # noqa: ANN401
    """Return what a Parquet file holds, its checksums looked at."""
    try:
        return pq.read_table(path, page_checksum_verification=True, **of)
    except (OSError, pa.ArrowException) as error:
        said = str(error)[:100].strip() or type(error).__name__  # it may say a blank name alone
        raise FileError(str(path), f"a whole {what} of a study", said) from None


def merge(
    parts: Sequence[Path],
    out: Path,
    notes: dict[str, str],
    columns: Any = COLUMNS,  # noqa: ANN401
) -> None:
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
"""How two generators differ on the same throws."""
Efforts = Mapping[str, float]
"""What a throw took, by the name of the column; without what is not known."""
Cell = tuple[dict[str, Any], Mapping[int, bool], Mapping[int, Efforts]]
"""A row of the summary; whether each of its throws was caught, and what it took, by its index."""

#: Columns of which the rows give the median.
_MEDIANS = (
    "position_error_mm",
    "velocity_error_m_s",
    "peak_contact_force_n",
    "energy_j",
    "demand_cost",
    "peak_torque_ratio",
    "peak_speed_ratio",
    "effort_s",
    "jerk_rad_s3",
)
#: Columns that a summary needs.
_SUMMED = (
    "index",
    "status",
    "limit_violations",
    "over_force",
    "stopped_by_reason",
    "stopped_by_joint",
    *_MEDIANS,
)


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
        FileError: It holds no study, one without a table of throws, or one that was altered.
    """
    study = read_manifest(folder.path, Study)
    if not folder.summary.exists() or not folder.trials.exists():
        raise FileError(
            str(folder.path),
            "a study with a summary",
            "one that is not over",
            do="finish it with mitt study --resume",
        )
    return StudyResult(study=study, folder=folder, rows=summary(study, folder))


def summary(study: Study, folder: Folder) -> list[dict[str, Any]]:
    """Return the rows of a study's summary, from its table of throws.

    Raises:
        FileError: The table is missing, cut short or altered.
    """
    cells = []
    for condition in study.conditions:
        for generator, wanted in study.counts.items():
            cell = [("generator", "=", generator), ("condition", "=", condition.name)]
            throws = read_columns(folder.trials, _SUMMED, cell).to_pylist()
            cells.append(throws_in_cell(generator, condition, wanted, throws))
    return compared(cells)


def throws_in_cell(
    generator: str, condition: Condition, wanted: int, trials: Iterable[dict[str, Any]]
) -> Cell:
    """Return the throws of one generator in one condition, as far as they are done.

    ``trials`` are rows of the table; ``wanted`` is how many throws there should be.
    """
    counts = dict.fromkeys(STATUSES, 0)
    values: dict[str, list[float]] = {name: [] for name in _MEDIANS}
    caught: dict[int, bool] = {}
    took: dict[int, Efforts] = {}
    violating, over, reasons = 0, 0, Counter[str]()
    for trial in trials:
        counts[trial["status"]] += 1
        violating += trial["limit_violations"] > 0
        over += trial["over_force"] is True
        if trial["stopped_by_reason"] is not None:
            named = {"reason": trial["stopped_by_reason"], "joint": trial["stopped_by_joint"]}
            reasons[reason_of(named)] += 1
        caught[trial["index"]] = trial["status"] == "caught"
        known = {name: _largest(trial[name]) for name in _MEDIANS if trial[name] is not None}
        took[trial["index"]] = known
        for name, value in known.items():
            values[name].append(value)
    throws = sum(counts.values())
    row = {
        "generator": generator,
        "condition": condition.name,
        "throws": throws,
        "caught": counts["caught"],
        "catch_rate": counts["caught"] / throws if throws else 0.0,
        "ci95": list(wilson(counts["caught"], throws)),
        "force_n": spread_of(values["peak_contact_force_n"]),
        "over_force": over,
        **{status: counts[status] for status in STATUSES[1:]},
        "stopped_by": dict(sorted(reasons.items())),
        "complete": throws == wanted,
        "disturbance": condition.disturbance,
        "value": condition.value,
        "unit": condition.unit,
        "violating_throws": violating,
        "median": {name: float(np.median(x)) if x else None for name, x in values.items()},
    }
    return row, caught, took


def _largest(value: float | list[float]) -> float:
    """Return a value, or the largest of those of the joints."""
    return max(value, default=0.0) if isinstance(value, list) else value


def compared(cells: Sequence[Cell]) -> list[dict[str, Any]]:
    """Return the rows; each rival is compared with the direct map on the same throws."""
    places = [(row["generator"], row["condition"]) for row, _, _ in cells]
    caught = {place: hits for place, (_, hits, _) in zip(places, cells, strict=True)}
    took = {place: efforts for place, (_, _, efforts) in zip(places, cells, strict=True)}
    pairs = against(caught, REFERENCE)
    out = []
    for place, (row, _, _) in zip(places, cells, strict=True):
        pair: dict[str, Any] | None = pairs.get(place)
        if pair is not None:
            ours = REFERENCE, place[1]
            both = [k for k, hit in caught[ours].items() if hit and caught[place].get(k)]
            pair = pair | {
                "ratio": _ratios([took[ours][k] for k in both], [took[place][k] for k in both])
            }
        out.append(row | {"against_direct": pair})
    return out


def _ratios(ours: Sequence[Efforts], theirs: Sequence[Efforts]) -> dict[str, list[float]]:
    """Return what a generator took over what the map took, on the balls that both caught.

    The ratio of geometric means and its 95 % interval, by the name of the column.
    """
    out = {}
    for name in _MEDIANS:
        known = [
            (a[name], b[name]) for a, b in zip(ours, theirs, strict=True) if name in a and name in b
        ]
        found = ratio_of_means([a for a, _ in known], [b for _, b in known])
        if found is not None:
            out[name] = list(found)
    return out


def against(caught: Mapping[Place, Mapping[int, bool]], reference: str) -> dict[Place, Pair]:
    """Return how others differ from a reference generator on the throws that both had.

    McNemar's test, ``p``, and the same after Holm's correction over the whole table, ``p_holm``.
    ``caught`` says of each generator in each condition whether each throw was caught, by its index.
    """
    out = {
        (generator, condition): _paired(caught[reference, condition], hits)
        for (generator, condition), hits in caught.items()
        if generator != reference and (reference, condition) in caught
    }
    corrected = holm([pair["p"] for pair in out.values()])
    for pair, p in zip(out.values(), corrected, strict=True):
        pair["p_holm"] = p
    return out


def _paired(first: Mapping[int, bool], second: Mapping[int, bool]) -> Pair:
    """Return how two generators differ on the throws that both had."""
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
