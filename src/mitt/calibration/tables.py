"""The tables that calibration reads: places of the hand, and what the cameras saw of it."""

import csv
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from mitt.errors import FileError
from mitt.reading import read_bytes
from mitt.robot.arm import Arm
from mitt.signals import Array
from mitt.world.tables import MAX_BYTES, number, read_rows

#: Longest header line that is read [bytes].
_LONGEST_HEADER = 10_000
POINT = ("x_m", "y_m", "z_m")
#: Largest coordinate [m], angle [rad], image point [px] and time [s] that is read.
_LIMITS = {"m": 100.0, "rad": 100.0, "px": 1e5, "s": 2e9}


def read_columns(path: Path, columns: Sequence[str]) -> Array:
    """Return a table of numbers with exactly ``columns``, shape (n, columns).

    Raises:
        FileError: It cannot be read, has other columns, no rows, or a cell that is no number.
    """
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
    """Return the names in the first line of a table.

    Raises:
        FileError: It cannot be read.
    """
    content = read_bytes(path, max_bytes=MAX_BYTES, wanted="a readable CSV file")
    try:
        line = content[:_LONGEST_HEADER].split(b"\n")[0].decode("utf-8-sig")
        return tuple(name.strip() for name in next(csv.reader([line]), []))
    except (UnicodeDecodeError, csv.Error):
        raise FileError(str(path), "UTF-8 text", "other bytes") from None


def read_places(path: Path, arm: Arm, others: Sequence[str]) -> tuple[Array, Array]:
    """Return places of the catch point and the other columns of a table.

    The places stand in ``x_m,y_m,z_m``, or follow from joint angles in a column for each active
    joint of the arm, ``q1_rad,q2_rad,...`` in its order.

    Args:
        path: CSV file.
        arm: The arm that held the ball.
        others: Names of the other columns.

    Returns:
        Places [m], shape (n, 3), and the others, shape (n, others).
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
    """Return the first column as times that rise [s], shape (n,).

    Raises:
        FileError: They do not.
    """
    t = table[:, 0]
    if np.any(np.diff(t) <= 0.0):
        line = int(np.argmax(np.diff(t) <= 0.0)) + 3
        raise FileError(f"{path} line {line} column t_s", "times that rise", f"{t[line - 2]:g}")
    return np.asarray(t)
