"""A tiny search for the WAM, done once for the tests of designs."""

import pytest

from mitt.design.balls import Balls
from mitt.design.design import Design, design
from mitt.design.effort import Effort
from mitt.design.task import Task
from mitt.design.whole import whole_arm
from mitt.robot.arm import Arm
from mitt.robot.hands import HandModel
from mitt.world.scenes import read_scene

#: A search that is over in seconds.
TINY = Effort(
    poses=4000, rounds=1, enough=200, changes=2, judged=4, generations=1, offspring=2, thrown=2,
    throws=(2, 2), parents=1, children=2, last=1, confirm=3, again=1, report=4,
    speeds=(5.0, 7.0), each_speed=2, sure=3, grid=4, slower=1,
)  # fmt: skip


def silent(name: str, done: int, of: int) -> None:
    """Tell nobody."""


@pytest.fixture(scope="session")
def whole() -> Arm:
    return whole_arm("wam", tip=None, limits="wam-80v", hand=HandModel())


@pytest.fixture(scope="session")
def task() -> Task:
    return Task(balls=Balls(), scene=read_scene("lab"), seed=3)


@pytest.fixture(scope="session")
def found(whole: Arm, task: Task) -> Design:
    return design(whole, task, TINY, progress=silent)
