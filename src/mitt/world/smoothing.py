"""A smooth curve through recorded positions, with a bounce kept sharp.

Between bounces each axis is a least-squares polynomial in Legendre form; at a bounce the two
sides meet in position only, as the ball does. A polynomial of this degree follows gravity, drag
and spin of a one-second flight to well below the noise of a camera and has an analytic velocity.
"""

from dataclasses import dataclass

import numpy as np
from numpy.polynomial import Polynomial, legendre
from numpy.typing import NDArray

from mitt.signals import Array

DEGREE = 6
"""Largest degree of a piece; short pieces get less, one for each eight samples."""

WINDOW = 6
"""Samples on either side from which the slope before and after a bounce is taken; fewer, down to
two, where the recording ends soon after it."""

MIN_SLOPE = 0.7
"""Least speed down before and up after a bounce [m/s]; an apex of a throw has neither."""

OUTLIER = 6.0
"""Samples further off than this many robust standard deviations are left out of the last fit."""


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
