"""The page of a run as it is written, and what each task shows on it besides what all show."""

import shlex
from collections.abc import Callable
from typing import Any, Final

from mitt.clock import Progress
from mitt.io.writing import write_text
from mitt.lab.report.bat_blocks import bat_blocks
from mitt.lab.report.catch_blocks import catch_blocks
from mitt.lab.report.meet_blocks import meet_blocks
from mitt.lab.report.run_page import Blocks, run_page
from mitt.lab.trials.scored_task import PAGE
from mitt.lab.trials.task_run import FinishedRun

BLOCKS: Final[dict[str, Callable[[FinishedRun, dict[str, Any]], Blocks]]] = {
    "catch": catch_blocks,
    "meet": meet_blocks,
    "bat": bat_blocks,
}
"""What a task shows on the page of a run, by its name; a task without has the page of all tasks."""


def blocks_of(finished: FinishedRun, result: dict[str, Any]) -> Blocks:
    """Return what the task of a run shows; a trial that was not kept is run once more for it."""
    of = BLOCKS.get(finished.run.task.name)
    return Blocks() if of is None else of(finished, result)


def write_page(finished: FinishedRun, result: dict[str, Any], *, progress: Progress) -> None:
    """Write the page of a run into its folder, whole or not at all.

    Args:
        finished: The run.
        result: Its result, as the folder has it.
        progress: Is told how far it is.

    Raises:
        FileError: The file cannot be written.
    """
    run = finished.run
    progress("report", 0, 1)
    typed = shlex.join(["mitt", run.task.name, *run.again.get("words", [])])
    text = run_page(run.task, result, blocks_of(finished, result), command=typed)
    write_text(run.out / PAGE, text)
    progress("report", 1, 1)
