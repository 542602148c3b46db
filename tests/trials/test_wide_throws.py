"""Throws far from the default ones: within every limit, and refused only where that is settled."""

from dataclasses import replace

import pytest
from support import thorough

from mitt.core.map.learn import Learned
from mitt.core.map.neighbourhood import learn
from mitt.io.load import build_arm
from mitt.lab.trials.registry import make_generator
from mitt.lab.trials.runner import TrialRunner
from mitt.lab.trials.score import Trial
from mitt.lab.trials.source import Source, source_of
from mitt.lab.world.scene import Scene, scene_of
from mitt.lab.world.throws import ThrowRanges

#: Throws and ball of the study show-throws; seeds on which nothing else is measured.
FLAT = ThrowRanges(speed=(7.0, 10.0), duration=(0.28, 0.42), distance=(2.0, 4.2), height=(0.0, 1.2))
ASKEW = ThrowRanges(azimuth=(-1.05, 1.05))
HIGH = ThrowRanges(speed=(5.0, 9.0), duration=(0.80, 1.20), distance=(2.0, 4.5))
SEED = 5100
COUNT = 8


@pytest.fixture(scope="module")
def maps() -> dict[str, Learned]:
    """A map for each limit set."""
    return {name: learn(build_arm("wam", limits=name)) for name in ("paper", "wam-80v", "wam-48v")}


def lab(**ball: float) -> Scene:
    """Return the scene lab with another ball."""
    return scene_of({"ball": ball}, place="test", base="lab")


def thrown(learned: Learned, ranges: ThrowRanges, scene: Scene) -> list[Trial]:
    """Throw a few balls by points."""
    f = learned.map
    runner = TrialRunner(f.arm, make_generator("direct", f), scene, pixels=False)
    source: Source = source_of(f.arm, seed=SEED, count=COUNT, drag=scene.ball.drag)
    source = replace(source, ranges=ranges)
    return [runner.throw(source, k).trial for k in range(COUNT)]


@pytest.mark.parametrize("limits", thorough(["wam-48v"], ["wam-80v"]))
@pytest.mark.parametrize("ranges", [FLAT, ASKEW], ids=["flat", "askew"])
def test_fast_throws_keep_the_motors_torque_speed_lines(
    maps: dict[str, Learned], limits: str, ranges: ThrowRanges
) -> None:
    """No tick is beyond a limit, though torques act a millisecond after they were commanded."""
    trials = thrown(maps[limits], ranges, lab())
    assert [trial.limit_violations for trial in trials] == [0] * COUNT
    lost = 2 if (ranges, limits) == (FLAT, "wam-80v") else 1
    assert sum(trial.status == "caught" for trial in trials) >= COUNT - lost


@pytest.mark.thorough
def test_a_high_throw_is_refused_only_once_it_comes_near(maps: dict[str, Learned]) -> None:
    """A motion that is begun half a second before the catch catches what one at first cannot."""
    trials = thrown(maps["paper"], HIGH, lab())
    assert sum(trial.status == "caught" for trial in trials) >= COUNT // 2
    assert not any(trial.limit_violations for trial in trials)
