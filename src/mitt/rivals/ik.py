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

| here   | meaning                                                    | unit | shape |
|--------|------------------------------------------------------------|------|-------|
| ``goal`` | what the hand is to do: position and two derivatives     | m .. | (3, 3)|
| ``gap``  | of hand and goal at the start, closed on the way         | m .. | (3, 3)|
"""

from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import product
from typing import final

import numpy as np
from numba import njit

from mitt.generator.generators import Generator
from mitt.generator.mapping import DirectMap
from mitt.generator.packing import unfold, unpack
from mitt.rivals.course import Course, state_of
from mitt.rivals.meeting import fly_on, hand_of, palm
from mitt.rivals.pursuit import rival
from mitt.rivals.quintics import quintic
from mitt.rivals.servo import bounds_of, servo
from mitt.robot.chain import sweep
from mitt.signals import Array, BallState


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class LineSettings:
    """How the hand moves along the line of flight.

    Attributes:
        run: Time before the catch at which the hand sets off along the line [s].
        approach: Relative acceleration along the palm's normal at the catch [m/s^2].
        back: Largest set-back along it [m].
        join: Share of the time to the catch in which the hand gets onto the line.
        gain: Bandwidth of the position error [rad/s].
        reach: Share of the arm's reach within which the hand waits.
        torque: Share of the torques on each joint's own inertia that bounds its acceleration.
    """

    run: float = 0.16
    approach: float = 90.0
    back: float = 0.15
    join: float = 0.85
    gain: float = 60.0
    reach: float = 0.96
    torque: float = 1.2

    @property
    def packed(self) -> Array:
        """Numbers of the kernel."""
        return np.array([self.run, self.approach, self.back])


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class Line:
    """One arm's way of following the line of flight."""

    map: DirectMap
    settings: LineSettings = field(default_factory=LineSettings)

    @cached_property
    def most(self) -> Array:
        """Bounds of the joints."""
        return bounds_of(self.map.arm, share=self.settings.torque)

    @cached_property
    def hand(self) -> Array:
        """Numbers of the hand."""
        return hand_of(self.map.arm)

    @cached_property
    def sphere(self) -> Array:
        """Centre and radius of the reach [m], shape (4,)."""
        arm, f = self.map.arm, self.map
        corner = _tip(f.packed, arm.q_ready, f.work)[3]
        grid = product(*(np.linspace(*ends, 9) for ends in zip(arm.q_min, arm.q_max, strict=True)))
        far = max(float(np.linalg.norm(arm.position(np.array(q)) - corner)) for q in grid)
        return np.array([*corner, self.settings.reach * far])

    def goal(self, course: Course, ball: BallState, t: float) -> Array:
        """Return what the hand is to do at time ``t`` [s], shape (3, 3)."""
        out, numbers = np.empty((3, 3)), self.settings.packed
        normal = palm(self.map.packed, self.hand, course.end[0])
        _goal(state_of(ball), ball.t, t, course.t_c, numbers, np.array(normal), self.sphere, out)
        return out


@final
@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Tracking:
    """Pursuit along the line of flight.

    Attributes:
        line: The arm's way.
        t: Time of ``motion`` [s].
        t_s: When it began [s].
        motion: q, dq, ddq of the tick before, shape (3, n).
        gap: Of hand and goal when it began, shape (3, 3); None before the first tick.
    """

    line: Line
    t: float = 0.0
    t_s: float = 0.0
    motion: Array | None = None
    gap: Array | None = None

    def begin(self, course: Course, t: float, motion: Array) -> "Tracking":  # noqa: ARG002
        """Start from a motion."""
        return replace(self, t=t, t_s=t, motion=motion, gap=None)

    def step(self, course: Course, ball: BallState) -> tuple[Array, "Tracking"]:
        """Carry the joints on by a tick."""
        if self.motion is None:
            raise RuntimeError("a pursuit must begin before it goes on")
        f, s = self.line.map, self.line.settings
        gap = self._gap(course, ball) if self.gap is None else self.gap
        rows, goal, left = self.motion.copy(), self.line.goal(course, ball, ball.t), np.zeros((3, 3))
        span = max(s.join * (course.t_c - self.t_s), 1e-3)
        if ball.t - self.t_s < span:
            quintic(gap, np.zeros((3, 3)), span, ball.t - self.t_s, left)
        dt = ball.t - self.t
        if dt > 0.0:
            servo(f.packed, self.line.most, goal + left, s.gain, dt, rows, f.work)
        return rows, replace(self, t=ball.t, motion=rows, gap=gap)

    def _gap(self, course: Course, ball: BallState) -> Array:
        """Return how far the hand is from its goal, and how fast that changes."""
        if self.motion is None:
            raise RuntimeError("a pursuit must begin before it goes on")
        f, out = self.line.map, np.zeros((3, 3))
        dl = f.arm.jacobian(self.motion[0]) @ self.motion[1]
        goal = self.line.goal(course, ball, self.t_s)
        out[0], out[1] = f.arm.position(self.motion[0]) - goal[0], dl - goal[1]
        return out


@njit(cache=True)
def _tip(packed: Array, q: Array, work: Array) -> Array:
    """Return the catch point and its derivatives, and the second joint's origin, shape (4, 3)."""
    g = unpack(packed)
    w = unfold(work, len(q))
    sweep(g.chain, q, w.still, w.motion)
    out = np.empty((4, 3))
    out[:3] = w.motion.tip
    out[3] = w.motion.origin[0, 1]
    return out


@njit(cache=True)
def _goal(
    state: Array,
    now: float,
    t: float,
    t_c: float,
    numbers: Array,
    normal: Array,
    sphere: Array,
    out: Array,
) -> None:
    """Write what the hand is to do at time ``t``, from the ball's state at time ``now``.

    With tau = t_c - t and u = tau / D, the hand is at the ball's place of the time
    sigma = t + D (u^3 - u^4 / 2), so that d sigma / dt = 1 - u^2 (3 - 2 u), and
    h = x / (1 + x / h_max), x = a tau^2 / 2, behind it.
    """
    run, a, back = numbers
    tau = t_c - t
    u = min(max(tau / run, 0.0), 1.0)
    sigma = t_c - run * (u - u**3 + 0.5 * u**4)
    ds, dds = 1.0 - u * u * (3.0 - 2.0 * u), 6.0 * u * (1.0 - u) / run
    fly_on(state, sigma - now, out)
    x = 0.5 * a * tau * tau
    part = 1.0 / (1.0 + x / back)
    h, dh = x * part, -a * tau * part * part
    ddh = a * part * part - 2.0 * (a * tau) ** 2 * part**3 / back
    size = 0.0
    for c in range(3):
        v = out[1, c]
        out[0, c] -= h * normal[c]
        out[1, c] = v * ds - dh * normal[c]
        out[2, c] = out[2, c] * ds * ds + v * dds - ddh * normal[c]
        size += (out[0, c] - sphere[c]) ** 2
    size = np.sqrt(size)
    if size > sphere[3]:
        share, along = sphere[3] / size, 0.0
        for c in range(3):
            along += out[1, c] * (out[0, c] - sphere[c]) / size
        for c in range(3):
            ray = (out[0, c] - sphere[c]) / size
            out[0, c] = sphere[c] + sphere[3] * ray
            out[1, c] = share * (out[1, c] - along * ray)
            out[2, c] = 0.0


def make_ik(f: DirectMap) -> Generator:
    """Return the rival for the arm of a map."""
    return rival(f, Tracking(line=Line(map=f)))
