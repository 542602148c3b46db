"""Rival ``ds``: a dynamical system that is softly coupled to the ball.

After Salehian, Khoramshahi and Billard, "A Dynamical System Approach for Softly Catching a Flying
Object: Theory and Experiment", IEEE Transactions on Robotics 32 (2016): the hand is attracted not
by the ball but by a virtual one, seen from the predicted intercept r_c as
x = r_c + gamma (r_o - r_c). The softness gamma goes from 0, where the hand is attracted by the
intercept alone, to 1, where it moves with the ball, and depends on the state. Here
gamma = (1 - s)^3 with s = |r_o - r_c|^2 / R^2 (0 beyond R), and the system is of second order in
the joints, critically damped, its rate rising towards the catch.
"""

from dataclasses import dataclass, replace
from typing import final

import numpy as np

from mitt.generator.generators import Generator
from mitt.generator.mapping import DirectMap
from mitt.jit import kernel
from mitt.rivals.approach import Reaching, Shares, hold_back, set_back
from mitt.rivals.course import Course
from mitt.rivals.meeting import lift_ahead
from mitt.rivals.pursuit import rival
from mitt.rivals.servo import follow
from mitt.signals import Array, BallState


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class SoftSettings(Shares):
    """How soft the coupling is.

    Attributes:
        radius: Distance R of the ball from the intercept at which the coupling begins [m].
        approach: Relative acceleration along the palm's normal at the catch [m/s^2].
        back: Largest set-back along it [m].
        rate: Smallest and largest rate of the system [rad/s].
        sharpen: Rate times the time to the catch, between those.
    """

    radius: float = 1.6
    approach: float = 90.0
    back: float = 0.2
    rate: tuple[float, float] = (6.0, 60.0)
    sharpen: float = 6.0


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class Soft(Reaching[SoftSettings]):
    """The system of one arm."""

    def attract(self, course: Course, ball: BallState, rows: Array) -> None:
        """Write the joint motion that attracts; row 0 is where it was, shape (3, n)."""
        f, s = self.map, self.settings
        numbers = np.array([s.radius, s.approach, s.back, course.t_c - ball.t])
        point = np.array([ball.r_o, ball.dr_o, ball.ddr_o])
        _attract(f.packed, self.hand, numbers, course.r_c, self.sphere, point, rows, f.work)


@final
@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Softly:
    """Pursuit by the system.

    Attributes:
        soft: The system of the arm.
        t: Time of ``motion`` [s].
        motion: q, dq, ddq of the tick before, shape (3, n).
        goal: q, dq, ddq of what attracted then, shape (3, n).
    """

    soft: Soft
    t: float = 0.0
    motion: Array | None = None
    goal: Array | None = None

    def begin(self, course: Course, t: float, motion: Array) -> "Softly":
        """Start from a motion, on the branch of the catch."""
        return replace(self, t=t, motion=motion, goal=course.end)

    def step(self, course: Course, ball: BallState) -> tuple[Array, "Softly"]:
        """Carry the system on by a tick."""
        if self.motion is None or self.goal is None:
            raise RuntimeError("a pursuit must begin before it goes on")
        s, goal, rows = self.soft.settings, self.goal.copy(), self.motion.copy()
        self.soft.attract(course, ball, goal)
        rate = s.sharpen / max(course.t_c - ball.t, 1e-3)
        rate = min(max(rate, s.rate[0]), s.rate[1])
        if ball.t > self.t:
            follow(self.soft.most, goal, rate, ball.t - self.t, rows)
        return rows, Softly(soft=self.soft, t=ball.t, motion=rows, goal=goal)


@kernel
def soften(radius: float, centre: Array, point: Array) -> None:
    """Replace a ball's r_o, dr_o, ddr_o (3, 3) by those of the virtual ball, in place."""
    s, ds, dds = 0.0, 0.0, 0.0
    for c in range(3):
        o = point[0, c] - centre[c]
        s += o * o
        ds += 2.0 * o * point[1, c]
        dds += 2.0 * (point[1, c] ** 2 + o * point[2, c])
    size = radius * radius
    left = max(1.0 - s / size, 0.0)
    ds, dds = ds / size, dds / size
    soft, dsoft = left**3, -3.0 * left * left * ds
    ddsoft = 6.0 * left * ds * ds - 3.0 * left * left * dds
    for c in range(3):
        o, do, ddo = point[0, c] - centre[c], point[1, c], point[2, c]
        point[0, c] = centre[c] + soft * o
        point[1, c] = soft * do + dsoft * o
        point[2, c] = soft * ddo + 2.0 * dsoft * do + ddsoft * o


@kernel
def _attract(
    packed: Array,
    hand: Array,
    numbers: Array,
    centre: Array,
    sphere: Array,
    point: Array,
    rows: Array,
    work: Array,
) -> None:
    """Write the joint motion that leads the hand, palm first, to the virtual ball."""
    radius, a, back, tau = numbers
    soften(radius, centre, point)
    h = set_back(tau, a, back)
    hold_back(point, sphere, h[0])
    lift_ahead(packed, hand, h, point, rows, work)


def make_ds(f: DirectMap) -> Generator:
    """Return the rival for the arm of a map."""
    return rival(f, Softly(soft=Soft(map=f, settings=SoftSettings())))
