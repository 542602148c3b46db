"""The compiled loop and the way through Python are the same trial, byte for byte."""

import numpy as np
import pytest

from mitt.generator.generators import Direct
from mitt.generator.learn import Learned
from mitt.robot.arm import Arm
from mitt.study.source import source_of
from mitt.study.trial import Bench
from mitt.world.scene import Scene, Sensing
from mitt.world.simulation import World


@pytest.mark.parametrize("latency", [0, 1])
def test_both_ways_through_a_trial_are_the_same(
    arm: Arm, learned: Learned, latency: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Score, results of all ticks and true states do not tell which way a trial took.

    Images late or not, caught or not; one bench after the other, so that nothing is left over
    from a trial before.
    """
    scene = Scene(sensing=Sensing(latency=latency))
    source = source_of(
        learned.map, seed=77, count=2, throws_file=None, flights_file=None, drag=scene.ball.drag
    )
    ways = []
    for stepped in (False, True):
        bench = Bench(arm, Direct(learned.map), scene)
        if stepped:
            monkeypatch.setattr(World, "stage", property(lambda _: None))
        ways.append(
            [
                bench.run(k, source.ball(k), seed=source.trial_seed(k), log=True)
                for k in range(source.count)
            ]
        )
        assert bench.stopwatch.percentiles_us()["p50"] > 0.0
    for compiled, python in zip(*ways, strict=True):
        assert compiled.trial == python.trial
        assert compiled.log is not None
        assert python.log is not None
        for name in ("t", "phase", "encoders", "ball", "asked", "command", "tau", "hand"):
            mine, theirs = getattr(compiled.log, name), getattr(python.log, name)
            assert mine.tobytes() == theirs.tobytes(), name
        for name in ("t", "qpos", "qvel", "tau", "position", "velocity", "force", "seen"):
            mine, theirs = getattr(compiled.log.truth, name), getattr(python.log.truth, name)
            assert np.array_equal(mine, theirs), name
