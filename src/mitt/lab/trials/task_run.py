"""A run of trials of whatever task: claim a folder, run, keep each trial, and the result.

An interrupt ends the run and keeps what is done; a process that cannot be reached by a signal
leaves the result of the trials that are done.
"""

from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass, field
from typing import Any, final

from mitt.clock import Progress, settled
from mitt.interrupts import finally_do, notice, status_of
from mitt.io.recordings import write_recording
from mitt.io.writing import claim_folder, write_json
from mitt.lab.trials.journal import Journal
from mitt.lab.trials.prepared import TaskRun, Trials
from mitt.lab.trials.result import result
from mitt.lab.trials.scored_task import RESULT


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class FinishedRun:
    """A run that is over, by itself or because it was interrupted.

    Attributes:
        run: The run.
        runner: What has run its trials.
        trials: The trials that ended.
        interrupt: Exit status after an interrupt.
    """

    run: TaskRun
    runner: Trials
    trials: Sequence[Any] = field(default_factory=list)
    interrupt: int | None = None

    @property
    def status(self) -> int:
        """Exit status of the command."""
        return self.interrupt or 0

    @property
    def whole(self) -> bool:
        """Whether there are trials, and none is missing."""
        return bool(self.trials) and self.interrupt is None

    @property
    def result(self) -> dict[str, Any]:
        """The result as the contract writes it."""
        run, head = self.run, {**self.run.head, **self.runner.said}
        return result(run.task, self.trials, self.runner.stopwatch, head, run.count)


Keep = Callable[[Any], None]
"""Keeps a trial that has ended."""


@contextmanager
def keeping(run: TaskRun, runner: Trials) -> Iterator[Keep]:
    """Claim the folder of a run and give what keeps each trial in it as it ends."""
    claim_folder(run.out, run.task.leaves, overwrite=run.overwrite)
    journal = Journal(run.out, run.task, run.head, run.count, again=run.again)

    def keep(trial: Any) -> None:  # noqa: ANN401
        journal.add(trial)
        if run.records(trial):
            write_recording(run.out / run.task.recording(trial.index), runner.recording(trial))

    with journal, finally_do(journal.last_words):
        runner.keep(run.out)
        yield keep


def run_trials(
    run: TaskRun,
    *,
    progress: Progress,
    keeps: Callable[[TaskRun, Trials], AbstractContextManager[Keep]] = keeping,
) -> FinishedRun:
    """Run all trials, each kept as it ends; an interrupt keeps those that are done.

    Args:
        run: The run.
        progress: Is told how far it is.
        keeps: Gives what keeps each trial; called when the first is about to begin.
    """
    runner, doing = run.begin(progress), run.task.doing
    trials: list[Any] = []
    interrupt = None
    try:
        with settled(), keeps(run, runner) as keep:
            for index in range(run.count):
                progress(doing, index, run.count)
                trial = runner.trial(index)
                trials.append(trial)
                keep(trial)
        progress(doing, run.count, run.count)
    except KeyboardInterrupt as stop:
        notice()
        interrupt = status_of(stop)
    return FinishedRun(run=run, runner=runner, trials=trials, interrupt=interrupt)


def write_result(finished: FinishedRun) -> dict[str, Any]:
    """Write the result of a run into its folder, which is claimed; return it."""
    said = finished.result
    write_json(finished.run.out / RESULT, said)
    return said
