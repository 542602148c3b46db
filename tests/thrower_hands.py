"""A ball that is seen in the thrower's hand before it flies, and an exact arm that waits for it.

The hand swings it forward for 0.2 s at the end, without a jump of position or velocity. Before, it
rests, walks at up to 1 m/s, sways at up to 0.36 m/s, or tosses the ball up by 0.44 m and catches it
again. ``hidden`` is at rest and not seen for the last 0.3 s; ``swung`` is seen from the swing on.
"""

from collections.abc import Callable

import numpy as np
from exact_plant import FALL, SIGMA, ExactPlant

from mitt.core.arm.arm import Arm
from mitt.core.catcher.catcher import Catcher, Phase
from mitt.core.signals import TICK, ArmState, Array, Senses, Sighting
from mitt.lab.world.throws import Throw

#: Time of the swing, of a toss and from one to the next, and how long a hidden ball is hidden [s].
SWING = 0.2
TOSS = 0.6
APART = 0.9
HIDDEN = 0.3
#: How near a ball has to come to the open hand [m], and how long a throw is watched [s].
NEAR = 0.02
LONGEST = 1.3
KINDS = ("none", "still", "walk", "toss", "sway", "swung", "hidden")


def still(_: float) -> Array:
    """Return how far the hand is from where its swing begins, so long before it [m], (3,)."""
    return np.zeros(3)


def sway(before: float) -> Array:
    """Return the same of a hand that sways."""
    angles = np.array([3.0, 2.0, 5.0]) * before
    return np.array([0.10, 0.05, 0.03]) * np.sin(angles)


def walk(before: float) -> Array:
    """Return the same of a person who walks to and fro."""
    return np.array([0.5 * np.sin(2.0 * before), 0.2 * np.sin(1.1 * before), 0.0])


def toss(before: float) -> Array:
    """Return the same of a ball that is tossed up again and again, and at last rests."""
    since = -before % APART
    return np.array([0.0, 0.0, 0.5 * -FALL[2] * since * max(TOSS - since, 0.0)])


_MOVES: dict[str, Callable[[float], Array]] = {"walk": walk, "toss": toss, "sway": sway}


def carried(kind: str, ball: Throw, since: float) -> Array | None:
    """Return where a ball is seen so long after its release [m], (3,); None where it is not.

    Args:
        kind: What the hand does, of ``KINDS``.
        ball: At its release.
        since: Time since then, negative before [s].
    """
    if since >= 0.0:
        r_o: Array = ball.r + since * ball.dr + 0.5 * since * since * FALL
        return r_o
    unseen = {"none": np.inf, "hidden": HIDDEN}.get(kind, 0.0)
    if -since < unseen or (kind == "swung" and -since > SWING):
        return None
    begins, gone = ball.r - 0.5 * SWING * ball.dr, max(SWING + since, 0.0)
    place = begins + 0.5 / SWING * gone * gone * ball.dr
    return place if gone > 0.0 else place + _MOVES.get(kind, still)(-since - SWING)


def thrown(
    catcher: Catcher, arm: Arm, ball: Throw, *, kind: str, rate: float, seed: int
) -> tuple[bool, list[str]]:
    """Throw to a fresh catcher; say whether it caught the ball, and each phase that it was in.

    Args:
        catcher: A fresh one.
        arm: The arm, as it is.
        ball: At its release; it has no drag.
        kind: What the thrower's hand does before, of ``KINDS``.
        rate: How often the ball is seen [Hz].
        seed: Of the error of what is seen, and of when it is.
    """
    rng, plant, nearest = np.random.default_rng(seed), ExactPlant(arm), np.inf
    lead = {"none": 0.0, "swung": SWING, "toss": 2.0 * APART + SWING}.get(
        kind, rng.uniform(1.2, 2.1)
    )
    t, due, phases = -lead, rng.uniform(0.0, 1.0 / rate) - lead, ["watch"]
    while t < LONGEST and not catcher.done:
        points = list[Sighting]()
        while due <= t:
            if (seen := carried(kind, ball, due)) is not None:
                noisy = seen + SIGMA * rng.standard_normal(3)
                points.append(
                    Sighting(t=due + lead, found=True, r_o=noisy, covariance=SIGMA**2 * np.eye(3))
                )
            due += 1.0 / rate
        reading = ArmState(t=t + lead, q=plant.state[0].copy(), dq=plant.state[1].copy())
        command = catcher.step(Senses(t=t + lead, arm=reading, points=tuple(points)))
        plant.move(command, TICK)
        catcher.think()
        t += TICK
        if catcher.phase.value != phases[-1]:
            phases.append(catcher.phase.value)
        if t > SWING:
            at = ball.r + t * ball.dr + 0.5 * t * t * FALL
            nearest = min(nearest, float(np.linalg.norm(arm.position(plant.state[0]) - at)))
    return catcher.phase is Phase.BRAKE and nearest < NEAR, phases
