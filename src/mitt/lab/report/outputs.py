"""The page of a run, by its task.

What it shows of one trial is run once more where it was not kept.
.
"""

import shlex
from collections.abc import Callable, Mapping
from typing import Any, Final

import numpy as np

from mitt.clock import Progress
from mitt.lab.report.bat_page import BatContent, write_bat_page
from mitt.lab.report.meet_page import write_meet_page
from mitt.lab.report.run_page import ReportContent, write_report
from mitt.lab.trials.batting import BatRunner
from mitt.lab.trials.log import TrialLog
from mitt.lab.trials.meeting import MeetRunner
from mitt.lab.trials.runner import LoggedTrial, TrialRunner
from mitt.lab.trials.runs import Prepared, ThrownBalls, make_runner
from mitt.lab.trials.scored_task import PAGE
from mitt.lab.trials.source import release_of
from mitt.lab.trials.task_run import FinishedRun

#: A throw with fewer ticks has nothing to draw.
_FEWEST_TICKS = 50


def write_page(finished: FinishedRun, result: dict[str, Any], *, progress: Progress) -> None:
    """Write the page of a run, for its result as the folder has it."""
    progress("report", 0, 1)
    _WRITERS[finished.run.task.name](finished, result)
    progress("report", 1, 1)


def _typed(finished: FinishedRun) -> str:
    """Return the command that made a run."""
    run = finished.run
    return shlex.join(["mitt", run.task.name, *run.again.get("words", [])])


def _write_throws(finished: FinishedRun, result: dict[str, Any]) -> None:
    """Write the page of throws."""
    write_report(finished.run.out / PAGE, _content(finished, result))


def _content(finished: FinishedRun, result: dict[str, Any]) -> ReportContent:
    """Collect what the report shows; alpha = 0 is thrown beside it, if the run was not that."""
    prepared, throws = finished.run, finished.runner
    if not isinstance(prepared, Prepared) or not isinstance(throws, ThrownBalls):
        raise TypeError("a run of throws has a page of throws")
    learned, generator = throws.learned, prepared.settings.generator
    runner = make_runner(prepared, learned, generator=generator)
    plain = None
    if generator != "unoptimised":
        plain = make_runner(prepared, learned, generator="unoptimised")
    balls = [prepared.source.ball(trial.index) for trial in finished.trials]
    return ReportContent(
        result=result,
        arm=prepared.arm,
        scene=prepared.scene,
        steps=learned.steps if len(learned.maps) > 1 else None,
        direct=_shown(runner, prepared),
        unoptimised=None if plain is None else _shown(plain, prepared),
        command=_typed(finished),
        releases=np.array([release_of(ball) for ball in balls]),
    )


def _shown(runner: TrialRunner, prepared: Prepared) -> LoggedTrial | None:
    """Return the first throw with its log; None where it ended before it began."""
    outcome = runner.throw(prepared.source, 0, log=True)
    return outcome if outcome.log is not None and len(outcome.log.t) >= _FEWEST_TICKS else None


def _write_meetings(finished: FinishedRun, result: dict[str, Any]) -> None:
    """Write the page of meetings, with the course of the first."""
    runner = finished.runner
    if not isinstance(runner, MeetRunner):
        raise TypeError("a run of meetings has a page of meetings")
    course = runner.first_course
    write_meet_page(finished.run.out / PAGE, result, course, command=_typed(finished))


def _write_bats(finished: FinishedRun, result: dict[str, Any]) -> None:
    """Write the page of balls that were hit back, with the log of the first."""
    runner = finished.runner
    if not isinstance(runner, BatRunner):
        raise TypeError("a run of batting has a page of batting")
    hit = next((t.index for t in finished.trials if t.status == "hit"), None)
    log: TrialLog | None = None if hit is None else runner.log_of_hit(hit)
    content = BatContent(
        result=result, arm=runner.arm, scene=runner.scene, log=log, command=_typed(finished)
    )
    write_bat_page(finished.run.out / PAGE, content)


#: Writers of pages by task.
_WRITERS: Final[Mapping[str, Callable[[FinishedRun, dict[str, Any]], None]]] = {
    "catch": _write_throws,
    "meet": _write_meetings,
    "bat": _write_bats,
}
