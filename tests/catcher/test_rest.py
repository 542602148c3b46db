"""What a catcher says of an arm that rests; ``soak/rest.py`` gives large doses."""

import numpy as np
import pytest
from exact_plant import SETTINGS
from soak import rest

from mitt.core.arm.arm import Arm
from mitt.core.catcher.catcher import Catcher
from mitt.core.catcher.generators import Direct
from mitt.core.map.learn import Learned
from mitt.lab.trials.runner import TrialRunner
from mitt.lab.trials.source import source_of
from mitt.lab.world.scene import Scene

THROWS = 10
SEED = 9000


@pytest.mark.parametrize("plant", ["exact", "true"])
def test_an_arm_that_is_done_moves_no_more(arm: Arm, learned: Learned, plant: str) -> None:
    """After throws, stops, a ball that stays in the air, and a motion with a pause in it."""
    generator, scene = Direct(learned.map), Scene()
    drag = 0.0 if plant == "exact" else scene.ball.drag
    source = source_of(arm, seed=SEED, count=THROWS, drag=drag)
    if plant == "exact":
        first = Catcher(arm, learned, settings=SETTINGS)
        found = rest.exact(arm, first, generator, source, THROWS, SEED)
    else:
        found = rest.true(TrialRunner(arm, generator, scene, pixels=False), source, THROWS, SEED)
    assert found.faults == []
    assert found.over >= 0.8 * THROWS
    assert found.ticks > 100 * THROWS


def test_the_rule_of_rest_sees_an_arm_that_moves_on() -> None:
    """By a little more than an arm may creep, after a tick that said that it rests."""
    found, way = rest.Rested(), np.linspace(0.0, 1.01 * rest.CREEPS, 5)[:, None]
    found.judge("rests", [False] * 5, list(way))
    assert found.faults == []
    found.judge("moves", [True] + [False] * 4, list(way))
    assert len(found.faults) == 1
