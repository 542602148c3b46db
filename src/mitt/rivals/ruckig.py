"""Rival ``ruckig``: predict the catch and let Ruckig meet its position and velocity.

Ruckig (Berscheid and Kroeger 2021) gives time-optimal motions of bounded speed, acceleration and
jerk between any two states; here it is stretched to end at the time of the catch. Its limits are
those of the torques at the pose: each joint may accelerate as its own inertia and a share of the
torque that gravity and speed leave allow. A target that moves by a hair can make Ruckig fail,
once in about 1e4 ticks, so the plan is kept within a dead-band, and whatever Ruckig
refuses is left to the quintic.
"""

from dataclasses import dataclass
from typing import final

import numpy as np
from ruckig import InputParameter, Result, Ruckig, RuckigError, Synchronization, Trajectory

from mitt.generator.generators import Generator
from mitt.generator.mapping import DirectMap
from mitt.rivals.course import Course
from mitt.rivals.planned import Plan, Planned, PlannedSettings
from mitt.rivals.pursuit import rival
from mitt.robot.arm import Arm
from mitt.signals import Array


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class RuckigSettings:
    """Limits given to Ruckig.

    Attributes:
        torque: Share of the free torque that one joint's acceleration may take.
        speed: Share of the speed limits.
        onset: Time in which the largest acceleration builds up [s].
        late: Excess of the duration over the time left that is let pass [s].
    """

    torque: float = 1.0
    speed: float = 0.98
    onset: float = 0.04
    late: float = 2e-4


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
    settings: RuckigSettings

    def __call__(self, motion: Array, t: float, course: Course) -> Plan | None:
        """Return the plan that ends at the catch; None where Ruckig finds none in that time."""
        request = self._request(motion, course, course.t_c - t)
        trajectory = Trajectory(self.arm.n)
        try:
            answer = Ruckig(self.arm.n).calculate(request, trajectory)
        except (RuckigError, RuntimeError, ValueError):
            return None
        if answer not in (Result.Working, Result.Finished):
            return None
        ends = abs(float(trajectory.duration) - (course.t_c - t)) <= self.settings.late
        return RuckigPlan(t, trajectory) if ends else None

    def _request(self, motion: Array, course: Course, left: float) -> InputParameter:
        """Return the problem: from a motion to the end of a course in the time left [s]."""
        s, most = self.settings, self.accelerations(motion, course.end)
        request = InputParameter(self.arm.n)
        request.synchronization = Synchronization.Time
        request.current_position, request.current_velocity = list(motion[0]), list(motion[1])
        request.current_acceleration = list(np.clip(motion[2], -most, most))
        request.target_position, request.target_velocity = list(course.end[0]), list(course.end[1])
        request.target_acceleration = list(np.clip(course.end[2], -0.98 * most, 0.98 * most))
        request.max_velocity = list(s.speed * self.arm.dq_max)
        request.max_acceleration, request.max_jerk = list(most), list(most / s.onset)
        request.minimum_duration = max(left, 0.0)
        return request

    def accelerations(self, motion: Array, end: Array) -> Array:
        """Return the accelerations that the torques allow at both ends [rad/s^2], shape (n,)."""
        arm, most = self.arm, np.full(self.arm.n, np.inf)
        for q, dq in ((motion[0], motion[1]), (end[0], end[1])):
            bias = arm.inverse_dynamics(q, dq, np.zeros(arm.n))
            free = np.maximum(arm.tau_max - np.abs(bias), 0.2 * arm.tau_max)
            most = np.minimum(most, self.settings.torque * free / np.diag(arm.mass_matrix(q)))
        return most


def make_ruckig(f: DirectMap) -> Generator:
    """Return the rival for the arm of a map."""
    planner = RuckigPlanner(f.arm, RuckigSettings())
    return rival(f, Planned(planner=planner, settings=PlannedSettings()))
