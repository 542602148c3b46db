"""A run of whatever task that can start, and what runs its trials: what each task provides."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, ClassVar, Protocol, runtime_checkable

from mitt.clock import Progress, Stopwatch
from mitt.core.arm.arm import Arm
from mitt.io.recordings import Recording
from mitt.lab.trials.log import TrialLog
from mitt.lab.trials.scored_task import ScoredTask
from mitt.lab.world.scene import Scene


class Trials(Protocol):
    """What runs the trials of a run, one after the other."""

    @property
    def stopwatch(self) -> Stopwatch:
        """Times of the catcher's ticks."""
        ...

    @property
    def said(self) -> Mapping[str, object]:
        """What the result says of the run beside its head: what was learned on the way."""
        ...

    @property
    def warning(self) -> str | None:
        """What is odd about what was learned on the way; None where nothing is."""
        ...

    def trial(self, index: int) -> Any:  # noqa: ANN401 (one of its task)
        """Run a trial."""
        ...

    def recording(self, trial: Any) -> Recording:  # noqa: ANN401 (one of its task)
        """Return the recording of the last trial."""
        ...

    def keep(self, folder: Path) -> None:
        """Write what a run keeps beside its trials, before the first."""
        ...


@runtime_checkable
class Shown(Protocol):
    """What has run trials of which one can be shown in three dimensions."""

    @property
    def arm(self) -> Arm:
        """The arm."""
        ...

    @property
    def scene(self) -> Scene:
        """The world as the catcher is told of it."""
        ...

    def log_of_success(self, index: int) -> TrialLog:
        """Return the log of the first trial that did what it was to do, by its number."""
        ...


class TaskRun(Protocol):
    """A run that can start: every input read and found good."""

    @property
    def task(self) -> ScoredTask:
        """What is run."""
        ...

    @property
    def out(self) -> Path:
        """Folder to write."""
        ...

    @property
    def overwrite(self) -> bool:
        """Whether a folder with files in it may be used."""
        ...

    @property
    def count(self) -> int:
        """Number of trials."""
        ...

    @property
    def warnings(self) -> Sequence[str]:
        """What is odd about it, in words."""
        ...

    @property
    def head(self) -> Mapping[str, object]:
        """What the result says of the run."""
        ...

    @property
    def again(self) -> Mapping[str, Any]:
        """What makes the run again, as JSON: its options, and what it read."""
        ...

    def begin(self, progress: Progress) -> Trials:
        """Learn what is not there yet, and return what runs the trials."""
        ...

    def records(self, trial: Any) -> bool:  # noqa: ANN401 (one of its task)
        """Say whether a trial is to be recorded."""
        ...


def recorded_as(wanted: str, task: ScoredTask, trial: Any) -> bool:  # noqa: ANN401
    """Say whether a trial is recorded where ``none``, ``failures`` or ``all`` are wanted."""
    return wanted == "all" or (wanted == "failures" and trial.status != task.success)


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
