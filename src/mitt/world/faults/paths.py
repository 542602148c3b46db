"""Paths of balls that are not thrown, and the undisturbed path of any ball.

A ball is on a spring, or carried by somebody's hand. The path that a disturbed ball would take if
nobody touched it is for the clairvoyant rival alone, which knows the future.
"""

from dataclasses import dataclass
from math import cos, pi, sin
from typing import final

import numpy as np

from mitt.ball.flight import advance
from mitt.signals import Array
from mitt.world.ballistics import fly
from mitt.world.faults.draw import drawn
from mitt.world.faults.flight import Push, Undisturbed
from mitt.world.faults.plan import Carried, Fault, Spring
from mitt.world.flights import BallPath
from mitt.world.throws import Throw

#: How far a flight is flown beforehand [s].
_LONGEST = 2.0


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Swing:
    """A harmonic motion from rest.

    Attributes:
        centre: Its middle [m], shape (3,).
        out: From the middle to where it is let go [m], shape (3,).
        rate: Angular frequency [rad/s].
    """

    centre: Array
    out: Array
    rate: float

    def at(self, t: float) -> tuple[Array, Array]:
        """Position [m], shape (3,), and velocity [m/s], shape (3,), ``t`` s after release."""
        r = self.centre + cos(self.rate * t) * self.out
        return r, -self.rate * sin(self.rate * t) * self.out


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Walk:
    """A motion by hand: smoothly up to a speed along a line, with sideways wandering.

    Attributes:
        start: Where it begins [m], shape (3,).
        along: Unit direction of the line, shape (3,).
        speed: Speed after the run-up [m/s].
        run_up: Duration of the run-up [s].
        sway: Directions and amplitudes of the wandering [m], shape (2, 3).
        rates: Its angular frequencies [rad/s].
    """

    start: Array
    along: Array
    speed: float
    run_up: float
    sway: Array
    rates: tuple[float, float]

    def at(self, t: float) -> tuple[Array, Array]:
        """Position [m], shape (3,), and velocity [m/s], shape (3,), ``t`` s after release."""
        s = min(max(t / self.run_up, 0.0), 1.0)
        run_up = self.run_up * (s * s * s - 0.5 * (s * s * (s * s)))
        way = self.speed * (run_up + max(t - self.run_up, 0.0))
        r = self.start + way * self.along
        dr = self.speed * (3.0 * (s * s) - 2.0 * (s * s * s)) * self.along
        for rate, sway in zip(self.rates, self.sway, strict=True):
            r += (1.0 - cos(rate * t)) * sway
            dr += rate * sin(rate * t) * sway
        return r, dr


def replaced_ball(plan: tuple[Fault, ...], seed: int, flight: Undisturbed) -> Throw | BallPath:
    """Return the last spring or carrying hand of the plan, or the throw where there is none."""
    ball = flight.ball
    for fault, rng in drawn(plan, seed):
        if not isinstance(fault, Spring | Carried):
            continue
        goal, start = flight.at(flight.nearest())[0], flight.at(0.0)[0]
        if isinstance(fault, Spring):
            out = start - goal
            ball = Swing(centre=goal, out=out, rate=fault.magnitude / float(np.linalg.norm(out)))
        else:
            ball = _walk(fault, rng, 0.5 * (start + goal), goal)
    return ball


def _walk(fault: Carried, rng: np.random.Generator, start: Array, goal: Array) -> Walk:
    """Return a walk from one place to another; it starts without a jump and ends on its line."""
    along = goal - start
    length = float(np.linalg.norm(along))
    along = along / length
    across = np.cross(along, (0.0, 0.0, 1.0))
    across /= np.linalg.norm(across)
    sway = 0.5 * fault.wander * np.array([across, np.cross(across, along)])
    rates = rng.uniform(0.6, 1.6, 2) * 2.0 * pi
    return Walk(
        start=start,
        along=along,
        speed=fault.magnitude,
        run_up=min(0.3, length / fault.magnitude),
        sway=sway,
        rates=(float(rates[0]), float(rates[1])),
    )


@final
@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class DisturbedFlight:
    """A flight by its states at each tick.

    Attributes:
        tick: Time between two of them [s].
        r: Positions [m], shape (k, 3).
        dr: Velocities [m/s], shape (k, 3).
        drag: Drag of the flight after the last [1/m].
    """

    tick: float
    r: Array
    dr: Array
    drag: float

    def at(self, t: float) -> tuple[Array, Array]:
        """Position [m], shape (3,), and velocity [m/s], shape (3,), ``t`` s after release."""
        k = min(max(int(t / self.tick), 0), len(self.r) - 1)
        rest = t - k * self.tick
        return fly(self.r[k], self.dr[k], drag=self.drag, duration=rest)


def disturbed_flight(
    ball: Throw | BallPath, pushes: tuple[Push, ...], *, drag: float, tick: float
) -> DisturbedFlight:
    """Fly a ball through its disturbances.

    Args:
        ball: What comes at the arm.
        pushes: What disturbs it, a fresh copy: they remember what they did.
        drag: Drag coefficient that acts [1/m].
        tick: Time between two states [s].
    """
    path = None if isinstance(ball, Throw) else ball
    r, dr = (ball.r.copy(), ball.dr.copy()) if isinstance(ball, Throw) else ball.at(0.0)
    states = [(r.copy(), dr.copy())]
    for k in range(round(_LONGEST / tick)):
        changed = [push.act(k * tick, tick, r, dr) for push in pushes]
        path = None if any(changed) else path
        if path is None:
            advance(r, dr, drag, tick)
        else:
            r, dr = path.at((k + 1) * tick)
        states.append((r.copy(), dr.copy()))
    positions, velocities = (np.array(column) for column in zip(*states, strict=True))
    return DisturbedFlight(tick=tick, r=positions, dr=velocities, drag=drag)
