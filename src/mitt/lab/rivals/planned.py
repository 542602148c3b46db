"""Rivals that plan to the predicted catch, and plan anew when the prediction moves.

``quintic`` is the classic of robotic catching (Hong and Slotine 1995, Frese and others 2001):
position, velocity and acceleration are met at the predicted catch by a polynomial of degree five in
each joint. ``ruckig`` and ``mpc`` do the same with planners of their own.

While the catch is far, a new plan starts from the commanded motion, so nothing jumps. Near the
catch a new plan would accelerate the arm for a millimetre; there the last plan stays and only its
end is moved: a quintic that starts from zero adds what the end has moved.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from math import inf
from typing import Protocol, final

import numpy as np
from ruckig import InputParameter, Result, Ruckig, RuckigError, Synchronization, Trajectory

from mitt.core.arm.arm import Arm
from mitt.core.catcher.generators import Generator
from mitt.core.map.mapping import DirectMap
from mitt.core.signals import Array, BallState
from mitt.lab.rivals.intercept import Intercept
from mitt.lab.rivals.paths import quintic
from mitt.lab.rivals.pursuit import SPEED, rival


class Plan(Protocol):
    """A motion by time."""

    def at(self, t: float) -> Array:
        """Return q, dq, ddq at time ``t`` [s], shape (3, n)."""
        ...


#: A plan that would act so shortly before the catch does not act any more [s].
_LATEST = 0.01
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


@final
@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Budgeted:
    """Pursuit by a planner that makes so many plans a second, as real ones do.

    A plan is made for the catch that is forecast when planning begins, and acts a period later; the
    plan before goes on until then. The first acts at once.

    Attributes:
        planner: Makes the plans; where it finds none, a quintic is taken.
        period: Time between two plans, and time that a plan takes [s].
        plan: The present plan.
        asked: The catch for which a plan is being made; None where none is.
        due: When that plan acts, or the next is begun [s].
    """

    planner: Planner
    period: float
    plan: Plan | None = None
    asked: Intercept | None = None
    due: float = -np.inf

    def begin(self, catch: Intercept, t: float, motion: Array) -> "Budgeted":
        """Plan for the first time; a catch chosen anew waits for the next plan."""
        if self.plan is not None:
            return self
        return replace(self, plan=self._made(catch, t, motion), due=t + self.period)

    def step(self, catch: Intercept, ball: BallState) -> tuple[Array, "Budgeted"]:
        """Follow the plan; let a finished one act, and begin another."""
        if self.plan is None:
            raise RuntimeError("a pursuit must begin before it goes on")
        t, now = ball.t, self
        motion = self.plan.at(t)
        if t >= self.due:
            asked = self.asked
            acts = asked is not None and asked.t_c - t > _LATEST
            plan = self._made(asked, t, motion) if asked is not None and acts else self.plan
            now = replace(self, plan=plan, asked=catch, due=t + self.period)
        return motion, now

    def _made(self, catch: Intercept, t: float, motion: Array) -> Plan:
        """Return the plan from a motion at a time to a catch."""
        return self.planner(motion, t, catch) or plan_quintic(motion, t, catch)


def budgeted(rate: float) -> Callable[[DirectMap], Generator]:
    """Return what makes the quintic rival that makes so many plans a second [Hz]."""
    return lambda f: rival(f, Budgeted(planner=plan_quintic, period=1.0 / rate))


@final
@dataclass(frozen=True, slots=True, eq=False)
class RuckigPlan:
    """Ruckig's trajectory from a time on."""

    t: float
    trajectory: Trajectory

    def at(self, t: float) -> Array:
        """Evaluate it; past its end, at its end."""
        after = min(max(t - self.t, 0.0), float(self.trajectory.duration))
        return np.array(self.trajectory.at_time(after))


@final
@dataclass(frozen=True, slots=True)
class RuckigPlanner:
    """Plans for one arm with Ruckig (Berscheid and Kroeger 2021).

    It gives time-optimal motions of bounded speed, acceleration and jerk between any two states;
    here it is stretched to end at the time of the catch. The largest accelerations follow from the
    torques that gravity and speed leave, each joint with its own inertia. A target that moves very
    little can make Ruckig fail, once in about 1e4 ticks, so the plan stays within a dead band;
    where Ruckig finds none, the quintic is taken.

    Attributes:
        arm: The arm.
        most: Largest acceleration, of what the torques allow [rad/s^2].
    """

    arm: Arm
    most: float = inf

    def __call__(self, motion: Array, t: float, catch: Intercept) -> Plan | None:
        """Return the plan that ends at the catch; None where Ruckig finds none in that time.

        There is none from a motion that is no number.
        """
        if not np.all(np.isfinite(motion)):
            return None
        request = self._request(motion, catch, catch.t_c - t)
        trajectory = Trajectory(self.arm.n)
        try:
            answer = Ruckig(self.arm.n).calculate(request, trajectory)
        except (RuckigError, RuntimeError, ValueError):
            return None
        if answer not in (Result.Working, Result.Finished):
            return None
        ends = abs(float(trajectory.duration) - (catch.t_c - t)) <= 2e-4  # a fifth of a tick [s]
        return RuckigPlan(t, trajectory) if ends else None

    def _request(self, motion: Array, catch: Intercept, left: float) -> InputParameter:
        """Return the problem: from a motion to a catch in the time left [s]."""
        most = self.accelerations(motion, catch.end)
        request = InputParameter(self.arm.n)
        request.synchronization = Synchronization.Time
        request.current_position, request.current_velocity = list(motion[0]), list(motion[1])
        request.current_acceleration = list(np.clip(motion[2], -most, most))
        request.target_position, request.target_velocity = list(catch.end[0]), list(catch.end[1])
        request.target_acceleration = list(np.clip(catch.end[2], -0.98 * most, 0.98 * most))
        request.max_velocity = list(SPEED * self.arm.dq_max)
        request.max_acceleration = list(most)
        request.max_jerk = list(most / 0.04)  # it builds up in 40 ms
        request.minimum_duration = max(left, 0.0)
        return request

    def accelerations(self, motion: Array, end: Array) -> Array:
        """Return the accelerations that the torques allow at both ends [rad/s^2], shape (n,)."""
        arm, most = self.arm, np.full(self.arm.n, self.most)
        for q, dq in ((motion[0], motion[1]), (end[0], end[1])):
            bias = arm.inverse_dynamics(q, dq, np.zeros(arm.n))
            free = np.maximum(arm.tau_max - np.abs(bias), 0.2 * arm.tau_max)
            most = np.minimum(most, free / np.diag(arm.mass_matrix(q)))
        return most


def make_ruckig(f: DirectMap) -> Generator:
    """Return the rival for the arm of a map."""
    return rival(f, Planned(planner=RuckigPlanner(f.arm)))
