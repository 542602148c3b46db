"""A serial arm as a table, from which every implementation of it is built.

A link turns about or slides along ``axis`` of its own frame, which sits at ``placement`` in the
frame of the link before it; mass properties are given in the link's frame. One table gives the
Pinocchio model of the catcher, the MuJoCo model of the plant and the arrays of our kernels.
"""

from dataclasses import dataclass, replace

import numpy as np

from mitt import checks
from mitt.errors import ModelError
from mitt.fields import brief
from mitt.robot.basket import Hand, checked_hand
from mitt.robot.inertia import checked_inertia
from mitt.signals import Array

_keep = object.__setattr__
#: Largest length, mass or inertia of a link that is taken for meant [m, kg, kg m^2].
_LARGEST = 1e4
#: Least mass of a link, which MuJoCo still takes [kg].
_LIGHTEST = 1e-12

#: Gap that commands keep to the ends of a joint's range [rad or m]; a choice of this project.
STOP_GAP = 0.06

#: Encoder resolution of a joint whose description states none [rad or m]: 17 bits a turn of the
#: joint, as the joint-side encoders of common cobots have or better. A choice of this project.
ENCODER_STEP = 2.0 * np.pi / 2**17


@dataclass(frozen=True, slots=True, kw_only=True)
class Brake:
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
    brake: Brake | None = None

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
            raise ModelError(where, f"numbers within +-{_LARGEST:g} in m, rad and kg m^2",
                             "larger ones, NaN or infinity")  # fmt: skip
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
            ("placement", self.placement, (4, 4)), ("axis", self.axis, (3,)),
            ("com", self.com, (3,)), ("inertia", self.inertia, (3, 3)),
        ):  # fmt: skip
            _keep(self, name, checks.array(f"{where} {name}", value, shape))
        for name, plain in (
            ("q_min", self.q_min), ("q_max", self.q_max), ("mass", self.mass),
            ("armature", self.armature), ("encoder_step", self.encoder_step),
        ):  # fmt: skip
            _keep(self, name, checks.number(f"{where} {name}", plain))
        if self.brake is not None:
            checks.instance(f"{where} brake", self.brake, Brake)
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
                raise ModelError(f"ready pose of {link.name}", wanted, f"{q:g}",
                                 do="angles are in rad, in the order of the joints")  # fmt: skip

    def check_ranges(self) -> None:
        """Refuse an arm with a joint that could not be moved: commands keep a gap to its ends.

        Raises:
            ModelError: A range is too short; the joint is named.
        """
        for link in (link for link in self.links if link.held is None):
            unit, span = ("m" if link.prismatic else "rad"), link.q_max - link.q_min
            if not span > 2.0 * STOP_GAP:
                wanted = (f"a range of more than {2.0 * STOP_GAP:g} {unit}, since commands keep"
                          f" {STOP_GAP:g} {unit} to its ends")  # fmt: skip
                also = "" if link.prismatic else f"; {meant_in_radians(link)}"
                raise ModelError(f"joint {link.name!r}", wanted, f"{span:g} {unit}",
                                 do=f"hold the joint, or widen its range{also}")  # fmt: skip

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
        last = self.links[-1]
        R, p = self.tool[:3, :3], self.tool[:3, 3]
        total = last.mass + mass
        com_body = p + R @ at
        com = (last.mass * last.com + mass * com_body) / total
        both = last.inertia + _steiner(last.mass, last.com - com)
        both = both + R @ inertia @ R.T + _steiner(mass, com_body - com)
        heavier = replace(last, mass=total, com=com, inertia=both)
        return replace(self, links=(*self.links[:-1], heavier))


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
    return np.array([
        [c * b, c * e * d - f * a, c * e * a + f * d],
        [f * b, f * e * d + c * a, f * e * a - c * d],
        [-e, b * d, b * a],
    ])  # fmt: skip


def rotation(axis: Array, angle: float) -> Array:
    """Return the rotation matrix about a unit axis (Rodrigues), shape (3, 3)."""
    x, y, z = axis
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    R: Array = np.eye(3) + np.sin(angle) * cross + (1.0 - np.cos(angle)) * cross @ cross
    return R


def meant_in_radians(link: Link) -> str:
    """Return what to do where a hinge's range in radians was read as one in degrees."""
    low, high = np.degrees((link.q_min, link.q_max))
    return (f"if {low:.3g}..{high:.3g} rad are meant for {link.name}, radians were read as degrees:"
            ' say <compiler angle="radian"/> in an MJCF, write radians in other files')  # fmt: skip


def joint_motion(link: Link, q: float) -> Array:
    """Return the transform of a link's own motion at joint value ``q``, shape (4, 4)."""
    if link.prismatic:
        return transform(p=q * link.axis)
    return transform(rotation(link.axis, q))


def _steiner(mass: float, d: Array) -> Array:
    """Return the inertia of a point mass at ``d`` [kg m^2], shape (3, 3)."""
    inertia: Array = mass * (float(d @ d) * np.eye(3) - np.outer(d, d))
    return inertia
