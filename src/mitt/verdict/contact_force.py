"""How hard a ball presses on the hand that catches it: the largest single force of a contact.

A ball of mass m that meets what it strikes at a speed u, spring and damper between them, presses
with at most F = rate m u. The rate follows from what the ball gives back of its speed. Of what
moves as well, the hand on its arm or a finger, the reduced mass counts in the place of m. Three
contacts are looked at, and the hardest of them is the force of the catch:

| contact | what it is, and what it was measured with                                         |
|---------|-----------------------------------------------------------------------------------|
| palm    | at the speed that the fingers leave; a ball that touches pad and rim jams there   |
| fingers | at the speed of the catch, where they meet the ball before the palm does          |
| press   | of the closed fingers, by their drives                                            |

Fingers that come between ball and palm stop the ball, others hardly slow it: what counts is where
on the ball they touch it. A ball that has more energy than their drives can take of it pushes them
open and goes on with the rest. A net gives way, from whichever side the ball comes: it presses with
its damping.
"""

from functools import lru_cache

import numpy as np

from mitt.arm.arm import Arm
from mitt.arm.basket import Basket
from mitt.arm.description import Hand
from mitt.arm.hands import HandModel, closing_angle, closing_time
from mitt.control.closing import LONGEST_INSIDE, fingers_of, takes_of
from mitt.signals import Array
from mitt.verdict.holding import CaughtBall

#: Rate of a contact with the pads [1/s]: not below that of a tennis ball, which touches for 5 ms,
#: and as much higher as the pads damp; within 15 % of the force per momentum on a palm held still,
#: for restitutions of 0.2 to 0.75 and radii up to 30 mm.
_RATE, _DAMPED = 560.0, 260.0
#: By how much a ball jams between rim and pad: one of 40 mm touches both at once, and what its
#: contacts press on one another with is no force on the ball. For it 1 + _JAM (e - _DULL), with a
#: friction of 1; none with one of _SLIPPERY; a bell of _NARROW about that radius [m]. Within 45 %.
_JAM, _DULL, _SLIPPERY = 17.5, 0.2, 0.6
_ROUND, _NARROW = 0.040, 0.0065
#: Share of the rate with which one finger of several presses.
_ONE_FINGER = 0.65
#: How far beyond a ball's widest circle, towards the palm, fingers have to meet it to stop it, for
#: one as heavy as they are [m]; from how much less on they leave it all of its speed [m].
_BEYOND, _BAND = 0.0034, 0.009
#: Way over which the drives of the fingers press against a ball that pushes them open [m]; of balls
#: of 0.14 kg at 5 m/s and of 0.2 kg at 4 m/s one in three comes through the default hand's.
_PUSHED = 0.0136
#: Share of a ball's distance from the axis that counts here. For one off the axis the fingers start
#: later (:func:`mitt.control.closing.takes_of`), but the finger that it passes nearest meets it
#: sooner than one on the axis. Chosen on 60 throws at a Panda: with it 2 of the 54 that press less
#: than 240 N are refused, with 1 there were 15; of the 6 that press more it refuses 1, with 1 four.
_OFF_AXIS = 0.7
#: By how much fingers are behind a command that is given early enough for its delays [s].
_BEHIND = 0.002
#: Rate of a basket's net, of all its cords together [1/s]: its damping (``hand_bodies.NET``).
_NET = 300.0
#: Speed of a ball that stands still in the hand [m/s].
_STILL = 1e-6
#: Instants of a closing that are looked at, greatest height above the catch point at which a ball
#: is looked for [m], and how many heights: fingers end below it.
_INSTANTS, _HIGHEST, _HEIGHTS = 161, 0.12, 241


def rate(restitution: float) -> float:
    """Return the largest force of a contact with the pads per momentum of the ball [1/s]."""
    return max(_RATE, _DAMPED / max(restitution, 1e-3))


def jam(ball: CaughtBall) -> float:
    """Return how many times as hard as without a rim the palm's hardest contact presses."""
    grip = min(max((ball.friction - _SLIPPERY) / (1.0 - _SLIPPERY), 0.0), 1.0)
    near = float(np.exp(-(((ball.radius - _ROUND) / _NARROW) ** 2)))
    return 1.0 + _JAM * max(ball.restitution - _DULL, 0.0) * grip * near


def contact_force(
    hand: Hand, ball: CaughtBall, *, palm_speed: float, finger_speed: float, behind: float = np.inf
) -> float:
    """Return the largest single force of a contact while a hand catches a ball [N].

    Args:
        hand: The hand, or the basket.
        ball: The ball.
        palm_speed: Speed along the palm's normal at which the ball meets the palm, of which the
            fingers have taken their part; for a net its whole speed [m/s].
        finger_speed: Speed along it at which fingers meet the ball; 0 where they close on a ball
            that lies in the palm [m/s].
        behind: Mass that the palm has behind it, along its normal [kg].
    """
    mass = reduced(ball.mass, behind)
    if not isinstance(hand, HandModel):
        return _NET * mass * palm_speed
    palm = rate(ball.restitution) * jam(ball) * mass * palm_speed
    struck = reduced(ball.mass, hand.finger_mass)
    fingers = _ONE_FINGER * rate(ball.restitution) * struck * finger_speed
    return max(palm, fingers, _press(hand, ball.radius))


@lru_cache(maxsize=8)
def _press(hand: HandModel, radius: float) -> float:
    """Return how hard the drive of a finger presses it on a ball [N]; worked out once."""
    return hand.press(radius)


def reduced(mass: float, other: float) -> float:
    """Return the reduced mass of two bodies [kg]."""
    return mass if np.isinf(other) else mass * other / (mass + other)


def speed_left(hand: HandModel, ball: CaughtBall, beyond: float) -> float:
    """Return which share of its speed the fingers leave a ball on its way to the palm.

    Args:
        hand: The hand.
        ball: The ball.
        beyond: How far beyond the ball's widest circle, towards the palm, they meet it [m].
    """
    needed = _BEYOND * ball.mass / hand.finger_mass
    return float(np.sqrt(np.clip((needed - beyond) / _BAND, 0.0, 1.0)))


def speed_through(hand: HandModel, ball: CaughtBall, speed: float) -> float:
    """Return the speed [m/s] of a ball that has pushed the closed fingers open; 0 if it cannot.

    It takes the fingers along, as one body, and their drives press against it.

    Args:
        hand: The hand.
        ball: The ball.
        speed: At which it meets the fingers [m/s].
    """
    both = ball.mass + hand.finger_mass
    work = hand.fingers * _press(hand, ball.radius) * _PUSHED
    shared = ball.mass * speed / both
    return float(np.sqrt(max(shared**2 - 2.0 * work / both, 0.0)))


def meeting(hand: HandModel, radius: float, lead: float, speed: float) -> float:
    """Return how far beyond a ball's widest circle, towards the palm, its fingers meet it [m].

    Negative where they close around a ball that is in the palm already.

    Args:
        hand: The hand.
        radius: Of the ball [m].
        lead: From the start of the closing to the catch [s].
        speed: Of the ball along the palm's normal, towards the palm [m/s].
    """
    times, angles, tops = _closing(hand, radius)
    height = speed * np.maximum(lead - times, 0.0)
    met = np.flatnonzero(height <= tops)
    if not len(met):
        return -radius
    k = int(met[0])
    share = 1.0
    if k > 0 and np.isfinite(tops[k - 1]):
        free, blocked = height[k - 1] - tops[k - 1], tops[k] - height[k]
        share = float(free / (free + blocked))
    last = max(k - 1, 0)
    z = hand.catch_offset + float(height[last] + share * (height[k] - height[last]))
    angle = float(angles[last] + share * (angles[k] - angles[last]))
    point, _ = hand.finger.touches(angle, z)
    return z - float(point[1])


@lru_cache(maxsize=8)
def _closing(hand: HandModel, radius: float) -> tuple[Array, Array, Array]:
    """Return how far fingers are, and how high they meet a ball, from the start of a closing on.

    Returns:
        Times since the command to close [s], the fingers' angles [rad], and the greatest height
        above the catch point at which they touch the ball on its way in [m], -inf where it is free
        to come in; shape (k,) each.
    """
    profile = hand.profile(radius)
    end = _BEHIND + closing_time(profile, hand.hold_angle(radius))
    times: Array = np.linspace(0.0, end, _INSTANTS)
    angles: Array = np.array([closing_angle(t - _BEHIND, profile) for t in times])
    heights: Array = np.linspace(_HIGHEST, 0.0, _HEIGHTS)
    tops: Array = np.full(len(times), -np.inf)
    for k, angle in enumerate(angles.tolist()):
        gaps = hand.finger.gap(angle, radius, hand.catch_offset + heights)
        touched = np.flatnonzero(gaps <= 0.0)
        if len(touched):
            tops[k] = heights[touched[0]]
    return times, angles, tops


def lead_of(hand: HandModel, ball: CaughtBall, speed: float, aslant: float = 0.0) -> float:
    """Return the time from the start of the closing to the catch [s], drives and delays apart.

    As :func:`mitt.control.closing.close` has it for a ball of a steady relative speed.

    Args:
        hand: The hand.
        ball: The ball.
        speed: Of it relative to the catch point at the catch [m/s].
        aslant: Sine of the angle between its way and the palm's normal.
    """
    f = fingers_of(hand, ball.radius, ball.restitution)[0]
    inside, early = float(f["inside"]), float(f["early"])
    takes = takes_of(f, aslant * f["ring"])
    left = max(early, inside / max(speed, inside / LONGEST_INSIDE, _STILL))
    return float(takes + min(left, f["near"] / max(speed, _STILL) - f["firm"]))


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
    whole = float(np.linalg.norm(v_rel))
    speed = whole if isinstance(hand, Basket) else max(-float(v_rel @ normal), 0.0)
    pushed = normal @ arm.jacobian(q)
    yields = float(pushed @ np.linalg.solve(arm.mass_matrix(q), pushed))
    behind = 1.0 / yields if yields > 0.0 else np.inf
    palm, met = speed, 0.0
    if isinstance(hand, HandModel):
        aslant = float(np.sqrt(max(1.0 - (speed / max(whole, _STILL)) ** 2, 0.0)))
        lead = lead_of(hand, ball, whole, _OFF_AXIS * aslant)
        left = speed_left(hand, ball, meeting(hand, ball.radius, lead, speed))
        palm = max(left * speed, speed_through(hand, ball, speed))
        met = speed if left < 1.0 else 0.0
    return contact_force(hand, ball, palm_speed=palm, finger_speed=met, behind=behind)
