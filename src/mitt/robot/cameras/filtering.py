"""The ball filter on recorded positions, whose noise it learns from them; the tables of both.

Each row of a track uses only rows up to itself.
"""

import csv
import io
from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass
from math import isfinite
from pathlib import Path
from typing import NamedTuple

import numpy as np

from mitt.core.ball.counts import counts_of
from mitt.core.ball.filter import FilterConfig, doubt, fresh_filter, predict, update
from mitt.core.errors import FileError
from mitt.core.kernels import Record, kernel
from mitt.core.signals import Array
from mitt.io.csv_table import finite_cell, measured, read_rows
from mitt.io.writing import write_text

POINTS = ("t_s", "x_m", "y_m", "z_m")
"""Time and position."""
ADDED = ("vx_m_s", "vy_m_s", "vz_m_s", "ax_m_s2", "ay_m_s2", "az_m_s2", "sx_m", "sy_m", "sz_m")
"""Velocity, acceleration, standard deviation of the position."""
STATE = (*POINTS, *ADDED)
AHEAD = ("x_ahead_m", "y_ahead_m", "z_ahead_m")

MAX_ROWS = 1_000_000
#: Largest time [s] and coordinate [m] that is read.
_LIMITS = dict(zip(POINTS, (1e10, 500.0, 500.0, 500.0), strict=True))

UNKNOWN_BALL = FilterConfig(
    drag_mean=0.08,
    drag_sigma=0.05,
    accel_density=0.005,
    push_sigma=1.0,
    push_time=1.0,
    other_motion=0.3,
    watchful=True,
    speaks_after=1,
)
"""Any ball, and whatever else moves: the other laws of motion count from the first position."""


#: Standard deviation of a position that is assumed at first, of a good pair of cameras at a few
#: metres, and the smallest that is believed [m].
_SIGMA_START = 1.5e-3
_SIGMA_LEAST = 5e-5
#: Samples of the variance that the first value is worth, and that are remembered.
_SAMPLES_BEFORE = 6.0
_SAMPLES_KEPT = 100.0
#: Times the variance that a sample counts for at most: an outlier of 5 sigma is rare.
_CLIP = 5.0

NOISE = np.dtype(
    [
        ("variance", float, (3,)),  # of the axes [m^2]
        ("seen", int),  # positions so far
        ("in_a_row", int),  # positions in a row
        ("t", float, (3,)),  # times of the newest [s], and the positions [m]
        ("z", float, (3, 3)),
    ],
    align=True,
)


def fresh_noise() -> Record:
    """Return what is known without a position, one record of type ``NOISE``, shape (1,)."""
    noise = np.zeros(1, NOISE)
    noise["variance"] = _SIGMA_START**2
    return noise


@kernel
def learn_noise(noise: Record, t: float, z: Array) -> None:
    """Learn from the next position, if that and its time are finite.

    Each position is compared with the parabola through the three before it; without noise they
    agree but for the jerk. The squared difference, over the sum of the squared weights of the four,
    is a sample of the variance, axis by axis. It counts at most ``_CLIP`` times the variance so
    far, so that an outlier or a bounce hardly moves it. Where a time does not come after the one
    before it, as after a wrong stamp, the next four positions in a row are waited for.

    Args:
        noise: What is known, of :func:`fresh_noise`.
        t: Its time [s].
        z: Position [m], shape (3,).
    """
    if not (isfinite(t) and isfinite(z[0]) and isfinite(z[1]) and isfinite(z[2])):
        return
    k = noise[0]
    if not t - k.t[2] > 1e-9:
        k.in_a_row = 0
    if k.in_a_row >= 3:
        a, b, c = k.t[0], k.t[1], k.t[2]
        wa = (t - b) * (t - c) / ((a - b) * (a - c))
        wb = (t - a) * (t - c) / ((b - a) * (b - c))
        wc = (t - a) * (t - b) / ((c - a) * (c - b))
        share = 1.0 / (_SAMPLES_BEFORE + min(k.seen - 2.0, _SAMPLES_KEPT))
        for i in range(3):
            e = z[i] - wa * k.z[0, i] - wb * k.z[1, i] - wc * k.z[2, i]
            sample = e * e / (1.0 + wa * wa + wb * wb + wc * wc)
            so_far = k.variance[i]
            if sample >= 0.0:  # else times too far apart for numbers
                more = share * (min(sample, _CLIP * so_far) - so_far)
                k.variance[i] = max(so_far + more, _SIGMA_LEAST**2)
    k.seen += 1
    k.in_a_row += 1
    for n in range(2):
        k.t[n] = k.t[n + 1]
        k.z[n] = k.z[n + 1]
    k.t[2] = t
    k.z[2] = z


class FilteredTrack(NamedTuple):
    """Estimates at the times of the positions, shape (n, 3) each; NaN where nothing is known.

    Attributes:
        r: Position [m].
        dr: Velocity [m/s].
        ddr: Acceleration [m/s^2].
        sigma: Standard deviation of the position [m].
        ahead: Predicted position, a while later [m].
        unused: Positions that were not used, by why (:class:`mitt.core.ball.counts.FilterCounts`).
    """

    r: Array
    dr: Array
    ddr: Array
    sigma: Array
    ahead: Array
    unused: dict[str, int]


def filter_flight(
    t: Array,
    points: Array,
    *,
    ahead: float = 0.0,
    sigma: float | None = None,
    config: FilterConfig = UNKNOWN_BALL,
) -> FilteredTrack:
    """Filter one flight.

    Args:
        t: Times, rising [s], shape (n,).
        points: Positions [m], shape (n, 3); NaN where the ball was not seen.
        ahead: How far to look ahead [s].
        sigma: Standard deviation of each coordinate [m]; learned from the positions if None.
        config: What is assumed of the ball.
    """
    rows, ball = np.zeros((len(t), 5, 3)), fresh_filter(config)
    _follow(t, points, ahead, sigma or 0.0, ball, fresh_noise(), rows)
    r, dr, ddr, spread, later = rows.transpose(1, 0, 2)
    return FilteredTrack(r, dr, ddr, spread, later, counts_of(ball).unused)


def follow_all(
    samples: Array, flights: Iterable[list[int]], *, ahead: float = 0.0, sigma: float | None = None
) -> FilteredTrack:
    """Filter several flights, each on its own; see :func:`filter_flight`.

    Samples are times and positions [s, m], shape (n, 4); flights the indices of their rows. The
    rows of the track are in the order of the samples.
    """
    rows, unused = np.zeros((5, len(samples), 3)), Counter[str]()
    for flight in flights:
        t, points = samples[flight, 0], samples[flight, 1:]
        *rows[:, flight], left = filter_flight(t - t[0], points, ahead=ahead, sigma=sigma)
        unused.update(left)
    r, dr, ddr, spread, later = rows
    return FilteredTrack(r, dr, ddr, spread, later, dict(unused))


@kernel
def _follow(
    t: Array, points: Array, ahead: float, sigma: float, ball: Record, noise: Record, rows: Array
) -> None:
    """Fill the rows of a track, shape (n, 5, 3); the noise is learned if ``sigma`` is 0."""
    R, motion, covariance = np.zeros((3, 3)), np.zeros((3, 3)), np.zeros((6, 6))
    for n in range(len(t)):
        learn_noise(noise, t[n], points[n])
        for i in range(3):
            R[i, i] = sigma * sigma if sigma > 0.0 else noise[0].variance[i]
        update(ball, t[n], points[n], R)
        predict(ball, t[n] + ahead, motion, covariance)
        rows[n, 4] = motion[0]
        if predict(ball, t[n], motion, covariance):
            doubt(ball, t[n], covariance)
        elif not isfinite(points[n].sum()):  # not seen, and not known from before
            rows[n] = np.nan
            continue
        rows[n, 0:3] = motion
        for i in range(3):
            rows[n, 3, i] = np.sqrt(covariance[i, i])


@dataclass(frozen=True, slots=True, kw_only=True)
class RecordedPositions:
    """Recorded positions, flight by flight.

    Attributes:
        columns: Columns of the file, in its order.
        cells: Its rows as they were written.
        rows: Indices of the rows of each flight, by name, shape (k,) each.
        samples: Time and position of all rows [s, m], shape (n, 4); the position is NaN where the
            ball was not seen.
    """

    columns: tuple[str, ...]
    cells: list[tuple[str, ...]]
    rows: dict[str, list[int]]
    samples: Array

    def flight(self, name: str) -> Array:
        """Return time and position of one flight where it was seen [s, m], shape (k, 4)."""
        samples = self.samples[self.rows[name]]
        return np.asarray(samples[np.isfinite(samples).all(axis=1)])


def read_positions(path: Path) -> RecordedPositions:
    """Read recorded positions; flights may be interleaved, and rows without a position.

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
        sample = [
            (finite_cell if c == "t_s" else measured)(path, line, c, row[c], limit=limit)
            for c, limit in _LIMITS.items()
        ]
        flight = flights.setdefault(row.get("flight", "").strip(), [])
        if flight and sample[0] <= samples[flight[-1]][0]:
            where = f"{path} line {line} column t_s"
            before = cells[flight[-1]][columns.index("t_s")].strip()
            raise FileError(where, f"a time after {before} in this flight", row["t_s"].strip())
        flight.append(len(samples))
        samples.append(sample)
        cells.append(tuple(row.values()))
    if not np.any(np.isfinite(np.array(samples).reshape(-1, 4)).all(axis=1)):
        raise FileError(str(path), "at least one row with a position", "none")
    return RecordedPositions(columns=columns, cells=cells, rows=flights, samples=np.array(samples))


def write_track(
    path: Path, positions: RecordedPositions, track: FilteredTrack, *, ahead: bool
) -> None:
    """Write the rows of the input with velocity, acceleration and standard deviations added.

    Of a ball that was not seen they are what was known from before, or empty.
    """
    values = np.hstack((track.dr, track.ddr, track.sigma, *((track.ahead,) if ahead else ())))
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow((*positions.columns, *ADDED, *(AHEAD if ahead else ())))
    for cells, row in zip(positions.cells, values.tolist(), strict=True):
        writer.writerow((*cells, *(f"{value:.9g}" if isfinite(value) else "" for value in row)))
    write_text(path, text.getvalue())


def write_table(path: Path, columns: tuple[str, ...], rows: Iterable[Array]) -> None:
    """Write rows of numbers as CSV, atomically; times to the microsecond, lengths to 10 nm."""
    lines = [",".join(columns)]
    lines += [f"{row[0]:.6f}," + ",".join(f"{x:.8g}" for x in row[1:]) for row in rows]
    write_text(path, "\n".join(lines) + "\n")
