"""Recorded flights: reading, smoothing, and placing them before the arm.

The smooth curve keeps a bounce sharp. Between bounces each axis is a least-squares polynomial in
Legendre form; at a bounce the two sides meet in position only, as the ball does. A polynomial of
this degree follows gravity, drag and spin of a one-second flight to well below the noise of a
camera and has an analytic velocity.
"""

from dataclasses import dataclass, replace
from importlib.resources import as_file, files
from pathlib import Path
from typing import Protocol, runtime_checkable

import numpy as np
from numpy.polynomial import Polynomial, legendre
from numpy.typing import NDArray

from mitt.errors import FileError
from mitt.files.csv_table import measured, number, read_rows
from mitt.signals import Array
from mitt.world.fall import WANTED, doubt_of
from mitt.world.throws import fly

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

DEGREE = 6
"""Largest degree of a piece; short pieces get less, one for each eight samples."""

WINDOW = 6
"""Samples on either side from which the slope before and after a bounce is taken; fewer, down to
two, where the recording ends soon after it."""

MIN_SLOPE = 0.7
"""Least speed down before and up after a bounce [m/s]; an apex of a throw has neither."""

OUTLIER = 6.0
"""Samples further off than this many robust standard deviations are left out of the last fit."""


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
class Pieces:
    """Piecewise polynomial curve.

    Attributes:
        edges: Ends of the pieces, rising [s], shape (p + 1,).
        coefficients: Power series of each piece in x = 2 (t - start) / (end - start) - 1 [m],
            lowest power first, padded with zeros, shape (p, d, 3).
        rates: The same for the velocity [m/s], shape (p, d, 3).
        used: Whether a sample took part in the last fit, shape (n,).
    """

    edges: Array
    coefficients: Array
    rates: Array
    used: NDArray[np.bool_]

    def at(self, t: float) -> tuple[Array, Array]:
        """Position [m], shape (3,), and velocity [m/s], shape (3,), at ``t`` [s]."""
        piece = int(np.searchsorted(self.edges[1:-1], t, side="right"))
        start, end = self.edges[piece], self.edges[piece + 1]
        x, r, dr = 2.0 * (t - start) / (end - start) - 1.0, np.zeros(3), np.zeros(3)
        for position, rate in zip(
            self.coefficients[piece][::-1], self.rates[piece][::-1], strict=True
        ):
            r, dr = r * x + position, dr * x + rate
        return r, dr


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
    """Read recorded flights, by their first rows; rows without a position are left out.

    Raises:
        FileError: Not the columns ``flight,t_s,x_m,y_m,z_m``, a cell that is no finite number,
            times that do not rise, fewer than ten samples, a flight that goes nowhere, or flights
            in other units or with another axis up.
    """
    rows: dict[str, list[tuple[float, ...]]] = {}
    limits = {"t_s": MAX_TIME, "x_m": MAX_DISTANCE, "y_m": MAX_DISTANCE, "z_m": MAX_DISTANCE}
    for line, cells in read_rows(path, COLUMNS):
        flight = rows.setdefault(cells["flight"].strip(), [])
        t = number(path, line, "t_s", cells["t_s"], limit=limits["t_s"])
        r = (measured(path, line, c, cells[c], limit=limits[c]) for c in COLUMNS[2:])
        row = (t, *r)
        if not np.all(np.isfinite(row)):
            continue
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
    recording: Recording, catch_point: Array, *, rng: np.random.Generator | None,
    drag: float = 0.12, share: float = CATCH_FRACTION,
) -> PlacedFlight:  # fmt: skip
    """Smooth a recording and put it before the arm.

    It is turned about the vertical so that its chord comes from +x, shifted so that it passes
    ``catch_point`` after a share of its duration, and jittered about that point.

    Args:
        recording: The flight.
        catch_point: Nominal catch point [m], shape (3,).
        rng: Source of the jitter; no jitter if None.
        drag: Drag after the last sample [1/m]; 0.09 to 0.15 fitted to these balls.
        share: That share; above 1 it is after the last sample.
    """
    pieces = smooth(recording.t, recording.r)
    flight = PlacedFlight(
        name=recording.name, pieces=pieces, rotation=np.eye(3), shift=np.zeros(3), drag=drag
    )
    anchor = flight.at(share * flight.duration)[0]
    rotation, shift = placing(recording, anchor, catch_point, rng)
    return replace(flight, rotation=rotation, shift=shift)


def placing(
    recording: Recording, anchor: Array, place: Array, rng: np.random.Generator | None
) -> tuple[Array, Array]:
    """Return rotation, shape (3, 3), and shift [m], shape (3,), of a recording before an arm.

    Its chord comes from +x then, and a point of it, the ``anchor``, is at a place [m], shape (3,);
    both but for the jitter.
    """
    chord = recording.r[-1] - recording.r[0]
    yaw = np.pi - np.arctan2(chord[1], chord[0])
    if rng is not None:
        place = place + rng.uniform(-JITTER_POSITION, JITTER_POSITION, 3)
        yaw += rng.uniform(-JITTER_YAW, JITTER_YAW)
    c, s = np.cos(yaw), np.sin(yaw)
    rotation = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    return rotation, place - rotation @ anchor


def smooth(t: Array, r: Array) -> Pieces:
    """Fit a smooth curve to recorded positions.

    Args:
        t: Times, strictly rising [s], shape (n,).
        r: Positions, z up [m], shape (n, 3).

    Returns:
        The curve, from ``t[0]`` to ``t[-1]``.
    """
    used = np.ones(t.shape, dtype=np.bool_)
    edges = np.array([t[0], *bounces(t, r[:, 2]), t[-1]])
    for final in (False, True):
        edges = _meeting_times(edges, t[used], r[used])
        fits = _fit(edges, t[used], r[used])
        pieces = _pieces(edges, fits, used)
        if final:
            break
        residual = r - np.array([pieces.at(float(s))[0] for s in t])
        scale = 1.4826 * np.median(np.abs(residual), axis=0) + 1e-9
        used = np.all(np.abs(residual) < OUTLIER * scale, axis=1)
        used[[0, -1]] = True
    return pieces


def bounces(t: Array, z: Array) -> list[float]:
    """Find where the vertical velocity flips from down to up within a few samples.

    Args:
        t: Times [s], shape (n,).
        z: Heights [m], shape (n,).

    Returns:
        Times between samples, rough to a sampling interval [s].
    """
    jumps = np.zeros(len(t))
    for i in range(2, len(t) - 1):
        before = _slope(t[max(0, i - WINDOW) : i], z[max(0, i - WINDOW) : i])
        after = _slope(t[i : i + WINDOW], z[i : i + WINDOW])
        if before < -MIN_SLOPE and after > MIN_SLOPE:
            jumps[i] = after - before
    found = []
    while jumps.max() > 0.0:
        i = int(jumps.argmax())
        found.append(0.5 * float(t[i - 1] + t[i]))
        jumps[max(0, i - 2 * WINDOW) : i + 2 * WINDOW] = 0.0
    return sorted(found)


def _slope(t: Array, z: Array) -> float:
    """Slope of the least-squares line [m/s]."""
    centred = t - t.mean()
    return float(centred @ z / (centred @ centred))


def _degree(count: int) -> int:
    """Degree of a piece with so many samples."""
    return int(min(DEGREE, max(1, count // 8)))


def _basis(edges: Array, piece: int, t: Array, degree: int) -> Array:
    """Legendre polynomials of one piece at times ``t``, shape (n, degree + 1)."""
    x = 2.0 * (t - edges[piece]) / (edges[piece + 1] - edges[piece]) - 1.0
    return np.asarray(legendre.legvander(x, degree))


def _members(edges: Array, t: Array) -> list[NDArray[np.intp]]:
    """Indices of the samples in each piece."""
    piece = np.searchsorted(edges[1:-1], t, side="right")
    return [np.flatnonzero(piece == p) for p in range(len(edges) - 1)]


def _meeting_times(edges: Array, t: Array, r: Array) -> Array:
    """Move each bounce to where the heights of the free fits on its two sides meet."""
    edges = edges.copy()
    for b in range(1, len(edges) - 1):
        near = (t > edges[b - 1]) & (t < edges[b + 1]) & (np.abs(t - edges[b]) < 0.1)
        left, right = near & (t < edges[b]), near & (t >= edges[b])
        if min(left.sum(), right.sum()) < 2:
            continue
        offset = t - edges[b]
        roots = (
            _parabola(offset[left], r[left, 2]) - _parabola(offset[right], r[right, 2])
        ).roots()
        real = roots.real[np.abs(roots.imag) < 1e-9]
        if real.size and abs(real[np.abs(real).argmin()]) < 0.02:
            edges[b] += real[np.abs(real).argmin()]
    return edges


def _parabola(t: Array, z: Array) -> Polynomial:
    """Least-squares parabola of a height, or line where there are few samples."""
    return Polynomial.fit(t, z, 2 if len(t) >= 6 else 1).convert()


def _fit(edges: Array, t: Array, r: Array) -> list[Array]:
    """Least squares of all pieces at once, with position continuous at the inner edges."""
    members = _members(edges, t)
    degrees = [_degree(len(m)) for m in members]
    starts = np.concatenate(([0], np.cumsum([d + 1 for d in degrees])))
    size, joints = int(starts[-1]), len(edges) - 2
    normal = np.zeros((size + joints, size + joints))
    right = np.zeros((size + joints, 3))
    for p, rows in enumerate(members):
        block = slice(starts[p], starts[p + 1])
        basis = _basis(edges, p, t[rows], degrees[p])
        normal[block, block] = basis.T @ basis
        right[block] = basis.T @ r[rows]
    for b in range(joints):
        at = edges[b + 1 : b + 2]
        ends = ((b, 1.0), (b + 1, -1.0))
        for p, sign in ends:
            row = sign * _basis(edges, p, at, degrees[p])[0]
            normal[size + b, starts[p] : starts[p + 1]] = row
            normal[starts[p] : starts[p + 1], size + b] = row
    solution = np.linalg.lstsq(normal, right, rcond=None)[0]
    return [np.asarray(solution[starts[p] : starts[p + 1]], float) for p in range(len(members))]


def _pieces(edges: Array, fits: list[Array], used: NDArray[np.bool_]) -> Pieces:
    """Turn Legendre coefficients into padded power series of position and velocity."""
    width = max(len(fit) for fit in fits)
    coefficients = np.zeros((len(fits), width, 3))
    rates = np.zeros((len(fits), width, 3))
    for p, fit in enumerate(fits):
        scale = 2.0 / (edges[p + 1] - edges[p])
        for axis in range(3):
            power = legendre.leg2poly(fit[:, axis])
            coefficients[p, : len(power), axis] = power
            rates[p, : len(power) - 1, axis] = scale * power[1:] * np.arange(1, len(power))
    return Pieces(edges=edges, coefficients=coefficients, rates=rates, used=used)
