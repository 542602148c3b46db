"""The basket as data: a rigid ring with a net below it, the catcher without moving parts.

Robots that catch with a net or a cup are common (a hoop with a fish net on a Franka Panda:
K. Jyothi Swaroop and others, project page "Franka Ball Catcher", 2026); few state its sizes. So
all numbers here are choices of this project: an opening of 0.1 m radius lets a ball of 40 mm radius
in that is 60 mm off its middle, and 0.3 kg is what ring, struts and flange weigh in aluminium.

Heights are above the tool plate, along the opening's normal:

| part   | where                                                                   |
|--------|-------------------------------------------------------------------------|
| flange | on the plate; struts lead from it, outside the net, to the ring         |
| bottom | of the net, ``floor`` above the plate: room for the net to give way     |
| ring   | ``depth`` above the bottom; its inner edge is the opening               |
"""

from dataclasses import dataclass
from math import inf
from typing import Annotated, ClassVar, Final

import numpy as np

from mitt.core.arm.catch import LOST, Catch, CaughtBall, HandImpact, reduced
from mitt.core.arm.description import Capsule, Hand
from mitt.core.arm.hands import HandModel
from mitt.core.errors import InputError, UnknownNameError
from mitt.core.fields import Range, Settings, check
from mitt.core.signals import GRAVITY, Array

#: Gap between a basket that lies across the plate and the plate [m].
_GAP = 0.01
#: Rate of the net, of all its cords together [1/s]: its damping (``hand_bodies.NET``).
_NET = 300.0
#: Largest tilt [rad].
MOST_TILT = 2.0
#: A length that a basket cannot be without [m].
_LENGTH = Range(1e-4, 2.0)


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Basket(Hand, Settings):
    """A ring with a net on the tool plate, the opening's normal along the plate's z axis.

    Attributes:
        mass: Mass [kg].
        ring_radius: Radius of the opening, inside the ring [m].
        ring_thickness: Radius of the ring's tube [m].
        depth: From the ring's middle plane to the bottom of the net [m].
        floor: Height of the bottom of the net above the tool plate [m].
        catch_depth: How far below the ring's plane the catch point is [m].
        cords: Number of cords from the ring to the bottom, even.
        cord: Radius of a cord [m].
        struts: Number of struts that carry the ring.
        strut: Radius of a strut [m].
        clear: Distance of the struts' axes from the opening's edge [m].
        flange: Radius of the flange [m]; its thickness is a quarter of that.
        tilt: Angle by which the opening is turned off the plate's normal, about the plate's y axis,
            towards its x axis [rad]. A tilted basket stands farther off, clear of the plate.
        restitution: Share of its speed with which a ball comes back from the net, measured by
            ``tests/world/test_net.py``: 0.04 to 0.08.
        force: Largest force of a single contact with a ball that it takes [N]; infinite where
            nobody knows. That at which its struts yield, bent by a force across their ends: three
            of pi r^3 / 4 times 240 MPa (aluminium 6061-T6) over 0.2 m.
    """

    mass: Annotated[float, Range(1e-3, 50.0)] = 0.3
    ring_radius: Annotated[float, _LENGTH] = 0.10
    ring_thickness: Annotated[float, _LENGTH] = 0.005
    depth: Annotated[float, _LENGTH] = 0.20
    floor: Annotated[float, Range(0.0, 2.0)] = 0.04
    catch_depth: Annotated[float, Range(0.0, 2.0)] = 0.10
    cords: Annotated[int, Range(6, 200)] = 20
    cord: Annotated[float, _LENGTH] = 0.002
    struts: Annotated[int, Range(2, 100)] = 3
    strut: Annotated[float, _LENGTH] = 0.004
    clear: Annotated[float, Range(0.0, 2.0)] = 0.03
    flange: Annotated[float, _LENGTH] = 0.04
    tilt: Annotated[float, Range(-MOST_TILT, MOST_TILT)] = 0.0
    restitution: Annotated[float, Range(0.0, 1.0)] = 0.06
    force: Annotated[float, Range(1e-3, inf)] = 180.0
    enters: ClassVar[float] = 0.010
    loose: ClassVar[bool] = True

    def __post_init__(self) -> None:
        """Refuse a basket that nobody can build."""
        check(self)
        if self.catch_depth > self.depth:
            raise InputError("Basket.catch_depth", f"{self.depth:g} at most", self.catch_depth)
        if self.cords % 2:
            raise InputError("Basket.cords", "an even number", self.cords)

    @property
    def ring_height(self) -> float:
        """Height of the ring above the tool plate [m]."""
        return self.floor + self.depth

    @property
    def net_radius(self) -> float:
        """Distance of the cords from the axis [m]: the ring's inner edge stands before them."""
        return self.ring_radius + self.ring_thickness

    @property
    def catch_offset(self) -> float:
        """Distance of the catch point beyond the tool plate [m]."""
        return self.ring_height - self.catch_depth

    @property
    def outside(self) -> float:
        """Radius of all of it [m]."""
        return self.ring_radius + self.clear + self.strut

    @property
    def stand(self) -> float:
        """Distance of the catch point from the plate that the basket is mounted on [m]."""
        across = abs(np.sin(self.tilt)) * (self.outside + _GAP)
        return float(self.catch_offset * np.cos(self.tilt) + across)

    @property
    def mount(self) -> Array:
        """Frame of the basket's own plate, seen from the plate it is mounted on, shape (4, 4)."""
        sin, cos, back = float(np.sin(self.tilt)), float(np.cos(self.tilt)), self.catch_offset
        return np.array([
            [cos, 0.0, sin, -back * sin],
            [0.0, 1.0, 0.0, 0.0],
            [-sin, 0.0, cos, self.stand - back * cos],
            [0.0, 0.0, 0.0, 1.0],
        ])  # fmt: skip

    @property
    def com(self) -> float:
        """Height of the centre of mass above the tool plate [m]."""
        return sum(share * height for share, height, _, _ in self._parts)

    @property
    def inertia(self) -> Array:
        """Inertia about the centre of mass, axes of the tool plate [kg m^2], shape (3, 3)."""
        across = along = 0.0
        for share, height, spin, length in self._parts:
            own = 0.5 * spin + length**2 / 12.0
            across += share * (own + (height - self.com) ** 2)
            along += share * spin
        return self.mass * np.diag([across, across, along])

    @property
    def _parts(self) -> tuple[tuple[float, float, float, float], ...]:
        """Share of the mass, height [m], squared radius of gyration about z [m^2], length [m].

        Of ring, struts with net, and flange. A ring of aluminium tube, 10 mm thick outside, and
        three struts of 8 mm weigh 0.1 kg each.
        """
        top, disc = self.ring_height, 0.5 * self.flange**2
        return (
            (0.35, top, self.net_radius**2, 0.0),
            (0.45, 0.5 * top, (self.ring_radius + self.clear) ** 2, top),
            (0.20, 0.125 * self.flange, disc, 0.25 * self.flange),
        )

    def capsules(self) -> tuple[Capsule, ...]:
        """Return capsules on the plate that hold the flange, and net, struts and ring."""
        ring = self.net_radius + self.ring_thickness
        wide = max(self.outside, ring)
        top = self.ring_height + self.ring_thickness - float(np.sqrt(wide**2 - ring**2))
        low = min(self.floor + float(np.sqrt(wide**2 - (wide - self.strut) ** 2)), top)
        return (
            Capsule(
                start=(0.0, 0.0, 0.0),
                end=(0.0, 0.0, 0.25 * self.flange),
                radius=self.flange + self.strut,
            ),
            Capsule(start=(0.0, 0.0, low), end=(0.0, 0.0, top), radius=wide),
        )

    def shares(self, catch: Catch) -> dict[str, float]:
        """Return ``spill``: how far the ball leaves the bottom, in units of the depth."""
        return {"spill": self._spill(catch)}

    def _spill(self, catch: Catch) -> float:
        """Return how far the ball leaves the bottom towards the ring, as share.

        It springs back from the net, and goes on where the arm brakes under it; friction and the
        sides of the net are left out. A basket that comes to rest facing down holds nothing, and
        one whose ring or net is too small for the ball does not let it in.
        """
        ball = catch.ball
        if ball.radius >= min(self.ring_radius, self.depth):
            return LOST
        instants = 24
        h = catch.duration / instants
        force, normal = catch.felt(h * np.concatenate([[0.0], np.arange(instants) + 0.5]))
        out = -ball.restitution * float(catch.v_rel @ normal[0])
        height, speed, most = 0.0, max(out, 0.0), 0.0
        for pushed in np.sum(force * normal, axis=1)[1:].tolist():
            speed -= h * pushed
            height += h * speed
            if height < 0.0:
                height, speed = 0.0, 0.0
            most = max(most, height)
        weight = GRAVITY * float(normal[-1, 2])
        if weight <= 0.0:
            return LOST
        most = max(most, height + 0.5 * max(speed, 0.0) ** 2 / weight)
        return min(most / (self.depth - ball.radius), LOST)

    def contact_force(self, ball: CaughtBall, strike: HandImpact) -> float:
        """Return the force of the net [N], which gives way from whichever side the ball comes."""
        return _NET * reduced(ball.mass, strike.behind) * strike.whole

    def rebound(self, palm: float) -> float:  # noqa: ARG002
        """Return that of the net."""
        return self.restitution

    def contains(self, place: Array) -> bool:
        """Say whether a ball is in the basket: its centre between ring and bottom, inside the net.

        Args:
            place: Its centre from the catch point, axes of the tool plate [m], shape (3,).
        """
        below = self.catch_depth - float(place[2])
        return 0.0 <= below <= self.depth and float(np.hypot(*place[:2])) <= self.net_radius


HANDS: Final[dict[str, HandModel | Basket]] = {"three-finger": HandModel(), "basket": Basket()}
"""Hands by name."""


def hand_named(name: str) -> HandModel | Basket | None:
    """Return a hand by name; none for ``none``.

    Raises:
        UnknownNameError: There is no such hand.
    """
    if name == "none":
        return None
    if name not in HANDS:
        raise UnknownNameError("hand", name, (*HANDS, "none"))
    return HANDS[name]
