"""Tables of recorded positions, and the same tables with what the filter makes of them."""

import csv
import io
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from mitt.errors import FileError
from mitt.link.files import write_text
from mitt.signals import Array
from mitt.tracks.filtering import Track
from mitt.world.tables import number, read_rows

COLUMNS = ("t_s", "x_m", "y_m", "z_m")
ADDED = ("vx_m_s", "vy_m_s", "vz_m_s", "ax_m_s2", "ay_m_s2", "az_m_s2", "sx_m", "sy_m", "sz_m")
AHEAD = ("x_ahead_m", "y_ahead_m", "z_ahead_m")

MAX_ROWS = 1_000_000
MAX_TIME = 1e10
MAX_DISTANCE = 500.0


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


def read_positions(path: Path) -> Positions:
    """Read recorded positions; flights may be interleaved.

    Raises:
        FileError: Other columns than ``t_s,x_m,y_m,z_m`` and perhaps ``flight``, a cell that is
            no finite number, a time that does not rise within its flight, or no row at all.
    """
    cells: list[tuple[str, ...]] = []
    samples: list[tuple[float, ...]] = []
    flights: dict[str, list[int]] = {}
    columns: tuple[str, ...] = COLUMNS
    for line, row in read_rows(path, COLUMNS, optional="flight", max_rows=MAX_ROWS):
        columns = tuple(row)
        t = number(path, line, "t_s", row["t_s"], limit=MAX_TIME)
        place = (number(path, line, c, row[c], limit=MAX_DISTANCE) for c in COLUMNS[1:])
        flight = flights.setdefault(row.get("flight", "").strip(), [])
        if flight and t <= samples[flight[-1]][0]:
            where = f"{path} line {line} column t_s"
            before = cells[flight[-1]][columns.index("t_s")].strip()
            raise FileError(where, f"a time after {before} in this flight", row["t_s"].strip())
        flight.append(len(samples))
        samples.append((t, *place))
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
        ahead: Whether to add the positions foretold.
    """
    values = np.hstack((track.dr, track.ddr, track.sigma, *((track.ahead,) if ahead else ())))
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow((*positions.columns, *ADDED, *(AHEAD if ahead else ())))
    for cells, row in zip(positions.cells, values.tolist(), strict=True):
        writer.writerow((*cells, *(f"{value:.9g}" for value in row)))
    write_text(path, text.getvalue())
