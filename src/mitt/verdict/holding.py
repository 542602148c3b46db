"""Whether a ball gets into the hand, and stays there while the arm brakes."""

from dataclasses import dataclass
from functools import lru_cache
from typing import Annotated

import numpy as np

from mitt.arm.arm import Arm
from mitt.arm.basket import Basket
from mitt.arm.hands import HandModel
from mitt.control.closing import fingers_of, takes_of
from mitt.control.stop import Brake
from mitt.fields import Range, check
from mitt.signals import GRAVITY, TICK, Array

#: Share of what the fingers' drives hold at rest that holds a ball which has just struck: of 11
#: balls of 1 kg that asked for more none stayed, of 60 of 0.5 kg that asked for less 50 did.
_HOLDS = 0.6
#: Angle off the palm's normal, seen from the hand, from which on a ball touches the fingers before
#: it is in the hand [rad]: of 200 throws at one design all beyond it were lost, none below 95
#: degrees, and of 15 balls at 95 to 96 degrees at another map none. Relative speed below which the
#: share falls with it, a choice of this project [m/s].
_BEHIND, _SLOW = np.deg2rad(100.0), 1.0
#: Instants of the brake at which the pull on the fingers is looked at, and a difference's step [s].
_INSTANTS, _STEP = 8, 1e-3
#: Instants of the brake in which a ball's way in a basket is followed; share of a ball that is lost
#: whatever the arm does, as one that is too large for the hand.
_SPILLS, _LOST = 24, 10.0


@dataclass(frozen=True, slots=True, kw_only=True)
class CaughtBall:
    """What is known of the ball that will be in the hand.

    Attributes:
        mass: Its mass [kg].
        radius: Its radius [m].
        restitution: Share of the approach speed with which it springs back from the palm.
        friction: Coefficient of friction of ball and hand.
        doubt: Relative error that the mass may have.
    """

    mass: Annotated[float, Range(0.0, 1e4)]
    radius: Annotated[float, Range(1e-4, 10.0)]
    restitution: Annotated[float, Range(0.0, 1.0)] = 0.2
    friction: Annotated[float, Range(0.0, 100.0)] = 1.0
    doubt: Annotated[float, Range(0.0, 1.0)] = 0.1

    def __post_init__(self) -> None:
        """Refuse what no ball can be; InputError names the field."""
        check(self)

    @property
    def heaviest(self) -> float:
        """Largest mass that the ball may have [kg]."""
        return self.mass * (1.0 + self.doubt)


def aslant(arm: Arm, q: Array, v_rel: Array) -> float:
    """Return how far a ball comes from the side or from behind the palm, as share of what may be.

    Between the fingers it may come from nearly everywhere in front of the palm. Without fingers
    there is no bound.

    Args:
        arm: The arm.
        q: Joint angles at the catch [rad], shape (n,).
        v_rel: Velocity of the ball relative to the catch point [m/s], shape (3,).
    """
    if not isinstance(arm.model.hand, HandModel):
        return 0.0
    speed, into = float(np.linalg.norm(v_rel)), -float(v_rel @ arm.orientation(q)[:, 2])
    return (speed - into) / ((1.0 - float(np.cos(_BEHIND))) * max(speed, _SLOW))


def pull(arm: Arm, brake: Brake, ball: CaughtBall) -> float:
    """Return the largest pull of the ball on the fingers while the arm brakes, as share.

    What presses it into the palm costs the fingers nothing. A ball that they cannot hold at all is
    lost. Without a hand there is no bound.
    """
    hand = arm.model.hand
    if not isinstance(hand, HandModel):
        return 0.0
    held = _HOLDS * _holding_force(hand, ball.radius, ball.friction)
    if held == 0.0:
        return _LOST
    most = 0.0
    for t in np.linspace(0.0, brake.duration, _INSTANTS).tolist():
        force, normal = _felt(arm, brake, t)
        out = float(force @ normal)
        across = float(np.linalg.norm(force - out * normal))
        most = max(most, max(-out, 0.0) + across)
    return ball.heaviest * most / held


def closing(arm: Arm, ball: CaughtBall, left: float) -> float:
    """Return the time that the fingers need to close, as share of what is left until the catch.

    Args:
        arm: The arm; one without fingers needs none.
        ball: The ball.
        left: That time [s].
    """
    hand = arm.model.hand
    if not isinstance(hand, HandModel):
        return 0.0
    takes = float(takes_of(fingers_of(hand, ball.radius, ball.restitution)[0], 0.0))
    return min(takes / max(left, TICK), _LOST)


def spill(arm: Arm, brake: Brake, ball: CaughtBall, basket: Basket, v_rel: Array) -> float:
    """Return how far the ball leaves the bottom of a basket towards its ring, as share.

    It springs back from the net, and goes on where the arm brakes under it; friction and the sides
    of the net are left out. A basket that comes to rest facing down holds nothing, and one whose
    ring or net is too small for the ball does not let it in.
    """
    if ball.radius >= min(basket.ring_radius, basket.depth):
        return _LOST
    h = brake.duration / _SPILLS
    normal = arm.orientation(brake.at(0.0)[0])[:, 2]
    height, speed, most = 0.0, max(-ball.restitution * float(v_rel @ normal), 0.0), 0.0
    for k in range(_SPILLS):
        force, normal = _felt(arm, brake, (k + 0.5) * h)
        speed -= h * float(force @ normal)
        height += h * speed
        if height < 0.0:
            height, speed = 0.0, 0.0
        most = max(most, height)
    weight = GRAVITY * float(normal[2])
    if weight <= 0.0:
        return _LOST
    most = max(most, height + 0.5 * max(speed, 0.0) ** 2 / weight)
    return min(most / (basket.depth - ball.radius), _LOST)


def _felt(arm: Arm, brake: Brake, t: float) -> tuple[Array, Array]:
    """Return what the hand gives a kilogram while the arm brakes [N], and the palm's normal."""
    (q, dq, _), (p, dp, _) = brake.at(t), brake.at(t + _STEP)
    up = np.array([0.0, 0.0, GRAVITY])
    force: Array = (arm.jacobian(p) @ dp - arm.jacobian(q) @ dq) / _STEP + up
    return force, arm.orientation(q)[:, 2]


@lru_cache(maxsize=32)
def _holding_force(hand: HandModel, radius: float, friction: float) -> float:
    """Return what a hand holds a ball with [N]; worked out once."""
    return hand.holding_force(radius, friction)
