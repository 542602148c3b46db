"""What the commands share: checks of output files, progress on stderr, tables on stdout."""

import json
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn
from rich.table import Table

from mitt.errors import InputError
from mitt.files.files import check_folder
from mitt.interrupts import tell
from mitt.link.clock import Pace

Report = Callable[[str, int, int], None]

#: Time over which the pace of a bar is taken [s].
_PACE = 600.0
#: Width of tables that do not go to a terminal [characters].
_FILE_WIDTH = 110


def checked(what: str) -> int:
    """Say that the input is good."""
    tell(f"the input is good: {what}")
    return 0


def check_new_file(name: str, path: Path | None, *, overwrite: bool) -> None:
    """Refuse an output file that exists, or whose folder cannot be written; None is no file.

    Raises:
        InputError: The file may not be written.
    """
    if path is None:
        return
    if path.is_dir():
        raise InputError(name, "a file", f"{path}, which is a folder")
    if path.exists() and not overwrite:
        raise InputError(name, "a new file", f"{path}, which exists",
                         do="choose another or say --overwrite")  # fmt: skip
    check_folder(path.parent, overwrite=True)


def tell_of_kernels() -> None:
    """Say in one line that kernels are to be compiled, or that they cannot be kept."""
    from mitt.jit import cache_folder, is_cold  # noqa: PLC0415 (loads Numba)

    if cache_folder() is None:
        tell("compiled code cannot be kept, since no folder for it can be written: each start "
             "compiles for 1 to 2 minutes; set NUMBA_CACHE_DIR to a folder of yours")  # fmt: skip
    elif is_cold():
        tell("compiling, once: 1 to 2 minutes")


@contextmanager
def progress() -> Iterator[Report]:
    """Show progress on stderr: a bar on a terminal, else a line now and then.

    What is named ``work: part`` is one work, of whichever part.
    """
    if not sys.stderr.isatty():
        paces: dict[str, Pace] = {}

        def line(name: str, done: int, of: int) -> None:
            pace = paces.setdefault(name.partition(":")[0], Pace())
            left = pace.left(done, of)
            if left is not None and done < of and pace.due():
                tell(f"{name} {done} of {of}, {left / 60.0:.1f} min left")

        yield line
        return
    columns = (
        TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn()
    )  # fmt: skip
    console = Console(stderr=True)
    with Progress(*columns, console=console, transient=True, speed_estimate_period=_PACE) as bar:
        tasks = {}

        def report(name: str, done: int, of: int) -> None:
            work = name.partition(":")[0]
            if work not in tasks:
                tasks[work] = bar.add_task(name, total=of)
            bar.update(tasks[work], description=name, completed=done, total=of)

        yield report


def print_json(value: object) -> None:
    """Print one JSON object on stdout; NaN and infinity are refused."""
    print(json.dumps(value, allow_nan=False))  # noqa: T201


def show(*parts: str | Table, style: str | None = None) -> None:
    """Print tables and lines on stdout: as wide as the terminal, wide enough in a file."""
    console = Console()
    console = console if console.is_terminal else Console(width=_FILE_WIDTH)
    for part in parts:
        console.print(part, soft_wrap=isinstance(part, str), style=style)


def warn(texts: Sequence[str], *, json: bool = False) -> None:
    """Print warnings on stdout; on stderr where stdout is for JSON."""
    if json:
        for text in texts:
            tell(f"warning: {text}")
        return
    show(*(f"warning: {text}" for text in texts), style="yellow")


def table(
    title: str, columns: Sequence[str], *, left: Sequence[str] = (), no_wrap: bool = False
) -> Table:
    """Return an empty table; all columns but those in ``left`` are aligned to the right."""
    out = Table(title=title, title_justify="left")
    for name in columns:
        out.add_column(name, justify="left" if name in left else "right", no_wrap=no_wrap)
    return out
