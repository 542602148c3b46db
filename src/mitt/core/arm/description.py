"""A serial arm as a table, from which every implementation of it is built.

A link turns about or slides along ``axis`` of its own frame, which sits at ``placement`` in the
frame of the link before it; mass properties are given in the link's frame. One table gives the
arrays of our kernels and the MuJoCo model of the plant.

A body's principal moments of inertia are above 0, and none is above the sum of the others (that of
a flat plate is just as large). Files of light links break this in the last digit that they keep, or
leave all moments out: such moments are mended, and what no rounding explains is refused.
"""

from abc import ABC, abstractmethod
from dataclasses import dataclass, replace
from typing import ClassVar, NamedTuple

import numpy as np

from mitt.core import checks
from mitt.core.arm.catch import Catch, CaughtBall, ClosingPlan, FingerDrive, HandImpact
from mitt.core.errors import InputError, ModelError
from mitt.core.fields import brief
from mitt.core.signals import Array

_keep = object.__setattr__
#: Largest length, mass or inertia of a link that is taken for meant [m, kg, kg m^2].
_LARGEST = 1e4
#: Least mass of a link, which MuJoCo still takes [kg].
_LIGHTEST = 1e-12

#: Gap that commands keep to the ends of a joint's range [rad or m]; a choice of this project.
STOP_GAP = 0.06

#: Least principal moment that MuJoCo takes, with some room [kg m^2].
_LEAST = 1e-13
#: By how much of itself the largest moment stays below the sum of the others: room for rounding.
_SLACK = 1e-9
#: How far moments may be off by the rounding of a file [kg m^2].
_ROUNDED = 1e-6
#: Density of steel [kg/m^3].
_STEEL = 7850.0
#: Encoder resolution of a joint whose description states none [rad or m]: 17 bits a turn of the
#: joint, as the joint-side encoders of common cobots have or better. A choice of this project.
ENCODER_STEP = 2.0 * np.pi / 2**17


@dataclass(frozen=True, slots=True, kw_only=True)
class JointBrake:
    """What holds a joint once its drive is off.

    Attributes:
        torque: Largest torque of the holding brake [N m]; 0 where there is none.
        damping: Torque per joint speed of the drive's shorted windings [N m s/rad].
        delay: Time from the command to engage until both act [s].
    """

    torque: float
    damping: float = 0.0
    delay: float = 0.05

    def __post_init__(self) -> None:
        """Refuse what no brake can be."""
        given = {"torque": self.torque, "damping": self.damping, "delay": self.delay}
        numbers = [checks.number(f"brake.{name}", value) for name, value in given.items()]
        if not all(0.0 <= x < np.inf for x in numbers) or self.delay > 1.0:
            wanted = "a torque, a damping and a delay of at least 0, the delay at most 1 s"
            raise ModelError("brake", wanted, numbers)


@dataclass(frozen=True, slots=True, kw_only=True)
class Capsule:
    """A collision shape of a link: all points within ``radius`` of a segment, in its frame [m]."""

    start: tuple[float, float, float]
    end: tuple[float, float, float]
    radius: float

    def __post_init__(self) -> None:
        """Refuse ends that are not finite and a radius that is not above zero."""
        for name, end in (("start", self.start), ("end", self.end)):
            _keep(self, name, tuple(checks.vector(f"capsule.{name}", end, 3).tolist()))
        _keep(self, "radius", checks.number("capsule.radius", self.radius))
        finite = np.all(np.isfinite((*self.start, *self.end, self.radius)))
        if not (finite and self.radius > 0.0):
            given = f"{self.start}, {self.end}, {self.radius}"
            raise ModelError("capsule", "finite ends and a radius above 0 m", given)


class Hand(ABC):
    """What can be mounted on a tool plate, normal of palm or opening along the plate's z axis.

    Attributes:
        mass: Mass, fingers included [kg].
        force: Largest force of a single contact with a ball that it takes [N]; infinite where
            nobody knows.
        closes: Whether it has fingers that close on the ball; then ``closing_on`` says how.
        enters: From the first time that a ball can strike it to the catch, where nothing closes
            [s].
        loose: Whether a ball that it holds rolls about in it.
        pulls: Whether it pulls at what it touches once it is told to close.
    """

    __slots__ = ()
    mass: float
    force: float
    closes: ClassVar[bool] = False
    enters: ClassVar[float] = 0.0
    loose: ClassVar[bool] = False
    pulls: ClassVar[bool] = False

    @property
    @abstractmethod
    def com(self) -> float:
        """Height of the centre of mass above the plate, fingers open [m]."""

    @property
    @abstractmethod
    def inertia(self) -> Array:
        """Inertia about the centre of mass, axes of the plate [kg m^2], shape (3, 3)."""

    @property
    @abstractmethod
    def catch_offset(self) -> float:
        """Distance of the catch point beyond the plate [m]."""

    @property
    def delay(self) -> float:
        """From a command until it begins to act [s]."""
        return 0.0

    @property
    def drive(self) -> FingerDrive:
        """Servo of each finger, where it has fingers."""
        return FingerDrive()

    @property
    def closed(self) -> float:
        """What it is told to close, as far as its fingers go [rad, m]; 1 where there are none."""
        return 1.0

    def fingers_at(self, told: float) -> float:
        """Return where its fingers are that are told to close so far [rad, m]."""
        return told

    def rebound(self, palm: float) -> float:
        """Return the share of its speed that a ball keeps in it, whose ``palm`` leaves so much."""
        return palm

    def contains(self, place: Array) -> bool:  # noqa: ARG002
        """Say whether a ball is inside, its centre so far from the catch point [m], shape (3,)."""
        return False

    @property
    def stand(self) -> float:
        """Distance of the catch point from the arm's plate, on which its own may be tilted [m]."""
        return self.catch_offset

    @property
    def mount(self) -> Array:
        """Frame of its plate as seen from the arm's, shape (4, 4)."""
        return np.eye(4)

    @abstractmethod
    def capsules(self) -> tuple[Capsule, ...]:
        """Return capsules on the plate that hold it, its fingers at any angle."""

    def closing_on(self, radius: float, restitution: float, aside: Array) -> ClosingPlan | None:  # noqa: ARG002
        """Return how it closes on a ball; None where nothing closes.

        Args:
            radius: Radius of the ball [m].
            restitution: Share of its speed with which it springs back from the palm.
            aside: Distances from the palm's axis for which the time is wanted [m], shape (k,).
        """
        return None

    @abstractmethod
    def shares(self, catch: Catch) -> dict[str, float]:
        """Return what a catch asks of it, by the name of the limit; 1 is the limit."""

    @abstractmethod
    def contact_force(self, ball: CaughtBall, strike: HandImpact) -> float:
        """Return the largest single force of a contact with a ball that it catches [N]."""


def mounting(hand: Hand | None) -> tuple[float, Array]:
    """Return how far the catch point is beyond the arm's plate [m], and the hand's plate on it."""
    return (0.0, np.eye(4)) if hand is None else (hand.stand, hand.mount)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Link:
    """One moving link and the joint before it.

    Attributes:
        name: Name of the joint.
        placement: Frame at joint value zero in the frame of the link before, shape (4, 4).
        axis: Unit axis in the link's frame, shape (3,).
        prismatic: Whether the joint slides [m] instead of turning [rad].
        q_min: Lower end of the joint's range [rad].
        q_max: Upper end of the joint's range [rad].
        mass: Mass [kg].
        com: Centre of mass [m], shape (3,).
        inertia: Inertia about the centre of mass [kg m^2], shape (3, 3).
        armature: Rotor inertia reflected to the joint [kg m^2].
        capsules: Collision shapes.
        held: Joint value at which the joint is held [rad]; None where it is active.
        encoder_step: Resolution of the joint's encoder [rad].
        brake: What holds the joint once its drive is off; None: a spring-applied brake as strong
            as the joint's largest torque (see ``Arm.brakes``).
    """

    name: str
    placement: Array
    axis: Array
    prismatic: bool = False
    q_min: float
    q_max: float
    mass: float
    com: Array
    inertia: Array
    armature: float = 0.0
    capsules: tuple[Capsule, ...] = ()
    held: float | None = None
    encoder_step: float = ENCODER_STEP
    brake: JointBrake | None = None

    __repr__ = brief

    def __post_init__(self) -> None:
        """Refuse what no real link can have."""
        where = f"joint {self.name!r}"
        self._hold_shapes(where)
        if not 0.0 < self.encoder_step < 0.1:
            wanted = "an encoder resolution above 0 and below 0.1 rad"
            raise ModelError(where, wanted, f"{self.encoder_step:g}")
        bodily = (self.placement, self.axis, self.com, self.inertia, self.armature)
        numbers = (*bodily, self.q_min, self.q_max)
        if not all(np.all(np.abs(x) <= _LARGEST) for x in numbers):
            raise ModelError(
                where,
                f"numbers within +-{_LARGEST:g} in m, rad and kg m^2",
                "larger ones, NaN or infinity",
            )
        if not _LIGHTEST < self.mass <= _LARGEST:
            wanted = f"a mass above 0 and up to {_LARGEST:g} kg"
            raise ModelError(where, wanted, f"{self.mass:g} kg")
        if not self.q_min < self.q_max:
            raise ModelError(where, "a range with lower < upper", f"{self.q_min:g}..{self.q_max:g}")
        _keep(self, "inertia", checked_inertia(where, self.inertia))
        if self.armature < 0.0:
            raise ModelError(where, "an armature of at least 0", f"{self.armature:g}")

    def _hold_shapes(self, where: str) -> None:
        """Convert the fields to what kernels and Pinocchio take; refuse other shapes."""
        for name, value, shape in (
            ("placement", self.placement, (4, 4)),
            ("axis", self.axis, (3,)),
            ("com", self.com, (3,)),
            ("inertia", self.inertia, (3, 3)),
        ):
            _keep(self, name, checks.array(f"{where} {name}", value, shape))
        for name, plain in (
            ("q_min", self.q_min),
            ("q_max", self.q_max),
            ("mass", self.mass),
            ("armature", self.armature),
            ("encoder_step", self.encoder_step),
        ):
            _keep(self, name, checks.number(f"{where} {name}", plain))
        if self.brake is not None:
            checks.instance(f"{where} brake", self.brake, JointBrake)
        if self.held is not None:
            _keep(self, "held", checks.number(f"{where} held", self.held, finite=True))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ArmModel:
    """A serial chain of links and the catch point at its end.

    Attributes:
        name: Name of the arm.
        links: Links from the base outwards.
        tool: Frame of the tool plate in the last link's frame, shape (4, 4); its z axis is the
            normal of the palm.
        hand: The hand mounted there; None where the tool frame itself is the catch point.
        q_ready: Pose in which the active joints wait for a throw [rad], shape (n,).
        base_capsules: Collision shapes of what stands still, in the world frame.
        mount: Frame of the base in the world frame, shape (4, 4).
        aim: Centre and half-widths of the box at which default throws are aimed, and around which
            maps are learned, world frame [m], shape (2, 3); that of docs/throws.md where None.
        arrivals: How balls come there, least and most: speed [m/s], descent [rad], azimuth off +x
            [rad], time of flight before [s], shape (4, 2); as default throws do where None. Maps
            are learned on them.
        design: The choices that its maps are made with, a
            :class:`mitt.core.map.map_design.MapDesign`; those that follow from the arm where None.
        notes: What a user should know of how the arm was read from its file.
    """

    name: str
    links: tuple[Link, ...]
    tool: Array
    hand: Hand | None
    q_ready: Array
    base_capsules: tuple[Capsule, ...]
    mount: Array
    aim: Array | None = None
    arrivals: Array | None = None
    design: object | None = None
    notes: tuple[str, ...] = ()

    __repr__ = brief

    def __post_init__(self) -> None:
        """Refuse an arm without links or joints, other shapes, and a pose out of range."""
        if not self.links:
            raise ModelError("links", "at least one link", "none")
        for link in checks.instance("links", self.links, tuple):
            checks.instance("link", link, Link)
        if self.hand is not None:
            checked_hand(self.hand)
        _keep(self, "tool", checks.array("tool", self.tool, (4, 4), finite=True))
        _keep(self, "mount", checks.array("mount", self.mount, (4, 4), finite=True))
        if self.aim is not None:
            _keep(self, "aim", checks.array("aim", self.aim, (2, 3), finite=True))
        if self.arrivals is not None:
            _keep(self, "arrivals", checks.array("arrivals", self.arrivals, (4, 2), finite=True))
        q_ready = checks.vector("q_ready", self.q_ready, len(self.active), finite=True)
        _keep(self, "q_ready", q_ready)
        moving = [link for link in self.links if link.held is None]
        for link, q in zip(moving, q_ready.tolist(), strict=True):
            if not link.q_min <= q <= link.q_max:
                wanted = f"a position in {link.q_min:.3f}..{link.q_max:.3f}"
                raise ModelError(
                    f"ready pose of {link.name}",
                    wanted,
                    f"{q:g}",
                    do="angles are in rad, in the order of the joints",
                )

    def check_ranges(self) -> None:
        """Refuse an arm with a joint that could not be moved: commands keep a gap to its ends.

        Raises:
            ModelError: A range is too short; the joint is named.
        """
        for link in (link for link in self.links if link.held is None):
            unit, span = ("m" if link.prismatic else "rad"), link.q_max - link.q_min
            if not span > 2.0 * STOP_GAP:
                wanted = (
                    f"a range of more than {2.0 * STOP_GAP:g} {unit}, since commands keep"
                    f" {STOP_GAP:g} {unit} to its ends"
                )
                also = "" if link.prismatic else f"; {meant_in_radians(link)}"
                raise ModelError(
                    f"joint {link.name!r}",
                    wanted,
                    f"{span:g} {unit}",
                    do=f"hold the joint, or widen its range{also}",
                )

    @property
    def active(self) -> tuple[int, ...]:
        """Indices of the active joints among the links."""
        return tuple(k for k, link in enumerate(self.links) if link.held is None)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the active joints, from the base outwards."""
        return tuple(link.name for link in self.links if link.held is None)

    @property
    def catch_point(self) -> Array:
        """Catch point in the last link's frame [m], shape (3,)."""
        offset = 0.0 if self.hand is None else self.hand.catch_offset
        point: Array = self.tool[:3, 3] + offset * self.tool[:3, 2]
        return point

    def complete(self) -> "ArmModel":
        """Return the arm with the hand's mass in its last link, as the catcher reckons it."""
        if self.hand is None:
            return self
        at = np.array([0.0, 0.0, self.hand.com])
        return self.loaded(self.hand.mass, at=at, inertia=self.hand.inertia)

    def loaded(self, mass: float, *, at: Array, inertia: Array) -> "ArmModel":
        """Return the arm with a body fixed to its last link.

        Args:
            mass: Mass of the body [kg].
            at: Its centre of mass in the frame of the tool plate [m], shape (3,).
            inertia: Inertia about that point, axes of the tool plate [kg m^2], shape (3, 3).
        """
        mass = checks.number("mass", mass, finite=True)
        at = checks.vector("at", at, 3, finite=True)
        inertia = checks.array("inertia", inertia, (3, 3), finite=True)
        largest = max(abs(mass), np.abs(at).max(), np.abs(inertia).max())
        if not largest <= _LARGEST:
            raise ModelError("body", f"numbers within +-{_LARGEST:g}", f"{largest:g}")
        last, body = self.links[-1], Inertial(mass, at, inertia).moved(self.tool)
        both = Inertial(last.mass, last.com, last.inertia).joined(body)
        return replace(self, links=(*self.links[:-1], replace(last, **both._asdict())))


def transform(R: Array | None = None, p: Array | None = None) -> Array:
    """Return a homogeneous transform, shape (4, 4), from a rotation and a translation."""
    T = np.eye(4)
    if R is not None:
        T[:3, :3] = R
    if p is not None:
        T[:3, 3] = p
    return T


def roll_pitch_yaw(angles: Array) -> Array:
    """Return the rotation of roll, pitch and yaw about fixed axes (REP 103) [rad], shape (3, 3)."""
    (a, b, c), (d, e, f) = np.cos(angles), np.sin(angles)
    return np.array(
        [
            [c * b, c * e * d - f * a, c * e * a + f * d],
            [f * b, f * e * d + c * a, f * e * a - c * d],
            [-e, b * d, b * a],
        ]
    )


def rotation(axis: Array, angle: float) -> Array:
    """Return the rotation matrix about a unit axis (Rodrigues), shape (3, 3)."""
    x, y, z = axis
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    R: Array = np.eye(3) + np.sin(angle) * cross + (1.0 - np.cos(angle)) * cross @ cross
    return R


def meant_in_radians(link: Link) -> str:
    """Return what to do where a hinge's range in radians was read as one in degrees."""
    low, high = np.degrees((link.q_min, link.q_max))
    return (
        f"if {low:.3g}..{high:.3g} rad are meant for {link.name}, radians were read as degrees:"
        ' say <compiler angle="radian"/> in an MJCF, write radians in other files'
    )


def joint_motion(link: Link, q: float) -> Array:
    """Return the transform of a link's own motion at joint value ``q``, shape (4, 4)."""
    if link.prismatic:
        return transform(p=q * link.axis)
    return transform(rotation(link.axis, q))


def checked_hand(value: object) -> Hand:
    """Return a hand; InputError for anything else."""
    if not isinstance(value, Hand):
        raise InputError("hand", "a HandModel or a Basket", checks.shown(value))
    return value


class Inertial(NamedTuple):
    """Mass of a body [kg], its centre of mass [m], (3,), inertia about that [kg m^2], (3, 3)."""

    mass: float
    com: Array
    inertia: Array

    def moved(self, T: Array) -> "Inertial":
        """Return the same body as seen from the frame in which its own is at ``T``, (4, 4)."""
        R = T[:3, :3]
        return Inertial(self.mass, T[:3, 3] + R @ self.com, R @ self.inertia @ R.T)

    def joined(self, other: "Inertial") -> "Inertial":
        """Return both bodies as one."""
        mass = self.mass + other.mass
        com = (self.mass * self.com + other.mass * other.com) / (mass or 1.0)
        inertia = self.inertia + steiner(self.mass, self.com - com)
        return Inertial(mass, com, inertia + other.inertia + steiner(other.mass, other.com - com))


def steiner(mass: float, d: Array) -> Array:
    """Return the inertia of a point mass at ``d`` [kg m^2], shape (3, 3)."""
    return np.asarray(mass * (float(d @ d) * np.eye(3) - np.outer(d, d)))


def checked_inertia(
    where: str, inertia: Array, *, do: str = "check the inertia of that link"
) -> Array:
    """Return an inertia that MuJoCo takes; a flat plate's moments are moved by rounding only.

    Args:
        where: What an error calls the body.
        inertia: Inertia about the centre of mass [kg m^2], shape (3, 3).
        do: What to do about another one.

    Raises:
        ModelError: No body has such moments.
    """
    moments, axes = np.linalg.eigh(0.5 * (inertia + inertia.T))
    room = moments[0] + moments[1] - moments[2]
    if moments[0] < _LEAST or room < -_SLACK * moments[2]:
        wanted = (
            "principal moments that a body can have (above 0, none above the sum of the others)"
        )
        raise ModelError(where, wanted, _shown(moments), do=do)
    if room > 1e-3 * _SLACK * moments[2]:
        return inertia
    return _turned(_apart(moments), axes)


def mended_inertia(where: str, mass: float, inertia: Array) -> tuple[Array, str]:
    """Return an inertia that a body can have, and a note where a file's was mended.

    Moments of 0 become those of a ball of steel, the smallest body of that mass; where the largest
    is above the sum of the others, these are raised. Both only as far as a file rounds.

    Args:
        where: What a note and an error call the body.
        mass: Its mass [kg].
        inertia: Inertia about the centre of mass [kg m^2], shape (3, 3).

    Raises:
        ModelError: No body has such moments, and no rounding explains them.
    """
    given, axes = np.linalg.eigh(0.5 * (inertia + inertia.T))
    moments = given.copy()
    if -_ROUNDED <= moments[0] < _LEAST:
        ball = max(steel_ball(mass), _LEAST)
        moments[moments < _LEAST] = min(ball, moments[2]) if moments[2] > _LEAST else ball
    order = np.argsort(moments, kind="stable")
    moments, axes = moments[order], axes[:, order]
    if _SLACK * moments[2] < moments[2] - moments[0] - moments[1] <= _ROUNDED:
        moments = _apart(moments)
    if np.array_equal(moments, given):
        return checked_inertia(where, inertia), ""
    out = checked_inertia(where, _turned(moments, axes))
    return out, (
        f"{where}: no body has the principal moments {_shown(given)} kg m^2; taken as"
        f" {_shown(moments)}"
    )


def steel_ball(mass: float) -> float:
    """Return the moment of inertia of a ball of steel, given its mass [kg]."""
    return float(0.4 * mass * (3.0 * mass / (4.0 * np.pi * _STEEL)) ** (2.0 / 3.0))


def _shown(moments: Array) -> str:
    """Return moments as a message has them."""
    return ", ".join(f"{x:.4g}" for x in moments)


def _apart(moments: Array) -> Array:
    """Return rising moments, the smaller two raised until the largest is below their sum."""
    lacking = max(moments[2] * (1.0 + _SLACK) - moments[0] - moments[1], 0.0)
    return np.asarray(moments + np.array((0.5, 0.5, 0.0)) * lacking)


def _turned(moments: Array, axes: Array) -> Array:
    """Return the inertia with principal moments about the columns of ``axes``."""
    out = axes @ np.diag(moments) @ axes.T
    return np.asarray(0.5 * (out + out.T))
