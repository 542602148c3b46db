"""The entry of the command line: signals and streams are in order before anything is imported.

Exit status: 0 done, 1 a fault of ours, 2 bad input, 129, 130 and 143 interrupted by SIGHUP, SIGINT
and SIGTERM. Every failure is one line on stderr.
"""

import os
import sys
from collections.abc import Sequence
from contextlib import suppress

from mitt.interrupts import Interrupted, listening, notice, status_of, words_of

#: Exit statuses above this are those of signals.
_SIGNALLED = 128


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command and return its exit status.

    A process of its own, without ``arguments``, ends here and now when it was interrupted: the
    interpreter would take its time to clear up.
    """
    alone = arguments is None
    _open_streams()
    status = 0
    try:
        with listening(for_good=alone):
            try:
                from mitt.commands.line import run  # noqa: PLC0415 (once signals are in order)

                status = run(sys.argv[1:] if arguments is None else list(arguments))
            except KeyboardInterrupt as stop:
                notice()
                status = _tell(status_of(stop), words_of(status_of(stop)))
    except Interrupted as stop:  # in the moment in which signals are handed back
        status = status or status_of(stop)
    except SystemExit:  # help was asked for, and printed
        if _flushed(0) == 0:
            raise
        return 2
    status = _flushed(status)
    if alone and status > _SIGNALLED:
        os._exit(status)
    return status


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
    """Write what is left for stdout; return the exit status.

    Nobody who reads is no fault, as for other commands in a pipe. What is not written is gone: the
    stream is pointed at the null device, or Python would try again and complain at its end.
    """
    try:
        sys.stdout.flush()
        return status
    except BrokenPipeError:
        failed = status
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) else str(error)
        failed = _tell(2, f"stdout: wanted a place that can be written, got {reason}")
    null = os.open(os.devnull, os.O_WRONLY)
    os.dup2(null, sys.stdout.fileno())
    os.close(null)
    return failed


def _tell(status: int, text: str) -> int:
    """Say one line on stderr, if anybody can hear it; return the status."""
    with suppress(OSError):
        print(f"mitt: {text}", file=sys.stderr, flush=True)  # noqa: T201
    return status
