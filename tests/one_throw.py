"""One throw at the learned map and at alpha = 0, shared by the tests of what people see."""

import numpy as np
import pytest

from mitt.core.arm.arm import Arm
from mitt.core.catcher.generators import Direct, Unoptimised
from mitt.core.map.learn import Learned
from mitt.core.map.mapping import DirectMap
from mitt.lab.trials.runner import LoggedTrial, TrialRunner
from mitt.lab.trials.source import aim_of
from mitt.lab.world.scene import Scene
from mitt.lab.world.throws import Throw, default_throw


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
