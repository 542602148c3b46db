"""The clock of the machine, read nowhere else, and loops kept on time; no result depends on it.

A full garbage collection with a million live containers takes a tenth of a second. So what existed
before a loop is left out of it. Two real-time processes on one core leave nothing to the others
there; Linux then gives these 50 ms of each second, and a loop stands still for as long. So each
loop stays on a core of its own.
"""

import gc
import os
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from math import exp, inf
from typing import final

import numpy as np
from numba import types
from numpy.typing import NDArray

from mitt.core.kernels import kernel
from mitt.core.signals import TICK

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


def date() -> str:
    """Return today's date, as 2026-11-26."""
    return time.strftime("%Y-%m-%d")


#: Time before a deadline from which it is waited for by spinning [s].
_SPIN = 1.2e-4
STALL = 0.003
"""How late a tick may come on a machine that a live loop is to run on [s]; longer stalls add up
with those of the robot's side to the 10 to 20 ms at which the arm is stopped."""
#: Time constant with which the pace of some work forgets what was before [s]: long beside a stage
#: of a search, short beside a search.
_SMOOTH = 120.0
#: By how much of the whole time, and of a minute besides, an expected end may move off before that
#: is said [1, s].
_LATE_SHARE = 0.1
_LATE = 30.0
#: For how long a machine is watched [ticks].
_WATCHED = 2000

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


Progress = Callable[[str, int, int], None]
"""Is told what is being done, how much of it is done, and of how much."""


@final
class Pace:
    """Estimates the time left of some work, and says when to report it.

    The pace is that of the last minutes: what a machine did before others began to use it says
    little of the rest. Work may turn out to be more or less; only what is done takes time.

    Attributes:
        every: Shortest time between two reports, and from the start to the first [s].
    """

    def __init__(self, *, every: float = 10.0) -> None:
        """Start now."""
        self.every = every
        self._start = self._reported = self._asked = time.monotonic()
        self._before: float | None = None
        self._gone = self._spent = 0.0
        self._left = self._said = inf

    def due(self) -> bool:
        """Say whether it is time for a report, and count it as given."""
        now = time.monotonic()
        if now - self._reported < self.every:
            return False
        self._reported = now
        return True

    def left(self, done: float, of: float) -> float | None:
        """Return the time left [s] at the pace of late; None before the first report is due.

        What was done before this is asked for the first time does not count.
        """
        now = time.monotonic()
        if self._before is None:
            self._before, self._asked = done, now
            return None
        gone, spent = done - self._before, now - self._asked
        kept = exp(-spent / _SMOOTH)
        self._gone, self._spent = kept * self._gone + gone, kept * self._spent + spent
        self._before, self._asked = done, now
        if self._gone > 0.0 and now - self._start >= self.every:
            self._left = self._spent / self._gone * (of - done)
        return None if self._left == inf else self._left

    def words(self, left: float) -> str:
        """Return in words what is reported of the time left [s], and how much more that is.

        A forecast that is late by a tenth of the whole time, and half a minute, is called so.
        """
        now = time.monotonic()
        late = now + left - self._said
        allowed = _LATE_SHARE * (self._said - self._start) + _LATE
        more = late > allowed
        if more or late < 0.0 or self._said == inf:
            self._said = now + left
        said = f"{left / 60.0:.1f} min left"
        return f"{said}, {late / 60.0:.1f} min more than was said" if more else said


def sleep_until(t: float) -> float:
    """Sleep until the steady clock shows ``t`` [s], spinning at the end; return how late it is [s].

    Sleep ends 0.1 ms late in the median, spinning does not; but it takes the core.
    """
    while (left := t - time.monotonic()) > _SPIN:
        time.sleep(left - _SPIN)
    while (now := time.monotonic()) < t:
        pass
    return now - t


def settle() -> None:
    """Collect garbage once and take all that is left out of later collections, for good."""
    gc.collect()
    gc.freeze()


@contextmanager
def settled() -> Iterator[None]:
    """Run a loop in which garbage collections leave alone what was there before it."""
    settle()
    try:
        yield
    finally:
        gc.unfreeze()


@contextmanager
def uncollected() -> Iterator[None]:
    """Run a loop without garbage collection; afterwards it is as it was before."""
    was_on = gc.isenabled()
    with settled():
        gc.disable()
        try:
            yield
        finally:
            if was_on:
                gc.enable()


@contextmanager
def hurried(priority: int = 50) -> Iterator[str]:
    """Run a loop before ordinary processes, where the system allows it: SCHED_FIFO.

    All threads that there are run so, and those made inside the block: what takes long, as joining
    a network, is done before it, or it holds up the real-time loops of others. 50 is what
    ``ros2_control`` uses.

    Yields:
        What was granted, in words.
    """
    before = {}
    for k in (0, *map(int, os.listdir("/proc/self/task"))):  # this process, and its threads
        with suppress(OSError):  # a thread that has ended
            before[k] = os.sched_getscheduler(k), os.sched_getparam(k)
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(priority))
    except OSError:
        yield "ordinary priority: SCHED_FIFO is not allowed"
        return
    for k in before:
        with suppress(OSError):  # a thread that has ended
            os.sched_setscheduler(k, os.SCHED_FIFO, os.sched_param(priority))
    try:
        yield f"SCHED_FIFO {priority}"
    finally:
        for k, was in before.items():
            with suppress(OSError):
                os.sched_setscheduler(k, *was)


@contextmanager
def pinned(place: int) -> Iterator[None]:
    """Keep this thread on one core; the threads that there are already stay where they like.

    Args:
        place: Which of the cores that are allowed, counted as in a list: 0 is the first of them,
            -1 the last.
    """
    try:
        allowed = os.sched_getaffinity(0)
        os.sched_setaffinity(0, {sorted(allowed)[place]})
    except (OSError, AttributeError):  # not allowed, or another system than Linux
        yield
        return
    try:
        yield
    finally:
        os.sched_setaffinity(0, allowed)


def longest_stall(place: int) -> float:
    """Return by how much the latest tick of a loop that does nothing else came too late [s].

    It runs for two seconds on a core as for :func:`pinned`, hurried as a live loop is.
    """
    worst = 0.0
    with hurried(), pinned(place):
        due = monotonic()
        for _ in range(_WATCHED):
            due += TICK
            late = sleep_until(due)
            worst, due = max(worst, late), due + late
    return worst


def timekeeping(place: int) -> str:
    """Return in words whether a live loop could keep its time on a core; see :func:`pinned`."""
    worst = longest_stall(place)
    said = f"a tick of 1 ms came {1e3 * worst:.1f} ms late at most in two seconds"
    stops = ": such stalls stop the arm (docs/cell.md, real time)" if worst > STALL else ""
    return f"{said}{stops}"
