"""The hand as data: what it weighs, where it catches, how its fingers are shaped and close.

The paper gives three fingers of 0.1 m that close 90 degrees in 20 ms (Table 1). Mass, centre of
mass and catch point are choices of this project where the paper is silent, and so
are the shapes: they were chosen by throwing balls at a hand on a turning arm. A bent finger of
one joint reaches over a 40 mm ball and closes on a 20 mm one; its plane stands off the axis,
so that the fingers pass one another instead of meeting tip to tip over a small ball.

A ball of mass m that meets what it strikes at a speed u, spring and damper between them, presses
with at most F = rate m u. The rate follows from what the ball gives back of its speed. Of what
moves as well, the hand on its arm or a finger, the reduced mass counts in the place of m. Three
contacts are looked at, and the hardest of them is the force of the catch:

| contact | what it is, and what it was measured with                                         |
|---------|-----------------------------------------------------------------------------------|
| palm    | at the speed that the fingers leave; a ball that touches pad and rim jams there   |
| fingers | at the speed of the catch, where they meet the ball before the palm does          |
| press   | of the closed fingers, by their drives                                            |

Fingers that come between ball and palm stop the ball, others hardly slow it: what counts is where
on the ball they touch it. A ball that has more energy than their drives can take of it pushes them
open and goes on with the rest.
"""

from dataclasses import dataclass, field
from functools import lru_cache
from math import inf
from typing import Annotated, ClassVar

import numpy as np

from mitt.core import checks
from mitt.core.arm.catch import (
    LOST,
    Catch,
    CaughtBall,
    ClosingPlan,
    FingerDrive,
    HandImpact,
    reduced,
)
from mitt.core.arm.description import Capsule, Hand, checked_inertia
from mitt.core.errors import InputError
from mitt.core.fields import Range, Settings, brief, check
from mitt.core.kernels import kernel
from mitt.core.signals import Array

#: Angles from open to closed at which fingers are looked at for a ball in their way.
_LOOKS = 91
#: Places of a ball, from the catch point to one radius in front of it, at which they are.
_PLACES = 21
#: The angle of a touch is looked for by cutting a range of angles in 32, and the one cut where
#: the fingers first touch again, so often: to 1e-12 of the first range.
_SHARES = np.linspace(0.0, 1.0, 33)[:, None]
_CUTS = 8
#: Angles of the fingers at which capsules are laid about them: between two of these the tip of a
#: finger of 0.1 m strays by less than 0.1 um. Every thirtieth tells how high they reach.
_ANGLES = 901
_ROUGH = 30
#: Radius of the palm and how far its rim stands above it [m], and radius of its capsule [m].
_PALM = 0.041
_RIM = 0.012
_PALM_CAPSULE = 0.045
#: By how much fingers are behind a command that is given early enough for its delays [s].
_LATE = 0.002


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Finger(Settings):
    """A one-joint finger: two rods with a fixed bend, turning in a plane along the palm normal.

    Angles are measured in that plane from the palm normal, inward positive.

    Attributes:
        base_radius: Distance of the joint from the palm's axis, in the finger's plane [m].
        base_height: Height of the joint above the tool plate [m].
        offset: Distance of the finger's plane from the palm's axis [m].
        lean: Outward lean of the first rod when open [rad].
        proximal: Length of the first rod [m].
        distal: Length of the second rod [m]; both make the paper's 0.1 m.
        bend: Fixed inward bend of the second rod [rad].
        thickness: Radius of the rods [m].
        mass: Mass of a finger [kg].
        armature: Rotor inertia of its drive at the joint [kg m^2].
    """

    base_radius: Annotated[float, Range(0.0, 1.0)] = 0.06
    base_height: Annotated[float, Range(-1.0, 1.0)] = 0.07
    offset: Annotated[float, Range(-1.0, 1.0)] = 0.0125
    lean: Annotated[float, Range(-np.pi, np.pi)] = np.deg2rad(65.0)
    proximal: Annotated[float, Range(1e-3, 1.0)] = 0.055
    distal: Annotated[float, Range(1e-3, 1.0)] = 0.045
    bend: Annotated[float, Range(-np.pi, np.pi)] = np.deg2rad(80.0)
    thickness: Annotated[float, Range(1e-4, 0.1)] = 0.006
    mass: Annotated[float, Range(1e-6, 10.0)] = 0.025
    armature: Annotated[float, Range(0.0, 1.0)] = 5e-5

    def points(self, angle: float | Array) -> tuple[Array, Array, Array]:
        """Return joint, bend and tip [m], each shape (..., 2): outward and along the palm normal.

        Args:
            angle: Closing angles [rad], shape (...); 0 is open.
        """
        first = np.asarray(angle) - self.lean
        second = first + self.bend
        base = np.array([self.base_radius, self.base_height])
        knuckle = base + self.proximal * np.stack((-np.sin(first), np.cos(first)), axis=-1)
        tip = knuckle + self.distal * np.stack((-np.sin(second), np.cos(second)), axis=-1)
        return base, knuckle, tip

    def touches(self, angle: float, ball_height: float) -> tuple[Array, Array]:
        """Return where the finger comes nearest to the palm's axis at a height, and its joint [m].

        Args:
            angle: Closing angle [rad].
            ball_height: Height above the tool plate [m].

        Returns:
            Two points in the finger's plane, outward and along the palm normal, shape (2,) each.
        """
        base, knuckle, tip = self.points(angle)
        ball = np.array([0.0, ball_height])
        near = [_nearest(ball, *rod) for rod in ((base, knuckle), (knuckle, tip))]
        return min(near, key=lambda point: float(np.linalg.norm(point - ball))), base

    def gap(self, angle: float | Array, ball_radius: float, ball_height: float | Array) -> Array:
        """Return the free way between the finger and balls on the palm's axis [m], shape (...).

        Args:
            angle: Closing angles [rad], shape (...).
            ball_radius: Radius of the balls [m].
            ball_height: Heights of their centres above the tool plate [m], shape (...).
        """
        first = np.asarray(angle) - self.lean
        out, up = np.array(self.base_radius), self.base_height - np.array(ball_height)
        nearest: Array = np.full(np.broadcast_shapes(first.shape, up.shape), inf)
        for length, turned in ((self.proximal, first), (self.distal, first + self.bend)):
            across, along = -length * np.sin(turned), length * np.cos(turned)
            share = np.clip(-(out * across + up * along) / length**2, 0.0, 1.0)
            away = (out + share * across) ** 2 + (up + share * along) ** 2
            nearest = np.minimum(nearest, away)
            out, up = out + across, up + along
        free: Array = np.sqrt(nearest + self.offset**2) - ball_radius - self.thickness
        return free


@dataclass(frozen=True, slots=True, kw_only=True)
class Closing:
    """How the fingers are led: fast until just before they touch, slow and firm from there.

    The ring of the fingertips is widest for a ball whose middle passes them, 26 mm before the catch
    point for the default fingers and ball. They begin so early that they have closed when the ball
    has passed by ``passed``: so they meet a fast ball as it passes, slow it down, and are behind it
    before it has come back from the palm.

    They end a little beyond the angle at which they touch a ball that lies on the palm: a cage
    whose fingers each push back what comes towards them. Fingers that press on at full torque
    push a ball that lies off the middle out of the hand, the sooner the more slippery it is.

    Attributes:
        acceleration: Acceleration and braking of the fast part [rad/s^2].
        fastest: Largest speed of the fast part [rad/s].
        touch_speed: Speed at which the ball is met [rad/s]; it sets the force of the impact.
        margin: Angle before touching at which the fast part ends [rad].
        firm: Time from the first touch until the fingers hold [s].
        passed: How far the ball's middle has passed the fingertips when they have closed [m].
        near: How far the ball's middle is at most from passing the fingertips when they first are
            as narrow as it [m]: fingers that are so sooner keep a fast ball out.
        squeeze: Angle beyond the touch of a ball on the palm at which the closing ends [rad]; it
            asks the default drives for their full torque.
        soft: Restitution up to which ``passed`` and ``near`` hold. A harder ball springs off the
            fingers, too: it is met farther inside, the harder the farther, but before the catch.
        hard: Restitution from which the fingers have closed ``early`` before the catch, wherever
            the ball is then.
        early: That time [s].
    """

    acceleration: Annotated[float, Range(1.0, 1e7)] = 11_000.0
    fastest: Annotated[float, Range(1e-2, 1e3)] = 200.0
    touch_speed: Annotated[float, Range(1e-3, 1e3)] = 11.0
    margin: Annotated[float, Range(0.0, np.pi)] = 0.07
    firm: Annotated[float, Range(0.0, 1.0)] = 0.005
    passed: Annotated[float, Range(0.0, 1.0)] = 0.015
    near: Annotated[float, Range(0.0, 1.0)] = 0.0105
    squeeze: Annotated[float, Range(0.0, np.pi)] = 0.04
    soft: Annotated[float, Range(0.0, 1.0)] = 0.5
    hard: Annotated[float, Range(0.0, 1.0)] = 0.85
    early: Annotated[float, Range(0.0, 1.0)] = 0.0035

    __repr__ = brief

    def __post_init__(self) -> None:
        """Refuse what no closing can be; InputError names the field."""
        check(self)
        if not self.soft < self.hard:
            raise InputError("Closing.soft", f"a number below hard, {self.hard:g}", self.soft)

    def hardness(self, restitution: float) -> float:
        """Return where a ball's restitution is between ``soft``, 0, and ``hard``, 1."""
        return min(max((restitution - self.soft) / (self.hard - self.soft), 0.0), 1.0)

    def inside(self, ring: float) -> float:
        """Return how far from the catch point a ball is inside whose ring is so far from it [m]."""
        return max(ring - self.passed, 0.0)

    def profile(self, touch: float, hold: float) -> Array:
        """Return the numbers that :func:`closing_angle` takes, shape (5,).

        Args:
            touch: Angle at which the fingers touch a ball at the catch point [rad].
            hold: Angle at which the closing ends [rad].
        """
        slow, fast_part = min(self.touch_speed, self.fastest), max(0.0, touch - self.margin)
        peak = max(float(np.sqrt(self.acceleration * fast_part + 0.5 * slow**2)), slow)
        peak = min(peak, self.fastest)
        return np.array([self.acceleration, peak, slow, fast_part, hold])


def _cylinder(mass: float, radius: float, length: float) -> Array:
    """Return the inertia of a solid cylinder along z [kg m^2], shape (3, 3)."""
    across = mass * (3.0 * radius**2 + length**2) / 12.0
    return np.diag([across, across, 0.5 * mass * radius**2])


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class HandModel(Hand):
    """A hand mounted on the tool plate, palm normal along the plate's z axis.

    Attributes:
        mass: Mass, fingers included [kg].
        com: Centre of mass beyond the tool plate, fingers open [m].
        inertia: Inertia about it, axes of the tool plate [kg m^2], shape (3, 3).
        catch_offset: Distance of the catch point beyond the tool plate [m].
        palm_height: Height of the palm's surface above the tool plate [m].
        fingers: Number of fingers, evenly around the palm.
        yaw: Direction of the first finger about the palm normal, from the plate's x axis [rad].
        finger: Shape of each finger.
        drive: Servo of each finger.
        closing: How they are led.
        force: Largest force of a single contact with a ball that it takes [N]; infinite where
            nobody knows. A choice of this project where no maker says one: 300 m/s^2 of its mass,
            the shock that devices with motors and gears are commonly tested with (30 g, 11 ms, one
            of the severities of IEC 60068-2-27).
    """

    mass: Annotated[float, Range(1e-12, 100.0)] = 0.8
    com: Annotated[float, Range(-1.0, 1.0)] = 0.05
    inertia: Array = field(default_factory=lambda: _cylinder(0.8, 0.06, 0.10))
    catch_offset: Annotated[float, Range(-1.0, 2.0)] = 0.12
    palm_height: Annotated[float, Range(0.0, 1.0)] = 0.08
    fingers: Annotated[int, Range(1, 12)] = 3
    yaw: Annotated[float, Range(-10.0, 10.0)] = 0.0
    finger: Finger = field(default_factory=Finger)
    drive: FingerDrive = field(default_factory=FingerDrive)
    closing: Closing = field(default_factory=Closing)
    force: Annotated[float, Range(1e-3, inf)] = 240.0
    closes: ClassVar[bool] = True

    __repr__ = brief

    def __post_init__(self) -> None:
        """Refuse what no hand can be.

        Raises:
            ShapeError: The inertia has another shape.
            InputError: A field is not what it may be; the message names it.
            ModelError: No body has such an inertia.
        """
        check(self)
        inertia = checks.array("HandModel.inertia", self.inertia, (3, 3), finite=True)
        if np.abs(inertia - inertia.T).max() > 1e-6 * np.abs(inertia).max():
            raise InputError("HandModel.inertia", "a symmetric matrix", inertia.tolist())
        inertia = checked_inertia("HandModel.inertia", inertia, do="check the hand's inertia")
        object.__setattr__(self, "inertia", inertia)

    def reaches(self, ball_radius: float) -> bool:
        """Say whether the fingers, open, let a ball to the catch point, and then close on it.

        Args:
            ball_radius: Radius of the ball [m].
        """
        at_catch = np.array([self.catch_offset])
        let_in = self.finger.gap(0.0, ball_radius, at_catch) > 0.0
        return bool(np.all(let_in & (self._meets(ball_radius, at_catch) < inf)))

    def touch_angle(self, ball_radius: float) -> float:
        """Return the closing angle at which the fingers touch a ball at the catch point [rad].

        Args:
            ball_radius: Radius of the ball [m]; where the fingers never touch it, the closed
                angle is returned.
        """
        return float(self._touch(ball_radius, np.array([self.catch_offset]))[0])

    def hold_angle(self, ball_radius: float) -> float:
        """Return the closing angle at which the closing ends [rad]: see :class:`Closing`.

        Args:
            ball_radius: Radius of the ball [m].
        """
        heights = np.array([self.palm_height + ball_radius, self.catch_offset])
        touch = float(self._touch(ball_radius, heights).max())
        return min(touch + self.closing.squeeze, self.drive.closed)

    def ring(self, ball_radius: float) -> tuple[float, float]:
        """Return where the ring of the fingertips is widest for a ball.

        Args:
            ball_radius: Radius of the ball [m].

        Returns:
            How far before the catch point the ball's middle passes it [m], and the closing angle at
            which it just does [rad].
        """
        before = np.linspace(0.0, ball_radius, _PLACES)
        angles = self._touch(ball_radius, self.catch_offset + before)
        k = int(np.argmin(angles))
        return float(before[k]), float(angles[k])

    def _touch(self, ball_radius: float, heights: Array) -> Array:
        """Return the angles at which the fingers touch balls on the axis at heights [rad], (m,)."""
        low, high = np.zeros(len(heights)), self._meets(ball_radius, heights)
        met, high, each = high < inf, np.minimum(high, self.drive.closed), np.arange(len(heights))
        for _ in range(_CUTS):
            angles = low + (high - low) * _SHARES
            first = np.argmax(self.finger.gap(angles, ball_radius, heights) <= 0.0, axis=0)
            low, high = angles[np.maximum(first - 1, 0), each], angles[first, each]
        return np.where(met, high, self.drive.closed)

    def _meets(self, ball_radius: float, heights: Array) -> Array:
        """Return angles at which balls on the axis are in the way, or infinity [rad], (m,).

        That is the closed angle, unless fingers that close farther pass a small ball by then.
        """
        closed = self.drive.closed
        angles = np.array([closed, *np.linspace(0.0, closed, _LOOKS)])
        met = self.finger.gap(angles[:, None], ball_radius, heights) <= 0.0
        return np.where(met.any(axis=0), angles[met.argmax(axis=0)], inf)

    def capsules(self) -> tuple[Capsule, ...]:
        """Return capsules on the plate that hold the palm, and the fingers at any angle."""
        finger = self.finger
        points = np.array([finger.points(x) for x in np.linspace(0.0, self.drive.closed, _ANGLES)])
        off, height = np.hypot(points[..., 0], finger.offset), points[..., 1]
        width = float(off.max()) + finger.thickness
        low, high = height.min() - finger.thickness, height[::_ROUGH].max() + finger.thickness
        # The tops of the swept fingers are narrow: the round end of the capsule covers them where
        # it reaches. A capsule that holds the ends of a rod holds the rod.
        round_ = np.sqrt(np.maximum((width - finger.thickness) ** 2 - off**2, 0.0))
        end = max(float(high - 0.5 * width), float(low), float((height - round_).max()))
        palm = _palm_end(self.palm_height, width, float(low), end)
        return (
            Capsule(start=(0.0, 0.0, 0.0), end=(0.0, 0.0, palm), radius=_PALM_CAPSULE),
            Capsule(start=(0.0, 0.0, float(low)), end=(0.0, 0.0, end), radius=width),
        )

    def holding_force(self, ball_radius: float, friction: float) -> float:
        """Return how hard a ball at the catch point can be pulled out of the closed hand [N].

        Each finger presses on the ball where it touches it, as hard as its drive can; what holds
        the ball along the palm's normal is that force's own part and its friction. A ball that is
        too large for the open fingers, or that they do not reach, is held by nothing.

        Args:
            ball_radius: Radius of the ball [m].
            friction: Coefficient of friction of ball and fingers.
        """
        inward, press = _pressing(self, ball_radius)
        held = -inward[2] + friction * float(np.hypot(inward[0], inward[1]))
        return self.fingers * press * max(float(held), 0.0)

    def press(self, ball_radius: float) -> float:
        """Return how hard the drive of a finger presses it on a ball at the catch point [N].

        Args:
            ball_radius: Radius of the ball [m]; 0 N where the fingers do not reach it.
        """
        return _pressing(self, ball_radius)[1]

    @property
    def closed(self) -> float:
        """Angle of its closed fingers [rad]."""
        return self.drive.closed

    @property
    def finger_mass(self) -> float:
        """Mass that the fingers together oppose to a ball which meets them beyond their bend [kg].

        Their inertia about their joints, a rod's for each of the two, over the lever of the outer
        one.
        """
        f = self.finger
        inertia = f.armature + f.mass * (f.proximal**2 + f.distal**2) / 3.0
        return self.fingers * inertia / f.distal**2

    def profile(self, ball_radius: float) -> Array:
        """Return the numbers of the closing on a ball, for :func:`closing_angle`, shape (5,)."""
        touch, hold = self.touch_angle(ball_radius), self.hold_angle(ball_radius)
        return self.closing.profile(touch, hold)

    def closing_time(self, ball_radius: float, aside: float = 0.0) -> float:
        """Return the time from the start of the closing until the fingers hold a ball [s].

        A ball that passes between the fingertips off the palm's axis needs room as a larger one:
        the fingers have to be as far open as for that one when it does.

        Args:
            ball_radius: Radius of the ball [m].
            aside: How far from the axis it passes between the fingertips [m].
        """
        return self._takes(self.profile(ball_radius), ball_radius + aside)

    def _takes(self, profile: Array, passing: float) -> float:
        """Return the closing time [s] where so large a radius passes the fingertips [m]."""
        reached = closing_time(profile, self.ring(passing)[1])
        return reached + self.drive.settling + self.closing.firm

    def closing_on(self, radius: float, restitution: float, aside: Array) -> ClosingPlan:
        """Return how the fingers close on a ball; see :meth:`Hand.closing_on`."""
        c, hardness = self.closing, self.closing.hardness(restitution)
        profile, ring = self.profile(radius), self.ring(radius)[0]
        return ClosingPlan(
            profile=profile,
            inside=(1.0 - hardness) * c.inside(ring),
            early=hardness * c.early,
            ring=ring,
            near=(ring + c.near) / (1.0 - hardness) if hardness < 1.0 else inf,
            firm=c.firm,
            takes=np.array([self._takes(profile, radius + x) for x in aside.tolist()]),
        )

    def shares(self, catch: Catch) -> dict[str, float]:
        """Return ``grip`` and ``palm``.

        The one is the pull on the fingers in units of what they hold; the other, how far the ball
        comes from the side or from behind the palm: between the fingers it may come from nearly
        everywhere in front of it. From 100 degrees off the palm's normal on, seen from the hand, it
        touches the fingers before it is in the hand: of 200 throws at one design all beyond it were
        lost, none below 95 degrees, and of 15 balls at 95 to 96 degrees at another map none. Below
        a relative speed of 1 m/s, a choice of this project, the share falls with the speed.
        """
        speed, into = float(np.linalg.norm(catch.v_rel)), -float(catch.v_rel @ catch.normal)
        palm = (speed - into) / ((1.0 - float(np.cos(np.deg2rad(100.0)))) * max(speed, 1.0))
        return {"grip": self._grip(catch), "palm": palm}

    def _grip(self, catch: Catch) -> float:
        """Return the largest pull of the ball on the fingers, as share.

        What presses it into the palm costs the fingers nothing. A ball that they cannot hold at all
        is lost. One that has just struck is held with 60 % of what the drives hold at rest: of 11
        balls of 1 kg that asked for more none stayed, of 60 of 0.5 kg that asked for less 50 did.
        """
        ball = catch.ball
        held = 0.6 * self.holding_force(ball.radius, ball.friction)
        if held == 0.0:
            return LOST
        force, normal = catch.felt(np.linspace(0.0, catch.duration, 8))
        out = np.sum(force * normal, axis=1)
        across = np.linalg.norm(force - out[:, None] * normal, axis=1)
        return ball.heaviest * float(np.max(np.maximum(-out, 0.0) + across)) / held

    def contact_force(self, ball: CaughtBall, strike: HandImpact) -> float:
        """Return the hardest of the contacts of the module's table [N].

        One finger of several presses with 0.65 of the rate.
        """
        speed = strike.into
        left = self.speed_left(ball, self.meeting(ball.radius, strike.lead, speed))
        palm = max(left * speed, self.speed_through(ball, speed))
        fingers = speed if left < 1.0 else 0.0
        return max(
            rate(ball.restitution) * jam(ball) * reduced(ball.mass, strike.behind) * palm,
            0.65 * rate(ball.restitution) * reduced(ball.mass, self.finger_mass) * fingers,
            self.press(ball.radius),
        )

    def speed_left(self, ball: CaughtBall, beyond: float) -> float:
        """Return which share of its speed the fingers leave a ball on its way to the palm.

        To stop one as heavy as they are they have to meet it 3.4 mm beyond its widest circle; from
        9 mm less on they leave it all of its speed.

        Args:
            ball: The ball.
            beyond: How far beyond the ball's widest circle, towards the palm, they meet it [m].
        """
        needed = 0.0034 * ball.mass / self.finger_mass
        return float(np.sqrt(np.clip((needed - beyond) / 0.009, 0.0, 1.0)))

    def speed_through(self, ball: CaughtBall, speed: float) -> float:
        """Return the speed [m/s] of a ball that has pushed the closed fingers open; 0 if it cannot.

        It takes the fingers along, as one body, and their drives press against it over 13.6 mm: of
        balls of 0.14 kg at 5 m/s and of 0.2 kg at 4 m/s one in three comes through the default
        hand's.

        Args:
            ball: The ball.
            speed: At which it meets the fingers [m/s].
        """
        both = ball.mass + self.finger_mass
        work = self.fingers * self.press(ball.radius) * 0.0136
        shared = ball.mass * speed / both
        return float(np.sqrt(max(shared**2 - 2.0 * work / both, 0.0)))

    def meeting(self, ball_radius: float, lead: float, speed: float) -> float:
        """Return how far beyond a ball's widest circle, towards the palm, its fingers meet it [m].

        Negative where they close around a ball that is in the palm already.

        Args:
            ball_radius: Radius of the ball [m].
            lead: From the start of the closing to the catch [s].
            speed: Of the ball along the palm's normal, towards the palm [m/s].
        """
        times, angles, tops = _course(self, ball_radius)
        height = speed * np.maximum(lead - times, 0.0)
        met = np.flatnonzero(height <= tops)
        if not len(met):
            return -ball_radius
        k = int(met[0])
        share = 1.0
        if k > 0 and np.isfinite(tops[k - 1]):
            free, blocked = height[k - 1] - tops[k - 1], tops[k] - height[k]
            share = float(free / (free + blocked))
        last = max(k - 1, 0)
        z = self.catch_offset + float(height[last] + share * (height[k] - height[last]))
        angle = float(angles[last] + share * (angles[k] - angles[last]))
        point, _ = self.finger.touches(angle, z)
        return z - float(point[1])

    def inside(self, ball_radius: float) -> float:
        """Return how far from the catch point a ball is when the fingers have closed [m].

        Args:
            ball_radius: Radius of the ball [m].
        """
        return self.closing.inside(self.ring(ball_radius)[0])

    def closing_angle(self, elapsed: float, ball_radius: float) -> float:
        """Return the angle to be commanded so long after the start of the closing [rad].

        Args:
            elapsed: Time since the start [s]; 0 or less is open.
            ball_radius: Radius of the ball [m].
        """
        return float(closing_angle(elapsed, self.profile(ball_radius)))


@kernel
def closing_angle(elapsed: float, profile: Array) -> float:
    """Return the commanded angle [rad] so long after the start of the closing.

    Args:
        elapsed: Time since the start [s]; 0 or less is open.
        profile: Acceleration, largest speed, speed at the touch, angle at which the fast part ends,
            and at which the closing ends [rad ...], shape (5,); more behind them is not read.
    """
    a, peak, slow, fast_part = profile[0], profile[1], profile[2], profile[3]
    rise, fall = peak / a, (peak - slow) / a
    risen = 0.5 * a * rise * rise
    even = max(fast_part - risen - 0.5 * (peak + slow) * fall, 0.0) / peak
    if elapsed <= 0.0:
        angle = 0.0
    elif elapsed < rise:
        angle = 0.5 * a * elapsed * elapsed
    elif elapsed < rise + even:
        angle = risen + peak * (elapsed - rise)
    elif elapsed < rise + even + fall:
        left = rise + even + fall - elapsed
        angle = fast_part - slow * left - 0.5 * a * left * left
    else:
        angle = fast_part + slow * (elapsed - rise - even - fall)
    return float(min(angle, profile[4]))


def closing_time(profile: Array, angle: float) -> float:
    """Return the time from the start of the closing until an angle is commanded [s].

    Args:
        profile: As of :func:`closing_angle`.
        angle: The angle, up to that at which the closing ends [rad].
    """
    low, high = 0.0, 1.0
    while closing_angle(high, profile) < min(angle, float(profile[4])):
        high *= 2.0
    for _ in range(40):
        middle = 0.5 * (low + high)
        if closing_angle(middle, profile) < angle:
            low = middle
        else:
            high = middle
    return high


@lru_cache(maxsize=32)
def _pressing(hand: HandModel, ball_radius: float) -> tuple[Array, float]:
    """Return where to a finger presses on a ball at the catch point, (3,), and its force [N].

    0 N where the fingers do not reach it.
    """
    if not hand.reaches(ball_radius):
        return np.zeros(3), 0.0
    finger, catch = hand.finger, hand.catch_offset
    point, base = finger.touches(hand.touch_angle(ball_radius), catch)
    inward = np.array([-point[0], -finger.offset, catch - point[1]])
    inward = inward / np.linalg.norm(inward)
    arm = point - base
    lever = abs(float(arm[0] * inward[2] - arm[1] * inward[0]))
    # A lever shorter than a finger is thick is none: there the rod bends, not the joint.
    return inward, hand.drive.tau_max / max(lever, finger.thickness)


@lru_cache(maxsize=8)
def _course(hand: HandModel, ball_radius: float) -> tuple[Array, Array, Array]:
    """Return how far fingers are, and how high they meet a ball, from the start of a closing on.

    Returns:
        Times since the command to close [s], the fingers' angles [rad], and the greatest height
        above the catch point, up to 120 mm, below which fingers end, at which they touch the ball
        on its way in [m], -inf where it is free to come in; shape (k,) each.
    """
    profile = hand.profile(ball_radius)
    end = _LATE + closing_time(profile, hand.hold_angle(ball_radius))
    times: Array = np.linspace(0.0, end, 161)
    angles: Array = np.array([closing_angle(t - _LATE, profile) for t in times])
    heights: Array = np.linspace(0.12, 0.0, 241)
    tops: Array = np.full(len(times), -np.inf)
    for k, angle in enumerate(angles.tolist()):
        gaps = hand.finger.gap(angle, ball_radius, hand.catch_offset + heights)
        touched = np.flatnonzero(gaps <= 0.0)
        if len(touched):
            tops[k] = heights[touched[0]]
    return times, angles, tops


def rate(restitution: float) -> float:
    """Return the largest force of a contact with the pads per momentum of the ball [1/s].

    Not below that of a tennis ball, which touches for 5 ms, and as much higher as the pads damp;
    within 15 % of what a palm held still shows, for restitutions of 0.2 to 0.75 and radii up to
    30 mm.
    """
    return max(560.0, 260.0 / max(restitution, 1e-3))


def jam(ball: CaughtBall) -> float:
    """Return how many times as hard as without a rim the palm's hardest contact presses.

    A ball of 40 mm touches rim and pad at once and jams, and what its contacts press on one another
    with is no force on the ball. For it 1 + 17.5 (e - 0.2) with a friction of 1, and none with one
    of 0.6; a bell of 6.5 mm about that radius. Within 45 %.
    """
    grip = min(max((ball.friction - 0.6) / (1.0 - 0.6), 0.0), 1.0)
    near = float(np.exp(-(((ball.radius - 0.040) / 0.0065) ** 2)))
    return 1.0 + 17.5 * max(ball.restitution - 0.2, 0.0) * grip * near


def _nearest(point: Array, start: Array, end: Array) -> Array:
    """Return the points of segments nearest to points [m], shape (..., 2)."""
    along = end - start
    share = np.sum((point - start) * along, axis=-1) / np.sum(along * along, axis=-1)
    out: Array = start + np.clip(share, 0.0, 1.0)[..., None] * along
    return out


def _palm_end(height: float, width: float, low: float, end: float) -> float:
    """Return where the palm's capsule ends, so that with that of the fingers it holds the palm [m].

    Args:
        height: Of the palm above the plate [m].
        width: Radius of the fingers' capsule [m].
        low: Where that begins [m].
        end: Where that ends [m].
    """
    own, theirs = (np.sqrt(max(x**2 - _PALM**2, 0.0)) for x in (_PALM_CAPSULE, width))
    top, half = height + _RIM, 0.5 * height
    covered = width > _PALM and low - theirs <= half + own and end + theirs >= top
    return half if covered else max(half, float(top - own))
