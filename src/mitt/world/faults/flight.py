"""Disturbances of the ball's flight: wind, spin, unknown drag, kicks, and plates in the way."""

from dataclasses import dataclass, field
from math import sqrt
from typing import Protocol, final

import numpy as np

from mitt.jit import kernel
from mitt.robot.vectors import Vec, cross, dot, minus, plus, times
from mitt.signals import Array
from mitt.world.ballistics import fly
from mitt.world.faults.draw import direction, drawn
from mitt.world.faults.plan import Bounce, Drag, Fault, Gust, Kick, Spin
from mitt.world.flights import BallPath
from mitt.world.throws import Throw

#: Instants at which the undisturbed flight is looked at, first and then between them, and how
#: far [s].
_COARSE, _FINE, _LONGEST = 0.02, 0.001, 1.6
#: What rounding may make of a time [s].
_SURE = 1e-9


@dataclass(frozen=True, slots=True, kw_only=True)
class Undisturbed:
    """The flight as it would have been.

    Attributes:
        ball: What is thrown.
        drag: Its drag coefficient [1/m].
        hand: Catch point of the waiting arm [m], shape (3,).
    """

    ball: Throw | BallPath
    drag: float
    hand: Array

    def at(self, t: float) -> tuple[Array, Array]:
        """Return position [m] and velocity [m/s] at a time after release [s]."""
        if not isinstance(self.ball, Throw):
            return self.ball.at(t)
        return fly(self.ball.r, self.ball.dr, drag=self.drag, duration=t)

    def nearest(self) -> float:
        """Return when it is nearest to the waiting hand [s]."""
        coarse = self._nearest(np.arange(0.0, _LONGEST, _COARSE))
        return self._nearest(np.arange(max(coarse - _COARSE, 0.0), coarse + _COARSE, _FINE))

    def _nearest(self, instants: Array) -> float:
        """Return the one of some instants at which it is nearest to the waiting hand [s]."""
        gaps = [float(np.linalg.norm(self.at(float(t))[0] - self.hand)) for t in instants]
        return float(instants[int(np.argmin(gaps))])


class Push(Protocol):
    """Something that changes the velocity of a flying ball."""

    def act(self, t: float, h: float, r: Array, dr: Array) -> bool:
        """Act from ``t`` for ``h`` [s] on position [m] and velocity [m/s], in place.

        Returns:
            Whether it changed anything.
        """

    def rests(self, t: float, until: float) -> bool:
        """Say whether ``act`` is sure to change nothing, itself included, between two times [s]."""


@kernel
def _accelerate(ddr: Vec, h: float, r: Array, dr: Array) -> None:
    """Let an acceleration act for a step that is still to be flown, to second order."""
    for i in range(3):
        dr[i] += h * ddr[i]
        r[i] -= 0.5 * h * h * ddr[i]


@kernel
def _drag(nominal: float, drag: float, wind: Array, h: float, r: Array, dr: Array) -> None:
    """Let the difference of two drags act for a step, one of them in moving air."""
    v = dr[0], dr[1], dr[2]
    past = minus(v, (wind[0], wind[1], wind[2]))
    wanted = times(-drag * sqrt(dot(past, past)), past)
    _accelerate(plus(wanted, times(nominal * sqrt(dot(v, v)), v)), h, r, dr)


@kernel
def _lift(size: float, axis: Array, h: float, r: Array, dr: Array) -> None:
    """Let the lift of a spinning ball act for a step; ``size`` is that per squared speed [1/m]."""
    v = dr[0], dr[1], dr[2]
    across = cross((axis[0], axis[1], axis[2]), v)
    _accelerate(times(size * sqrt(dot(v, v)), across), h, r, dr)


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Air:
    """Air that drags otherwise than the nominal drag: wind, or another coefficient.

    Attributes:
        fault: The entry.
        nominal: Drag that acts anyway [1/m].
        drag: Drag that should act [1/m].
        wind: Velocity of the air [m/s], shape (3,).
    """

    fault: Gust | Drag
    nominal: float
    drag: float
    wind: Array

    def act(self, t: float, h: float, r: Array, dr: Array) -> bool:
        """Add the difference of the two drags."""
        if not self.fault.holds(t):
            return False
        _drag(self.nominal, self.drag, self.wind, h, r, dr)
        return True

    def rests(self, t: float, until: float) -> bool:
        """Say whether it is not the time of the fault."""
        return self.fault.rests(t, until)


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Lift:
    """The Magnus force of a spinning ball, across spin and velocity, as their sizes' product.

    Attributes:
        fault: The entry.
        axis: Axis of the spin, shape (3,).
    """

    fault: Spin
    axis: Array

    def act(self, t: float, h: float, r: Array, dr: Array) -> bool:
        """Add the lift."""
        if not self.fault.holds(t):
            return False
        _lift(self.fault.magnitude, self.axis, h, r, dr)
        return True

    def rests(self, t: float, until: float) -> bool:
        """Say whether it is not the time of the fault."""
        return self.fault.rests(t, until)


@final
@dataclass(slots=True, kw_only=True)
class Blow:
    """A sudden change of velocity, once.

    Attributes:
        when: Time after release [s].
        change: What is added to the velocity [m/s], shape (3,).
        over: Whether it has happened.
    """

    when: float
    change: Array
    over: bool = False

    def act(self, t: float, h: float, r: Array, dr: Array) -> bool:  # noqa: ARG002
        """Add it in the step in which it is due."""
        if self.over or t + h <= self.when:
            return False
        self.over = True
        dr += self.change
        return True

    def rests(self, t: float, until: float) -> bool:  # noqa: ARG002
        """Say whether it has happened or is not due yet."""
        return self.over or until + _SURE <= self.when


@final
@dataclass(slots=True, kw_only=True)
class Plate:
    """A smooth square plate off which the ball bounces, once.

    Attributes:
        centre: Where the ball's centre touches its middle [m], shape (3,).
        normal: Unit normal towards the side from which the ball comes, shape (3,).
        restitution: Coefficient of restitution.
        size: Half the side [m].
        before: Last distance of the ball's centre [m].
        over: Whether the ball has bounced or gone by.
    """

    centre: Array
    normal: Array
    restitution: float
    size: float
    before: float = field(default=np.inf)
    over: bool = False

    def act(self, t: float, h: float, r: Array, dr: Array) -> bool:  # noqa: ARG002
        """Turn the velocity about when the ball has come through the plane."""
        if self.over:
            return False
        away = r - self.centre
        gap = float(self.normal @ away)
        before, self.before = self.before, gap
        if gap >= 0.0 or before < 0.0:
            return False
        self.over = True
        beside = away - gap * self.normal
        if np.linalg.norm(beside) > self.size:
            return False
        r -= (1.0 + self.restitution) * gap * self.normal
        dr -= (1.0 + self.restitution) * float(self.normal @ dr) * self.normal
        return True

    def rests(self, t: float, until: float) -> bool:  # noqa: ARG002
        """Say whether the ball has bounced or gone by."""
        return self.over


def pushes(plan: tuple[Fault, ...], seed: int, flight: Undisturbed) -> tuple[Push, ...]:
    """Return what disturbs the ball's flight in a trial, in the order of the plan."""
    out: list[Push] = []
    for fault, rng in drawn(plan, seed):
        match fault:
            case Kick():
                when = fault.start + fault.share * flight.nearest()
                out.append(Blow(when=when, change=fault.magnitude * direction(rng)))
            case Bounce():
                out.append(_plate(fault, rng, flight))
            case Spin():
                out.append(Lift(fault=fault, axis=direction(rng)))
            case Gust() | Drag():
                out.append(_air(fault, rng, flight.drag))
            case _:
                pass
    return tuple(out)


def _air(fault: Gust | Drag, rng: np.random.Generator, drag: float) -> Air:
    """Return the air of a gust or of an unknown drag."""
    heading = rng.uniform(-np.pi, np.pi)
    wind = np.zeros(3)
    if isinstance(fault, Gust):
        wind[:2] = fault.magnitude * np.cos(heading), fault.magnitude * np.sin(heading)
    factor = fault.magnitude if isinstance(fault, Drag) else 1.0
    return Air(fault=fault, nominal=drag, drag=factor * drag, wind=wind)


def _plate(fault: Bounce, rng: np.random.Generator, flight: Undisturbed) -> Plate:
    """Return the plate in the way of a flight, tilted about a random side."""
    centre, dr = flight.at(fault.start + fault.share * flight.nearest())
    along = dr / np.linalg.norm(dr)
    side = direction(rng)
    side -= (side @ along) * along
    side /= np.linalg.norm(side)
    normal = np.cos(fault.magnitude) * side - np.sin(fault.magnitude) * along
    return Plate(centre=centre, normal=normal, restitution=fault.restitution, size=fault.size)
