"""How old commands are when they begin to act, over hours: counted, not kept."""

from math import log
from typing import final

import numpy as np

#: Youngest age that is told apart [s], and ratio from one class to the next.
_LEAST, _RATIO = 1e-6, 1.01
#: Number of classes: up to 12 s.
_CLASSES = 1640


@final
class Ages:
    """Counts ages in classes 1 % wide, in memory that does not grow."""

    def __init__(self) -> None:
        """Start without any."""
        self._counts = np.zeros(_CLASSES, dtype=np.int64)
        self._oldest = 0.0

    def add(self, age: float) -> None:
        """Count an age [s]."""
        place = int(log(max(age, _LEAST) / _LEAST) / log(_RATIO))
        self._counts[min(place, _CLASSES - 1)] += 1
        self._oldest = max(self._oldest, age)

    def percentiles_us(self) -> dict[str, float] | None:
        """Return median, p99 and p99.9, each within 1 %, and the largest [us]; None without any.

        A percentile is told as the upper end of its class, at most the largest.
        """
        names, total = ("p50", "p99", "p99_9"), int(self._counts.sum())
        if total == 0:
            return None
        most, below = 1e6 * self._oldest, np.cumsum(self._counts)
        places = np.searchsorted(below, np.array([0.5, 0.99, 0.999]) * total)
        ends = 1e6 * _LEAST * _RATIO ** (places + 1.0)
        return {**dict(zip(names, np.minimum(ends, most).tolist(), strict=True)), "max": most}
