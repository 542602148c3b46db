"""What a run leaves in its folder: throws, result, map, recordings, report."""

import shlex
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np

from mitt.clock import Progress
from mitt.files.maps import save_map
from mitt.files.recordings import write_recording
from mitt.files.writing import claim_folder, write_json
from mitt.interrupts import finally_do
from mitt.map.learn import Learned
from mitt.report.run_page import ReportContent, write_report
from mitt.trials.log import recording_of
from mitt.trials.result import LEAVES, MAP, PAGE, RESULT, Journal
from mitt.trials.runner import LoggedTrial, TrialRunner
from mitt.trials.runs import FinishedRun, Prepared, make_runner
from mitt.trials.score import Trial
from mitt.trials.source import release_of

#: A throw with fewer ticks has nothing to draw.
_FEWEST_TICKS = 50


@contextmanager
def keeping(prepared: Prepared, learned: Learned) -> Iterator[Callable[[Trial], None]]:
    """Claim the folder of a run and give what keeps each throw in it as it ends.

    A process that cannot be reached by a signal leaves the result of the throws that are done.
    """
    claim_folder(prepared.out, LEAVES, overwrite=prepared.settings.overwrite)
    journal = Journal(prepared.out, prepared.head, prepared.source.count, again=prepared.again)
    with journal, finally_do(journal.last_words):
        save_map(prepared.out / MAP, learned)
        yield journal.add


def write_outputs(finished: FinishedRun, *, progress: Progress) -> None:
    """Fill the claimed folder of a run; the result first, so that it is never lost.

    An interrupted run has the result of what is done and nothing that would take time.
    """
    prepared = finished.prepared
    write_json(prepared.out / RESULT, finished.result)
    if finished.trials and finished.interrupt is None:
        _write_recordings(finished, progress)
        write_page(finished, finished.result, progress=progress)


def write_page(finished: FinishedRun, result: dict[str, Any], *, progress: Progress) -> None:
    """Write the page of a run, for its result as the folder has it."""
    progress("report", 0, 1)
    content = _content(finished, result)
    write_report(finished.prepared.out / PAGE, content)
    progress("report", 1, 1)


def _write_recordings(finished: FinishedRun, progress: Progress) -> None:
    """Throw the balls to be recorded once more, which gives the same trials, and record them."""
    prepared, record = finished.prepared, finished.prepared.settings.record
    kept = [
        t.index
        for t in finished.trials
        if record == "all" or (record == "failures" and (t.index == 0 or t.status != "caught"))
    ]
    runner = make_runner(prepared, finished.learned, generator=prepared.settings.generator)
    clocks = {t.index: t.clock for t in finished.trials}
    for done, index in enumerate(kept):
        progress("recordings", done, len(kept))
        clock = clocks[index]
        runner.clock_offset = 0.0 if clock is None else float(clock["offset_s"] or 0.0)
        images = prepared.settings.record_images and prepared.settings.vision == "pixels"
        outcome = runner.throw(prepared.source, index, log=True, images=images)
        if outcome.log is not None:
            about = runner.about(prepared.settings.generator, finished.learned.map)
            recording = recording_of(outcome.log, outcome.trial, about, prepared.head)
            write_recording(prepared.out / "recordings" / f"throw-{index:05d}.mcap", recording)
    progress("recordings", len(kept), len(kept))


def _content(finished: FinishedRun, result: dict[str, Any]) -> ReportContent:
    """Collect what the report shows; alpha = 0 is thrown beside it, if the run was not that."""
    prepared, learned = finished.prepared, finished.learned
    generator = prepared.settings.generator
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
        command=shlex.join(["mitt", "catch", *prepared.again.get("words", [])]),
        releases=np.array([release_of(ball) for ball in balls]),
    )


def _shown(runner: TrialRunner, prepared: Prepared) -> LoggedTrial | None:
    """Return the first throw with its log; None where it ended before it began."""
    outcome = runner.throw(prepared.source, 0, log=True)
    return outcome if outcome.log is not None and len(outcome.log.t) >= _FEWEST_TICKS else None
