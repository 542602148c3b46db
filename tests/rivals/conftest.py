"""What the rivals' tests share: throws as the filter would know them, and a bench."""

from collections.abc import Callable

import numpy as np
import pytest

from mitt.flight import acceleration, advance
from mitt.generator.learn import Learned
from mitt.rivals.course import Chooser
from mitt.robot.arm import Arm
from mitt.signals import BallState
from mitt.study.neighbourhood import aim_of
from mitt.world.throws import Throw, default_throw

#: Drag of the thrown ball [1/m].
DRAG = 0.04


@pytest.fixture(scope="session")
def chooser(learned: Learned) -> Chooser:
    """Chooses catches for the WAM."""
    return Chooser(map=learned.map)


@pytest.fixture(scope="session")
def throw_of(arm: Arm) -> Callable[[int], Throw]:
    """Default throws by seed."""
    aim = aim_of(arm)
    return lambda seed: default_throw(np.random.default_rng(seed), aim)


@pytest.fixture(scope="session")
def ball_of(throw_of: Callable[[int], Throw]) -> Callable[[int, float], BallState]:
    """A default throw by seed, known exactly some time after its release."""

    def known(seed: int, t: float) -> BallState:
        throw = throw_of(seed)
        r, dr, ddr = throw.r.copy(), throw.dr.copy(), np.empty(3)
        advance(r, dr, DRAG, t)
        acceleration(dr, DRAG, ddr)
        return BallState(
            t=t, tracked=True, r_o=r, dr_o=dr, ddr_o=ddr, drag=DRAG,
            covariance=1e-8 * np.eye(6), t_seen=t, t_first=0.0,
        )  # fmt: skip

    return known
