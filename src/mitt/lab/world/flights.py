"""Recorded flights: reading, smoothing, and placing them before the arm.

The smooth curve keeps a bounce sharp. Between bounces each axis is a least-squares polynomial in
Legendre form; at a bounce the two sides meet in position only, as the ball does. A polynomial of
this degree follows gravity, drag and spin of a one-second flight to well below the noise of a
camera and has an analytic velocity.

A recording may begin in the thrower's hand. It is cut at the release, where the ball begins to
move as only gravity, drag and spin move it. The hand's part leads the ball, and is not counted as
flight.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from importlib.resources import as_file, files
from math import sqrt
from pathlib import Path
from typing import Protocol, runtime_checkable

import numpy as np
from numpy.polynomial import Polynomial, legendre
from numpy.typing import NDArray

from mitt.core.ball.spin import spin_shown
from mitt.core.errors import FileError
from mitt.core.signals import GRAVITY, Array
from mitt.io.csv_table import finite_cell, measured, read_rows
from mitt.lab.world.fall import WANTED, doubt_of, free_of_gravity
from mitt.lab.world.throws import Spinning, fly

#: Least samples and instants of a fitted spin, and the noise of a sample [m].
_SPIN_SAMPLES = 12
_SPIN_GRID = 120
_SPIN_NOISE = 0.0015
#: 1-sigma of drag [1/m] and w [1/s] before the fit; a spin of 100 rad/s has a w of 0.3.
_DRAG_SIGMA = 0.03
_W_SIGMA = 0.3
COLUMNS = ("flight", "t_s", "x_m", "y_m", "z_m")
MIN_SAMPLES = 10
MAX_DISTANCE = 100.0
MAX_TIME = 1e6
MIN_CHORD = 0.1
"""Shortest horizontal way of a flight that has a direction [m]."""

CATCH_FRACTION = 0.75
"""Share of its time since the release after which a flight passes the catch point."""

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

SHORTEST_FLIGHT = 0.15
"""Least time for which a thrown ball flies freely, bounces included [s]."""

SHORTEST_HOLD = 0.1
"""Least time in the hand for which a recording is cut at the release [s]."""

PART_OF_HOLD = 0.12
"""Longest piece of the hand's part [s]: rest and swing are not fitted by one polynomial."""

SPAN = 0.08
"""Least time from whose samples an acceleration is taken [s]: 1.6 mm of noise at 180 Hz make
1 m/s^2 of it."""

MIN_WINDOW = 8
"""Least number of samples from which an acceleration is taken."""

PUSH = 4.0
"""Acceleration along its velocity, beside gravity, that only a hand gives a ball [m/s^2]."""

ERRORS = 3.0
"""Standard errors by which an acceleration has to be beyond that of a free ball."""


@runtime_checkable
class BallPath(Protocol):
    """A motion that the ball is led along until it is first touched."""

    def at(self, t: float) -> tuple[Array, Array]:
        """Position [m], shape (3,), and velocity [m/s], shape (3,), ``t`` s after release."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RecordedFlight:
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
class PiecewisePolynomial:
    """Curve of polynomials, one after the other.

    Attributes:
        edges: Ends of the pieces, rising [s], shape (p + 1,).
        coefficients: Power series of each piece in x = 2 (t - start) / (end - start) - 1 [m],
            lowest power first, padded with zeros, shape (p, d, 3).
        rates: The same for the velocity [m/s], shape (p, d, 3).
        used: Whether a sample took part in the last fit, shape (n,).
        release: When the ball left the hand [s]; the first edge where it was not seen there.
    """

    edges: Array
    coefficients: Array
    rates: Array
    used: NDArray[np.bool_]
    release: float

    @property
    def bounces(self) -> Array:
        """Times of the bounces of the flight [s]."""
        inner: Array = self.edges[1:-1]
        return inner[inner > self.release]

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
        spun: Angular velocity of the last piece as its curve shows it, in the frame of the
            recording [rad/s], shape (3,); none if left out.
    """

    name: str
    pieces: PiecewisePolynomial
    rotation: Array
    shift: Array
    drag: float
    spun: Array = field(default_factory=lambda: np.zeros(3))

    @property
    def spin(self) -> Array:
        """Angular velocity in the world with which it is touched [rad/s], shape (3,)."""
        return self.rotation @ self.spun

    @property
    def duration(self) -> float:
        """Time of the last sample [s]."""
        return float(self.pieces.edges[-1])

    @property
    def release(self) -> float:
        """Time at which the ball leaves the hand [s]; 0 where it is not seen there."""
        return self.pieces.release

    def after(self, share: float) -> float:
        """Return the time after a share of the time from the release to the last sample [s]."""
        return self.release + share * (self.duration - self.release)

    def at(self, t: float) -> tuple[Array, Array]:
        """Position [m], shape (3,), and velocity [m/s], shape (3,), ``t`` s after the first."""
        r, dr = self.pieces.at(min(max(t, 0.0), self.duration))
        r, dr = self.rotation @ r + self.shift, self.rotation @ dr
        beyond = t - min(max(t, 0.0), self.duration)
        return (r, dr) if beyond == 0.0 else fly(r, dr, drag=self.drag, duration=beyond)


def read_flights(path: Path) -> tuple[RecordedFlight, ...]:
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
        t = finite_cell(path, line, "t_s", cells["t_s"], limit=limits["t_s"])
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


def _recording(path: Path, name: str, samples: Array) -> RecordedFlight:
    """Check the whole of one flight and start its time at zero."""
    place = f"{path} flight {name[:40]!r}"
    if len(samples) < MIN_SAMPLES:
        raise FileError(place, f"at least {MIN_SAMPLES} samples", len(samples))
    if np.hypot(*(samples[-1, 1:3] - samples[0, 1:3])) < MIN_CHORD:
        raise FileError(place, f"a horizontal way of at least {MIN_CHORD} m", "less")
    return RecordedFlight(name=name, t=samples[:, 0] - samples[0, 0], r=samples[:, 1:])


def builtin_flights() -> tuple[RecordedFlight, ...]:
    """The 44 flights of ``mitt/data/flights/tennicam.csv`` (source and licence beside it)."""
    with as_file(files("mitt") / "data" / "flights" / "tennicam.csv") as path:
        return read_flights(path)


def place_flight(
    recording: RecordedFlight,
    catch_point: Array,
    *,
    rng: np.random.Generator | None,
    drag: float = 0.12,
    share: float = CATCH_FRACTION,
    spinning: Spinning | None = None,
) -> PlacedFlight:
    """Smooth a recording and put it before the arm.

    It is turned about the vertical so that its chord comes from +x, shifted so that it passes
    ``catch_point`` after a share of its time since the release, and jittered about that point.

    Args:
        recording: The flight.
        catch_point: Nominal catch point [m], shape (3,).
        rng: Source of the jitter; no jitter if None.
        drag: Drag after the last sample [1/m]; 0.09 to 0.15 fitted to these balls.
        share: That share; above 1 it is after the last sample.
        spinning: Of the ball, its lift constant and radius, by which its spin is fitted to the
            flight after the last bounce; not fitted if left out.
    """
    pieces, spun = smooth(recording.t, recording.r), np.zeros(3)
    if spinning is not None:
        spun = fitted_spin(recording, pieces, drag, spinning)
    flight = PlacedFlight(
        name=recording.name,
        pieces=pieces,
        rotation=np.eye(3),
        shift=np.zeros(3),
        drag=drag,
        spun=spun,
    )
    anchor = flight.at(flight.after(share))[0]
    first = int(np.searchsorted(recording.t, flight.release))
    chord = recording.r[-1] - recording.r[first]
    rotation, shift = placing(chord, anchor, catch_point, rng)
    return replace(flight, rotation=rotation, shift=shift)


def fitted_spin(
    recording: RecordedFlight, pieces: PiecewisePolynomial, drag: float, ball: Spinning
) -> Array:
    """Return the spin that a recorded flight shows after its last bounce [rad/s], shape (3,).

    Least squares for place, velocity, drag and w of :mod:`mitt.core.ball.spin`, linear in all of
    them along the smoothed velocity; drag and w are held to what balls of table tennis have as by
    one sighting each. None where too little was recorded.
    """
    start, end = max(float(pieces.edges[-2]), pieces.release), float(pieces.edges[-1])
    inside = (recording.t >= start) & (recording.t <= end)
    if np.sum(inside) < _SPIN_SAMPLES:
        return np.zeros(3)
    grid = np.linspace(start, end, _SPIN_GRID)
    v = np.array([pieces.at(x)[1] for x in grid.tolist()])
    pulls = [-np.linalg.norm(v, axis=1)[:, None] * v, *(np.cross(axis, v) for axis in np.eye(3))]
    t, tau = recording.t[inside], recording.t[inside] - start
    columns = []
    for pull in pulls:
        way = _summed(_summed(pull, grid), grid)
        columns.append(np.column_stack([np.interp(t, grid, way[:, k]) for k in range(3)]).ravel())
    plain = [np.kron(rise, axis) for rise in (np.ones(len(t)), tau) for axis in np.eye(3)]
    known = recording.r[inside] + 0.5 * GRAVITY * tau[:, None] ** 2 * (0.0, 0.0, 1.0)
    rows, right = np.column_stack([*plain, *columns]), known.ravel()
    held = np.diag(_SPIN_NOISE / np.array([_DRAG_SIGMA, *[_W_SIGMA] * 3]))
    rows = np.vstack([rows, np.column_stack([np.zeros((4, 6)), held])])
    right = np.append(right, held @ np.array([drag, 0.0, 0.0, 0.0]))
    w = np.linalg.lstsq(rows, right, rcond=None)[0][-3:]
    return spin_shown(w, v[-1], ball.K, ball.radius)


def _summed(values: Array, t: Array) -> Array:
    """Return the integral of values, (k, 3), from the first of rising times on, by trapezoids."""
    steps = 0.5 * (values[1:] + values[:-1]) * np.diff(t)[:, None]
    return np.vstack([np.zeros(3), np.cumsum(steps, axis=0)])


def placing(
    chord: Array, anchor: Array, place: Array, rng: np.random.Generator | None
) -> tuple[Array, Array]:
    """Return rotation, shape (3, 3), and shift [m], shape (3,), of a recording before an arm.

    Its chord [m], shape (3,), comes from +x then, and a point of it, the ``anchor``, is at a place
    [m], shape (3,); both but for the jitter.
    """
    yaw = np.pi - np.arctan2(chord[1], chord[0])
    if rng is not None:
        place = place + rng.uniform(-JITTER_POSITION, JITTER_POSITION, 3)
        yaw += rng.uniform(-JITTER_YAW, JITTER_YAW)
    c, s = np.cos(yaw), np.sin(yaw)
    rotation = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    return rotation, place - rotation @ anchor


def smooth(t: Array, r: Array) -> PiecewisePolynomial:
    """Fit a smooth curve to recorded positions.

    Args:
        t: Times, strictly rising [s], shape (n,).
        r: Positions, z up [m], shape (n, 3).

    Returns:
        The curve, from ``t[0]`` to ``t[-1]``.
    """
    used = np.ones(t.shape, dtype=np.bool_)
    hits = bounces(t, r[:, 2])
    release = find_release(t, r, hits)
    count = int(np.ceil((release - t[0]) / PART_OF_HOLD))
    held = np.linspace(t[0], release, count + 1)  # one edge alone where there is no hand
    edges = np.array([*held, *(x for x in hits if x > release), t[-1]])
    for final in (False, True):
        edges = _meeting_times(edges, t[used], r[used], first=count + 1)
        fits = _fit(edges, t[used], r[used])
        pieces = _pieces(edges, fits, used, release)
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


def find_release(t: Array, r: Array, hits: Sequence[float] = ()) -> float:
    """Find when a ball leaves the hand: from then on it moves as in free flight, but for bounces.

    Its last stretch of free flight counts that lasts: a ball may be tossed before it is thrown, and
    may be caught or roll at the end.

    Args:
        t: Times, strictly rising [s], shape (n,).
        r: Positions, z up [m], shape (n, 3).
        hits: Times of what looks like a bounce [s].

    Returns:
        The time of a sample [s]; the first one where the ball is not seen in a hand.
    """
    first, last, free = _windows(t, r)
    across = np.array(
        [any(a < x < b for x in hits) for a, b in zip(first, last, strict=True)], np.bool_
    )
    end = len(free)
    while end > 0:
        stop = end - 1
        while stop >= 0 and (free[stop] or across[stop]):
            stop -= 1
        inner = np.flatnonzero(free[stop + 1 : end] & ~across[stop + 1 : end])
        if inner.size and last[end - 1] - first[stop + 1] >= SHORTEST_FLIGHT:
            release = _sharpened(t, r, int(np.searchsorted(t, first[stop + 1])))
            return release if stop >= 0 and release - t[0] >= SHORTEST_HOLD else float(t[0])
        end = stop
    return float(t[0])


def _windows(t: Array, r: Array) -> tuple[Array, Array, NDArray[np.bool_]]:
    """Return begin and end of windows of samples [s], and whether the ball flies freely in each.

    One begins at each sample that has enough of them behind it, all of shape (m,).
    """
    ends = np.maximum(np.searchsorted(t, t + SPAN), np.arange(len(t)) + MIN_WINDOW - 1)
    rows = [
        (t[k], t[end], _is_free(t[k : end + 1], r[k : end + 1]))
        for k, end in enumerate(ends)
        if end < len(t)
    ]
    first, last, free = zip(*rows, strict=True) if rows else ((), (), ())
    return np.array(first, float), np.array(last, float), np.array(free, np.bool_)


def _is_free(t: Array, r: Array) -> bool:
    """Tell whether a ball may fly freely, by the parabola through its samples.

    Its acceleration beside gravity is beyond what drag and spin give only if it is so by some
    standard errors, which the samples' own scatter says: an outlier is no hand.
    """
    basis = np.vander((t - t.mean()) / (t[-1] - t[0]), 3)
    fitted, left = np.linalg.lstsq(basis, r, rcond=None)[:2]
    scale = 2.0 / float(t[-1] - t[0]) ** 2
    spread = float(np.linalg.inv(basis.T @ basis)[0, 0] * left.sum()) / (len(t) - 3)
    error = ERRORS * scale * sqrt(max(spread, 0.0))
    beside, velocity = scale * fitted[0] + (0.0, 0.0, GRAVITY), fitted[1] / (t[-1] - t[0])
    speed = float(np.linalg.norm(velocity))
    push = float(beside @ velocity) / max(speed, 1e-9)
    return push < PUSH + error and float(np.linalg.norm(beside)) < free_of_gravity(speed) + error


def _sharpened(t: Array, r: Array, near: int) -> float:
    """Return the sample near one at which a parabola before and one from it on fit best [s].

    The first window of free flight may begin in the hand's last moments already, or a little later.
    """
    size = max(int(np.searchsorted(t, t[near] + SPAN)) - near, MIN_WINDOW)
    low, high = max(near - size, 0), min(near + 2 * size, len(t))
    cuts = range(max(low + 4, near - size // 2), min(near + size, high - 4) + 1)
    costs = {k: _misfit(t[low:k], r[low:k]) + _misfit(t[k:high], r[k:high]) for k in cuts}
    return float(t[min(costs, key=lambda k: costs[k])] if costs else t[near])


def _misfit(t: Array, r: Array) -> float:
    """Return the squares that a parabola leaves [m^2]."""
    basis = legendre.legvander((t - t.mean()) / (t[-1] - t[0]), 2)
    return float(np.linalg.lstsq(basis, r, rcond=None)[1].sum())


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


def _meeting_times(edges: Array, t: Array, r: Array, *, first: int) -> Array:
    """Move each bounce, from the edge ``first`` on, to where the free fits on its sides meet."""
    edges = edges.copy()
    for b in range(first, len(edges) - 1):
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


def _pieces(
    edges: Array, fits: list[Array], used: NDArray[np.bool_], release: float
) -> PiecewisePolynomial:
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
    return PiecewisePolynomial(
        edges=edges, coefficients=coefficients, rates=rates, used=used, release=release
    )
