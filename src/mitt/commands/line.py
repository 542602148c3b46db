"""The command line: options in, exit status out; the work is done elsewhere."""

import contextlib
import io
from collections.abc import Callable
from importlib import import_module

import tyro
from tyro.conf import FlagCreatePairsOff

import mitt
from mitt.commands import camera_options as cameras
from mitt.commands import options as of
from mitt.commands.help import overview, screen
from mitt.errors import MittError

#: Options of every command; the module of ``mitt.commands`` of the same name does what is asked.
COMMANDS: dict[str, Callable[..., object]] = {
    "catch": of.CatchOptions,
    "learn": of.LearnOptions,
    "design": of.DesignOptions,
    "run": of.RunOptions,
    "sim": of.SimOptions,
    "study": of.StudyOptions,
    "report": of.ReportOptions,
    "track": cameras.TrackOptions,
    "see": cameras.SeeOptions,
    "calibrate": cameras.CalibrateOptions,
    "replay": of.ReplayOptions,
    "view": of.ViewOptions,
    "bench": of.BenchOptions,
}
#: Characters that frame tyro's messages.
_FRAME = "╭╮╰╯│─"


def run(words: list[str]) -> int:
    """Run a command and return its exit status; what goes wrong is the caller's to tell.

    Raises:
        MittError: The input is bad.
    """
    if "--version" in words:
        print(mitt.__version__, flush=True)  # noqa: T201
        return 0
    if {"--help", "-h"} & set(words) or words == ["--help-all"]:
        said = screen(words[0], COMMANDS[words[0]]) if words[0] in COMMANDS else overview(COMMANDS)
        print(said, flush=True)  # noqa: T201
        return 0
    name, options = parse(["--help" if word == "--help-all" else word for word in words])
    status: int = import_module(f"mitt.commands.{name}").run(options)  # heavy: only when needed
    return status


def parse(words: list[str]) -> tuple[str, object]:
    """Return command and options; tyro's framed message becomes one line."""
    said = io.StringIO()
    # A parser of one command alone is ready five times sooner than that of all.
    chosen = {k: v for k, v in COMMANDS.items() if [k] == words[:1]} or COMMANDS
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
        where = f"mitt {words[0]}" if words and words[0] in COMMANDS else "mitt"
        raise MittError(f"{_one_line(said.getvalue())}; see {where} --help") from None
    return next(name for name, kind in COMMANDS.items() if type(options) is kind), options


def _one_line(framed: str) -> str:
    """Return the first paragraph of a framed message in one line."""
    words: list[str] = []
    for line in framed.splitlines()[1:]:
        if not line.strip(_FRAME + " "):
            break
        words.append(line.strip(_FRAME + " "))
    return " ".join(words)
