"""The command line: options in, exit status out; the work is done elsewhere."""

import contextlib
import errno
import io
import os
import sys
from collections.abc import Callable
from importlib import import_module

import tyro
from tyro.conf import FlagCreatePairsOff

import mitt
from mitt.commands.options import (
    BenchOptions,
    CalibrateOptions,
    CatchOptions,
    LearnOptions,
    ReportOptions,
    SeeOptions,
    StudyOptions,
    TrackOptions,
)
from mitt.errors import MittError
from mitt.interrupts import raise_again

#: Options of every command; the module of ``mitt.commands`` of the same name does what is asked.
_OPTIONS: dict[str, Callable[..., object]] = {
    "catch": CatchOptions,
    "learn": LearnOptions,
    "study": StudyOptions,
    "report": ReportOptions,
    "track": TrackOptions,
    "see": SeeOptions,
    "calibrate": CalibrateOptions,
    "bench": BenchOptions,
}
#: Characters that frame tyro's messages.
_FRAME = "╭╮╰╯│─"
#: What the system says where a standard stream cannot be written.
_NOT_WRITTEN = (errno.ENOSPC, errno.EIO, errno.EBADF, errno.EDQUOT, errno.EFBIG)


def run(words: list[str]) -> int:
    """Run a command and return its exit status; an interrupt is the caller's to see to."""
    try:
        if "--version" in words:
            print(mitt.__version__, flush=True)  # noqa: T201
            return 0
        return _run(*_parse(words))
    except (MittError, _UsageError) as error:
        raise_again()
        return _fail(2, str(error))
    except BrokenPipeError:  # nobody reads on: no fault, as for other commands in a pipe
        _silence()
        return 0
    except Exception as error:  # the last resort: one line, never a traceback
        raise_again()
        if isinstance(error, OSError) and error.errno in _NOT_WRITTEN and error.filename is None:
            _silence()
            return _fail(2, f"stdout: wanted a place that can be written, got {error.strerror}")
        if os.environ.get("MITT_TRACEBACK"):
            raise
        text = " ".join(f"{type(error).__name__}: {error}".split())
        return _fail(1, f"a fault of mitt, please report it: {text} (MITT_TRACEBACK=1 shows where)")


def _silence() -> None:
    """Point stdout at the null device: what could not be written is not tried again at the end."""
    null = os.open(os.devnull, os.O_WRONLY)
    os.dup2(null, sys.stdout.fileno())
    os.close(null)


class _UsageError(Exception):
    """The options do not parse."""


def _run(name: str, options: object) -> int:
    """Import what the command needs, and run it."""
    job = import_module(f"mitt.commands.{name}")  # heavy: only when needed
    status: int = job.run(options)
    return status


def _parse(words: list[str]) -> tuple[str, object]:
    """Return command and options; tyro's framed message becomes one line."""
    said = io.StringIO()
    # A parser of one command alone is ready five times sooner than that of all.
    chosen = {k: v for k, v in _OPTIONS.items() if [k] == words[:1]} or _OPTIONS
    try:
        with contextlib.redirect_stderr(said):
            options: object = tyro.extras.subcommand_cli_from_dict(
                chosen,
                args=words,
                prog="mitt",
                description="Lets a robot arm catch what is thrown at it. --version shows which.",
                config=(FlagCreatePairsOff,),
            )
    except SystemExit as leave:
        if leave.code in (0, None):
            raise
        raise _UsageError(_one_line(said.getvalue())) from None
    return next(name for name, kind in _OPTIONS.items() if type(options) is kind), options


def _one_line(framed: str) -> str:
    """Return the first paragraph of a framed message in one line."""
    words: list[str] = []
    for line in framed.splitlines()[1:]:
        if not line.strip(_FRAME + " "):
            break
        words.append(line.strip(_FRAME + " "))
    return f"{' '.join(words)}; see mitt --help"


def _fail(status: int, text: str) -> int:
    """Say one line, if anybody can hear it, and return the status."""
    with contextlib.suppress(OSError):
        print(f"mitt: {text}", file=sys.stderr, flush=True)  # noqa: T201
    return status
