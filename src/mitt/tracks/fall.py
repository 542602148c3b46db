"""Does what was seen fall as balls fall? Tells a wrong rig, or left and right exchanged."""

from collections.abc import Sequence

import numpy as np

from mitt.flight import GRAVITY
from mitt.signals import Array

#: Length of the pieces that are looked at [s], fewest sightings in one.
_PIECE, _FEWEST = 0.15, 8


def fall_error(points: Sequence[Array]) -> float | None:
    """Return how far from gravity the acceleration of the points is [m/s^2].

    The median over pieces of 0.15 s of |a - g|, a from a parabola; drag makes it 1 to 2 m/s^2 at
    the speeds of a throw. None where no piece has enough points.

    Args:
        points: Rows t, x, y, z [s, m], each shape (4,), in the order of time.
    """
    errors, start = [], 0
    for n in range(len(points)):
        if points[n][0] - points[start][0] < _PIECE:
            continue
        piece = np.array(points[start : n + 1])
        start = n + 1 if n + 1 < len(points) else n
        if len(piece) < _FEWEST:
            continue
        t = piece[:, 0] - piece[:, 0].mean()
        a = 2.0 * np.polyfit(t, piece[:, 1:], 2)[0]
        errors.append(float(np.linalg.norm(a - np.array((0.0, 0.0, -GRAVITY)))))
    return float(np.median(errors)) if errors else None
