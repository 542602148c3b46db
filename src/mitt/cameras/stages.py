"""What the stages of a calibration read, tables of places, and hand on, numbers and warnings."""

import csv
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from mitt.arm.arm import Arm
from mitt.cameras.least_squares import Fit, P
from mitt.errors import FileError
from mitt.files.csv_table import MAX_BYTES, number, read_rows
from mitt.reading import read_bytes
from mitt.signals import Array

#: Longest header line that is read [bytes].
_LONGEST_HEADER = 10_000
POINT = ("x_m", "y_m", "z_m")
#: Largest coordinate [m], angle [rad], image point [px] and time [s] that is read.
_LIMITS = {"m": 100.0, "rad": 100.0, "px": 1e5, "s": 2e9}


@dataclass(frozen=True, slots=True)
class Stage:
    """One stage of a calibration.

    Attributes:
        name: Its name: boards, heads, hand or clock.
        status: Of its fit, converged or stopped.
        numbers: What it found, by name with unit.
        warnings: What the measurements do not determine, and what would.
    """

    name: str
    status: str
    numbers: Mapping[str, float]
    warnings: tuple[str, ...]


def weak(fit: Fit[P], limits: Mapping[str, tuple[float, str]]) -> tuple[str, ...]:
    """Return a warning for each parameter that the measurements leave open.

    ``limits`` are, by its name, its largest standard deviation and the measurements that would
    bring it down.
    """
    said = []
    for name, (limit, advice) in limits.items():
        sigma = fit.sigma_of(name)
        if name in fit.undetermined:
            said.append(f"{name} is not determined: {advice}")
        elif not sigma <= limit:
            said.append(f"{name} is uncertain by {sigma:.2g} (wanted {limit:.2g}): {advice}")
    return tuple(said)


def read_columns(path: Path, columns: Sequence[str]) -> Array:
    """Return a table of numbers with exactly ``columns``, shape (n, columns)."""
    limits = [_LIMITS[name.rsplit("_", 1)[1]] for name in columns]
    rows = [
        [number(path, line, name, cells[name], limit=limit)
         for name, limit in zip(columns, limits, strict=True)]
        for line, cells in read_rows(path, columns)
    ]  # fmt: skip
    if not rows:
        raise FileError(str(path), "a table with rows", "none")
    return np.array(rows, dtype=np.float64)


def header_of(path: Path) -> tuple[str, ...]:
    """Return the names in the first line of a table."""
    content = read_bytes(path, max_bytes=MAX_BYTES, wanted="a readable CSV file")
    try:
        line = content[:_LONGEST_HEADER].split(b"\n")[0].decode("utf-8-sig")
        return tuple(name.strip() for name in next(csv.reader([line]), []))
    except (UnicodeDecodeError, csv.Error):
        raise FileError(str(path), "UTF-8 text", "other bytes") from None


def read_places(path: Path, arm: Arm, others: Sequence[str]) -> tuple[Array, Array]:
    """Return places of the catch point [m], shape (n, 3), and the other columns of a table.

    The places stand in ``x_m,y_m,z_m``, or follow from joint angles in a column for each active
    joint of the arm, ``q1_rad,q2_rad,...`` in its order.
    """
    joints = tuple(f"q{k + 1}_rad" for k in range(arm.n))
    by_angles = "q1_rad" in header_of(path)
    names = joints if by_angles else POINT
    table = read_columns(path, (*names, *others))
    places, rest = table[:, : len(names)], table[:, len(names) :]
    if by_angles:
        places = np.array([arm.position(q) for q in places])
    return places, rest


def times_of(path: Path, table: Array) -> Array:
    """Return the first column as times that rise [s], shape (n,)."""
    t = table[:, 0]
    if np.any(np.diff(t) <= 0.0):
        line = int(np.argmax(np.diff(t) <= 0.0)) + 3
        raise FileError(f"{path} line {line} column t_s", "times that rise", f"{t[line - 2]:g}")
    return np.asarray(t)
