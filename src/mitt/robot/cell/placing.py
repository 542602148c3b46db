"""What the arm does with a part that it has met: back along the tool's axis, over, down, let go."""

from enum import Enum
from typing import final

import numpy as np

from mitt.core.arm.arm import Arm
from mitt.core.arm.kinematics import motion_of, sweep
from mitt.core.catcher.catcher import Catcher
from mitt.core.errors import InputError
from mitt.core.map.meeting import MeetingMap
from mitt.core.signals import TICK, Array
from mitt.lab.trials.placing import backed, carried, poses_at

#: Cosine of the first axis with the vertical from which it stands upright.
_UPRIGHT = 0.999
#: Time for which the part is left alone after the tool has let go [s].
_LETS_GO = 0.3


class Leg(Enum):
    """A motion on the way, in this order."""

    BACK = 0
    """Back from the target, along the tool's axis."""
    OVER = 1
    """To above the place, slowly, straight in the joints."""
    DOWN = 2
    """Down to it."""
    LET_GO = 3
    """At rest, the tool open."""
    UP = 4
    """Back again."""


def _turn(arm: Arm, put: Array) -> tuple[float, float]:
    """Return by how much the first axis turns from the ready pose towards a place, and the tool.

    Both about the vertical [rad]; nothing where that axis does not stand upright.
    """
    m = motion_of(arm.n)
    sweep(arm.chain, arm.q_ready, np.zeros(arm.n), m)
    up = float(m.line[0, 0, 2])
    if abs(up) < _UPRIGHT:
        return 0.0, 0.0
    away = np.array([arm.position(arm.q_ready), put]) - m.origin[0, 0]
    here, there = np.arctan2(away[:, 1], away[:, 0])
    turn = float(np.sign(up) * (there - here))
    low, high = arm.q_min[0] - arm.q_ready[0], arm.q_max[0] - arm.q_ready[0]
    turn = min(
        (turn + k * 2.0 * np.pi for k in (-1, 0, 1)), key=lambda x: (not low < x < high, abs(x))
    )
    return turn, turn * float(np.sign(up))


@final
class PutDown:
    """Puts parts down at one place."""

    def __init__(self, f: MeetingMap, put: Array, *, pause: float, speed: float) -> None:
        """Find the poses above the place and at it.

        The tool is turned with the arm's first axis, so that the arm stays as clear of itself.

        Args:
            f: The map of the arm.
            put: Where the middle of a part is put down [m], shape (3,).
            pause: Time that the tool takes to let go [s].
            speed: Largest speed of the tool [m/s].

        Raises:
            InputError: The arm does not reach it.
        """
        self._f, self._pause, self._speed = f, pause + _LETS_GO, speed
        turn, angle = _turn(f.arm, put)
        start = f.arm.q_ready.copy()
        start[0] += turn
        poses = poses_at(f, angle, put, start)
        if poses is None:
            said = ", ".join(f"{x:.3g}" for x in put)
            raise InputError("task.put", "a place that the tool reaches, and 0.1 m above it", said)
        self._over, self._down = poses

    def go(self, catcher: Catcher, leg: Leg, share: float) -> float:
        """Let a catcher that rests begin a motion; return how long that takes [s].

        Args:
            catcher: The catcher.
            leg: Which one.
            share: Share of the joints' speeds that is used.

        Raises:
            InputError: A limit forbids it.
        """
        q = catcher.result.command[0].copy()
        if leg is Leg.LET_GO:
            still = np.array([q, 0.0 * q, 0.0 * q])
            way = np.repeat(still[None], round(self._pause / TICK), axis=0)
        else:
            way = carried(self._f.arm, q, self._end(leg, q), self._speed, share)
        catcher.move(way)
        return len(way) * TICK

    def _end(self, leg: Leg, q: Array) -> Array:
        """Return the pose in which a motion from another ends [rad], shape (n,)."""
        if leg is Leg.BACK:
            return backed(self._f, q)
        return self._down if leg is Leg.DOWN else self._over
