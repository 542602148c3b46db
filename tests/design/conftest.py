"""A tiny search for the WAM, done once for the tests of designs."""

import fcntl
import os
from collections.abc import Sequence
from pathlib import Path

import pytest

from mitt.core.arm.arm import Arm
from mitt.core.arm.hands import HandModel
from mitt.lab.design.arm_design import Design, design
from mitt.lab.design.driven_arm import whole_arm
from mitt.lab.design.evaluation import Evaluation
from mitt.lab.design.search import RATE, Effort, search_of
from mitt.lab.design.search_jobs import Answers, Evaluator, SearchJob
from mitt.lab.design.task import Balls, DesignTask
from mitt.lab.world.scene import read_scene

#: A search that is over in seconds.
TINY = Effort(
    poses=4000,
    rounds=1,
    enough=200,
    changes=2,
    judged=4,
    generations=1,
    offspring=2,
    thrown=2,
    throws=(2, 2),
    parents=1,
    children=2,
    last=1,
    confirm=2,
    again=1,
    more=8,
    report=4,
    speeds=(5.0, 7.0),
    each_speed=2,
    sure=2,
    grid=3,
    slower=1,
)


def silent(name: str, done: int, of: int) -> None:
    """Tell nobody."""


def folder_of_all(factory: pytest.TempPathFactory) -> Path:
    """Return the folder that processes which test side by side share."""
    base = factory.getbasetemp()
    return base.parent if "PYTEST_XDIST_WORKER" in os.environ else base


@pytest.fixture(scope="session")
def whole() -> Arm:
    return whole_arm("wam", tip=None, limits="wam-80v", hand=HandModel())


@pytest.fixture(scope="session")
def task() -> DesignTask:
    return DesignTask(balls=Balls(), scene=read_scene("lab"), seed=3)


@pytest.fixture(scope="session")
def searched(
    whole: Arm, task: DesignTask, tmp_path_factory: pytest.TempPathFactory
) -> tuple[Design, list[tuple[str, SearchJob]]]:
    """The search, and what it asked of candidates in which stage.

    Processes that test side by side search once: the second finds the answers of the first.
    """
    folder, asked = folder_of_all(tmp_path_factory), list[tuple[str, SearchJob]]()
    inner = Evaluator._worth

    def noted(self: Evaluator, name: str, jobs: Sequence[SearchJob]) -> list[Evaluation]:
        asked.extend((name, job) for job in jobs)
        return inner(self, name, jobs)

    search = search_of(whole, task, TINY, joints=None, rate=RATE)
    with (folder / "search.lock").open("w") as lock, pytest.MonkeyPatch.context() as patch:
        fcntl.flock(lock, fcntl.LOCK_EX)
        answers = Answers.open(folder / "search.jsonl", search, resume=True)
        patch.setattr(Evaluator, "_worth", noted)
        found = design(whole, task, TINY, progress=silent, answers=answers)
        answers.close(done=False)
    return found, asked


@pytest.fixture
def answered(found: Design, tmp_path_factory: pytest.TempPathFactory) -> list[bytes]:
    """The lines of the file of answers that the search came to; the first is the file's head."""
    assert found.best is not None
    return (folder_of_all(tmp_path_factory) / "search.jsonl").read_bytes().splitlines(keepends=True)


@pytest.fixture(scope="session")
def found(searched: tuple[Design, list[tuple[str, SearchJob]]]) -> Design:
    return searched[0]
