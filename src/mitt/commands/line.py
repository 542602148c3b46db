"""The command line: options in, exit status out; the work is done elsewhere."""

import contextlib
import io
import shlex
from collections.abc import Callable
from importlib import import_module

import tyro
from tyro.conf import FlagCreatePairsOff

import mitt
from mitt.commands import camera_options as cameras
from mitt.commands import options as of
from mitt.commands.help import overview, screen
from mitt.commands.words import check_words, options_of
from mitt.errors import InputError, MittError

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


def run(words: list[str]) -> int:
    """Run a command and return its exit status; what goes wrong is the caller's to tell.

    Raises:
        MittError: The input is bad.
    """
    words = words or ["--help"]
    if "--version" in words:
        print(mitt.__version__, flush=True)  # noqa: T201
        return 0
    if {"--help", "-h"} & set(words) or words == ["--help-all"]:
        said = screen(words[0], COMMANDS[words[0]]) if words[0] in COMMANDS else overview(COMMANDS)
        print(said, flush=True)  # noqa: T201
        return 0
    name, options = parse(["--help" if word == "--help-all" else word for word in words])
    try:
        status: int = import_module(f"mitt.commands.{name}").run(options)  # heavy: only now
    except InputError as error:
        raise _as_said(name, error) from error
    return status


def _as_said(name: str, error: InputError) -> MittError:
    """Return an error that calls an input as the command line does, where it is an option."""
    options = {x.field: x.name for x in options_of(COMMANDS[name])}
    said = options.get(error.name.replace(" ", "_"))
    return error if said is None else MittError(said + str(error).removeprefix(error.name))


def parse(words: list[str]) -> tuple[str, object]:
    """Return command and options.

    Raises:
        InputError: A word cannot be.
    """
    if "--help" not in words:
        check_words(words, COMMANDS)
    # A parser of one command alone is ready five times sooner than that of all.
    chosen = {k: v for k, v in COMMANDS.items() if [k] == words[:1]} or COMMANDS
    try:
        with contextlib.redirect_stderr(io.StringIO()):
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
        raise InputError(words[0], "options of its own", shlex.join(words[1:]),
                         do=f"see mitt {words[0]} --help") from None  # fmt: skip
    return next(name for name, kind in COMMANDS.items() if type(options) is kind), options
