"""What hand and arm bear of a catch: the hand closes in time, holds the ball, bears its strike.

What differs between hands is theirs (:class:`mitt.core.arm.description.Hand`); here is what they
are asked: how the ball meets the hand on its arm, and how the arm brakes with it.
"""

from functools import partial

import numpy as np

from mitt.core.arm.arm import Arm
from mitt.core.arm.catch import LOST, Catch, CaughtBall, HandImpact
from mitt.core.control.closing import fingers_of, lead_of, takes_of
from mitt.core.control.stop import Brake, rows_of
from mitt.core.signals import GRAVITY, TICK, Array

#: Share of a ball's distance from the axis that counts here. For one off the axis the fingers start
#: later (:func:`mitt.core.control.closing.takes_of`), but the finger that it passes nearest meets
#: it sooner than one on the axis. Chosen on 60 throws at a Panda: with it 2 of the 54 that press
#: less than 240 N are refused, with 1 there were 15; of the 6 that press more it refuses 1, with 1
#: four.
_OFF_AXIS = 0.7


def hand_shares(
    arm: Arm, brake: Brake, ball: CaughtBall, *, q: Array, v_rel: Array, left: float
) -> dict[str, float]:
    """Return what a catch asks of the hand, by the name of the limit; nothing without a hand.

    Besides what the hand itself says (:meth:`mitt.core.arm.description.Hand.shares`), ``hand`` is
    the time that it needs to close, in units of what is left.

    Args:
        arm: The arm.
        brake: How it brakes with the ball.
        ball: The ball.
        q: Joint angles at the catch [rad], shape (n,).
        v_rel: Velocity of the ball relative to the catch point [m/s], shape (3,).
        left: Time left until the catch [s].
    """
    hand, normal = arm.model.hand, arm.orientation(q)[:, 2]
    if hand is None:
        return {}
    catch = Catch(ball, v_rel, normal, brake.duration, partial(_felt, arm, brake))
    if not hand.closes:
        return hand.shares(catch)
    takes = float(takes_of(fingers_of(hand, ball.radius, ball.restitution)[0], 0.0))
    return hand.shares(catch) | {"hand": min(takes / max(left, TICK), LOST)}


def force_of(arm: Arm, q: Array, v_rel: Array, ball: CaughtBall) -> float:
    """Return the largest single force of a contact of a catch, as it is expected [N].

    0 without a hand, of which nothing is known.

    Args:
        arm: The arm, without the ball.
        q: Joint angles at the catch [rad], shape (n,).
        v_rel: Velocity of the ball relative to the catch point [m/s], shape (3,).
        ball: The ball.
    """
    hand = arm.model.hand
    if hand is None:
        return 0.0
    normal = arm.orientation(q)[:, 2]
    whole, into = float(np.linalg.norm(v_rel)), max(-float(v_rel @ normal), 0.0)
    pushed = normal @ arm.jacobian(q)
    yields = float(pushed @ np.linalg.solve(arm.mass_matrix(q), pushed))
    behind = 1.0 / yields if yields > 0.0 else np.inf
    aslant = float(np.sqrt(max(1.0 - (into / max(whole, 1e-6)) ** 2, 0.0)))
    fingers = fingers_of(hand, ball.radius, ball.restitution)[0]
    lead = float(lead_of(fingers, whole, _OFF_AXIS * aslant))
    return hand.contact_force(ball, HandImpact(whole, into, lead, behind))


def _felt(arm: Arm, brake: Brake, t: Array) -> tuple[Array, Array]:
    """Return what the hand gives a kilogram while the arm brakes [N], and the palm's normal."""
    (before, palm), (after, _) = (arm.hand_along(rows_of(brake, x)) for x in (t, t + TICK))
    force: Array = (after - before) / TICK + [0.0, 0.0, GRAVITY]
    return force, palm
