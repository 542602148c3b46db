"""Keeping a loop on time: garbage collection, priority, and a core of its own.

A full garbage collection with a million live containers takes a tenth of a second. So what existed
before the loop is left out of it.

Two real-time processes on one core leave nothing to the others there; Linux then gives these 50 ms
of each second, and a loop stands still for as long. So each loop stays on a core of its own.
"""

import gc
import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress

from mitt.link.clock import monotonic, sleep_until
from mitt.signals import TICK

STALL = 0.003
"""How late a tick may come on a machine that a live loop is to run on [s]; longer stalls add up
with those of the robot's side to the 10 to 20 ms at which the arm is stopped."""
#: For how long a machine is watched [ticks].
_WATCHED = 2000


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
    for k in (0, *_threads()):
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


def _threads() -> list[int]:
    """Return the threads of this process, as the kernel calls them."""
    return [int(name) for name in os.listdir("/proc/self/task")]


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

    It runs for two seconds, hurried and pinned as a live loop is.

    Args:
        place: Its core, as for :func:`pinned`.
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
