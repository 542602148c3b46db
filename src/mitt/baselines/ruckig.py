"""Rival ``ruckig``: predict the catch and let Ruckig meet its position and velocity.

Ruckig (Berscheid and Kroeger 2021) gives time-optimal motions of bounded speed, acceleration and
jerk between any two states; here it is stretched to end at the time of the catch. The largest
accelerations follow from the torques that gravity and speed leave, each joint with its own inertia.
A target that moves very little can make Ruckig fail, once in about 1e4 ticks, so the plan stays
within a dead band; where Ruckig finds none, the quintic is taken.
"""

from dataclasses import dataclass
from typing import final

import numpy as np
from ruckig import InputParameter, Result, Ruckig, RuckigError, Synchronization, Trajectory

from mitt.baselines.choice import Intercept
from mitt.baselines.pursuit import rival
from mitt.baselines.quintic import Plan, Planned
from mitt.generator.generators import Generator
from mitt.generator.mapping import DirectMap
from mitt.robot.arm import Arm
from mitt.signals import Array

#: Share of the speed limits, and time in which the largest acceleration builds up [s].
_SPEED, _ONSET = 0.98, 0.04
#: Difference of the duration from the time left that is accepted [s].
_LATE = 2e-4


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
    """Plans for one arm."""

    arm: Arm

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
        ends = abs(float(trajectory.duration) - (catch.t_c - t)) <= _LATE
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
        request.max_velocity = list(_SPEED * self.arm.dq_max)
        request.max_acceleration, request.max_jerk = list(most), list(most / _ONSET)
        request.minimum_duration = max(left, 0.0)
        return request

    def accelerations(self, motion: Array, end: Array) -> Array:
        """Return the accelerations that the torques allow at both ends [rad/s^2], shape (n,)."""
        arm, most = self.arm, np.full(self.arm.n, np.inf)
        for q, dq in ((motion[0], motion[1]), (end[0], end[1])):
            bias = arm.inverse_dynamics(q, dq, np.zeros(arm.n))
            free = np.maximum(arm.tau_max - np.abs(bias), 0.2 * arm.tau_max)
            most = np.minimum(most, free / np.diag(arm.mass_matrix(q)))
        return most


def make_ruckig(f: DirectMap) -> Generator:
    """Return the rival for the arm of a map."""
    return rival(f, Planned(planner=RuckigPlanner(f.arm)))
