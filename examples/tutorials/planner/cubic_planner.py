"""A planner of one's own as a generator of mitt: a cubic to the predicted catch."""

from dataclasses import dataclass

import numpy as np

from mitt.core.catcher.generators import Generator
from mitt.core.map.mapping import DirectMap
from mitt.core.signals import Array
from mitt.lab.rivals.intercept import Intercept
from mitt.lab.rivals.planned import Planned
from mitt.lab.rivals.pursuit import rival


@dataclass(frozen=True)
class Cubic:
    """The polynomial of degree three between two states of motion (q, dq) at two times."""

    t: float
    start: Array  # q, dq, ddq now, shape (3, n)
    t_c: float
    end: Array  # q, dq, ddq at the catch, shape (3, n)

    def at(self, t: float) -> Array:
        """Return q, dq, ddq at time t [s], shape (3, n)."""
        T, h = max(self.t_c - self.t, 1e-4), t - self.t
        (q, dq), way = self.start[:2], self.end[0] - self.start[0] - T * self.start[1]
        turn = self.end[1] - self.start[1]
        b, a = 3.0 * way / T**2 - turn / T, turn / T**2 - 2.0 * way / T**3
        return np.array(
            [
                q + h * (dq + h * (b + h * a)),
                dq + h * (2.0 * b + 3.0 * h * a),
                2.0 * b + 6.0 * h * a,
            ]
        )


def plan(motion: Array, t: float, catch: Intercept) -> Cubic:
    """Return the motion from where the arm is to the catch; None would mean that there is none."""
    return Cubic(t, motion, catch.t_c, catch.end)


def make_cubic(f: DirectMap) -> Generator:
    """Return the generator for the arm of a map."""
    return rival(f, Planned(planner=plan))
