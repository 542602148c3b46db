"""The ball among the markers that belong to no body, as motion capture sends them.

A ball wrapped in reflecting tape is one of them. Reflections and markers that were forgotten stand
where they are. What does not stand, and goes on where the ball was last, is the ball; of several
that could be, none is.
"""

from typing import final

import numpy as np
from numpy.typing import NDArray

from mitt.core.signals import Array

#: How far a marker that stands is seen to move [m], from when it counts as standing, and how long
#: it is remembered where it is not seen [s].
_STILL = 0.01
_STANDS = 0.3
_REMEMBERED = 1.0
#: How far from where it was to be the ball may be [m], and how long it is looked for there [s].
_NEAR = 0.1
_GOES_ON = 0.1


@final
class LooseMarkers:
    """Tells the ball among loose markers, frame after frame."""

    def __init__(self) -> None:
        """Know no marker yet."""
        self._places, self._since, self._seen = np.zeros((0, 3)), np.zeros(0), np.zeros(0)
        self._last: list[tuple[float, Array]] = []

    def ball(self, t: float, places: Array) -> Array:
        """Return where the ball is, no numbers where none can be told.

        Args:
            t: Time of the frame [s].
            places: Places of all loose markers in it [m], shape (k, 3).
        """
        moving = places[~self._stand(t, places)]
        if self._last and not 0.0 < t - self._last[-1][0] < _GOES_ON:
            self._last.clear()
        if len(self._last) == 2:
            (t0, r0), (t1, r1) = self._last
            gaps = np.linalg.norm(moving - (r1 + (r1 - r0) * (t - t1) / (t1 - t0)), axis=1)
            moving = moving[gaps < _NEAR]
        if len(moving) != 1:
            return np.full(3, np.nan)
        self._last = [*self._last[-1:], (t, moving[0])]
        found: Array = moving[0].copy()
        return found

    def _stand(self, t: float, places: Array) -> NDArray[np.bool_]:
        """Return which markers stand where one stood before; remember all."""
        gaps = np.linalg.norm(places[:, None] - self._places[None], axis=2)
        near = gaps < _STILL
        first = np.argmax(near, axis=1) if near.shape[1] else np.zeros(len(places), dtype=int)
        known = near.any(axis=1)
        self._seen[first[known]] = t
        stands = np.zeros(len(places), dtype=bool)
        stands[known] = t - self._since[first[known]] >= _STANDS
        new, kept = places[~known], t - self._seen < _REMEMBERED
        fresh = np.full(len(new), t)
        self._places = np.concatenate((self._places[kept], new))
        self._since = np.concatenate((self._since[kept], fresh))
        self._seen = np.concatenate((self._seen[kept], fresh))
        return stands
