"""The true flight of a disturbed ball that nobody touches, flown beforehand.

For the clairvoyant rival alone, which is told the future; nothing else in the loop may ask.
"""

from dataclasses import dataclass
from typing import final

import numpy as np

from mitt.flight import advance
from mitt.signals import Array
from mitt.world.ballistics import fly
from mitt.world.faults.flight import Push
from mitt.world.flights import BallPath
from mitt.world.throws import Throw

#: How far a flight is rehearsed [s].
_LONGEST = 2.0


@final
@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Rehearsed:
    """A flight by its states at each tick.

    Attributes:
        tick: Time between two of them [s].
        r: Positions [m], shape (k, 3).
        dr: Velocities [m/s], shape (k, 3).
        drag: Drag of the flight after the last [1/m].
    """

    tick: float
    r: Array
    dr: Array
    drag: float

    def at(self, t: float) -> tuple[Array, Array]:
        """Position [m], shape (3,), and velocity [m/s], shape (3,), ``t`` s after release."""
        k = min(max(int(t / self.tick), 0), len(self.r) - 1)
        rest = t - k * self.tick
        return fly(self.r[k], self.dr[k], drag=self.drag, duration=rest)


def rehearse(
    ball: Throw | BallPath, pushes: tuple[Push, ...], *, drag: float, tick: float
) -> Rehearsed:
    """Fly a ball through its disturbances.

    Args:
        ball: What comes at the arm.
        pushes: What disturbs it, drawn for this rehearsal: they remember what they did.
        drag: Drag coefficient that acts [1/m].
        tick: Time between two states [s].
    """
    path = None if isinstance(ball, Throw) else ball
    r, dr = (ball.r.copy(), ball.dr.copy()) if isinstance(ball, Throw) else ball.at(0.0)
    states = [(r.copy(), dr.copy())]
    for k in range(round(_LONGEST / tick)):
        changed = [push.act(k * tick, tick, r, dr) for push in pushes]
        path = None if any(changed) else path
        if path is None:
            advance(r, dr, drag, tick)
        else:
            r, dr = path.at((k + 1) * tick)
        states.append((r.copy(), dr.copy()))
    ways, speeds = (np.array(column) for column in zip(*states, strict=True))
    return Rehearsed(tick=tick, r=ways, dr=speeds, drag=drag)
