"""Keeping a loop on time: garbage collection, memory pages, scheduling.

A full collection with a million live containers takes a tenth of a second; frozen, what was there
before the loop is never looked at again (performance.md, section 10).
"""

import ctypes
import gc
import os

from mitt.errors import InputError

#: Of mlockall(2): present and future pages.
_CURRENT_AND_FUTURE = 3


def settle() -> None:
    """Collect garbage once and take all that is left out of later collections."""
    gc.collect()
    gc.freeze()


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
