"""Rival ``ik``: the hand follows the ball by inverse kinematics, f = l^-1.

What the paper sets out from: the desired position of the hand is that of the ball, resolved to
joint motion by damped least squares. Taken literally it cannot catch: the ball enters the reach
of the arm where the arm is stretched, and no arm starts at 6 m/s. What an expert makes of it:

- until the ball is near, the hand waits on the predicted line of flight, ahead of the ball and
  within the reach;
- then it sets off along the line and lets the ball catch up: the hand is where the ball will be
  a moment later, r_o(sigma(t)) with sigma -> t and d sigma / dt -> 1 at the catch;
- and it comes from behind: set back along the palm's normal by h(t) -> 0, so that the ball comes
  into the open hand from the front.

Of the two elbows that reach a point the one of the catch is taken; the gap between the arm and
that motion is closed on the way.
"""

from dataclasses import dataclass, replace
from typing import final

import numpy as np

from mitt.generator.foresight import fly_on, state_of
from mitt.generator.generators import Generator
from mitt.generator.mapping import DirectMap
from mitt.jit import kernel
from mitt.rivals.approach import Reaching, Shares, hold_back, set_back
from mitt.rivals.course import Course
from mitt.rivals.meeting import lift_ahead
from mitt.rivals.pursuit import rival
from mitt.rivals.quintics import quintic
from mitt.rivals.servo import follow
from mitt.signals import Array, BallState


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class LineSettings(Shares):
    """How the hand moves along the line of flight.

    Attributes:
        run: Time before the catch at which the hand sets off along the line [s].
        approach: Relative acceleration along the palm's normal at the catch [m/s^2].
        back: Largest set-back along it [m].
        join: Share of the time to the catch in which the hand gets onto the line.
        gain: Smallest and largest bandwidth of the joints' error [rad/s].
        sharpen: Bandwidth times the time to the catch, between those.
    """

    run: float = 0.13
    approach: float = 90.0
    back: float = 0.2
    join: float = 0.95
    gain: tuple[float, float] = (15.0, 60.0)
    sharpen: float = 6.0

    @property
    def packed(self) -> Array:
        """Numbers of the kernel."""
        return np.array([self.run, self.approach, self.back])


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class Line(Reaching[LineSettings]):
    """One arm's way of following the line of flight."""

    def goal(self, course: Course, ball: BallState, rows: Array) -> None:
        """Write the joint motion that the hand is to follow now; row 0 is where it was, (3, n)."""
        numbers, f, tau = self.settings.packed, self.map, course.t_c - ball.t
        _goal(f.packed, self.hand, state_of(ball), tau, numbers, self.sphere, rows, f.work)


@final
@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Tracking:
    """Pursuit along the line of flight.

    Attributes:
        line: The arm's way.
        t: Time of ``motion`` [s].
        t_s: When it began [s].
        motion: q, dq, ddq of the tick before, shape (3, n).
        goal: q, dq, ddq of the goal of the tick before, shape (3, n).
        gap: Of motion and goal when it began, shape (3, n).
    """

    line: Line
    t: float = 0.0
    t_s: float = 0.0
    motion: Array | None = None
    goal: Array | None = None
    gap: Array | None = None

    def begin(self, course: Course, t: float, motion: Array) -> "Tracking":
        """Start from a motion, on the branch of the catch."""
        return replace(self, t=t, t_s=t, motion=motion, goal=course.end, gap=None)

    def step(self, course: Course, ball: BallState) -> tuple[Array, "Tracking"]:
        """Carry the joints on by a tick."""
        if self.motion is None or self.goal is None:
            raise RuntimeError("a pursuit must begin before it goes on")
        s, goal, rows = self.line.settings, self.goal.copy(), self.motion.copy()
        self.line.goal(course, ball, goal)
        left, span = np.zeros_like(goal), max(s.join * (course.t_c - self.t_s), 1e-3)
        gap = self.motion - goal if self.gap is None else self.gap
        if ball.t - self.t_s < span:
            quintic(gap, np.zeros_like(gap), span, ball.t - self.t_s, left)
        dt = ball.t - self.t
        gain = min(max(s.sharpen / max(course.t_c - ball.t, 1e-3), s.gain[0]), s.gain[1])
        if dt > 0.0:
            follow(self.line.most, goal + left, gain, dt, rows)
        return rows, Tracking(
            line=self.line, t=ball.t, t_s=self.t_s, motion=rows, goal=goal, gap=gap
        )


@kernel
def _goal(
    packed: Array,
    hand: Array,
    state: Array,
    tau: float,
    numbers: Array,
    sphere: Array,
    rows: Array,
    work: Array,
) -> None:
    """Write the joint motion to follow at time t = t_c - tau, from the ball's state then.

    With u = tau / D the point h in front of the catch point is at the ball's place of the time
    sigma = t_c - D (u - u^3 + u^4 / 2), so that d sigma / dt = 1 - u^2 (3 - 2 u).
    """
    run, a, back = numbers
    u = min(max(tau / run, 0.0), 1.0)
    ds, dds = 1.0 - u * u * (3.0 - 2.0 * u), 6.0 * u * (1.0 - u) / run
    point = np.empty((3, 3))
    fly_on(state, tau - run * (u - u**3 + 0.5 * u**4), point)
    for c in range(3):
        v = point[1, c]
        point[1, c] = v * ds
        point[2, c] = point[2, c] * ds * ds + v * dds
    h = set_back(tau, a, back)
    hold_back(point, sphere, h[0])
    lift_ahead(packed, hand, h, point, rows, work)


def make_ik(f: DirectMap) -> Generator:
    """Return the rival for the arm of a map."""
    return rival(f, Tracking(line=Line(map=f, settings=LineSettings())))
