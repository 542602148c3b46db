"""The table of a study: one row a throw, kept in parts, each a Parquet file of its own.

Pages carry checksums, and the metadata say which study, seed and version a part belongs to.
"""

import io
import json
from collections.abc import Iterator, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from mitt import checks
from mitt.errors import FileError, MissingPackageError
from mitt.signals import Array
from mitt.trials.score import Trial

try:
    import pyarrow as pa
    import pyarrow.parquet as pq
except ImportError as error:
    raise MissingPackageError("mitt study", "pyarrow", "study") from error

Row = dict[str, Any]
"""A throw, by columns of the table."""

#: Rows of one row group of the whole table.
_GROUP = 4096
_AXES = ("x", "y", "z", "vx", "vy", "vz")
_FLOATS = ("t_catch_s", "position_error_mm", "velocity_error_m_s", "demand_cost",
           "peak_contact_force_n", "range_excess_rad")  # fmt: skip
#: Fields of ``stopped_by``, each a column of its own.
_STOP_WORDS = ("state", "reason", "joint", "hint")
_STOP_ROWS = ("q", "dq", "q_read", "dq_read", "command_q", "command_dq", "command_ddq",
              "command_tau")  # fmt: skip

_COLUMNS = pa.schema(
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
    known = set(_COLUMNS.names)
    row: Row = {key: value for key, value in asdict(trial).items() if key in known}
    row |= {f"stopped_by_{name}": x for name, x in (trial.stopped_by or {}).items()}
    row |= {"generator": generator, "condition": condition, "energy_j": energy_j}
    for name, state in (("release", release), ("passing", passing)):
        row |= {f"{name}_{axis}": float(x) for axis, x in zip(_AXES, state, strict=True)}
    return row


def write_rows(rows: Sequence[Row], notes: dict[str, str]) -> bytes:
    """Return a part as the bytes of a Parquet file."""
    out, schema = io.BytesIO(), _schema(notes)
    with pq.ParquetWriter(out, schema, write_page_checksum=True) as writer:
        writer.write_table(pa.Table.from_pylist(list(rows), schema=schema))
    return out.getvalue()


def _schema(notes: dict[str, str]) -> Any:  # noqa: ANN401 (pyarrow has no types)
    """Return the columns with metadata."""
    return _COLUMNS.with_metadata(dict(sorted(notes.items())))


def read_part(path: Path) -> tuple[list[dict[str, Any]], dict[str, str]]:
    """Return rows and metadata of a part.

    Raises:
        FileError: The file is missing, cut short or altered.
    """
    path = checks.path("part", path)
    try:
        table = pq.read_table(path, page_checksum_verification=True)
    except (OSError, pa.ArrowException) as error:
        raise FileError(str(path), "a whole part of a study", str(error)[:100]) from None
    if set(table.schema.names) != set(_COLUMNS.names):
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
    try:
        table = pq.read_table(
            path, columns=list(columns), filters=list(filters), page_checksum_verification=True
        )
    except (OSError, pa.ArrowException) as error:
        raise FileError(str(path), "a whole table of a study", str(error)[:100]) from None
    if any(table.schema.field(name).type != _COLUMNS.field(name).type for name in columns):
        raise FileError(str(path), "the columns of this version", "others")
    return table


def merge(parts: Sequence[Path], out: Path, notes: dict[str, str]) -> None:
    """Write all parts as one table, in their order, a few thousand rows in memory at a time."""
    with pq.ParquetWriter(out, _schema(notes), write_page_checksum=True) as writer:
        for group in _groups(parts):
            writer.write_table(group.replace_schema_metadata(_schema(notes).metadata))


def _groups(parts: Sequence[Path]) -> Iterator[Any]:
    """Yield the rows of all parts in groups."""
    held: list[Any] = []
    for path in parts:
        held.append(pq.read_table(path, page_checksum_verification=True)
                    .replace_schema_metadata(None))  # fmt: skip
        if sum(table.num_rows for table in held) >= _GROUP:
            yield pa.concat_tables(held).combine_chunks()
            held = []
    if held:
        yield pa.concat_tables(held).combine_chunks()


def timing_of(path: Path) -> dict[str, float]:
    """Return the wall-clock figures of a part."""
    notes = pq.read_schema(path).metadata or {}
    found: dict[str, float] = json.loads(notes.get(b"timing", b"{}"))
    return found
