"""Choosing the map by computation: what a learned design asks of the arm over many flights.

The paper says of catch joint and q_alpha "select appropriately". Here a design is learned, its
motion along each flight of a set is held against the limits, and of the designs that keep them
with a margin the gentlest is chosen: the one whose ball meets the hand slowest.

| here        | meaning                                                        | unit | shape |
|-------------|----------------------------------------------------------------|------|-------|
| ``share``   | largest share of any limit along a flight                      | 1    | (F,)  |
| ``speed``   | relative velocity of ball and catch point at the catch         | m/s  | (F,)  |
| ``angle``   | between the way the ball comes in and the palm's normal        | rad  | (F,)  |
"""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mitt.generator.constraints import project
from mitt.generator.demand import Tolerance, shares_of
from mitt.generator.design import MapDesign
from mitt.generator.flights import Flight, Lifted, lift_flight
from mitt.generator.mapping import DirectMap
from mitt.generator.tangent import follow
from mitt.signals import Array


@dataclass(frozen=True, slots=True, kw_only=True)
class Choice:
    """What a design must keep on a flight to count as able to catch it.

    Attributes:
        share: Largest share of any limit; the rest is for noise and for feedback.
        angle: Largest angle off the palm's normal at which a ball may come in [rad].
        slow: Relative velocity below which the angle does not matter [m/s].
        within: How far behind the best a design's able flights may be to be chosen as gentler.
    """

    share: float = 0.9
    angle: float = np.deg2rad(25.0)
    slow: float = 1.0
    within: float = 0.005


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Assessment:
    """A learned design on a set of flights; see the module's table.

    Attributes:
        design: The design.
        share: Largest share of a limit; infinite where the flight leaves the domain.
        speed: Relative velocity at the catch [m/s].
        angle: Angle off the palm's normal [rad].
        binding: Name of the limit that is asked most, flight by flight.
    """

    design: MapDesign
    share: Array
    speed: Array
    angle: Array
    binding: tuple[str, ...]

    def able(self, choice: Choice) -> float:
        """Return the share of flights that the design catches with margin."""
        straight = (self.angle <= choice.angle) | (self.speed <= choice.slow)
        return float(np.mean((self.share <= choice.share) & straight))

    @property
    def binds(self) -> str:
        """The limit that binds most often."""
        return Counter(self.binding).most_common(1)[0][0]


def assess(f: DirectMap, flights: Sequence[Flight]) -> Assessment:
    """Return what a learned map asks on flights, each started from the ready pose at rest."""
    rows = [_row(f, lift_flight(f, flight), flight) for flight in flights]
    return Assessment(
        design=f.design,
        share=np.array([row[1] for row in rows]),
        speed=np.array([row[2] for row in rows]),
        angle=np.array([row[3] for row in rows]),
        binding=tuple(row[0] for row in rows),
    )


def choose(found: Sequence[Assessment], choice: Choice | None = None) -> Assessment:
    """Return the gentlest of the designs that catch, to ``within``, as many flights as the best."""
    choice = choice or Choice()
    best = max(a.able(choice) for a in found)
    able = [a for a in found if a.able(choice) >= best - choice.within]
    return min(able, key=lambda a: float(np.mean(a.speed)))


def _row(f: DirectMap, x: Lifted | None, flight: Flight) -> tuple[str, float, float, float]:
    """Return binding limit, its share, relative speed and angle of one flight."""
    if x is None:
        return "domain", np.inf, np.inf, np.pi
    alpha = project(f.alpha, f.H_inverse, x.phi_0, x.gap)
    shares = shares_of(f.arm, x.motion(alpha), Tolerance(torque=1.0, speed=1.0, acceleration=1.0))
    binding = max(shares, key=lambda name: shares[name])
    relative = _entry(f, x, flight)
    speed = float(np.linalg.norm(relative))
    normal = f.arm.orientation(x.virtual[-1, 0])[:, 2]
    cosine = float(np.clip(-relative @ normal / max(speed, 1e-9), -1.0, 1.0))
    return binding, shares[binding], speed, float(np.arccos(cosine))


def _entry(f: DirectMap, x: Lifted, flight: Flight) -> Array:
    """Return the ball's velocity relative to the catch point at the end of a flight [m/s], (3,).

    The end lies a little past the catch, where q_d and q_o differ by second order only.
    """
    q_o, dq_o = x.virtual[-1, 0].copy(), x.virtual[-1, 1]
    q_o[f.design.catch_joint] = f.design.q_catch
    follow(f.tangent, q_o)
    relative: Array = flight.ball[-1, 1] - f.arm.jacobian(q_o) @ dq_o
    return relative
