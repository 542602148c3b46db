"""The clock of the machine, read nowhere else; no result depends on it."""

import time
from typing import final

import numpy as np
from numba import types
from numpy.typing import NDArray

from mitt.jit import kernel

steady_ns = time.perf_counter_ns
"""Returns the time of the machine's steady clock [ns]."""

processor_time = time.process_time
"""Returns the processor time that this process has used [s]."""

monotonic = time.monotonic
"""Returns the time of the machine's steady clock [s]."""

pause = time.sleep
"""Waits for a time [s]."""
time_of_day = time.time
"""Returns the time since 1970 [s], as ROS 2 stamps it; it may be set at any time."""

#: Time before a deadline from which it is waited for by spinning [s].
_SPIN = 1.2e-4

_CLOCK = time.CLOCK_MONOTONIC
_clock_gettime = types.ExternalFunction("clock_gettime", types.intc(types.intc, types.intp))


@kernel
def now_ns(pair: NDArray[np.int64]) -> int:
    """Return the time of the machine's steady clock [ns], for compiled code.

    Args:
        pair: Scratch, shape (2,).
    """
    _clock_gettime(_CLOCK, pair.ctypes.data)
    return int(1_000_000_000 * pair[0] + pair[1])


@final
class Stopwatch:
    """Adds up how long a block takes, each time it is entered.

    Attributes:
        deadline_us: Time that one entry may take [us].
    """

    def __init__(self, *, deadline_us: float = 1000.0) -> None:
        """Start without entries."""
        self.deadline_us = deadline_us
        self._ns: list[int] = []
        self._start = 0

    def __enter__(self) -> "Stopwatch":
        """Note the time."""
        self._start = steady_ns()
        return self

    def __exit__(self, *_: object) -> None:
        """Keep the time since."""
        self._ns.append(steady_ns() - self._start)

    def add(self, ns: NDArray[np.int64]) -> None:
        """Keep times that compiled code took [ns], shape (k,)."""
        self._ns.extend(ns.tolist())

    def clear(self) -> None:
        """Forget all entries, as after warming up."""
        self._ns.clear()

    def percentiles_us(self) -> dict[str, float]:
        """Return median, p99, p99.9 and maximum [us]; zeros without entries."""
        names = ("p50", "p99", "p99_9", "max")
        if not self._ns:
            return dict.fromkeys(names, 0.0)
        us = np.array(self._ns) * 1e-3
        values = [*np.percentile(us, [50.0, 99.0, 99.9]).tolist(), float(us.max())]
        return dict(zip(names, values, strict=True))

    def misses(self) -> int:
        """Return how many entries took longer than the deadline."""
        return int(np.sum(np.array(self._ns, dtype=np.float64) > 1e3 * self.deadline_us))


@final
class Pace:
    """Estimates the time left of some work, and says when to report it.

    Attributes:
        every: Shortest time between two reports [s].
    """

    def __init__(self, *, every: float = 10.0) -> None:
        """Start now."""
        self.every = every
        self._begun: tuple[float, int] | None = None
        self._reported = 0.0

    def due(self) -> bool:
        """Say whether it is time for a report, and count it as given."""
        now = time.monotonic()
        self._reported = self._reported or now
        if now - self._reported < self.every:
            return False
        self._reported = now
        return True

    def left(self, done: int, of: int) -> float | None:
        """Return the time left [s] at the pace since the first call; None without progress."""
        now = time.monotonic()
        self._begun = self._begun or (now, done)
        start, before = self._begun
        return None if done <= before else (now - start) / (done - before) * (of - done)


def sleep_until(t: float) -> float:
    """Sleep until the steady clock shows ``t`` [s], spinning at the end; return how late it is [s].

    Sleep ends 0.1 ms late in the median, spinning does not; but it takes the core.
    """
    while (left := t - time.monotonic()) > _SPIN:
        time.sleep(left - _SPIN)
    while (now := time.monotonic()) < t:
        pass
    return now - t
