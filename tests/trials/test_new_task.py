"""A task is one file, a line in ``TASKS``, and the options of its command in ``COMMANDS``.

The file, in ``lab/trials``, is this module, of a task to touch the ball with the back of the hand:
what its trials count, its runner, its study and its run.
"""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
import pytest
from pydantic import Field
from small_study import Here, written

import mitt
from mitt.cli.main import main
from mitt.cli.options import COMMANDS, TaskOptions, Trials
from mitt.clock import Progress, Stopwatch
from mitt.io.recordings import Recording
from mitt.lab.trials.prepared import OptionsRun
from mitt.lab.trials.scored_task import NAME, PAGE, RESULT, Measure, ScoredTask
from mitt.lab.trials.study import Chunk, Condition, RunnerStudy
from mitt.lab.trials.study_file import (
    ConditionSettings,
    Names,
    StudySettings,
    head_of,
    read_settings,
    spelled,
)
from mitt.lab.trials.tasks import TASKS, KnownTask


@dataclass(frozen=True, slots=True, kw_only=True)
class TouchTrial:
    """One trial, as every task has it, and the speed at the touch."""

    index: int
    status: str
    limit_violations: int
    binding_limit: str | None
    speed_m_s: float | None
    stopped_by: dict[str, Any] | None = None


TOUCH = ScoredTask(
    name="touch",
    schema="mitt.touch-study/1",
    trial=TouchTrial,
    trials="trials",
    doing="touching",
    in_result="throws",
    statuses=("touched", "missed", "unreachable", "stopped", "aborted"),
    rate="touch_rate",
    counted="balls touched",
    measures={"speed_m_s": Measure("speed at the touch [m/s]", "speed_m_s", 2)},
    medians={},
    more=lambda _: {},
)


class TouchRunner:
    """Two of three balls are touched; no world is simulated, which other tests do."""

    def __init__(self, seed: int) -> None:
        self._seed, self.stopwatch, self.warning = seed, Stopwatch(), None
        self.said: Mapping[str, object] = {}

    def trial(self, index: int) -> TouchTrial:
        """Run a trial."""
        missed = index % 3 == 2
        return TouchTrial(
            index=index,
            status="missed" if missed else "touched",
            limit_violations=0,
            binding_limit="time" if missed else None,
            speed_m_s=None if missed else np.random.default_rng([self._seed, index]).uniform(1, 2),
        )

    def recording(self, trial: TouchTrial) -> Recording:
        """Refuse: nothing is simulated."""
        raise NotImplementedError

    def keep(self, folder: Path) -> None:
        """Keep nothing beside the trials."""


class TouchStudySettings(StudySettings):
    """The file of a study of touching."""

    task: Literal["touch"]
    generators: Names = ("direct",)
    conditions: Annotated[tuple[ConditionSettings, ...], Field(strict=False)] = ()


class TouchStudy(RunnerStudy):
    """A study of touching that can run."""

    kind: ClassVar[ScoredTask] = TOUCH

    conditions: Annotated[tuple[Condition, ...], Field(strict=False)]

    @property
    def setting(self) -> str:
        """What its page says of arm and hand."""
        return "wam, the back of its hand"

    def runner(self, chunk: Chunk, *, keeps: bool = False) -> TouchRunner:  # noqa: ARG002
        """Return a fresh runner for a chunk."""
        return TouchRunner(self.seed)


def read_touch_study(path: Path) -> TouchStudy:
    """Read the file of a study of touching."""
    path, settings = read_settings(path, TouchStudySettings, ("direct",))
    given = spelled(settings, ConditionSettings, path)
    conditions = [Condition(**x.common, scene=x.world()) for x in given]
    return TouchStudy(**head_of(settings, path, conditions))


@dataclass(frozen=True, slots=True, kw_only=True)
class TouchOptions(TaskOptions):
    """Touch balls with the back of the hand; print a table and write DIR.

    Attributes:
        throws: Number of throws.
    """

    examples: ClassVar = ("mitt touch --throws 3",)

    throws: Trials = 3


@dataclass(frozen=True, slots=True, kw_only=True)
class TouchRun(OptionsRun):
    """A run of touches that can start."""

    task: ClassVar[ScoredTask] = TOUCH

    @property
    def count(self) -> int:
        """Number of throws."""
        return int(self.options.throws)

    @property
    def head(self) -> dict[str, object]:
        """What the result says of the run."""
        return {"version": mitt.__version__, "arm": "wam", "limits": "paper", "generator": "direct"}

    def begin(self, progress: Progress) -> TouchRunner:  # noqa: ARG002 (learns nothing)
        """Return what runs the trials."""
        return TouchRunner(0)


def prepare_touches(options: TouchOptions, out: Path) -> TouchRun:
    """Return a run that can start; a task with an arm reads and checks it here."""
    return TouchRun(options=options, out=out)


@pytest.fixture
def _registered(monkeypatch: pytest.MonkeyPatch) -> None:
    """Register the task, and the options of its command."""
    known = KnownTask(TOUCH, TouchStudy, read_touch_study, prepare_touches)
    monkeypatch.setitem(TASKS, "touch", known)
    monkeypatch.setitem(COMMANDS, "touch", TouchOptions)
    monkeypatch.setattr("mitt.cli.measuring.engine_of", lambda *_: Here())


@pytest.mark.usefixtures("_registered")
def test_a_registered_task_has_a_command_a_page_and_a_study(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Its table, result, journal and page; the page of a run that died; a study and its page."""
    run, folder = tmp_path / "run", tmp_path / "study"
    assert main(["touch", "--throws", "4", "--out", str(run)]) == 0
    assert "touched 3 of 4: 75.0 %" in capsys.readouterr().out
    result = json.loads((run / RESULT).read_text())
    assert result["summary"]["touch_rate"] == 0.75
    page = (run / PAGE).read_text()
    assert "3 of 4 balls touched" in page
    assert TOUCH.done == "The ball was touched."  # what a replay says of it
    assert "Speed at the touch" in page
    assert (run / NAME).read_text().count("\n") == 5
    (run / PAGE).unlink()
    (run / RESULT).unlink()
    assert main(["report", str(run)]) == 0
    assert "3 of 4 balls touched" in (run / PAGE).read_text()
    text = 'task = "touch"\nname = "small"\ntrials = 6\n[[conditions]]\nname = "clean"\n'
    assert main(["study", str(written(tmp_path, text)), "--out", str(folder)]) == 0
    assert json.loads((folder / "summary.json").read_text())["rows"][0]["touched"] == 4
    assert main(["report", str(folder)]) == 0
    assert "wam, the back of its hand" in (folder / PAGE).read_text()
