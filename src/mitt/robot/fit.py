"""Capsules that hold points: the shapes of imported links.

A capsule about an axis: the circle about the points as seen along the axis gives line and radius,
and the ends are drawn in as far as the round caps still hold every point. Axes tried: the principal
ones of the points. A shape that two capsules, side by side along it, hold in less space gets two.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from mitt.robot.description import Capsule
from mitt.signals import Array

#: Steps towards the farthest point that find the smallest circle (Badoiu and Clarkson 2003).
_STEPS = 60
#: Share of the space that two capsules may take instead of one.
_WORTH = 0.7
#: Fewest points that are fitted with two capsules.
_FEWEST = 8
#: Most points all of whose pairs are taken for edges.
_FEW = 40
#: What is added to a radius against rounding [m].
_ROUNDING = 1e-9


def capsules_about(points: Array, radius: float = 0.0) -> tuple[Capsule, ...]:
    """Return one or two capsules that hold the convex hull of balls about points.

    Args:
        points: Centres of the balls [m], shape (k, 3).
        radius: Radius of the balls [m].
    """
    whole = _capsule(points, radius)
    along = (points - points.mean(axis=0)) @ _axes(points)[0]
    cut = _cut(points, along)
    if cut is None:
        return (whole,)
    parts = [np.vstack((points[side], cut)) for side in (along <= 0.0, along >= 0.0)]
    both = tuple(_capsule(x, radius) for x in parts)
    return both if sum(map(volume, both)) < _WORTH * volume(whole) else (whole,)


def _cut(points: Array, along: Array) -> Array | None:
    """Return where edges of the convex hull cross the middle plane; None where it has no inside.

    Args:
        points: Shape (k, 3).
        along: Their places along the axis, the plane at 0, shape (k,).
    """
    edges = None if len(points) < _FEWEST else _hull_edges(points)
    return None if edges is None else _crossings(points, edges, along)


def behind(points: Array, height: Array) -> Array:
    """Return points whose hull is the part of the points' hull at heights up to 0.

    Args:
        points: Shape (k, 3).
        height: Their heights over a plane, shape (k,).
    """
    edges = _hull_edges(points) if len(points) > _FEW else None
    if edges is None:
        edges = np.array(np.triu_indices(len(points), 1)).T
    return np.vstack((points[height <= 0.0], _crossings(points, edges, height)))


def _hull_edges(points: Array) -> NDArray[np.int64] | None:
    """Return the edges of the convex hull, shape (m, 2); None where it has no inside."""
    from scipy.spatial import ConvexHull, QhullError  # noqa: PLC0415 (slow to load)

    try:
        simplices = ConvexHull(points).simplices
    except QhullError:  # flat, or all in one place
        return None
    return np.vstack((simplices[:, :2], simplices[:, 1:], simplices[:, ::2])).astype(np.int64)


def _crossings(points: Array, edges: NDArray[np.int64], along: Array) -> Array:
    """Return where edges cross the plane at 0 of the points' places along an axis, shape (j, 3)."""
    first, second = along[edges[:, 0]], along[edges[:, 1]]
    crosses = first * second < 0.0
    share = (first / np.where(crosses, first - second, 1.0))[crosses, None]
    a, b = points[edges[crosses, 0]], points[edges[crosses, 1]]
    return np.asarray(a + share * (b - a))


def volume(capsule: Capsule) -> float:
    """Return the volume of a capsule [m^3]."""
    length = float(np.linalg.norm(np.subtract(capsule.end, capsule.start)))
    return float(np.pi * capsule.radius**2 * (length + 4.0 / 3.0 * capsule.radius))


def _axes(points: Array) -> Array:
    """Return the principal axes of points, the longest first, shape (3, 3)."""
    away = points - points.mean(axis=0)
    return np.asarray(np.linalg.eigh(away.T @ away)[1].T[::-1])


def _capsule(points: Array, radius: float) -> Capsule:
    """Return the smallest capsule about a principal axis."""
    fitted: Sequence[Capsule] = [_about(points, axis, radius) for axis in _axes(points)]
    return min(fitted, key=volume)


def _about(points: Array, axis: Array, radius: float) -> Capsule:
    """Return a capsule that holds balls about points, its axis along a unit vector."""
    along = points @ axis
    flat = points - along[:, None] * axis
    centre = 0.5 * (flat.min(axis=0) + flat.max(axis=0))
    for step in range(_STEPS):
        far = flat[np.argmax(np.linalg.norm(flat - centre, axis=1))]
        centre = centre + (far - centre) / (step + 2.0)
    centre = centre - (centre @ axis) * axis
    away = np.linalg.norm(flat - centre, axis=1)
    most = float(away.max())
    cap = np.sqrt(np.maximum(most**2 - away**2, 0.0))
    low, high = float(np.min(along + cap)), float(np.max(along - cap))
    if low > high:
        low = high = 0.5 * (low + high)
        most = float(np.max(np.hypot(away, along - low)))
    start, end = (tuple((centre + x * axis).tolist()) for x in (low, high))
    return Capsule(start=start, end=end, radius=most + radius + _ROUNDING)
