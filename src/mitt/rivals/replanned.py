"""A rival for meeting what moves: a quintic to where the target will be, planned again and again.

It is given the same filter, the same time of the meeting, the same way down and the same inverse
as the meeting map. At each new plan the motion goes on from where the last plan has brought the
arm, in position, velocity and acceleration, to those of the target as it is foreseen for the end.
Shortly before the meeting, and while the tool stays with the target, the end of each plan lies
``AHEAD`` before it: a plan without time left would ask for any acceleration.
"""

from dataclasses import dataclass, field, replace
from math import inf
from typing import final

import numpy as np

from mitt.arm.arm import Arm
from mitt.catcher.generators import Generator
from mitt.catcher.meeting import Meeting
from mitt.fields import brief
from mitt.map.prediction import flown
from mitt.signals import Array, BallState, JointReference, MapStatus
from mitt.verdict.feasibility import Verdict

AHEAD = 0.04
"""Least time from a plan to its end [s]."""


def quintic(start: Array, end: Array, T: float) -> Array:
    """Return coefficients from a state to another, lowest power first, shape (6, n).

    Args:
        start: q, dq, ddq [rad ...], shape (3, n).
        end: The same at the end.
        T: Time in between [s].
    """
    a0, a1, a2 = start[0], start[1], 0.5 * start[2]
    r = end[0] - a0 - a1 * T - a2 * T * T
    dr, ddr = end[1] - a1 - 2.0 * a2 * T, end[2] - 2.0 * a2
    a3 = (10.0 * r - 4.0 * dr * T + 0.5 * ddr * T * T) / T**3
    a4 = (-15.0 * r + 7.0 * dr * T - ddr * T * T) / T**4
    a5 = (6.0 * r - 3.0 * dr * T + 0.5 * ddr * T * T) / T**5
    return np.array([a0, a1, a2, a3, a4, a5])


def at(coefficients: Array, t: float) -> Array:
    """Return q, dq, ddq of a polynomial at a time [s], shape (3, n)."""
    out = np.zeros((3, coefficients.shape[1]))
    for a in coefficients[::-1]:
        out[2] = out[2] * t + 2.0 * out[1]
        out[1] = out[1] * t + out[0]
        out[0] = out[0] * t + a
    return out


@final
class Plan:
    """The plan under way; overwritten by the next."""

    def __init__(self) -> None:
        """Begin without one."""
        self.t, self.end, self.coefficients = -inf, -inf, np.zeros((6, 0))


@final
@dataclass(frozen=True, slots=True)
class Replanned(Generator):
    """Quintics to a moving target.

    Attributes:
        meeting: What chooses the time, and knows the target's way.
        rate: Plans a second [Hz].
        state: q, dq, ddq of the arm when it started [rad ...], shape (3, n).
        plan: The plan under way.
    """

    meeting: Meeting
    rate: float = 100.0
    state: Array = field(default_factory=lambda: np.zeros((3, 0)))
    plan: Plan = field(default_factory=Plan)

    __repr__ = brief

    @property
    def arms(self) -> tuple[Arm, ...]:
        """The arm that it was made for."""
        return self.meeting.arms

    def sharpness(self, ball: BallState) -> float:
        """Return what the meeting map says."""
        return self.meeting.sharpness(ball)

    def horizon(self) -> float:
        """Return what the meeting map says."""
        return self.meeting.horizon()

    def verdict(self, ball: BallState, q: Array) -> Verdict:
        """Return what the meeting map says."""
        return self.meeting.verdict(ball, q)

    def adapt(self, ball: BallState, q: Array, dq: Array) -> "Replanned":
        """Choose the time of the meeting; the first plan starts where the arm is."""
        adapted = self.meeting.adapt(ball, q, dq)
        return replace(self, meeting=adapted, state=np.array([q, dq, 0.0 * q]), plan=Plan())

    def reference(self, ball: BallState) -> JointReference:
        """Return the plan's motion at the time of the estimate, after a new plan if it is due."""
        m, plan = self.meeting, self.plan
        if ball.t - plan.t >= 1.0 / self.rate - 1e-9:
            self._plan_again(ball)
        inside = plan.coefficients.shape[1] > 0
        since = min(ball.t, plan.end) - plan.t
        motion = at(plan.coefficients, since) if inside else self.state
        if inside and ball.t > plan.end:
            late = ball.t - plan.end
            motion = np.array([motion[0] + late * motion[1], motion[1], 0.0 * motion[2]])
        left = m.start + m.after + m.settings.window - ball.t
        return JointReference(
            t=ball.t, status=MapStatus.INSIDE if inside else MapStatus.DOMAIN, q_d=motion[0],
            dq_d=motion[1], ddq_d=motion[2], q_o=motion[0], dq_o=motion[1],
            time_to_catch=left if inside else inf,
        )  # fmt: skip

    def _plan_again(self, ball: BallState) -> None:
        """Plan from where the last plan has brought the arm; the old one stays out of reach."""
        m, plan = self.meeting, self.plan
        above = m.start + m.approach(m.after)
        T = max(above - ball.t, AHEAD, 1.0 / self.rate)
        ahead = flown(ball, np.array([T]))[0]
        target = m.placed(ahead, m.start + m.after - ball.t - T)
        inside, virtual = m.map.virtual(target)
        if not inside:
            return
        begun = plan.coefficients.shape[1] > 0
        start = at(plan.coefficients, min(ball.t, plan.end) - plan.t) if begun else self.state
        plan.t, plan.end, plan.coefficients = ball.t, ball.t + T, quintic(start, virtual, T)
