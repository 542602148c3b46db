"""What a catch asks of a hand: the ball, how it strikes, how it is held while the arm brakes.

A hand of :mod:`mitt.core.arm.description` answers with shares of what it can and with the force of
the hardest contact. What moves it, arm and brake, is known here as numbers alone.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated, Final, NamedTuple

import numpy as np

from mitt.core.fields import Range, Settings
from mitt.core.signals import Array

LOST: Final = 10.0
"""Share of a ball that is lost whatever the arm does, as one that is too large for the hand."""


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class CaughtBall(Settings):
    """What is known of the ball that will be in the hand.

    Attributes:
        mass: Its mass [kg].
        radius: Its radius [m].
        restitution: Share of the approach speed with which it springs back from the palm.
        friction: Coefficient of friction of ball and hand.
        doubt: Relative error that the mass may have.
    """

    mass: Annotated[float, Range(0.0, 1e4)]
    radius: Annotated[float, Range(1e-4, 10.0)]
    restitution: Annotated[float, Range(0.0, 1.0)] = 0.2
    friction: Annotated[float, Range(0.0, 100.0)] = 1.0
    doubt: Annotated[float, Range(0.0, 1.0)] = 0.1

    @property
    def heaviest(self) -> float:
        """Largest mass that the ball may have [kg]."""
        return self.mass * (1.0 + self.doubt)


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class FingerDrive(Settings):
    """Servo inside the hand: full torque far from the commanded angle, PD near it.

    Attributes:
        tau_max: Torque limit [N m]; with the finger's inertia it gives the paper's 90 degrees in
            20 ms, and it bounds the grip.
        braking: Deceleration that the servo counts on when it nears the angle [rad/s^2].
        settling: Time constant of the last part [s].
        gain: Torque per error of speed [N m s/rad].
        closed: Largest closing angle [rad].
    """

    tau_max: Annotated[float, Range(1e-6, 1e4)] = 1.75
    braking: Annotated[float, Range(1.0, 1e7)] = 11_000.0
    settling: Annotated[float, Range(1e-5, 1.0)] = 0.0025
    gain: Annotated[float, Range(0.0, 1e4)] = 0.12
    closed: Annotated[float, Range(1e-3, np.pi)] = np.pi / 2


class ClosingPlan(NamedTuple):
    """How a hand closes on a ball; see :mod:`mitt.core.control.closing`."""

    profile: Array  # of :func:`mitt.core.arm.hands.closing_angle`, (5,)
    inside: float  # distance from the catch point at which the ball is inside [m]
    early: float  # before the catch the hand has closed by this at the latest [s]
    ring: float  # how far before the catch point the ball passes between the fingertips [m]
    near: float  # how far it is at most when they first are as narrow as it [m]
    firm: float  # time from then until they hold [s]
    takes: Array  # time that it takes, by how far from the palm's axis the ball passes [s], (k,)


class HandImpact(NamedTuple):
    """How a ball meets a hand.

    Attributes:
        whole: Its speed relative to the catch point [m/s].
        into: Its speed along the palm's normal, towards the palm; 0 where it flies away [m/s].
        lead: Time from the start of the closing to the catch [s].
        behind: Mass that the palm has behind it, along its normal [kg].
    """

    whole: float
    into: float
    lead: float = 0.0
    behind: float = np.inf


class Catch(NamedTuple):
    """A catch, and how the arm brakes with the ball.

    Attributes:
        ball: The ball.
        v_rel: Its velocity relative to the catch point at the catch [m/s], shape (3,).
        normal: The palm's normal then, shape (3,).
        duration: Time until the arm rests [s].
        felt: What the hand gives a kilogram at K times [N], and the palm's normal, (K, 3) each.
    """

    ball: CaughtBall
    v_rel: Array
    normal: Array
    duration: float
    felt: Callable[[Array], tuple[Array, Array]]


def reduced(mass: float, other: float) -> float:
    """Return the reduced mass of two bodies [kg]."""
    return mass if np.isinf(other) else mass * other / (mass + other)
