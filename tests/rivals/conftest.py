"""What the rivals' tests share: throws as the filter would know them, and a bench."""

from collections.abc import Callable

import numpy as np
import pytest

from mitt.core.arm.arm import Arm
from mitt.core.map.learn import Learned
from mitt.core.signals import BallState
from mitt.lab.bench.libraries import ball_at
from mitt.lab.rivals.intercept import Chooser
from mitt.lab.trials.source import aim_of
from mitt.lab.world.throws import Throw, default_throw


@pytest.fixture(scope="session")
def chooser(learned: Learned) -> Chooser:
    """Chooses catches for the WAM."""
    return Chooser(learned.map)


@pytest.fixture(scope="session")
def throw_of(arm: Arm) -> Callable[[int], Throw]:
    """Default throws by seed."""
    aim = aim_of(arm)
    return lambda seed: default_throw(np.random.default_rng(seed), aim)


@pytest.fixture(scope="session")
def ball_of(throw_of: Callable[[int], Throw]) -> Callable[[int, float], BallState]:
    """A default throw by seed, known exactly some time after its release."""
    return lambda seed, t: ball_at(throw_of(seed), t, sigma=1e-4)
