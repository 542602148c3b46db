"""Pursuit tick by tick: the joints follow a moving goal within bounds, the palm towards the ball.

The point that is led to the ball lies h in front of the catch point, along the palm's present
normal; h goes to zero at the catch. So the ball enters the open hand from the front, wherever the
palm faces on the way. The goal is kept within the reach of the arm, where the hand waits.

| here     | meaning                                                   | unit    | shape  |
|----------|-----------------------------------------------------------|---------|--------|
| ``goal`` | q, dq, ddq to be followed                                 | rad ... | (3, n) |
| ``rows`` | q, dq, ddq, advanced by a tick in place                   | rad ... | (3, n) |

Two rivals move so, each with a point of its own that attracts the hand: ``ik``
(:func:`on_the_line`) and ``ds`` (:func:`virtual_ball`).
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product
from typing import NamedTuple, final

import numpy as np

from mitt.core.arm.arm import Arm
from mitt.core.arm.description import STOP_GAP
from mitt.core.arm.kinematics import Vec
from mitt.core.arm.kinematics import place as place_chain
from mitt.core.catcher.generators import Generator
from mitt.core.kernels import kernel
from mitt.core.map.mapping import DirectMap
from mitt.core.map.prediction import fly_on, state_of
from mitt.core.map.tangent import unfold, unpack
from mitt.core.signals import Array, BallState
from mitt.lab.rivals.intercept import HandNumbers, Intercept, follow_point, hand_numbers
from mitt.lab.rivals.paths import quintic
from mitt.lab.rivals.pursuit import SPEED, rival

#: Relative acceleration along the palm's normal at the catch [m/s^2], largest set-back h [m].
_APPROACH = 90.0
_BACK = 0.2
#: Bandwidth of the joints times the time to the catch, and its largest value [rad/s].
_SHARPEN = 6.0
_FASTEST = 60.0


class Bounds(NamedTuple):
    """Bounds of the joints, shape (n,) each: angles, speed, acceleration [rad ...]."""

    q_min: Array
    q_max: Array
    speed: Array
    acceleration: Array


def pursuit_bounds(arm: Arm) -> Bounds:
    """Return the bounds; twice the torques on each joint's own inertia for acceleration."""
    top = 2.0 * arm.tau_max / np.diag(arm.mass_matrix(arm.q_ready))
    return Bounds(arm.q_min + STOP_GAP, arm.q_max - STOP_GAP, SPEED * arm.dq_max, top)


def pursuit_bandwidth(left: float, slowest: float, fastest: float) -> float:
    """Return the bandwidth of the joints a time before the catch [s], between two bounds."""
    return min(max(_SHARPEN / max(left, 1e-3), slowest), fastest)


class Sphere(NamedTuple):
    """Where the hand may wait: about a centre, shape (3,), within a radius [m]."""

    centre: Array
    radius: float


@final
@dataclass(frozen=True, eq=False)
class PursuitArm:
    """What the pursuit knows of the arm of a map."""

    map: DirectMap

    @cached_property
    def most(self) -> Bounds:
        """Bounds of the joints."""
        return pursuit_bounds(self.map.arm)

    @cached_property
    def hand(self) -> HandNumbers:
        """The hand, as the kernels take it."""
        return hand_numbers(self.map.arm)

    @cached_property
    def sphere(self) -> Sphere:
        """Where the hand may wait: about the second joint, within 96 % of the reach.

        That is found by nine values of each joint.
        """
        f, arm, centre = self.map, self.map.arm, np.zeros(3)
        _second(f.packed, arm.q_ready, centre, f.work)
        ends = zip(arm.q_min, arm.q_max, strict=True)
        grid = product(*(np.linspace(low, high, 9) for low, high in ends))
        far = max(float(np.linalg.norm(arm.position(np.array(q)) - centre)) for q in grid)
        return Sphere(centre, 0.96 * far)

    def lead(self, point: Array, left: float, closing: float, goal: Array) -> None:
        """Write the joint motion that leads the hand, palm first, to a moving point.

        Args:
            point: Position, velocity, acceleration of the point [m ...], shape (3, 3); changed.
            left: Time to the catch [s].
            closing: Speed with which the point is to come in at the catch [m/s].
            goal: Result, shape (3, n); row 0 is where it was and chooses the branch.
        """
        ahead = _set_back(left, closing)
        _lead(self.map.packed, self.hand, self.sphere, ahead, point, goal, self.map.work)


@final
@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Servo:
    """Pursuit of a goal that moves.

    Attributes:
        most: Bounds of the joints.
        lead: Writes where the joints are to be, q, dq, ddq (3, n), for a catch and a ball; row 0
            is where they were to be a tick before.
        slowest: Smallest bandwidth of the joints [rad/s].
        join: Share of the time to the catch in which the first gap to the goal is closed; 0 to
            leave that to the bandwidth.
        t: Time of ``motion`` [s].
        t_s: When the pursuit began [s].
        motion: q, dq, ddq of the tick before, shape (3, n).
        goal: The goal of the tick before, shape (3, n).
        gap: Motion minus goal when the pursuit began, shape (3, n).
    """

    most: Bounds
    lead: Callable[[Intercept, BallState, Array], None]
    slowest: float
    join: float = 0.0
    t: float = 0.0
    t_s: float = 0.0
    motion: Array | None = None
    goal: Array | None = None
    gap: Array | None = None

    def begin(self, catch: Intercept, t: float, motion: Array) -> "Servo":
        """Start from a motion, on the branch of the catch."""
        return replace(self, t=t, t_s=t, motion=motion, goal=catch.end, gap=None)

    def step(self, catch: Intercept, ball: BallState) -> tuple[Array, "Servo"]:
        """Advance the joints by a tick."""
        if self.motion is None or self.goal is None:
            raise RuntimeError("a pursuit must begin before it goes on")
        goal, rows, left = self.goal.copy(), self.motion.copy(), np.zeros_like(self.goal)
        self.lead(catch, ball, goal)
        gap = self.motion - goal if self.gap is None else self.gap
        span = max(self.join * (catch.t_c - self.t_s), 1e-3)
        if self.join > 0.0 and ball.t - self.t_s < span:
            quintic(gap, np.zeros_like(gap), span, ball.t - self.t_s, left)
        rate = pursuit_bandwidth(catch.t_c - ball.t, self.slowest, _FASTEST)
        if ball.t > self.t:
            close_gap(self.most, goal + left, rate, ball.t - self.t, rows)
        return rows, replace(self, t=ball.t, motion=rows, goal=goal, gap=gap)


@kernel
def _second(packed: Array, q: Array, place: Array, work: Array) -> None:
    """Write the origin of the second active joint in the world."""
    g = unpack(packed)
    w = unfold(work, len(q))
    place_chain(g.chain, q, w.motion)
    place[:] = w.motion.origin[0, 1]


@kernel
def _lead(
    packed: Array, hand: HandNumbers, sphere: Sphere, h: Vec, point: Array, rows: Array, work: Array
) -> None:
    """As :meth:`Reach.lead`, for a point so far in front of the palm, with two derivatives."""
    _hold_back(point, sphere, h[0])
    follow_point(packed, hand, h, point, rows, work)


@kernel
def _set_back(left: float, closing: float) -> Vec:
    """Return h [m] and its two derivatives in time, a time ``left`` [s] before the catch.

    h = x / (1 + x / h_max) with x = u left + a left^2 / 2: near the catch the ball nears the palm
    with the closing speed u and the relative acceleration a, far from it h is at most h_max.
    """
    a, x = _APPROACH, (closing + 0.5 * _APPROACH * left) * left
    part, dx = 1.0 / (1.0 + x / _BACK), closing + a * left
    bend = a * part * part - 2.0 * dx * dx * part**3 / _BACK
    return x * part, -dx * part * part, bend


@kernel
def _hold_back(point: Array, sphere: Sphere, longer: float) -> None:
    """Project a moving point onto the reach, made longer [m]."""
    size, radius, centre = 0.0, sphere.radius + longer, sphere.centre
    for c in range(3):
        size += (point[0, c] - centre[c]) ** 2
    size = np.sqrt(size)
    if size <= radius:
        return
    along = 0.0
    for c in range(3):
        along += point[1, c] * (point[0, c] - centre[c]) / size
    for c in range(3):
        ray = (point[0, c] - centre[c]) / size
        point[0, c] = centre[c] + radius * ray
        point[1, c] = radius / size * (point[1, c] - along * ray)
        point[2, c] = 0.0


@kernel
def close_gap(most: Bounds, goal: Array, gain: float, dt: float, rows: Array) -> None:
    """Advance ``rows`` by a tick so that the gap to the goal decays, critically damped.

    ddq = ddq_g + 2 w (dq_g - dq) + w^2 (q_g - q), the goal being that of the end of the tick.
    ``gain`` is w [rad/s], ``dt`` the length of the tick [s].
    """
    for k in range(rows.shape[1]):
        q, dq = rows[0, k] + dt * rows[1, k], rows[1, k]
        lag, slow = goal[0, k] - q, goal[1, k] - dt * goal[2, k] - dq
        ddq = goal[2, k] + 2.0 * gain * slow + gain * gain * lag
        ddq = min(max(ddq, -most.acceleration[k]), most.acceleration[k])
        dq = min(max(dq + dt * ddq, -most.speed[k]), most.speed[k])
        q = rows[0, k] + 0.5 * dt * (rows[1, k] + dq)
        if q < most.q_min[k] or q > most.q_max[k]:
            q, dq = min(max(q, most.q_min[k]), most.q_max[k]), 0.0
        rows[2, k] = (dq - rows[1, k]) / max(dt, 1e-9)
        rows[0, k], rows[1, k] = q, dq


#: ``ik``: time before the catch at which the hand sets off along the line [s].
_RUN = 0.13
#: ``ds``: distance R of the ball from the intercept at which the coupling begins [m].
_RADIUS = 1.6


def on_the_line(catch: Intercept, ball: BallState) -> Array:
    """Return the motion of the point that ``ik`` follows, position to acceleration, (3, 3).

    What the paper sets out from: the desired position of the hand is that of the ball, resolved to
    joint motion by damped least squares, f = l^-1. Taken literally it cannot catch: the ball enters
    the reach of the arm where the arm is stretched, and no arm starts at 6 m/s. What an expert
    makes of it: until the ball is near, the hand waits on the predicted line of flight, ahead of
    the ball and within the reach; then it sets off along the line and lets the ball catch up: the
    hand is where the ball will be a moment later, r_o(sigma(t)) with sigma -> t and
    d sigma / dt -> 1 at the catch. Of the two elbows that reach a point that of the catch is taken;
    the gap between the arm and that motion is closed on the way.

    It is at the ball's place of the time sigma of :func:`run_up`.
    """
    left = catch.t_c - ball.t
    early, ds, dds = run_up(left)
    point = np.empty((3, 3))
    fly_on(state_of(ball), left - early, point)
    r, dr, ddr = point
    return np.array([r, dr * ds, ddr * ds * ds + dr * dds])


def run_up(left: float) -> tuple[float, float, float]:
    """Return how long before the catch a goal is that sets off shortly before it.

    With u = left / D it is where it would be at sigma = t_c - D (u - u^3 + u^4 / 2), so that
    d sigma / dt = 1 - u^2 (3 - 2 u).

    Args:
        left: Time to the catch [s].

    Returns:
        t_c - sigma [s], d sigma / dt, and its rate [1/s].
    """
    u = min(max(left / _RUN, 0.0), 1.0)
    ds, dds = 1.0 - u * u * (3.0 - 2.0 * u), 6.0 * u * (1.0 - u) / _RUN
    return _RUN * (u - u * u * u + 0.5 * ((u * u) * (u * u))), ds, dds


def make_ik(f: DirectMap) -> Generator:
    """Return the rival for the arm of a map."""
    return rival(f, _servo(f, on_the_line, slowest=15.0, join=0.95))


def _servo(
    f: DirectMap, point: Callable[[Intercept, BallState], Array], *, slowest: float, join: float
) -> Servo:
    """Return the pursuit of a point, of which position to acceleration are given, (3, 3)."""
    reach = PursuitArm(f)

    def lead(catch: Intercept, ball: BallState, goal: Array) -> None:
        reach.lead(point(catch, ball), catch.t_c - ball.t, catch.closing, goal)

    return Servo(most=reach.most, lead=lead, slowest=slowest, join=join)


def virtual_ball(catch: Intercept, ball: BallState) -> Array:
    """Return position, velocity and acceleration of the virtual ball of ``ds``, shape (3, 3).

    A dynamical system that is softly coupled to the ball, after Salehian, Khoramshahi and Billard,
    "A Dynamical System Approach for Softly Catching a Flying Object: Theory and Experiment", IEEE
    Transactions on Robotics 32 (2016): the hand is attracted not by the ball but by a virtual one,
    seen from the predicted intercept r_c as x = r_c + gamma (r_o - r_c). The softness gamma goes
    from 0, where the hand is attracted by the intercept alone, to 1, where it moves with the ball,
    and depends on the state. Here gamma = (1 - s)^3 with s = |r_o - r_c|^2 / R^2 (0 beyond R), and
    the system is of second order in the joints, critically damped, its rate rising towards the
    catch.
    """
    o, do, ddo = ball.r_o - catch.r_c, ball.dr_o, ball.ddr_o
    size = _RADIUS * _RADIUS
    left = max(1.0 - float(np.sum(o * o)) / size, 0.0)
    ds = float(np.sum(2.0 * o * do)) / size
    dds = float(np.sum(2.0 * (do * do + o * ddo))) / size
    soft, dsoft = left * left * left, -3.0 * left * left * ds
    ddsoft = 6.0 * left * ds * ds - 3.0 * left * left * dds
    return np.array(
        [
            catch.r_c + soft * o,
            soft * do + dsoft * o,
            soft * ddo + 2.0 * dsoft * do + ddsoft * o,
        ]
    )


def make_ds(f: DirectMap) -> Generator:
    """Return the rival for the arm of a map."""
    return rival(f, _servo(f, virtual_ball, slowest=6.0, join=0.0))
