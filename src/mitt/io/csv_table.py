"""Reading the small CSV tables that users hand in, with an error that points at the cell.

What was not seen has no position: its cells are empty or say NaN, as programs of motion capture
write it. Such a row is a ball that was not seen, as a position that is NaN is in Python and over
ROS 2; where a table says what has to be there, as a throw's velocity, the cell is refused.
"""

import csv
import io
import math
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from mitt.core.errors import FileError
from mitt.core.signals import Array
from mitt.io.reading import read_bytes

MAX_ROWS = 100_000
"""Most rows that are read where nothing else is said."""

MAX_BYTES = 10_000_000
"""Largest table that is read, for so many rows [bytes]."""

_ABSENT = frozenset(("", "nan", "na", "n/a", "null", "none"))
"""What a cell without a value holds, in small letters."""

_LIMITS = {"m": 100.0, "rad": 100.0, "px": 1e5, "s": 2e9}
"""Largest coordinate, angle, image point and time that is read, by the unit of its column."""


def read_rows(
    path: Path, columns: Sequence[str], *, optional: str = "", max_rows: int = MAX_ROWS
) -> Iterator[tuple[int, dict[str, str]]]:
    """Read a table that has exactly ``columns``, in any order.

    Args:
        path: CSV file with a header line.
        columns: Names that the header must hold, no more and no less.
        optional: A name that it may hold, too.
        max_rows: Most rows that are read.

    Yields:
        The line number in the file, counted from 1, and the cells of that line by column.

    Raises:
        FileError: The file cannot be read, is too large, or has other columns or ragged rows.
    """
    wanted = ",".join(columns)
    max_bytes = MAX_BYTES * max(1, max_rows // MAX_ROWS)
    content = read_bytes(path, max_bytes=max_bytes, wanted="a readable CSV file")
    if b"\0" in content:
        raise FileError(str(path), "UTF-8 text", "a NUL byte")
    lines = io.TextIOWrapper(io.BytesIO(content), encoding="utf-8-sig", newline="")
    reader = csv.reader(lines, strict=True)
    try:
        header = [name.strip() for name in next(reader, [])]
        if sorted(header) not in (sorted(columns), sorted((*columns, optional))):
            given = ",".join(header)[:80] or "none"
            raise FileError(f"{path} line 1", f"columns {wanted}", given, do=_remedy(header))
        for count, cells in enumerate(row for row in reader if row):
            if count >= max_rows:
                raise FileError(str(path), f"at most {max_rows} rows", "more")
            if len(cells) != len(header):
                place = f"{path} line {reader.line_num}"
                raise FileError(
                    place,
                    f"{len(header)} cells ({wanted})",
                    f"{len(cells)} cells",
                    do=_POINTS if len(cells) > len(header) else "",
                )
            yield reader.line_num, dict(zip(header, cells, strict=True))
    except UnicodeDecodeError as error:
        raise FileError(str(path), "UTF-8 text", f"a bad byte: {error.reason}") from None
    except csv.Error as error:
        raise FileError(f"{path} line {reader.line_num}", "CSV", str(error)) from None


_POINTS = "separate cells by commas, with points for decimals"
_FOREIGN = "name the columns so in the first line, and take out all others"


def _remedy(header: Sequence[str]) -> str:
    """Return what to do about a header."""
    whole = ",".join(header)
    return _POINTS if ";" in whole or "\t" in whole else _FOREIGN


def finite_cell(path: Path, line: int, column: str, text: str, *, limit: float) -> float:
    """Read one cell as a finite number of magnitude at most ``limit``.

    Raises:
        FileError: The cell holds something else; the message names file, line and column.
    """
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not abs(value) <= limit:
        place = f"{path} line {line} column {column}"
        do = "" if math.isnan(value) else "is it in another unit than the table's?"
        do = "fill it in, or take that row out" if text.strip().lower() in _ABSENT else do
        raise FileError(place, f"a number within +-{limit:g}", repr(text[:40]), do=do)
    return value


def measured(path: Path, line: int, column: str, text: str, *, limit: float) -> float:
    """Read one cell of what a sensor saw, as :func:`finite_cell` does; NaN where it saw nothing."""
    if text.strip().lower() in _ABSENT:
        return math.nan
    return finite_cell(path, line, column, text, limit=limit)


def read_table(path: Path, columns: Sequence[str], *, seen: Sequence[str] = ()) -> Array:
    """Return a table of numbers with exactly ``columns``, shape (n, columns).

    Cells of the columns ``seen`` may be absent, and are NaN then.
    """
    limits = [_LIMITS[name.rsplit("_", 1)[1]] for name in columns]
    rows = [
        [
            (measured if name in seen else finite_cell)(path, line, name, cells[name], limit=limit)
            for name, limit in zip(columns, limits, strict=True)
        ]
        for line, cells in read_rows(path, columns)
    ]
    if not rows:
        raise FileError(str(path), "a table with rows", "none")
    return np.array(rows, dtype=np.float64)


def header_of(path: Path) -> tuple[str, ...]:
    """Return the names in the first line of a table, of which 10 kB are read."""
    content = read_bytes(path, max_bytes=MAX_BYTES, wanted="a readable CSV file")
    try:
        line = content[:10_000].split(b"\n")[0].decode("utf-8-sig")
        header = tuple(name.strip() for name in next(csv.reader([line]), []))
    except (UnicodeDecodeError, csv.Error):
        raise FileError(str(path), "UTF-8 text", "other bytes") from None
    if _remedy(header) == _POINTS:
        raise FileError(f"{path} line 1", "columns", ",".join(header)[:80], do=_POINTS)
    return header


def times_of(path: Path, table: Array) -> Array:
    """Return the first column as times that rise [s], shape (n,)."""
    t = table[:, 0]
    if np.any(np.diff(t) <= 0.0):
        line = int(np.argmax(np.diff(t) <= 0.0)) + 3
        raise FileError(f"{path} line {line} column t_s", "times that rise", f"{t[line - 2]:g}")
    return np.asarray(t)
