"""One throw at the learned map and at alpha = 0, shared by the tests of what people see."""

import numpy as np
import pytest

from mitt.arm.arm import Arm
from mitt.catcher.generators import Direct, Unoptimised
from mitt.map.learn import Learned
from mitt.map.mapping import DirectMap
from mitt.trials.runner import LoggedTrial, TrialRunner
from mitt.trials.source import aim_of
from mitt.world.scene import Scene
from mitt.world.throws import Throw, default_throw


@pytest.fixture(scope="session")
def scene() -> Scene:
    """The default world."""
    return Scene()


@pytest.fixture(scope="session")
def throw(arm: Arm) -> Throw:
    """A default throw."""
    return default_throw(np.random.default_rng(5), aim_of(arm))


@pytest.fixture(scope="session")
def direct(arm: Arm, learned: Learned, scene: Scene, throw: Throw) -> LoggedTrial:
    """The throw with the learned map, seen as points."""
    return TrialRunner(arm, Direct(learned.map), scene, pixels=False).run(
        0, throw, seed=3, log=True
    )


@pytest.fixture(scope="session")
def unoptimised(arm: Arm, plain: DirectMap, scene: Scene, throw: Throw) -> LoggedTrial:
    """The same throw with alpha = 0."""
    return TrialRunner(arm, Unoptimised(plain), scene, pixels=False).run(0, throw, seed=3, log=True)
