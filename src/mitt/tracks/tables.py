"""Tables of recorded positions and of tracks, as ``mitt track`` and ``mitt see`` write them."""

import csv
import io
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from mitt.errors import FileError
from mitt.files.files import write_text
from mitt.signals import Array
from mitt.tracks.filtering import Track
from mitt.world.tables import number, read_rows

POINTS = ("t_s", "x_m", "y_m", "z_m")
"""Time and position."""
ADDED = ("vx_m_s", "vy_m_s", "vz_m_s", "ax_m_s2", "ay_m_s2", "az_m_s2", "sx_m", "sy_m", "sz_m")
"""Velocity, acceleration, standard deviation of the position."""
STATE = (*POINTS, *ADDED)
AHEAD = ("x_ahead_m", "y_ahead_m", "z_ahead_m")

MAX_ROWS = 1_000_000
#: Largest time [s] and coordinate [m] that is read.
_LIMITS = dict(zip(POINTS, (1e10, 500.0, 500.0, 500.0), strict=True))


@dataclass(frozen=True, slots=True, kw_only=True)
class Positions:
    """Recorded positions, flight by flight.

    Attributes:
        columns: Columns of the file, in its order.
        cells: Its rows as they were written.
        rows: Indices of the rows of each flight, by name, shape (k,) each.
        samples: Time and position of all rows [s, m], shape (n, 4).
    """

    columns: tuple[str, ...]
    cells: list[tuple[str, ...]]
    rows: dict[str, list[int]]
    samples: Array

    def flight(self, name: str) -> Array:
        """Return time and position of one flight [s, m], shape (k, 4)."""
        return np.asarray(self.samples[self.rows[name]])


def read_positions(path: Path) -> Positions:
    """Read recorded positions; flights may be interleaved.

    Raises:
        FileError: Other columns than ``t_s,x_m,y_m,z_m`` and perhaps ``flight``, a cell that is
            no finite number, a time that does not rise within its flight, or no row at all.
    """
    cells: list[tuple[str, ...]] = []
    samples: list[list[float]] = []
    flights: dict[str, list[int]] = {}
    columns: tuple[str, ...] = POINTS
    for line, row in read_rows(path, POINTS, optional="flight", max_rows=MAX_ROWS):
        columns = tuple(row)
        sample = [number(path, line, c, row[c], limit=limit) for c, limit in _LIMITS.items()]
        flight = flights.setdefault(row.get("flight", "").strip(), [])
        if flight and sample[0] <= samples[flight[-1]][0]:
            where = f"{path} line {line} column t_s"
            before = cells[flight[-1]][columns.index("t_s")].strip()
            raise FileError(where, f"a time after {before} in this flight", row["t_s"].strip())
        flight.append(len(samples))
        samples.append(sample)
        cells.append(tuple(row.values()))
    if not samples:
        raise FileError(str(path), "at least one row", "none")
    return Positions(columns=columns, cells=cells, rows=flights, samples=np.array(samples))


def write_track(path: Path, positions: Positions, track: Track, *, ahead: bool) -> None:
    """Write the rows of the input with velocity, acceleration and standard deviations added.

    Args:
        path: File to write.
        positions: The input.
        track: Estimates, a row for each row of the input.
        ahead: Whether to add the predicted positions.
    """
    values = np.hstack((track.dr, track.ddr, track.sigma, *((track.ahead,) if ahead else ())))
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow((*positions.columns, *ADDED, *(AHEAD if ahead else ())))
    for cells, row in zip(positions.cells, values.tolist(), strict=True):
        writer.writerow((*cells, *(f"{value:.9g}" for value in row)))
    write_text(path, text.getvalue())


def write_table(path: Path, columns: tuple[str, ...], rows: Iterable[Array]) -> None:
    """Write rows of numbers as CSV, atomically; times to the microsecond, lengths to 10 nm.

    Args:
        path: File to write.
        columns: Names of the columns; the first is the time.
        rows: Numbers in their order, each shape (columns,).
    """
    lines = [",".join(columns)]
    lines += [f"{row[0]:.6f}," + ",".join(f"{x:.8g}" for x in row[1:]) for row in rows]
    write_text(path, "\n".join(lines) + "\n")
