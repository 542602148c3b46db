"""What ``mitt catch``, ``mitt meet`` and ``mitt bat`` do: prepare, run, keep, show."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Protocol

from rich.table import Table

import mitt
from mitt.cli.line import parse
from mitt.cli.screen import (
    checked,
    print_json,
    progress,
    say,
    show,
    table,
    tell_of_kernels,
    warn,
    worth_a_row,
)
from mitt.clock import Progress
from mitt.errors import FileError
from mitt.files.writing import locked
from mitt.interrupts import notice, status_of, words_of
from mitt.reading import changed_file
from mitt.trials.journal import Kept
from mitt.trials.result import kept_words
from mitt.trials.scored_task import PAGE, RESULT
from mitt.trials.task_run import FinishedRun, TaskRun, run_trials, write_result


class PreparedRun(TaskRun, Protocol):
    """A run that a command has prepared."""

    @property
    def warnings(self) -> Sequence[str]:
        """What is odd about it, in words."""
        ...


@dataclass(frozen=True, slots=True, kw_only=True)
class RunCommand:
    """What a command says of its task.

    Attributes:
        prepare: Reads and checks all that the options name.
        anew: Returns the options of a run again, in its folder.
        title: Of the table.
        columns: Its columns, the first two trial and status.
        left: Columns that are aligned to the left.
        row: Returns a trial as cells.
        lines: What the trials come to, and hints, a line each.
    """

    prepare: Callable[[Any], PreparedRun]
    anew: Callable[[Any, Path], Any]
    title: Callable[[FinishedRun], str]
    columns: Sequence[str]
    left: Sequence[str]
    row: Callable[[Any], tuple[str, ...]]
    lines: Callable[[FinishedRun, dict[str, Any]], Sequence[str]]


def run_of(command: RunCommand, options: Any) -> int:  # noqa: ANN401 (those of the command)
    """Run trials as a command's options say; return the exit status."""
    run = command.prepare(options)
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
        _show(command, finished, result)
    warnings = [] if finished.runner.warning is None else [finished.runner.warning]
    warn(warnings, json=options.json)
    if finished.interrupt is not None:
        kept = kept_words(len(finished.trials), run.count, run.out)
        say(f"{words_of(finished.interrupt)}; {kept}")
    return finished.status


def _run(run: TaskRun, report: Progress) -> FinishedRun:
    """Run and write; an interrupt that comes while pages are drawn leaves the result."""
    from mitt.report.outputs import write_page  # noqa: PLC0415 (plots: when written)

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
    show(table_of(command, command.title(finished), shown))
    if len(shown) < len(trials):
        show(f"{len(trials) - len(shown)} more {task.in_result}, all in result.json")
    page = finished.run.out / (PAGE if finished.whole else RESULT)
    show(*command.lines(finished, result["summary"]), f"written: {page}")


def table_of(command: RunCommand, title: str, trials: Sequence[Any]) -> Table:
    """Return the table of some trials."""
    out = table(title, command.columns, left=command.left, no_wrap=True)
    for trial in trials:
        out.add_row(*command.row(trial))
    return out


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
