"""What the commands share: checks of output files, progress on stderr, tables on stdout."""

import json
import os
import sys
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import fields
from multiprocessing import get_context
from pathlib import Path
from threading import Event
from typing import Any, Protocol, TypeVar

from rich.box import SIMPLE_HEAD
from rich.console import Console, JustifyMethod
from rich.live import Live
from rich.progress import BarColumn, MofNCompleteColumn, TextColumn
from rich.progress import Progress as Bar
from rich.table import Table
from rich.text import Text

from mitt.clock import Pace, Progress
from mitt.core.errors import InputError, printable
from mitt.interrupts import end_with_parent, safe_path, tell
from mitt.io.writing import check_folder, check_own, file_name, new_folder, overlaps


class _Ended(Protocol):
    """A trial of whatever task."""

    @property
    def status(self) -> str:
        """How it ended."""
        ...


class _OfRun(Protocol):
    """Options of a command that runs trials of a task."""

    @property
    def out(self) -> Path | None:
        """Folder to write."""

    @property
    def overwrite(self) -> bool:
        """Whether a folder with files in it may be used."""

    @property
    def check(self) -> bool:
        """Whether nothing is to be done."""


class _Records(Protocol):
    """Options that say what to record, of which generator."""

    @property
    def record(self) -> str:
        """Which trials: none, failures or all."""

    @property
    def generator(self) -> str:
        """What moves the arm."""


class _Limited(Protocol):
    """A trial that counts its ticks beyond a limit."""

    @property
    def limit_violations(self) -> int:
        """How many there were."""
        ...


_Trial = TypeVar("_Trial", bound=_Ended)

#: Columns of a terminal between those of a table.
_GAP = 2


def say(text: str) -> None:
    """Say one line on stderr, whatever names are in it."""
    tell(printable(text))


def checked(what: str) -> int:
    """Say that the input is good."""
    say(f"the input is good: {what}")
    return 0


def check_new_files(
    options: Any,  # noqa: ANN401
    made: Mapping[str, Path | None],
    *,
    overwrite: bool | None = None,
) -> None:
    """Refuse output files that exist, that are read, or whose folder cannot be written.

    With ``--check`` an output may exist: nothing is written. What is replaced is a file of mitt,
    as far as its kind tells, and no link.

    Args:
        options: Options of a command: their other paths are what is read.
        made: The files that would be written, by the option that names each; None is no file.
        overwrite: Whether files of mitt may be replaced; as the options say if left out.

    Raises:
        InputError: A file may not be written.
    """
    files = [(name, path) for name, path in made.items() if path is not None]
    read = _named(options, without=made)
    overwrite = options.overwrite if overwrite is None else overwrite
    for k, (name, path) in enumerate(files):
        if path.is_dir():
            raise InputError(name, "a file", f"{path}, which is a folder")
        if any(overlaps(path, other) for other in (*read, *(x for _, x in files[:k]))):
            raise InputError(
                name,
                "a file of its own",
                f"{path}, which is read or written too",
                do="choose another",
            )
        there, named = os.path.lexists(path), path in _named(options)
        if there and not overwrite and not options.check:
            raise InputError(
                name, "a new file", f"{path}, which exists", do="choose another or say --overwrite"
            )
        if overwrite or not named:
            check_own(name, path)
        check_folder(path.parent, overwrite=True)


def file_beside(out: Path, suffix: str) -> Path:
    """Return the file beside ``--out`` that is called so but for its suffix.

    Raises:
        InputError: That is no name of a file, as ``.`` and ``/``.
    """
    if not out.name:
        raise InputError("--out", "a file", f"{out}, which is a folder")
    return out.with_suffix(suffix)


def repeated(options: Any, *, files: Collection[str]) -> list[str]:  # noqa: ANN401
    """Return the words of options that make a run again, files by where they are from anywhere.

    Args:
        options: What was said.
        files: Names of the options that may name a file.
    """
    out = list[str]()
    for field in fields(options):
        name, value = field.name, getattr(options, field.name)
        if name in ("out", "overwrite", "json", "check") or value == field.default:
            continue
        said = f"--{name.replace('_', '-')}"
        path = Path(value) if isinstance(value, str | Path) else Path()
        if name in files and path.is_file() and (path.suffix or name == "scene"):
            value = path.absolute()
        out.append(said if value is True else f"{said}={value}")
    return out


def run_folder(options: _OfRun, name: str) -> Path:
    """Return the folder of a run: a new one in ``runs`` with a name, where the options name none.

    Raises:
        InputError: It may not be written.
    """
    out = options.out or Path("runs") / file_name(name)
    if options.out is None and not options.overwrite:
        out = new_folder(out)
    check_folder(out, overwrite=options.overwrite or options.check)
    return out


def check_record(options: _Records) -> None:
    """Refuse recordings of a rival: only what the map did can be replayed."""
    if options.record != "none" and options.generator != "direct":
        raise InputError(
            "--record",
            "none beside a rival",
            options.record,
            do="only what the map did can be replayed",
        )


def worth_a_row(trials: Sequence[_Trial], good: str) -> list[_Trial]:
    """Return the trials that a table shows: the first 20, and 40 of the others that failed."""
    return [*trials[:20], *[t for t in trials[20:] if t.status != good][:40]]


def rate_words(said: Mapping[str, Any], good: str, of: str) -> str:
    """Return in words how many trials of a summary were ``good``, of those counted as ``of``."""
    low, high = said["ci95"]
    share = 100.0 * said[good] / max(said[of], 1)
    return (
        f"{said[good]} of {said[of]}: {share:.1f} % "
        f"(95 % interval {100.0 * low:.1f} to {100.0 * high:.1f} %)"
    )


def beyond_words(trials: Sequence[_Limited]) -> list[str]:
    """Return in words in how many trials a limit was exceeded, and for how long; nothing if never.

    A tick is a millisecond.
    """
    beyond = [t.limit_violations for t in trials if t.limit_violations]
    ticks = f"{sum(beyond)} ms in all, commanded or of the plant"
    return [f"beyond a limit: {len(beyond)} of {len(trials)} trials, {ticks}"] if beyond else []


def table_number(value: float | None, digits: int) -> str:
    """Return a number as a table has it; nothing for None."""
    return "" if value is None else f"{value:.{digits}f}"


def _named(options: Any, *, without: Collection[str] = ()) -> list[Path]:  # noqa: ANN401
    """Return what options name that may be a file, but for some of them."""
    out: list[Path] = []
    for field in fields(options):
        value = getattr(options, field.name)
        if f"--{field.name.replace('_', '-')}" not in without:
            values = value if isinstance(value, tuple) else (value,)
            out += [Path(x) for x in values if isinstance(x, str | Path)]
    return out


def tell_of_kernels() -> None:
    """Say in one line that kernels are to be compiled; that they cannot be kept is logged."""
    from mitt.core.kernels import cache_folder, is_cold  # noqa: PLC0415 (loads Numba)

    if cache_folder() is not None and is_cold():
        tell("compiling, once: 1 to 2 minutes")


@contextmanager
def progress() -> Iterator[Progress]:
    """Show progress on stderr: a bar on a terminal, else a line now and then.

    What is named ``work: part`` is one work, of whichever part.
    """
    paces: dict[str, Pace] = {}
    if not sys.stderr.isatty():

        def line(name: str, done: int, of: int) -> None:
            pace = paces.setdefault(name.partition(":")[0], Pace())
            left = pace.left(done, of)
            if left is not None and done < of and pace.due():
                tell(f"{name} {done} of {of}, {pace.words(left)}")

        yield line
        return
    columns = (
        TextColumn("{task.description}", markup=False),
        BarColumn(),
        MofNCompleteColumn(),
        TextColumn("{task.fields[left]}"),
    )
    with Bar(*columns, console=_console(stderr=True), transient=True) as bar:
        tasks = {}

        def report(name: str, done: int, of: int) -> None:
            work = name.partition(":")[0]
            if work not in tasks:
                tasks[work], paces[work] = bar.add_task(name, total=of, left=""), Pace()
            part = name.rpartition(": ")[2]  # a line of 80 columns has no more room
            left = paces[work].left(done, of)
            said = "" if left is None else paces[work].words(left)
            words, _, more = said.removesuffix(" than was said").partition(", ")
            if more:  # a line of its own: the bar has no room
                bar.console.print(f"{work}: {said}")
            bar.update(
                tasks[work],
                description=part,
                completed=done,
                total=of,
                left=words.removesuffix(" left"),
            )

        yield report


def print_json(value: object) -> None:
    """Print one JSON object on stdout; NaN and infinity are refused."""
    print(json.dumps(value, allow_nan=False))  # noqa: T201


def show(*parts: str | Table, style: str | None = None) -> None:
    """Print tables and lines on stdout: as wide as the terminal, wide enough in a file."""
    console = _console()
    console = console if console.is_terminal else _console(width=110)
    for part in parts:
        if isinstance(part, Table):
            _fit(part, console)
        plain = printable(part) if isinstance(part, str) else part
        console.print(plain, soft_wrap=isinstance(part, str), style=style)


def _fit(rows: Table, console: Console) -> None:
    """Let cells break into lines where a table would be too wide: nothing is cut off.

    A column that may not break is as wide as its longest line, another as its longest word.
    """
    need = _GAP * (len(rows.columns) - 1)
    for column in rows.columns:
        cells = [Text(str(x)) for x in (column.header, *column.cells)]
        sizes = [x.__rich_measure__(console, console.options) for x in cells]
        need += max(x.maximum if column.no_wrap else x.minimum for x in sizes)
    if need > console.width:
        for column in rows.columns:
            column.no_wrap = False


def _console(*, stderr: bool = False, width: int | None = None) -> Console:
    """Return what prints texts as they are: a name that looks like markup is a name."""
    return Console(stderr=stderr, width=width, markup=False, emoji=False)


def warn(texts: Sequence[str], *, json: bool = False) -> None:
    """Print warnings on stdout; on stderr where stdout is for JSON."""
    if json:
        for text in texts:
            say(f"warning: {text}")
        return
    show(*(f"warning: {text}" for text in texts), style="yellow")


def table(
    title: str, columns: Sequence[str], *, left: Sequence[str] = (), no_wrap: bool = False
) -> Table:
    """Return an empty table; all columns but those in ``left`` are aligned to the right.

    With ``no_wrap`` only the last column may break into lines, where a terminal has the room.
    """
    out = _Table(
        title=printable(title),
        title_justify="left",
        box=SIMPLE_HEAD,
        pad_edge=False,
        collapse_padding=True,
    )
    for name in columns:
        justify: JustifyMethod = "left" if name in left else "right"
        out.add_column(
            _heading(name),
            justify=justify,
            overflow="fold",
            no_wrap=no_wrap and name != columns[-1],
        )
    return out


def _heading(name: str) -> str:
    """Return the heading of a column: a unit stands in a line of its own."""
    return printable(name).replace(" [", "\n[")


class _Table(Table):
    """A table whose cells can all be printed."""

    def add_row(self, *cells: Any, **how: Any) -> None:  # noqa: ANN401 (as its parent has them)
        """Add a row."""
        super().add_row(*(printable(x) if isinstance(x, str) else x for x in cells), **how)


@contextmanager
def live_table(
    shown: Any,  # noqa: ANN401
    said: Any,  # noqa: ANN401
    states: Sequence[str],
    counted: Sequence[str],
) -> Iterator[None]:
    """Show the numbers of a session on stderr while it runs, where that is a terminal.

    Args:
        shown: Shared memory of as many numbers as :data:`mitt.robot.cell.session.SHOWN` has.
        said: Shared memory of what is odd, in words.
        states: What the first of the numbers counts, in words.
        counted: What comes, what becomes of it and what of that, in words, as of :func:`picture`.
    """
    if not sys.stderr.isatty():
        yield
        return
    drawer = get_context("spawn").Process(
        target=_draw, args=(shown, said, states, counted), daemon=True
    )
    with safe_path():
        drawer.start()
    try:
        yield
    finally:
        drawer.terminate()
        drawer.join()


def _draw(shown: Any, said: Any, states: Sequence[str], counted: Sequence[str]) -> None:  # noqa: ANN401
    """Draw, four times a second, until ended."""
    end_with_parent()
    pause = Event()
    with Live(console=Console(stderr=True), auto_refresh=False, transient=True) as live:
        while True:
            odd = said.value.decode(errors="replace")
            live.update(picture(list(shown), states, counted, odd), refresh=True)
            pause.wait(0.25)


def picture(
    numbers: list[float], states: Sequence[str], counted: Sequence[str], odd: str = ""
) -> Table:
    """Return the table of some numbers, in the order of :data:`mitt.robot.cell.session.SHOWN`.

    Args:
        numbers: The numbers.
        states: What the first of them counts, in words.
        counted: What comes and what becomes of it: throws, caught; or parts, met, placed.
        odd: What is odd in what the robot and the ball's source send; nothing if nothing is.
    """
    mode, rate, age, late, lost, come, taken, told, placed = numbers
    table = Table(show_header=False, title="mitt run", title_justify="left")
    rows = {
        "state": states[int(mode)],
        "rate": f"{rate:.0f} Hz",
        "reading to command": f"{age:.0f} us",
        "late readings": f"{late:.0f}",
        "lost readings": f"{lost:.0f}",
        counted[0]: f"{come:.0f}",
        counted[1]: f"{taken:.0f} of {told:.0f}" if told else "unknown",
        **dict.fromkeys(counted[2:], f"{placed:.0f}" if told else "unknown"),
        **({"odd": odd} if odd else {}),
    }
    for name, value in rows.items():
        table.add_row(name, Text(value))
    return table
