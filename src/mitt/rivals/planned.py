"""Pursuit by plans: a motion to the predicted catch, made anew when the prediction moves.

As long as the catch is far, a new plan starts from the motion that is being asked for, so nothing
jumps. Near the catch a new plan would throw the arm about for a millimetre; there the last plan
stays, and its end alone is moved: a quintic that starts from zero adds what the end has moved.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Protocol, final

import numpy as np

from mitt.jit import kernel
from mitt.rivals.course import Course
from mitt.rivals.quintics import quintic
from mitt.signals import Array, BallState


class Plan(Protocol):
    """A motion by time."""

    def at(self, t: float) -> Array:
        """Return q, dq, ddq at time ``t`` [s], shape (3, n)."""
        ...


#: Makes a plan from q, dq, ddq at a time to the end of a course; None where it finds none.
Planner = Callable[[Array, float, Course], Plan | None]


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


def plan_quintic(motion: Array, t: float, course: Course) -> QuinticPlan:
    """Return the quintic from a motion at a time to the end of a course."""
    return QuinticPlan(t=t, start=motion, t_c=course.t_c, end=course.end)


@dataclass(frozen=True, slots=True, kw_only=True)
class PlannedSettings:
    """When to plan anew.

    Attributes:
        dead_q: Change of the end's angles below which the plan stays [rad].
        dead_dq: The same for its speeds [rad/s].
        settled: Time before the catch from which on only the end is moved [s].
        every: Shortest time between two plans [s].
    """

    dead_q: float = 0.004
    dead_dq: float = 0.06
    settled: float = 0.06
    every: float = 0.005


@final
@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Planned:
    """Pursuit by the plans of a planner; where it finds none, by a quintic.

    Attributes:
        planner: Makes the plans.
        settings: When.
        plan: The present plan.
        end: The end it was made for, shape (3, n).
        t: When it was made [s].
    """

    planner: Planner
    settings: PlannedSettings
    plan: Plan | None = None
    end: Array | None = None
    t: float = -np.inf

    def begin(self, course: Course, t: float, motion: Array) -> "Planned":
        """Plan for the first time."""
        plan = self.planner(motion, t, course) or plan_quintic(motion, t, course)
        return replace(self, plan=plan, end=course.end, t=t)

    def step(self, course: Course, ball: BallState) -> tuple[Array, "Planned"]:
        """Follow the plan, made anew or moved at its end."""
        if self.plan is None or self.end is None:
            raise RuntimeError("a pursuit must begin before it goes on")
        s, t, motion = self.settings, ball.t, self.plan.at(ball.t)
        if course.t_c - t > s.settled:
            soon = t - self.t < s.every
            if soon or not _strays(course.end, self.end, s.dead_q, s.dead_dq):
                return motion, self
            return motion, self.begin(course, t, motion)
        t_s = max(course.t_c - s.settled, self.t)
        _shift(course.end, self.end, max(course.t_c - t_s, 1e-4), t - t_s, motion)
        return motion, self


@kernel
def _strays(end: Array, planned: Array, dead_q: float, dead_dq: float) -> bool:
    """Say whether an end, (3, n), has moved by a dead-band [rad, rad/s] since it was planned."""
    for k in range(end.shape[1]):
        if not abs(end[0, k] - planned[0, k]) < dead_q:
            return True
        if not abs(end[1, k] - planned[1, k]) < dead_dq:
            return True
    return False


@kernel
def _shift(end: Array, planned: Array, span: float, t: float, motion: Array) -> None:
    """Add to a motion, (3, n), what its end has moved, by a quintic from zero in ``span`` [s]."""
    moved = end - planned
    way = np.empty_like(moved)
    quintic(np.zeros_like(moved), moved, span, t, way)
    motion += way
