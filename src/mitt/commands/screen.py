"""What the commands share: checks of output files, progress on stderr, tables on stdout."""

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from mitt.errors import InputError
from mitt.link.clock import Pace
from mitt.link.files import check_folder

Report = Callable[[str, int, int], None]

#: Width of tables that do not go to a terminal [characters].
_FILE_WIDTH = 110


def checked(what: str) -> int:
    """Say that the input is good."""
    tell(f"the input is good: {what}")
    return 0


def check_new_file(name: str, path: Path, *, overwrite: bool) -> None:
    """Refuse a file that exists, or a folder that cannot be written.

    Raises:
        InputError: The file may not be written.
    """
    if path.is_dir():
        raise InputError(name, "a file", f"{path}, which is a folder")
    if path.exists() and not overwrite:
        raise InputError(name, "a new file", f"{path}, which exists",
                         do="choose another or say --overwrite")  # fmt: skip
    check_folder(path.parent, overwrite=True)


def tell(text: str) -> None:
    """Say one line on stderr, if anybody can hear it."""
    with suppress(OSError):
        print(f"mitt: {text}", file=sys.stderr, flush=True)  # noqa: T201


def tell_of_kernels() -> None:
    """Say in one line that kernels are to be compiled, or that they cannot be kept."""
    from mitt.jit import cache_folder, is_cold  # noqa: PLC0415 (loads Numba)

    if cache_folder() is None:
        tell("compiled code cannot be kept, since no folder for it can be written: each start "
             "compiles for about 3 minutes; set NUMBA_CACHE_DIR to a folder of yours")  # fmt: skip
    elif is_cold():
        tell("compiling, once for this version: about 3 minutes")


@contextmanager
def progress() -> Iterator[Report]:
    """Show progress on stderr: a bar on a terminal, else a line now and then."""
    if not sys.stderr.isatty():
        yield _lines()
        return
    columns = (
        TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn()
    )  # fmt: skip
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        tasks = {}

        def report(name: str, done: int, of: int) -> None:
            if name not in tasks:
                tasks[name] = bar.add_task(name, total=of)
            bar.update(tasks[name], completed=done, total=of)

        yield report


def _lines() -> Report:
    """Return what writes a line of progress now and then, with the time left."""
    paces: dict[str, Pace] = {}

    def report(name: str, done: int, of: int) -> None:
        pace = paces.setdefault(name, Pace())
        left = pace.left(done, of)
        if left is not None and done < of and pace.due():
            tell(f"{name} {done} of {of}, {left / 60.0:.1f} min left")

    return report


def console_of() -> Console:
    """Return the console of tables: as wide as the terminal, wide enough in a file."""
    console = Console()
    return console if console.is_terminal else Console(width=_FILE_WIDTH)
