"""Balls that are not thrown: on a spring, or carried by somebody's hand."""

from dataclasses import dataclass
from math import cos, pi, sin
from typing import final

import numpy as np

from mitt.jit import kernel
from mitt.signals import Array
from mitt.world.faults.draw import drawn
from mitt.world.faults.flight import Undisturbed
from mitt.world.faults.plan import Carried, Fault, Spring
from mitt.world.flights import BallPath
from mitt.world.throws import Throw


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
        r, dr, rates = np.empty(3), np.empty(3), self.rates
        _walked(self.start, self.along, (self.speed, self.run_up, t), self.sway, rates, r, dr)
        return r, dr


@kernel
def _walked(
    start: Array,
    along: Array,
    numbers: tuple[float, float, float],
    sway: Array,
    rates: tuple[float, float],
    r: Array,
    dr: Array,
) -> None:
    """Write position and velocity of a :class:`Walk`; ``numbers`` are speed, run-up and time."""
    speed, run_up, t = numbers
    s = min(max(t / run_up, 0.0), 1.0)
    way = speed * (run_up * (s**3 - 0.5 * s**4) + max(t - run_up, 0.0))
    for i in range(3):
        r[i], dr[i] = start[i] + way * along[i], speed * (3.0 * s**2 - 2.0 * s**3) * along[i]
        for k in range(2):
            r[i] += (1.0 - cos(rates[k] * t)) * sway[k, i]
            dr[i] += rates[k] * sin(rates[k] * t) * sway[k, i]


def led(plan: tuple[Fault, ...], seed: int, flight: Undisturbed) -> Throw | BallPath:
    """Return what comes instead of the throw: the last spring or carrying hand of the plan."""
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
