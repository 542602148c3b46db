"""Where a ball lands that was hit: the score of batting, from the true states of the world.

A ball counts by where its centre comes down to the target's height, before it touches anything
else: that is the landing point on a table whose surface is one radius lower. What counts is its
distance from the target, seen from above, as in published returns of table tennis. A net does not
stand in its way.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np

from mitt.core.arm.arm import Arm
from mitt.core.arm.tools import Paddle
from mitt.core.errors import ModelError
from mitt.core.signals import TICK, Array
from mitt.lab.world.engine import BALL_ANY, BALL_ARM, BALL_FLOOR, BALL_HAND
from mitt.lab.world.simulation import World
from mitt.lab.world.truth import Trace

CLOSE: Final = 0.10
"""Landing error that counts as close [m]."""
NEAR: Final = 0.25
"""Landing error up to which a ball counts as returned [m]: about the mean of a published return on
a real arm, 24.9 cm (W. Gao and others, arXiv 2109.03100)."""

#: A trial without contact ends after this time [s], and one with it so long after it.
_LONGEST = 2.5
_AFTER = 2.0
#: How long a ball that a shield has met is followed [s].
_SHIELDED = 0.3
#: How far beyond the target's distance a ball is followed at least [m].
_BEYOND = 0.3


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Hit:
    """What became of a ball that touched the paddle's face first.

    Attributes:
        off_middle: Distance of the contact from the middle of the face [m].
        speed: Of the ball after it [m/s].
        returned: Whether it lands near enough to the target; true of a shield.
        lands: As ``lands_m`` of :class:`mitt.lab.trials.batting.BatTrial`, and ``miss``.
        miss: See ``lands``.
    """

    off_middle: float
    speed: float
    returned: bool = True
    lands: tuple[float, float] | None = None
    miss: float | None = None

    @property
    def landing(self) -> float | None:
        """Distance from the target of where it lands [m]; None where it does not."""
        return None if self.lands is None else float(np.hypot(*self.lands))


def paddle_of(arm: Arm) -> Paddle:
    """Return the paddle of an arm.

    Raises:
        ModelError: It has none.
    """
    if not isinstance(arm.model.hand, Paddle):
        raise ModelError(f"arm {arm.model.name}", "a paddle", "none")
    return arm.model.hand


def batted(world: World, target: Array | None) -> bool:
    """Say whether nothing more can happen to the score of a trial.

    A ball that has come to the target's distance is followed until it has come down.

    Args:
        world: Its world.
        target: Where the ball is sent [m], shape (3,); None for a shield.
    """
    truth, contact = world.truth(), world.first_contact
    if world.diverged or truth.ball_on_floor or (contact is None and truth.t >= _LONGEST):
        return True
    if contact is None:
        return False
    if target is None:
        return truth.t >= contact.t + _SHIELDED
    way = target - contact.r_o
    gone = float((truth.r_o - contact.r_o) @ way) / float(way @ way)
    passed = gone > 1.0 + _BEYOND / float(np.linalg.norm(way))
    down = truth.r_o[2] < target[2] and truth.dr_o[2] < 0.0
    return (passed and bool(down)) or truth.t > contact.t + _AFTER


def hit_of(arm: Arm, world: World, target: Array | None) -> Hit | None:
    """Return what became of a ball that touched the paddle's face first; None where it did not."""
    truth, contact, paddle = world.trace(), world.first_contact, paddle_of(arm)
    if contact is None:
        return None
    first = min(int(np.ceil(contact.t / TICK - 1e-6)), len(truth.t) - 1)
    if np.any(truth.seen[: first + 1] & (BALL_ARM | BALL_FLOOR)):
        return None
    normal = arm.orientation(truth.q[first])[:, 2]
    away = contact.r_o - contact.position
    deep = float(away @ normal)
    off = float(np.linalg.norm(away - deep * normal))
    if deep + world.radius < 0.0 or off > paddle.radius:
        return None
    apart = np.flatnonzero(truth.seen[first:] & BALL_HAND == 0)
    if len(apart) == 0:
        return None
    left = first + int(apart[0])
    speed = float(np.linalg.norm(truth.dr_o[left]))
    if target is None:
        return Hit(off_middle=off, speed=speed)
    path = _free_path(truth, left)
    lands = landing(path, target)
    return Hit(
        off_middle=off,
        speed=speed,
        returned=lands is not None and bool(np.hypot(*lands) <= NEAR),
        lands=lands,
        miss=nearest(path, target),
    )


def _free_path(truth: Trace, left: int) -> Array:
    """Return where a ball is from a tick on until it touches anything, shape (k, 3) [m]."""
    touches = np.flatnonzero(truth.seen[left + 1 :] & BALL_ANY)
    end = len(truth.t) if len(touches) == 0 else left + 1 + int(touches[0])
    return truth.r_o[left:end]


def nearest(path: Array, target: Array) -> float:
    """Return the least distance of a path of straight pieces, (k, 3), from a point, (3,) [m]."""
    start, way = path[:-1], np.diff(path, axis=0)
    if len(way) == 0:
        return float(np.linalg.norm(path[0] - target))
    squared = np.maximum(np.sum(way**2, axis=1), 1e-18)
    share = np.clip(np.sum((target - start) * way, axis=1) / squared, 0.0, 1.0)
    return float(np.linalg.norm(start + share[:, None] * way - target, axis=1).min())


def landing(path: Array, target: Array) -> tuple[float, float] | None:
    """Return where a path of straight pieces, (k, 3), comes down to a target's height [m].

    From the target, along the level way to it from the path's start, and to the left of that way.
    None where the path does not come down there.
    """
    high = path[:, 2] - target[2]
    down = np.flatnonzero((high[:-1] > 0.0) & (high[1:] <= 0.0))
    if len(down) == 0:
        return None
    k = int(down[0])
    share = high[k] / (high[k] - high[k + 1])
    off = (path[k] + share * (path[k + 1] - path[k]) - target)[:2]
    along = (target - path[0])[:2]
    along /= max(float(np.linalg.norm(along)), 1e-9)
    return float(off @ along), float(along[0] * off[1] - along[1] * off[0])
