"""Whether a ball gets into a hand and stays there: never a share of nothing, never below zero."""

from dataclasses import replace

import numpy as np
import pytest

from mitt.core.arm.arm import Arm
from mitt.core.arm.basket import Basket
from mitt.core.arm.catch import CaughtBall
from mitt.core.arm.hands import Finger, HandModel
from mitt.core.control.stop import Brake, plan_brake
from mitt.core.errors import InputError
from mitt.core.verdict.holding import hand_shares
from mitt.core.verdict.impact import speed_jump
from mitt.io.load import build_arm

RADII = np.concatenate([np.linspace(0.005, 0.12, 24), np.linspace(0.13, 0.5, 4)]).tolist()
"""Of balls [m]."""
HANDS = (
    HandModel(),
    HandModel(catch_offset=0.16),
    HandModel(catch_offset=0.04),
    HandModel(fingers=2),
    HandModel(finger=Finger(proximal=0.08, distal=0.02)),
    HandModel(finger=Finger(offset=0.05)),
)
V = np.array([0.0, 0.0, -3.0])
"""Velocity of the ball relative to the hand [m/s]."""
BASKETS = (Basket(), Basket(ring_radius=0.3), Basket(depth=0.05, catch_depth=0.02))


def ball(radius: float) -> CaughtBall:
    """Return a ball of a radius [m]."""
    return CaughtBall(mass=0.07, radius=radius)


def braking(arm: Arm) -> Brake:
    """Return a stop from a swing."""
    return plan_brake(arm, 0.0, np.array([arm.q_ready, [0.0, -2.0, 4.0], np.zeros(3)]))


def asked(arm: Arm, brake: Brake, radius: float) -> dict[str, float]:
    """Return what a ball of a radius [m] asks of the hand of an arm that is ready."""
    return hand_shares(arm, brake, ball(radius), q=arm.q_ready, v_rel=V, left=0.4)


@pytest.mark.parametrize("hand", HANDS, ids=range(len(HANDS)))
def test_a_ball_that_does_not_fit_the_fingers_is_refused(hand: HandModel) -> None:
    """From 5 to 500 mm: a finite share, beyond 1 exactly where nothing can hold the ball."""
    arm = build_arm("wam", hand=hand)
    stop = braking(arm)
    for radius in RADII:
        share = asked(arm, stop, radius)["grip"]
        assert np.isfinite(share)
        assert (share > 1.0) == (not hand.reaches(radius))


@pytest.mark.parametrize("basket", BASKETS, ids=range(len(BASKETS)))
def test_a_ball_that_does_not_fit_a_basket_is_refused(basket: Basket) -> None:
    """The share rises with the radius, and is beyond 1 from the ring's own on."""
    arm = build_arm("wam", hand=basket)
    stop = braking(arm)
    shares = [asked(arm, stop, radius)["spill"] for radius in RADII]
    assert np.all(np.isfinite(shares))
    assert min(shares) >= 0.0
    assert shares == sorted(shares)
    for radius, share in zip(RADII, shares, strict=True):
        assert radius < basket.ring_radius or share > 1.0


def test_a_ball_without_mass_moves_no_arm() -> None:
    """And the lighter it is the less, down to nothing, without a NaN."""
    arm, v = build_arm("wam"), np.array([-5.0, 0.4, -1.0])
    jumps = [
        float(np.abs(speed_jump(arm, arm.q_ready, v, m)).max())
        for m in (1.0, 1e-3, 1e-8, 1e-9, 1e-12, 1e-310, 0.0)
    ]
    assert jumps == sorted(jumps, reverse=True)
    assert jumps[-1] == 0.0


@pytest.mark.parametrize("name", ["mass", "radius", "restitution", "friction", "doubt"])
@pytest.mark.parametrize("bad", [np.nan, np.inf, -1e-3, 1e300, "much", None])
def test_what_no_ball_can_be_is_refused(name: str, bad: object) -> None:
    """Every field, by its name."""
    with pytest.raises(InputError, match=f"CaughtBall.{name}"):
        replace(ball(0.04), **{name: bad})  # type: ignore[arg-type]  # what is refused
