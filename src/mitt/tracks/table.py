"""The table of a track: one row an instant, columns as ``mitt track`` and ``mitt see`` write."""

from collections.abc import Iterable
from pathlib import Path

import numpy as np

from mitt.link.files import write_text
from mitt.signals import Array, BallState, Sighting

STATE = (
    "t_s", "x_m", "y_m", "z_m", "vx_m_s", "vy_m_s", "vz_m_s", "ax_m_s2", "ay_m_s2", "az_m_s2",
    "sx_m", "sy_m", "sz_m",
)  # fmt: skip
"""Time, position, velocity, acceleration, standard deviation of the position."""

POINTS = ("t_s", "x_m", "y_m", "z_m")
"""Time and position, as ``mitt track`` reads them."""


def state_row(ball: BallState) -> Array:
    """Return an estimate as a row of ``STATE``, shape (13,)."""
    sigma = np.sqrt(np.diag(ball.covariance)[:3])
    return np.concatenate(((ball.t,), ball.r_o, ball.dr_o, ball.ddr_o, sigma))


def point_row(seen: Sighting) -> Array:
    """Return a sighting as a row of ``POINTS``, shape (4,)."""
    return np.array((seen.t, *seen.r_o))


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
