"""What ``mitt catch``, ``mitt meet`` and ``mitt bat`` do: prepare, run, keep, show."""

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import Any, TypeVar

from rich.table import Table

import mitt
from mitt.cli.line import options_of, parse
from mitt.cli.options import COMMANDS, Options, TaskOptions
from mitt.cli.screen import (
    beyond_words,
    checked,
    print_json,
    progress,
    rate_words,
    repeated,
    run_folder,
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
from mitt.io.writing import check_ours, locked
from mitt.lab.trials.journal import Kept
from mitt.lab.trials.prepared import TaskRun
from mitt.lab.trials.result import kept_words
from mitt.lab.trials.scored_task import PAGE, RESULT, ScoredTask
from mitt.lab.trials.task_run import FinishedRun, run_trials, write_result
from mitt.lab.trials.tasks import TASKS, KnownTask

_Options = TypeVar("_Options", bound=Options)
_Run = TypeVar("_Run")


def with_origin(prepare: Callable[[_Options], _Run], options: _Options, *, kept: str = "") -> _Run:
    """Return a prepared run that says what makes it again: its options, and the files it read.

    Args:
        prepare: Reads and checks all that the options name.
        options: What was said.
        kept: A file that need not be there again, as the run keeps what it says.
    """
    with noted() as read:
        run = prepare(options)
    read.pop(kept, None)
    files = [x.field for x in options_of(type(options)) if x.names_file]
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
    prepare: Callable[[Any], TaskRun]
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
    """Return the command of a task: its own, or else that of all tasks."""
    known, module = TASKS[task], import_module(f"mitt.cli.{COMMANDS[task].module}")
    own: RunCommand | None = vars(module).get(f"{task}_command")
    return own or RunCommand(task=known.scored, prepare=partial(_prepared_by, known))


def _prepared_by(known: KnownTask, options: TaskOptions) -> TaskRun:
    """Read and check all that a run needs, by what the task says of that."""
    task = known.scored

    def prepared(options: TaskOptions) -> TaskRun:
        if known.prepare is None:
            raise RuntimeError(f"the task {task.name} has no command")
        out = run_folder(options, f"{task.name}-{options.seed}")
        run = known.prepare(options, out)
        if not options.check:
            check_ours(out, task.leaves)
        return run

    return with_origin(prepared, options)


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
