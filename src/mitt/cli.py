"""The command line: options in, exit status out; the work is done elsewhere.

Exit status: 0 done, 1 a fault of ours, 2 bad input, 130 and 143 interrupted. Every failure is one
line on stderr.
"""

import contextlib
import io
import os
import signal
import sys
from collections.abc import Callable, Sequence
from importlib import import_module
from types import FrameType
from typing import NoReturn

import tyro
from tyro.conf import FlagCreatePairsOff

import mitt
from mitt.errors import MittError, Terminated
from mitt.options import (
    BenchOptions,
    CalibrateOptions,
    CatchOptions,
    LearnOptions,
    ReportOptions,
    SeeOptions,
    StudyOptions,
    TrackOptions,
)

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


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command and return its exit status."""
    words = list(sys.argv[1:] if arguments is None else arguments)
    signal.signal(signal.SIGTERM, _terminate)
    try:
        if "--version" in words:
            print(mitt.__version__, flush=True)  # noqa: T201
            return 0
        return _run(*_parse(words))
    except MittError as error:
        return _fail(2, str(error))
    except _UsageError as error:
        return _fail(2, str(error))
    except Terminated:
        return 143
    except KeyboardInterrupt:
        return 130
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    except Exception as error:  # the last resort: one line, never a traceback
        if os.environ.get("MITT_TRACEBACK"):
            raise
        text = " ".join(f"{type(error).__name__}: {error}".split())
        return _fail(1, f"a fault of mitt, please report it: {text} (MITT_TRACEBACK=1 shows where)")


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


def _terminate(number: int, frame: FrameType | None) -> NoReturn:  # noqa: ARG001
    """Turn SIGTERM into an exception."""
    raise Terminated


def _fail(status: int, text: str) -> int:
    """Say one line and return the status."""
    print(f"mitt: {text}", file=sys.stderr)  # noqa: T201
    return status
