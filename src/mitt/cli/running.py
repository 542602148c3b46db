"""What ``mitt catch``, ``mitt meet`` and ``mitt bat`` do: prepare, run, keep, show."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from importlib import import_module
from pathlib import Path
from typing import Any, ClassVar, Protocol, TypeVar

from rich.table import Table

import mitt
from mitt.cli.line import parse
from mitt.cli.options import COMMANDS
from mitt.cli.screen import (
    beyond_words,
    checked,
    print_json,
    progress,
    rate_words,
    repeated,
    say,
    show,
    table,
    table_number,
    tell_of_kernels,
    warn,
    worth_a_row,
)
from mitt.clock import Progress
from mitt.core.errors import FileError
from mitt.interrupts import notice, status_of, words_of
from mitt.io.reading import changed_file, noted
from mitt.io.writing import locked
from mitt.lab.trials.journal import Kept
from mitt.lab.trials.result import kept_words
from mitt.lab.trials.scored_task import PAGE, RESULT, ScoredTask
from mitt.lab.trials.task_run import FinishedRun, TaskRun, recorded_as, run_trials, write_result


class PreparedRun(TaskRun, Protocol):
    """A run that a command has prepared."""

    @property
    def warnings(self) -> Sequence[str]:
        """What is odd about it, in words."""
        ...


@dataclass(frozen=True, slots=True, kw_only=True)
class OptionsRun:
    """What a run says that keeps the options of its command.

    Attributes:
        task: What is run.
        options: What was said.
        out: Folder to write.
        again: What makes the run again, as JSON: its options, and what it read.
    """

    task: ClassVar[ScoredTask]
    options: Any
    out: Path
    again: Mapping[str, Any] = field(default_factory=dict)

    @property
    def overwrite(self) -> bool:
        """Whether a folder with files in it may be used."""
        return bool(self.options.overwrite)

    @property
    def warnings(self) -> Sequence[str]:
        """Nothing is odd that is not refused."""
        return ()

    def records(self, trial: Any) -> bool:  # noqa: ANN401 (one of its task)
        """Say whether a trial is to be recorded."""
        return recorded_as(self.options.record, self.task, trial)


_Options = TypeVar("_Options")
_Run = TypeVar("_Run")


def with_origin(
    prepare: Callable[[_Options], _Run],
    options: _Options,
    files: Sequence[str],
    *,
    kept: str = "",
) -> _Run:
    """Return a prepared run that says what makes it again: its options, and the files it read.

    Args:
        prepare: Reads and checks all that the options name.
        options: What was said.
        files: Options that may name a file.
        kept: A file that need not be there again, as the run keeps what it says.
    """
    with noted() as read:
        run = prepare(options)
    read.pop(kept, None)
    again = {"words": repeated(options, files=files), "read": read}
    return replace(run, again=again)  # type: ignore[type-var]


def in_folder(options: Any, folder: Path) -> Any:  # noqa: ANN401 (those of a command)
    """Return the options of a run again, in its folder."""
    return replace(options, out=folder, overwrite=True)


def _title_of(finished: FinishedRun) -> str:
    """Return what is above the table of a run: what its result says of arm, limits, generator."""
    head = finished.run.head
    return ", ".join(str(head[x]) for x in ("arm", "limits", "generator") if x in head)


@dataclass(frozen=True, slots=True, kw_only=True)
class RunCommand:
    """The command that runs trials of a task; what it is not given follows from the task.

    Attributes:
        task: The task.
        prepare: Reads and checks all that the options name.
        title: Of the table.
        columns: Columns of the table, the first two trial and status; what the task measures
            where they are left out, as is ``row`` then.
        row: Returns a trial as cells.
        left: Columns that are aligned to the left.
        lines: What the trials come to, and hints, a line each; the rate, and what was beyond a
            limit, where left out.
        anew: Returns the options of a run again, in its folder.
    """

    task: ScoredTask
    prepare: Callable[[Any], PreparedRun]
    title: Callable[[FinishedRun], str] = _title_of
    columns: Sequence[str] = ()
    row: Callable[[Any], tuple[str, ...]] | None = None
    left: Sequence[str] = ("status", "why")
    lines: Callable[[FinishedRun, dict[str, Any]], Sequence[str]] | None = None
    anew: Callable[[Any, Path], Any] = in_folder

    def __call__(self, options: Any) -> int:  # noqa: ANN401 (those of the command)
        """Run trials as the options say; return the exit status."""
        run = self.prepare(options)
        warn(run.warnings, json=options.json)
        if options.check:
            return checked(f"{run.count} {run.task.in_result}, output to {run.out}")
        with locked(run.out):
            tell_of_kernels()
            with progress() as report:
                finished = _run(run, report)
        result = finished.result
        if options.json:
            print_json(result)
        else:
            _show(self, finished, result)
        warnings = [] if finished.runner.warning is None else [finished.runner.warning]
        warn(warnings, json=options.json)
        if finished.interrupt is not None:
            kept = kept_words(len(finished.trials), run.count, run.out)
            say(f"{words_of(finished.interrupt)}; {kept}")
        return finished.status

    def table(self, title: str, trials: Sequence[Any]) -> Table:
        """Return the table of some trials."""
        shown = self.task.shown
        columns = self.columns or ("trial", "status", *(x.words for x in shown), "why")
        out = table(title, columns, left=self.left, no_wrap=True)
        for trial in trials:
            out.add_row(*(self._plain_row(trial) if self.row is None else self.row(trial)))
        return out

    def _plain_row(self, trial: Any) -> tuple[str, ...]:  # noqa: ANN401 (one of its task)
        """Return a trial as cells: what the task measures."""
        row = asdict(trial)
        cells = [table_number(x.of(row), x.digits or 0) for x in self.task.shown]
        return str(trial.index), trial.status, *cells, row["binding_limit"] or ""

    def words(self, finished: FinishedRun, said: dict[str, Any]) -> Sequence[str]:
        """Return what the trials of a run come to, a line each."""
        if self.lines is not None:
            return self.lines(finished, said)
        task = self.task
        rate = f"{task.success} {rate_words(said, task.success, task.in_result)}"
        return [rate, *beyond_words(finished.trials)]


def command_of(task: str) -> RunCommand:
    """Return the command of a task, by its name; its options name the module that it stands in."""
    module = import_module(f"mitt.cli.{COMMANDS[task].module}")
    command: RunCommand = vars(module)[f"{task}_command"]
    return command


def _run(run: TaskRun, report: Progress) -> FinishedRun:
    """Run and write; an interrupt that comes while pages are drawn leaves the result."""
    from mitt.lab.report.outputs import write_page  # noqa: PLC0415 (plots: when written)

    finished = run_trials(run, progress=report)
    try:
        result = write_result(finished)
        if finished.whole:
            write_page(finished, result, progress=report)
    except KeyboardInterrupt as stop:
        notice()
        return replace(finished, interrupt=status_of(stop))
    return finished


def _show(command: RunCommand, finished: FinishedRun, result: dict[str, Any]) -> None:
    """Print the table of a run, and what it comes to."""
    task, trials = finished.run.task, finished.trials
    shown = worth_a_row(trials, task.success)
    show(command.table(command.title(finished), shown))
    if len(shown) < len(trials):
        show(f"{len(trials) - len(shown)} more {task.in_result}, all in result.json")
    page = finished.run.out / (PAGE if finished.whole else RESULT)
    show(*command.words(finished, result["summary"]), f"written: {page}")


def prepared_again(command: RunCommand, folder: Path, kept: Kept) -> TaskRun:
    """Return a run once more, from what its list of trials says.

    Raises:
        InputError: A file that it read holds something else now; MittError: one is not there.
    """
    words, read = kept.again.get("words"), kept.again.get("read")
    if not isinstance(words, list) or not isinstance(read, dict):
        raise FileError(str(folder), "a run that says what makes it again", "one that does not")
    if (version := kept.head.get("version")) != mitt.__version__:
        raise FileError(str(folder), f"a run of mitt {mitt.__version__}", f"one of {version}")
    _, options = parse([kept.task.name, *map(str, words)])
    run = command.prepare(command.anew(options, folder))
    if changed := changed_file(read, run.again["read"]):
        raise FileError(changed, "the file that the run read", "another content")
    return run
