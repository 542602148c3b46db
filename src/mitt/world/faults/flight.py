"""Disturbances of the ball's flight: wind, spin, unknown drag, kicks, and plates in the way."""

from collections.abc import Callable
from dataclasses import dataclass
from math import sqrt
from typing import Protocol, final

import numpy as np

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

    def is_inactive(self, t: float, until: float) -> bool:
        """Tell whether ``act`` changes nothing, itself included, throughout [t, until) [s]."""


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Force:
    """A force that acts as long as its fault does.

    Attributes:
        fault: The entry.
        acceleration: Acceleration [m/s^2], shape (3,), at a velocity [m/s], shape (3,).
    """

    fault: Gust | Drag | Spin
    acceleration: Callable[[Array], Array]

    def act(self, t: float, h: float, r: Array, dr: Array) -> bool:
        """Add the force to a step that is still to be flown, to second order."""
        if not self.fault.is_active(t):
            return False
        ddr = self.acceleration(dr)
        dr += h * ddr
        r -= 0.5 * h * h * ddr
        return True

    def is_inactive(self, t: float, until: float) -> bool:
        """Tell whether the fault is inactive."""
        return until <= self.fault.start or t >= self.fault.end


@final
@dataclass(slots=True, kw_only=True)
class Impulse:
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

    def is_inactive(self, t: float, until: float) -> bool:  # noqa: ARG002
        """Tell whether it has happened or is not due yet."""
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
    before: float = np.inf
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

    def is_inactive(self, t: float, until: float) -> bool:  # noqa: ARG002
        """Tell whether the ball has bounced or gone by."""
        return self.over


def pushes(plan: tuple[Fault, ...], seed: int, flight: Undisturbed) -> tuple[Push, ...]:
    """Return what disturbs the ball's flight in a trial, in the order of the plan."""
    out: list[Push] = []
    for fault, rng in drawn(plan, seed):
        match fault:
            case Kick():
                when = fault.start + fault.share * flight.nearest()
                out.append(Impulse(when=when, change=fault.magnitude * direction(rng)))
            case Bounce():
                out.append(_plate(fault, rng, flight))
            case Spin():
                out.append(Force(fault=fault, acceleration=_lift(fault.magnitude, direction(rng))))
            case Gust() | Drag():
                out.append(Force(fault=fault, acceleration=_air(fault, rng, flight.drag)))
            case _:
                pass
    return tuple(out)


def _lift(size: float, axis: Array) -> Callable[[Array], Array]:
    """Return the Magnus acceleration; ``size`` is that per squared speed [1/m]."""
    return lambda dr: size * sqrt((dr * dr).sum()) * np.cross(axis, dr)


def _air(fault: Gust | Drag, rng: np.random.Generator, nominal: float) -> Callable[[Array], Array]:
    """Return what wind or another drag adds to the acceleration by the nominal drag [1/m]."""
    heading, wind, drag = rng.uniform(-np.pi, np.pi), np.zeros(3), nominal
    if isinstance(fault, Gust):
        wind[:2] = fault.magnitude * np.cos(heading), fault.magnitude * np.sin(heading)
    else:
        drag = fault.magnitude * nominal

    def acceleration(dr: Array) -> Array:
        past = dr - wind
        actual, usual = -drag * sqrt((past * past).sum()), nominal * sqrt((dr * dr).sum())
        return np.asarray(actual * past + usual * dr)

    return acceleration


def _plate(fault: Bounce, rng: np.random.Generator, flight: Undisturbed) -> Plate:
    """Return the plate in the way of a flight, tilted about a random side."""
    centre, dr = flight.at(fault.start + fault.share * flight.nearest())
    along = dr / np.linalg.norm(dr)
    side = direction(rng)
    side -= (side @ along) * along
    side /= np.linalg.norm(side)
    normal = np.cos(fault.magnitude) * side - np.sin(fault.magnitude) * along
    return Plate(centre=centre, normal=normal, restitution=fault.restitution, size=fault.size)
