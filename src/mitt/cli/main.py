"""The entry of the command line: signals and streams are in order before anything is imported.

Exit status: 0 done, 1 a fault of ours, 2 bad input, 129, 130 and 143 interrupted by SIGHUP, SIGINT
and SIGTERM. Every failure is one line on stderr.
"""

import errno
import gc
import logging
import os
import sys
from collections.abc import Sequence
from typing import TextIO

from mitt.core.errors import FileError, InputError, MittError, printable
from mitt.interrupts import (
    Interrupted,
    listening,
    notice,
    raise_again,
    status_of,
    tell,
    words_of,
)

#: Linear algebra runs in one thread, in this process and in those that it starts. The matrices are
#: small: with two threads on two busy cores a map of five joints took 4.6 times as long, and sums
#: would depend on the number of cores. What a user has set stays.
_ONE_THREAD = ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
#: What the system says where a standard stream cannot be written.
_NOT_WRITTEN = (errno.ENOSPC, errno.EIO, errno.EBADF, errno.EDQUOT, errno.EFBIG)
#: What it says of a path that a user named and that cannot be looked at.
_NO_PATH = (errno.EACCES, errno.EPERM, errno.ENAMETOOLONG, errno.ELOOP, errno.EROFS)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command and return its exit status.

    A process of its own, without ``arguments``, ends here and now when it was interrupted: the
    interpreter would take its time to clear up.
    """
    alone = arguments is None
    _open_streams()
    for name in _ONE_THREAD if alone else ():
        os.environ.setdefault(name, "1")
    status = 0
    try:
        with listening(for_good=alone):
            try:
                status = _run(sys.argv[1:] if arguments is None else list(arguments))
            except KeyboardInterrupt as stop:
                notice()
                status = _failed(status_of(stop), words_of(status_of(stop)))
    except Interrupted as stop:  # in the moment in which signals are taken or handed back
        notice()
        status = status or _failed(status_of(stop), words_of(status_of(stop)))
    except SystemExit:  # help was asked for, and printed
        if _flushed(0) == 0:
            raise
        return 2
    status = _flushed(status)
    if alone and status > 128:  # that of a signal
        os._exit(status)
    if alone:  # a last look for garbage takes seconds, and the process ends anyway
        gc.freeze()
    return status


class _Warnings(logging.Handler):
    """Says what the library warns of, each line once: on stderr, before anything is refused."""

    def __init__(self) -> None:
        super().__init__(logging.WARNING)
        self._said = set[str]()

    def emit(self, record: logging.LogRecord) -> None:
        """Say a warning."""
        text = " ".join(printable(record.getMessage()).split())
        if text not in self._said:
            self._said.add(text)
            tell(f"warning: {text}")


def _run(words: list[str]) -> int:
    """Run a command; say what went wrong in one line, never in a traceback."""
    warnings, logger = _Warnings(), logging.getLogger("mitt")
    logger.addHandler(warnings)
    try:
        return _ended(words)
    finally:
        logger.removeHandler(warnings)


def _ended(words: list[str]) -> int:
    """Run a command; return its exit status, however it ends."""
    try:
        from mitt.cli.line import dispatch  # noqa: PLC0415 (once signals are in order)

        _check_words(words)
        return dispatch(words)
    except MittError as error:
        raise_again()
        return _failed(2, str(error))
    except Exception as error:
        raise_again()
        if isinstance(error, OSError) and error.filename is None:
            if isinstance(error, BrokenPipeError):
                return _unwritten(0)
            if error.errno in _NOT_WRITTEN:
                return _unwritten(0, error.strerror or "an error")
        if isinstance(error, OSError) and error.errno in _NO_PATH and error.filename is not None:
            place = os.fsdecode(error.filename) if isinstance(error.filename, str | bytes) else "it"
            wanted, given = "a path that can be used", error.strerror
            return _failed(2, str(FileError(place, wanted, given)))
        if os.environ.get("MITT_TRACEBACK"):
            raise
        text = " ".join(f"{type(error).__name__}: {error}".split())
        return _failed(
            1, f"a fault of mitt, please report it: {text} (MITT_TRACEBACK=1 shows where)"
        )


def _check_words(words: list[str]) -> None:
    """Refuse names that no text file could repeat."""
    for word in words:
        if any("\ud800" <= character <= "\udfff" for character in word):
            raise InputError("mitt", "names and values in UTF-8", word, do="rename the file")


def _open_streams() -> None:
    """Give each standard stream that is closed the null device.

    Otherwise the next file that is opened takes its number, and gets what is meant for the stream.
    """
    for number in range(3):
        try:
            os.fstat(number)
        except OSError:
            null = os.open(os.devnull, os.O_RDWR)  # the lowest number that is free: this one
            os.set_inheritable(null, True)
    sys.stdout = sys.stdout or open(os.devnull, "w", encoding="utf-8")  # noqa: SIM115 (for good)
    sys.stderr = sys.stderr or open(os.devnull, "w", encoding="utf-8")  # noqa: SIM115 (for good)


def _flushed(status: int) -> int:
    """Write what is left for stdout and stderr; return the exit status."""
    try:
        sys.stderr.flush()
    except (OSError, ValueError):
        _give_up(sys.stderr)
    try:
        sys.stdout.flush()
        return status
    except BrokenPipeError:
        return _unwritten(status)
    except (OSError, ValueError) as error:
        return _unwritten(status, error.strerror if isinstance(error, OSError) else str(error))


def _unwritten(status: int, reason: str | None = None) -> int:
    """Give up stdout; return the exit status, 2 where there is a reason for it.

    Nobody who reads is no fault, as for other commands in a pipe.
    """
    if reason is not None:
        status = _failed(2, f"stdout: wanted a place that can be written, got {reason}")
    _give_up(sys.stdout)
    return status


def _give_up(stream: TextIO) -> None:
    """Point a stream at the null device, or Python would try again and complain at its end.

    What is not written is gone.
    """
    null = os.open(os.devnull, os.O_WRONLY)
    os.dup2(null, stream.fileno())
    os.close(null)


def _failed(status: int, text: str) -> int:
    """Say one line on stderr; return the status."""
    tell(text)
    return status
