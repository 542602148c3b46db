"""Tools that grasp what rests or moves slowly (a parallel jaw, a suction cup), and a paddle.

Sizes are those of common tools: the jaw opens 85 mm, closes at 75 mm/s a finger and weighs 0.9 kg
(Robotiq 2F-85, instruction manual: 85 mm, 20 to 150 mm/s, 20 to 235 N, 0.925 kg); the cup of 40 mm
pulls with 75 N at 60 kPa below the air's pressure. ``delay``, from the command until the tool
begins to act, is what users of grippers tell of: 20 ms to 1 s. What else is said here are choices
of this project.

The z axis of the tool leads to the part; the catch point is the part's middle when it is grasped,
``half`` of its height beyond the cup's lip, or between the tips of the jaw. That of a paddle, which
hits a ball back, is the ball's centre when it touches the face.
"""

from dataclasses import dataclass
from math import inf
from typing import Annotated, ClassVar, Final

import numpy as np

from mitt.core.arm.catch import (
    LOST,
    Catch,
    CaughtBall,
    ClosingPlan,
    FingerDrive,
    HandImpact,
    reduced,
)
from mitt.core.arm.description import Capsule, Hand
from mitt.core.arm.hands import rate
from mitt.core.fields import Range, Settings
from mitt.core.signals import Array

#: Acceleration with which a commanded jaw comes to its speed [m/s^2].
_JERKY = 50.0


class Gripper(Hand, Settings):
    """What takes a thing that rests or moves slowly.

    It weighs as much and turns as hard as a block on the plate.

    Attributes:
        length: From the plate to its end, and length of the block [m].
        across: Width of the block [m].
    """

    __slots__ = ()
    closes: ClassVar[bool] = True
    across: ClassVar[float]
    length: float

    @property
    def yields(self) -> float:
        """How far its end gives way where it is pressed on something [m]."""
        return 0.0

    @property
    def com(self) -> float:
        """Height of the centre of mass above the plate [m]."""
        return 0.4 * self.length

    @property
    def inertia(self) -> Array:
        """Inertia about it [kg m^2], shape (3, 3)."""
        across = self.mass * (self.across**2 + self.length**2) / 12.0
        return np.diag([across, across, self.mass * self.across**2 / 6.0])


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Suction(Gripper):
    """A suction cup on a tube; its bellows give way along the tube.

    Attributes:
        mass: Mass [kg].
        length: Of flange, tube and cup, from the plate to the lip [m].
        radius: Of the cup [m].
        bellows: How far they give way [m].
        pull: With which the cup holds a part that seals it [N].
        press: With which the bellows press on the part at most [N].
        friction: Of the lip on the part.
        half: Half of the part's height [m].
        delay: From the command until the cup pulls [s].
        force: Largest force of a contact that it takes [N].
    """

    mass: Annotated[float, Range(1e-3, 50.0)] = 0.5
    length: Annotated[float, Range(0.02, 1.0)] = 0.15
    radius: Annotated[float, Range(0.002, 0.2)] = 0.02
    bellows: Annotated[float, Range(0.001, 0.1)] = 0.012
    pull: Annotated[float, Range(0.1, 1e4)] = 75.0
    press: Annotated[float, Range(0.1, 1e3)] = 6.0
    friction: Annotated[float, Range(0.0, 10.0)] = 0.8
    half: Annotated[float, Range(0.001, 0.5)] = 0.02
    delay: Annotated[float, Range(0.0, 5.0)] = 0.05
    force: Annotated[float, Range(1e-3, inf)] = 150.0
    across: ClassVar[float] = 0.06
    pulls: ClassVar[bool] = True

    def fingers_at(self, told: float) -> float:  # noqa: ARG002
        """Return that the bellows are out: nothing closes."""
        return 0.0

    @property
    def yields(self) -> float:
        """The bellows' way [m]."""
        return self.bellows

    @property
    def catch_offset(self) -> float:
        """Distance of the grasped part's middle beyond the plate [m]: the bellows half given."""
        return self.length - 0.5 * self.bellows + self.half

    @property
    def drive(self) -> FingerDrive:
        """The bellows: a servo that holds them out, no harder than they press."""
        return FingerDrive(tau_max=self.press, braking=50.0, settling=0.01, gain=40.0)

    def capsules(self) -> tuple[Capsule, ...]:
        """Return a capsule that holds all but the cup, which is meant to touch."""
        end = self.length - self.bellows - 0.03
        return (Capsule(start=(0.0, 0.0, 0.0), end=(0.0, 0.0, max(end, 0.01)), radius=0.03),)

    def closing_on(self, radius: float, restitution: float, aside: Array) -> ClosingPlan:  # noqa: ARG002
        """Return how it grasps: it pulls ``delay`` after the command."""
        profile = np.array([1e6, 1e3, 1e3, 0.0, 1.0])
        return ClosingPlan(profile, 0.0, 0.0, 0.0, inf, 0.0, np.full(len(aside), self.delay))

    def shares(self, catch: Catch) -> dict[str, float]:
        """Return ``seal``: what the part asks of the cup's pull while the arm brakes, as share.

        Across the lip friction holds, of the pull that is left.
        """
        felt, normal = catch.felt(np.linspace(0.0, catch.duration, 8))
        along = np.sum(felt * normal, axis=1)  # what presses the part on the cup is negative
        across = np.linalg.norm(felt - along[:, None] * normal, axis=1)
        most = float(np.max(np.maximum(-along, 0.0) + across / max(self.friction, 1e-6)))
        return {"seal": min(catch.ball.heaviest * most / self.pull, LOST)}

    def contact_force(self, ball: CaughtBall, strike: HandImpact) -> float:
        """Return the force of the lip on the part [N]: the bellows', and what a strike adds."""
        return self.press + rate(ball.restitution) * reduced(0.1 * self.mass, ball.mass) * (
            strike.into
        )


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Jaw(Gripper):
    """A jaw of two fingers that move along the plate's x axis, one towards the other.

    Attributes:
        mass: Mass, fingers included [kg].
        length: From the plate to the fingers' tips [m].
        finger: Length of the fingers [m].
        opening: Between the open fingers [m].
        width: Width of a finger [m]; its thickness is half of that.
        speed: Of each finger [m/s].
        grip: With which each finger presses on the part [N].
        friction: Of fingers and part.
        deep: How far beyond the part's middle the tips reach [m].
        delay: From the command until it begins to close [s].
        force: Largest force of a contact that it takes [N].
    """

    mass: Annotated[float, Range(1e-2, 50.0)] = 0.9
    length: Annotated[float, Range(0.05, 1.0)] = 0.16
    finger: Annotated[float, Range(0.01, 0.5)] = 0.06
    opening: Annotated[float, Range(0.005, 0.5)] = 0.085
    width: Annotated[float, Range(0.004, 0.2)] = 0.022
    speed: Annotated[float, Range(1e-3, 10.0)] = 0.075
    grip: Annotated[float, Range(0.1, 1e4)] = 40.0
    friction: Annotated[float, Range(0.0, 10.0)] = 0.8
    deep: Annotated[float, Range(0.0, 0.2)] = 0.012
    delay: Annotated[float, Range(0.0, 5.0)] = 0.05
    force: Annotated[float, Range(1e-3, inf)] = 235.0
    across: ClassVar[float] = 0.1

    @property
    def closed(self) -> float:
        """Way of each finger [m]."""
        return 0.5 * self.opening

    def fingers_at(self, told: float) -> float:
        """Return how far each finger has moved [m]."""
        return min(told, self.closed)

    @property
    def catch_offset(self) -> float:
        """Distance of the grasped part's middle beyond the plate [m]."""
        return self.length - self.deep

    @property
    def drive(self) -> FingerDrive:
        """The servo of each finger."""
        return FingerDrive(tau_max=self.grip, braking=10.0, settling=0.01, gain=400.0)

    def capsules(self) -> tuple[Capsule, ...]:
        """Return a capsule that holds the jaw's body; the fingers are meant to touch."""
        end = max(self.length - self.finger - 0.02, 0.01)
        return (Capsule(start=(0.0, 0.0, 0.0), end=(0.0, 0.0, end), radius=0.05),)

    def closing_on(self, radius: float, restitution: float, aside: Array) -> ClosingPlan:  # noqa: ARG002
        """Return how it grasps a part whose half width is ``radius``: by its delay and speed."""
        profile = np.array([_JERKY, self.speed, self.speed, 0.0, self.closed])
        takes = self.delay + max(self.closed - radius, 0.0) / self.speed + 0.03
        return ClosingPlan(profile, 0.0, 0.0, 0.0, inf, 0.0, np.full(len(aside), takes))

    def shares(self, catch: Catch) -> dict[str, float]:
        """Return ``grip``: what the part asks of the fingers' friction while the arm brakes."""
        held = 2.0 * self.friction * self.grip
        felt = catch.felt(np.linspace(0.0, catch.duration, 8))[0]
        most = float(np.linalg.norm(felt, axis=1).max())
        return {"grip": min(catch.ball.heaviest * most / max(held, 1e-9), LOST)}

    def contact_force(self, ball: CaughtBall, strike: HandImpact) -> float:
        """Return the harder of grip and strike [N]."""
        return max(
            self.grip, rate(ball.restitution) * reduced(ball.mass, strike.behind) * (strike.whole)
        )


USUAL_SPEED: Final = 6.0
"""Speed along the normal for which the restitution of a paddle is given [m/s]."""


def inertia_share(*, hollow: bool) -> float:
    """Return the moment of inertia of a ball as share of m r^2: of a thin shell, or solid."""
    return 2.0 / 3.0 if hollow else 2.0 / 5.0


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Paddle(Hand, Settings):
    """A round bat on a handle; the z axis leads out of its face.

    A bat of table tennis weighs 0.15 to 0.2 kg, and its blade is 0.15 m wide; this one is larger,
    for larger balls. Of ten rubbers the restitution fell linearly with the speed at which a ball
    comes, and differed from one to the other, as did what they give along the face (T. Gossard,
    arXiv 2604.11349). Which numbers is not published there in a form that was read here: these are
    believed, choices of this project.

    Attributes:
        mass: Mass [kg].
        radius: Of the face [m].
        thickness: Of the blade, its rubber included [m].
        length: From the plate to the face [m].
        restitution: Share of its speed with which a hard ball springs back from the rubber, where
            it comes at ``USUAL_SPEED``.
        fall: By how much that is less for each m/s more [s/m].
        tangential: Share of its slip along the face with which the rubber, bent by it, lets the
            ball go the other way; 0 for a ball that ends rolling.
        friction: Of ball and rubber, so much that a ball does not slide.
        touch: How long a ball and the face touch [s].
        half: Radius of the ball [m].
        force: Largest force of a contact that it takes [N].
    """

    mass: Annotated[float, Range(1e-2, 50.0)] = 0.25
    radius: Annotated[float, Range(0.02, 0.5)] = 0.09
    thickness: Annotated[float, Range(0.004, 0.1)] = 0.012
    length: Annotated[float, Range(0.02, 1.0)] = 0.12
    restitution: Annotated[float, Range(0.1, 0.95)] = 0.8
    fall: Annotated[float, Range(0.0, 0.1)] = 0.01
    tangential: Annotated[float, Range(-0.5, 0.99)] = 0.5
    friction: Annotated[float, Range(0.0, 10.0)] = 3.0
    touch: Annotated[float, Range(5e-4, 0.02)] = 0.005
    half: Annotated[float, Range(0.001, 0.5)] = 0.04
    force: Annotated[float, Range(1e-3, inf)] = inf
    enters: ClassVar[float] = 0.01

    @property
    def com(self) -> float:
        """Height of the centre of mass above the plate [m]: two thirds of it are the blade."""
        return self.length * 5.0 / 6.0

    @property
    def inertia(self) -> Array:
        """Inertia about it [kg m^2], shape (3, 3): a disc, and a rod from the plate to it."""
        m, apart = self.mass, self.length**2
        across = m * (self.radius**2 / 6.0 + apart / 36.0 + apart / 18.0)
        return np.diag([across, across, m * self.radius**2 / 3.0])

    @property
    def catch_offset(self) -> float:
        """Distance beyond the plate of the centre of a ball that touches the face [m]."""
        return self.length + self.half

    def capsules(self) -> tuple[Capsule, ...]:
        """Return capsules that hold the handle, and three side by side that hold the blade."""
        wide, high = self.radius / 3.0, self.length - 0.5 * self.thickness
        blade = (
            Capsule(start=(x, -y, high), end=(x, y, high), radius=wide)
            for x, y in ((0.0, self.radius), (-2.0 * wide, 2.8 * wide), (2.0 * wide, 2.8 * wide))
        )
        return (Capsule(start=(0.0, 0.0, 0.0), end=(0.0, 0.0, high), radius=0.02), *blade)

    def loss(self, *, hollow: bool, tangential: float | None = None) -> float:
        """Return the share of its slip along the face that a ball loses as velocity.

        A solid ball that ends rolling loses 2/7, a hollow one 2/5.

        Args:
            hollow: Whether the ball is a thin shell.
            tangential: Tangential restitution; the paddle's if left out.
        """
        given = self.tangential if tangential is None else tangential
        return (1.0 + given) / (1.0 + 1.0 / inertia_share(hollow=hollow))

    def shares(self, catch: Catch) -> dict[str, float]:  # noqa: ARG002
        """Return nothing: it holds no ball."""
        return {}

    def contact_force(self, ball: CaughtBall, strike: HandImpact) -> float:
        """Return the largest force of a ball on the face [N]: that of a spring, half a swing."""
        return reduced(ball.mass, strike.behind) * strike.into * np.pi / self.touch


TOOLS: Final[dict[str, Suction | Jaw]] = {"suction": Suction(), "jaw": Jaw()}
"""Tools by name."""
