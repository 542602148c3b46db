"""A module for workers that cannot be imported in a process that was started for it.

``MITT_DIES`` says how it dies there.
"""

import os
import signal
from multiprocessing import parent_process

from mitt.core.errors import InputError

DEATHS = ("raises", "refuses", "exits", "killed", "aborts", "at work")
"""Ways to die; all but the last before a task begins."""


def _die(how: str) -> None:
    """End this process, or its import, in some way."""
    match how:
        case "raises":
            raise RuntimeError("two\nlines")
        case "refuses":
            raise InputError("worker", "a package", "a Python without it")
        case "exits":
            os._exit(7)
        case "killed":
            os.kill(os.getpid(), signal.SIGKILL)
        case "aborts":
            os.abort()


if parent_process() is not None:
    _die(os.environ.get("MITT_DIES", ""))


def aborts_at_three(number: int) -> bytes:
    """Die without a word at three."""
    if number == 3:
        os.abort()
    return work(number)


def raises_at_three(number: int) -> bytes:
    """Raise an error at three."""
    if number == 3:
        raise ValueError("three")
    return work(number)


def work(number: int) -> bytes:
    """Return a number as text, or die at it."""
    if os.environ.get("MITT_DIES") == "at work":
        os.kill(os.getpid(), signal.SIGKILL)
    return str(number).encode()
