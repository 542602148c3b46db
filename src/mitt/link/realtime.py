"""Keeping a loop on time: what existed before it is left out of garbage collection.

A full collection with a million live containers takes a tenth of a second.
"""

import gc
import os
from collections.abc import Iterator
from contextlib import contextmanager


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

    Threads that are made inside the block inherit it. 50 is what ``ros2_control`` uses.

    Yields:
        What was granted, in words.
    """
    before = os.sched_getscheduler(0), os.sched_getparam(0)
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(priority))
    except OSError:
        yield "ordinary priority: SCHED_FIFO is not allowed"
        return
    try:
        yield f"SCHED_FIFO {priority}"
    finally:
        os.sched_setscheduler(0, *before)
