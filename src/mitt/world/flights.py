"""Recorded flights: reading, smoothing, and placing them before the arm."""

from dataclasses import dataclass
from importlib.resources import as_file, files
from pathlib import Path
from typing import Protocol, runtime_checkable

import numpy as np

from mitt.errors import FileError
from mitt.signals import Array
from mitt.world.ballistics import fly
from mitt.world.fall import WANTED, doubt_of
from mitt.world.smoothing import Pieces, smooth
from mitt.world.tables import number, read_rows

COLUMNS = ("flight", "t_s", "x_m", "y_m", "z_m")
MIN_SAMPLES = 10
MAX_DISTANCE = 100.0
MAX_TIME = 1e6
MIN_CHORD = 0.1
"""Shortest horizontal way of a flight that has a direction [m]."""

CATCH_FRACTION = 0.75
"""Share of its duration after which a flight passes the catch point."""

JITTER_POSITION = 0.03
JITTER_YAW = np.deg2rad(3.0)
"""Half-widths of the uniform jitter [m], [rad]."""


@runtime_checkable
class BallPath(Protocol):
    """A motion that the ball is led along until it is first touched."""

    def at(self, t: float) -> tuple[Array, Array]:
        """Position [m], shape (3,), and velocity [m/s], shape (3,), ``t`` s after release."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Recording:
    """Positions of one recorded flight, in the frame of the recording.

    Attributes:
        name: Name in the file.
        t: Times since the first sample, strictly rising [s], shape (n,).
        r: Positions, z up [m], shape (n, 3).
    """

    name: str
    t: Array
    r: Array


@dataclass(frozen=True, slots=True, kw_only=True)
class PlacedFlight:
    """A smoothed recording, turned and shifted into the world frame.

    Attributes:
        name: Name of the recording.
        pieces: The curve in the frame of the recording.
        rotation: World from recording, about the vertical, shape (3, 3).
        shift: World position of the recording's origin [m], shape (3,).
        drag: Drag of the free flight after the last sample [1/m].
    """

    name: str
    pieces: Pieces
    rotation: Array
    shift: Array
    drag: float

    @property
    def duration(self) -> float:
        """Time of the last sample [s]."""
        return float(self.pieces.edges[-1])

    def at(self, t: float) -> tuple[Array, Array]:
        """Position [m], shape (3,), and velocity [m/s], shape (3,), ``t`` s after release."""
        r, dr = self.pieces.at(min(max(t, 0.0), self.duration))
        r, dr = self.rotation @ r + self.shift, self.rotation @ dr
        beyond = t - min(max(t, 0.0), self.duration)
        return (r, dr) if beyond == 0.0 else fly(r, dr, drag=self.drag, duration=beyond)


def read_flights(path: Path) -> tuple[Recording, ...]:
    """Read recorded flights, in the order of their first rows.

    Raises:
        FileError: Not the columns ``flight,t_s,x_m,y_m,z_m``, a cell that is no finite number,
            times that do not rise, fewer than ten samples, a flight that goes nowhere, or flights
            in other units or with another axis up.
    """
    rows: dict[str, list[tuple[float, ...]]] = {}
    limits = {"t_s": MAX_TIME, "x_m": MAX_DISTANCE, "y_m": MAX_DISTANCE, "z_m": MAX_DISTANCE}
    for line, cells in read_rows(path, COLUMNS):
        flight = rows.setdefault(cells["flight"].strip(), [])
        row = tuple(number(path, line, c, cells[c], limit=limits[c]) for c in COLUMNS[1:])
        if flight and row[0] <= flight[-1][0]:
            place = f"{path} line {line} column t_s"
            raise FileError(place, f"a time after {flight[-1][0]:g} in this flight", row[0])
        flight.append(row)
    if not rows:
        raise FileError(str(path), "at least one flight", "none")
    flights = tuple(_recording(path, name, np.array(samples)) for name, samples in rows.items())
    doubt = doubt_of([(flight.t, flight.r) for flight in flights])
    if doubt is not None:
        raise FileError(str(path), WANTED, doubt.given, do=doubt.do)
    return flights


def _recording(path: Path, name: str, samples: Array) -> Recording:
    """Check the whole of one flight and start its time at zero."""
    place = f"{path} flight {name[:40]!r}"
    if len(samples) < MIN_SAMPLES:
        raise FileError(place, f"at least {MIN_SAMPLES} samples", len(samples))
    if np.hypot(*(samples[-1, 1:3] - samples[0, 1:3])) < MIN_CHORD:
        raise FileError(place, f"a horizontal way of at least {MIN_CHORD} m", "less")
    return Recording(name=name, t=samples[:, 0] - samples[0, 0], r=samples[:, 1:])


def builtin_flights() -> tuple[Recording, ...]:
    """The 44 flights of ``mitt/data/flights/tennicam.csv`` (source and licence beside it)."""
    with as_file(files("mitt") / "data" / "flights" / "tennicam.csv") as path:
        return read_flights(path)


def place_flight(
    recording: Recording, catch_point: Array, *, rng: np.random.Generator | None, drag: float = 0.12
) -> PlacedFlight:
    """Smooth a recording and put it before the arm.

    It is turned about the vertical so that its chord comes from +x, shifted so that it passes
    ``catch_point`` after 75 % of its duration, and jittered about that point.

    Args:
        recording: The flight.
        catch_point: Nominal catch point [m], shape (3,).
        rng: Source of the jitter; no jitter if None.
        drag: Drag after the last sample [1/m]; 0.09 to 0.15 fitted to these balls.
    """
    pieces = smooth(recording.t, recording.r)
    chord = recording.r[-1] - recording.r[0]
    yaw = np.pi - np.arctan2(chord[1], chord[0])
    target = catch_point
    if rng is not None:
        target = catch_point + rng.uniform(-JITTER_POSITION, JITTER_POSITION, 3)
        yaw += rng.uniform(-JITTER_YAW, JITTER_YAW)
    c, s = np.cos(yaw), np.sin(yaw)
    rotation = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    anchor = pieces.at(CATCH_FRACTION * float(recording.t[-1]))[0]
    return PlacedFlight(
        name=recording.name,
        pieces=pieces,
        rotation=rotation,
        shift=target - rotation @ anchor,
        drag=drag,
    )
