"""Keeping a loop on time: garbage collection, memory pages, scheduling.

A full collection with a million live containers takes a tenth of a second; frozen, what was there
before the loop is never looked at again.
"""

import ctypes
import gc
import os
from collections.abc import Iterator
from contextlib import contextmanager

from mitt.errors import InputError

#: Of mlockall(2): present and future pages.
_CURRENT_AND_FUTURE = 3
#: What says how many threads numerical libraries start.
_THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")


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
    """Run a loop without garbage collection; afterwards it is as it was before.

    What the loop leaves behind is freed by reference counts; only cycles wait until its end.
    """
    was_on = gc.isenabled()
    with settled():
        gc.disable()
        try:
            yield
        finally:
            if was_on:
                gc.enable()


def threads_of_libraries() -> dict[str, str]:
    """Return the settings of the libraries' own threads that are not one, by variable.

    A helper thread that holds the interpreter's lock delays a tick by milliseconds; libraries
    read these variables when they are loaded, so they are to be set before.
    """
    return {name: os.environ.get(name, "") for name in _THREADS if os.environ.get(name) != "1"}


def run_realtime(priority: int = 50) -> None:
    """Let the process go before others (SCHED_FIFO) and keep its memory in place; Linux only.

    Args:
        priority: 1 to 99; 50 leaves the kernel's own threads in front.

    Raises:
        InputError: The system does not allow it.
    """
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(priority))
        if ctypes.CDLL(None, use_errno=True).mlockall(_CURRENT_AND_FUTURE) != 0:
            raise OSError(ctypes.get_errno(), "mlockall refused")
    except OSError as error:
        wanted = "the right to real-time scheduling and locked memory (CAP_SYS_NICE, CAP_IPC_LOCK)"
        raise InputError("real time", wanted, error.strerror or "refused") from None
