"""Rival ``quintic``: predict the catch and replan a quintic to it when the prediction moves.

The classic of robotic catching (Hong and Slotine 1995, Frese and others 2001): position, velocity
and acceleration are met at the predicted catch by a polynomial of degree five in each joint.

While the catch is far, a new plan starts from the commanded motion, so nothing jumps. Near the
catch a new plan would accelerate the arm for a millimetre; there the last plan stays and only its
end is moved: a quintic that starts from zero adds what the end has moved. The rivals ``ruckig``
and ``mpc`` do the same with planners of their own.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Protocol, final

import numpy as np

from mitt.baselines.choice import Intercept
from mitt.baselines.paths import quintic
from mitt.baselines.pursuit import rival
from mitt.generator.generators import Generator
from mitt.generator.mapping import DirectMap
from mitt.signals import Array, BallState


class Plan(Protocol):
    """A motion by time."""

    def at(self, t: float) -> Array:
        """Return q, dq, ddq at time ``t`` [s], shape (3, n)."""
        ...


#: Makes a plan from q, dq, ddq at a time to a catch; None where it finds none.
Planner = Callable[[Array, float, Intercept], Plan | None]


@final
@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class QuinticPlan:
    """The quintic between two states of motion at two times."""

    t: float
    start: Array
    t_c: float
    end: Array

    def at(self, t: float) -> Array:
        """Evaluate it."""
        out = np.empty_like(self.start)
        quintic(self.start, self.end, max(self.t_c - self.t, 1e-4), t - self.t, out)
        return out


def plan_quintic(motion: Array, t: float, catch: Intercept) -> QuinticPlan:
    """Return the quintic from a motion at a time to a catch."""
    return QuinticPlan(t=t, start=motion, t_c=catch.t_c, end=catch.end)


@final
@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Planned:
    """Pursuit by the plans of a planner; where it finds none, by a quintic.

    Attributes:
        planner: Makes the plans.
        dead_q: Change of the end's angles below which the plan stays [rad].
        dead_dq: The same for its speeds [rad/s].
        settled: Time before the catch from which on only the end is moved [s].
        every: Shortest time between two plans [s].
        plan: The present plan.
        end: The end it was made for, shape (3, n).
        t: When it was made [s].
    """

    planner: Planner
    dead_q: float = 0.004
    dead_dq: float = 0.06
    settled: float = 0.06
    every: float = 0.005
    plan: Plan | None = None
    end: Array | None = None
    t: float = -np.inf

    def begin(self, catch: Intercept, t: float, motion: Array) -> "Planned":
        """Plan for the first time."""
        plan = self.planner(motion, t, catch) or plan_quintic(motion, t, catch)
        return replace(self, plan=plan, end=catch.end, t=t)

    def step(self, catch: Intercept, ball: BallState) -> tuple[Array, "Planned"]:
        """Follow the plan, made anew or moved at its end."""
        if self.plan is None or self.end is None:
            raise RuntimeError("a pursuit must begin before it goes on")
        t, motion, moved = ball.t, self.plan.at(ball.t), catch.end - self.end
        if catch.t_c - t > self.settled:
            kept = np.abs(moved[0]) < self.dead_q, np.abs(moved[1]) < self.dead_dq
            if t - self.t < self.every or np.all(kept):
                return motion, self
            return motion, self.begin(catch, t, motion)
        t_s, added = max(catch.t_c - self.settled, self.t), np.empty_like(moved)
        quintic(np.zeros_like(moved), moved, max(catch.t_c - t_s, 1e-4), t - t_s, added)
        return motion + added, self


def make_quintic(f: DirectMap) -> Generator:
    """Return the rival for the arm of a map."""
    return rival(f, Planned(planner=plan_quintic))
