"""A ball is seen in the thrower's hand before it flies; ``benchmarks/before_throw.py`` has more."""

import numpy as np
import pytest
from exact_plant import SETTINGS
from support import thorough
from thrower_hands import KINDS, thrown

from mitt.core.arm.arm import Arm
from mitt.core.catcher.catcher import Catcher
from mitt.core.map.learn import Learned
from mitt.lab.world.throws import Throw

BALL = Throw(r=np.array([3.6, 0.15, 0.2]), dr=np.array([-5.9, -0.2, 2.2]))


@pytest.fixture(scope="module")
def first(arm: Arm, learned: Learned) -> Catcher:
    """Return a catcher of which others are made."""
    return Catcher(arm, learned, settings=SETTINGS)


@pytest.mark.parametrize("rate", thorough([120.0], [1000.0]))
@pytest.mark.parametrize("kind", KINDS)
def test_a_ball_that_was_in_a_hand_is_caught_as_one_that_appears(
    first: Catcher, arm: Arm, learned: Learned, kind: str, rate: float
) -> None:
    """Whatever the hand did with it: what was refused is not the throw, and is no end of it."""
    caught, phases = thrown(first.again(learned), arm, BALL, kind=kind, rate=rate, seed=3)
    assert caught, phases
    assert ("refused" in phases) >= (kind == "toss")


def test_a_ball_that_passes_by_is_refused_and_the_throw_is_over(
    first: Catcher, arm: Arm, learned: Learned
) -> None:
    """Once, and for good when it has passed by."""
    wide = Throw(r=BALL.r + np.array([0.0, 1.5, 0.0]), dr=BALL.dr)
    catcher = first.again(learned)
    caught, phases = thrown(catcher, arm, wide, kind="none", rate=500.0, seed=3)
    assert not caught
    assert phases == ["watch", "refused"]
    assert catcher.refused
    assert catcher.done
