"""What flows from one stage to the next, each carrying the time it speaks of.

    Frame, one a camera -> Sighting -> BallState -> JointReference -> Command

SI units and radians; positions in the world frame (origin at the shoulder centre, z up,
+x to the thrower). Arrays are float64 and are not to be written to. What a user makes is checked
and converted once, when it is made (:mod:`mitt.core.checks`), so that kernels can trust it.
"""

from dataclasses import dataclass, field
from enum import Enum
from math import inf, sqrt
from typing import Final, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from mitt.core import checks
from mitt.core.errors import InputError
from mitt.core.fields import brief, line

_Kind = TypeVar("_Kind")
Array = NDArray[np.float64]
Image = NDArray[np.uint8]

TICK: Final = 0.001
"""Time between two ticks [s]."""

MOST_DRAG: Final = 10.0
"""Largest drag coefficient of a ball [1/m]; thrown balls have 0.04, a shuttlecock 0.2."""

PASSED: Final = 0.02
"""Time after a catch for which it counts as just passed, not as one that never comes [s]."""

GRAVITY: Final = 9.81
"""Acceleration of free fall, towards -z [m/s^2]."""

_ROUNDED: Final = 1e-9
"""Relative error that rounding may bring into a covariance."""

_UNSAID: Final[Array] = np.empty((0, 0))
"""Stands where a covariance was left out."""

_keep = object.__setattr__
"""Writes a field of a frozen value while it is made."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Frame:
    """One image of one camera.

    Attributes:
        t: Time of the middle of the exposure [s].
        camera: Index of the camera in its rig.
        number: Frame number, rising by one with each exposure.
        pixels: Grey values, row v down and column u right, shape (height, width).
        pan: First angle of the camera's head, read in the middle of the exposure [rad].
        tilt: Second angle of the camera's head [rad].
    """

    t: float
    camera: int
    number: int
    pixels: Image
    pan: float = 0.0
    tilt: float = 0.0

    __repr__ = brief

    def __post_init__(self) -> None:
        """Hold the fields to their types; ShapeError or InputError where they do not fit."""
        for name, value in (("t", self.t), ("pan", self.pan), ("tilt", self.tilt)):
            _keep(self, name, checks.number(f"frame.{name}", value))
        _keep(self, "camera", checks.whole("frame.camera", self.camera))
        _keep(self, "number", checks.whole("frame.number", self.number))
        checks.image("frame.pixels", self.pixels)


@dataclass(frozen=True, slots=True, kw_only=True)
class Moments:
    """Image moments of the target in one frame; pixel centres lie at integers.

    Attributes:
        t: Time of the exposure [s].
        camera: Index of the camera in its rig.
        found: Whether a target of sufficient area was found; the rest is zero if not.
        area: Pixels in the target [px^2].
        u: Grey-weighted centroid, column [px].
        v: Grey-weighted centroid, row [px].
        clipped: Whether the target touches the image border.
        merged: Whether the target is no ball alone: its shape is not that of one disc.
    """

    t: float
    camera: int
    found: bool
    area: float = 0.0
    u: float = 0.0
    v: float = 0.0
    clipped: bool = False
    merged: bool = False

    __repr__ = brief

    def __post_init__(self) -> None:
        """Hold the fields to their types; InputError where they do not fit."""
        for name, value in (("t", self.t), ("area", self.area), ("u", self.u), ("v", self.v)):
            _keep(self, name, checks.number(f"moments.{name}", value))
        for name, flag in (
            ("found", self.found),
            ("clipped", self.clipped),
            ("merged", self.merged),
        ):
            _keep(self, name, checks.flag(f"moments.{name}", flag))
        _keep(self, "camera", checks.whole("moments.camera", self.camera, least=0))


@dataclass(frozen=True, slots=True, kw_only=True)
class Sighting:
    """Position of the ball's centre seen in one instant.

    Attributes:
        t: Time of the exposure [s].
        found: Whether the ball was seen; ``r_o`` is zero if not.
        r_o: Position [m], shape (3,); one that is not finite, as trackers send for a ball that they
            do not see, tells nothing.
        covariance: Covariance of ``r_o`` [m^2], shape (3, 3); zero where it is known exactly, as in
            a simulation: it counts as known to 10 um. Of a ball that was not found it may be left
            out.
    """

    t: float
    found: bool
    r_o: Array
    covariance: Array = field(default_factory=lambda: _UNSAID)

    __repr__ = brief

    def __post_init__(self) -> None:
        """Hold the fields to their shapes.

        Raises:
            ShapeError: A field has another shape.
            InputError: A field is not what it should be; the covariance of a ball that was found
                is none: not finite, not symmetric, or negative in some direction.
        """
        _keep(self, "t", checks.number("sighting.t", self.t))
        _keep(self, "found", checks.flag("sighting.found", self.found))
        _keep(self, "r_o", checks.vector("sighting.r_o", self.r_o, 3))
        if self.covariance is _UNSAID:
            if self.found:
                raise InputError(
                    "sighting.covariance",
                    "that of the position [m^2], shape (3, 3)",
                    "none",
                    do="say sigma**2 * np.eye(3), where sigma is the standard"
                    " deviation of a coordinate [m]",
                )
            _keep(self, "covariance", np.zeros((3, 3)))
        covariance = checks.array("sighting.covariance", self.covariance, (3, 3))
        if self.found and not _is_covariance(covariance.tolist()):
            raise InputError(
                "sighting.covariance",
                "a covariance: finite, symmetric, not negative",
                covariance.tolist(),
                do="give sigma**2 * numpy.eye(3), zero if exact",
            )
        _keep(self, "covariance", covariance)


@dataclass(frozen=True, slots=True, kw_only=True)
class BallState:
    """Estimate of the ball's motion at time ``t``; what is left out follows from the rest.

    Attributes:
        t: Time that the estimate speaks of [s].
        r_o: Position [m], shape (3,).
        dr_o: Velocity [m/s], shape (3,).
        ddr_o: Acceleration [m/s^2], shape (3,); of free flight with ``drag`` if left out.
        tracked: Whether there is an estimate; the arrays are zero if not.
        drag: Quadratic drag coefficient k of the flight model [1/m], from 0 to ``MOST_DRAG``.
        lift: w of the lift w x dr_o of a ball that spins [1/s], shape (3,), part of ``ddr_o``;
            zero where no spin is estimated.
        covariance: Covariance of position and velocity, positive semidefinite, shape (6, 6); if
            left out, zero: they count as known exactly.
        t_seen: Time of the newest sighting used [s]; ``t`` if left out.
        t_first: Time of the first sighting of this track [s]; ``t_seen`` if left out.
        led: Whether another law of motion than flight speaks.
    """

    t: float
    r_o: Array
    dr_o: Array
    ddr_o: Array = None  # type: ignore[assignment]  # None is filled in when it is made
    tracked: bool = True
    drag: float = 0.0
    covariance: Array = field(default_factory=lambda: np.zeros((6, 6)))
    t_seen: float = None  # type: ignore[assignment]
    t_first: float = None  # type: ignore[assignment]
    led: bool = False
    lift: Array = field(default_factory=lambda: np.zeros(3))

    __repr__ = brief

    def __post_init__(self) -> None:
        """Fill in what was left out, and hold the fields to their shapes and types.

        Raises:
            InputError: A field is not what it should be.
        """
        if self.ddr_o is None:
            drag = checks.number("ball.drag", self.drag, least=0.0, most=MOST_DRAG)
            dr = checks.vector("ball.dr_o", self.dr_o, 3)
            _keep(self, "ddr_o", -drag * sqrt(dr @ dr) * dr - (0.0, 0.0, GRAVITY))
        if self.t_seen is None:
            _keep(self, "t_seen", self.t)
        if self.t_first is None:
            _keep(self, "t_first", self.t_seen)
        for name, x in (
            ("r_o", self.r_o),
            ("dr_o", self.dr_o),
            ("ddr_o", self.ddr_o),
            ("lift", self.lift),
        ):
            _keep(self, name, checks.vector(f"ball.{name}", x, 3))
        _keep(self, "drag", checks.number("ball.drag", self.drag, least=0.0, most=MOST_DRAG))
        for name, value in (("t", self.t), ("t_seen", self.t_seen), ("t_first", self.t_first)):
            _keep(self, name, checks.number(f"ball.{name}", value))
        for name, flag in (("tracked", self.tracked), ("led", self.led)):
            _keep(self, name, checks.flag(f"ball.{name}", flag))
        _keep(self, "covariance", checks.covariance("ball.covariance", self.covariance, 6))


@dataclass(frozen=True, slots=True, kw_only=True)
class ArmState:
    """Joint encoders.

    Attributes:
        t: Time of the reading, by the clock of ``Senses.t`` [s]. A reading that is older than 5 ms,
            from more than 1 ms ahead, or not newer than the one before, counts as missing.
        q: Active joint positions [rad], shape (n,).
        dq: Active joint velocities [rad/s], shape (n,).
    """

    t: float
    q: Array
    dq: Array

    __repr__ = brief

    def __post_init__(self) -> None:
        """Hold q and dq to vectors of one length; the catcher knows which."""
        _keep(self, "t", checks.number("arm.t", self.t))
        _keep(self, "q", checks.array("arm.q", self.q, (None,)))
        _keep(self, "dq", checks.vector("arm.dq", self.dq, len(self.q)))


@dataclass(frozen=True, slots=True, kw_only=True)
class BeltReading:
    """How far a belt has travelled, by its encoder.

    Attributes:
        t: Time of the reading, by the clock of ``Senses.t`` [s].
        travel: Since any instant [m]; it falls while the belt runs back. One that is not finite
            tells nothing.
    """

    t: float
    travel: float

    __repr__ = brief

    def __post_init__(self) -> None:
        """Hold the fields to numbers; InputError where they are none."""
        _keep(self, "t", checks.number("belt.t", self.t))
        _keep(self, "travel", checks.number("belt.travel", self.travel))


@dataclass(frozen=True, slots=True, kw_only=True)
class Senses:
    """All that reaches the catcher in one tick.

    Attributes:
        t: Time of the tick, monotonic [s]; all other stamps are by the same clock.
        arm: Joint encoders.
        frames: New images, one a camera; empty where points are given instead.
        points: New sightings from another source than images.
        belt: New readings of the encoder of a belt that carries what is seen as points.
    """

    t: float
    arm: ArmState
    frames: tuple[Frame, ...] = ()
    points: tuple[Sighting, ...] = ()
    belt: tuple[BeltReading, ...] = ()

    __repr__ = brief

    def __post_init__(self) -> None:
        """Hold the fields to their types; InputError where they do not fit."""
        _keep(self, "t", checks.number("senses.t", self.t))
        checks.instance("senses.arm", self.arm, ArmState)
        _keep(self, "frames", all_of("senses.frames", self.frames, Frame))
        _keep(self, "points", all_of("senses.points", self.points, Sighting))
        _keep(self, "belt", all_of("senses.belt", self.belt, BeltReading))


class MapStatus(Enum):
    """Whether the map has a value at a ball position."""

    INSIDE = "inside"
    DOMAIN = "domain"


@dataclass(frozen=True, slots=True, kw_only=True)
class JointReference:
    """Desired joint motion, eqs. (1), (6), (15); finite whatever the status.

    Attributes:
        t: Time that it speaks of [s].
        status: DOMAIN where the ball lies outside the domain of the inverse of l_c.
        q_d: Desired positions [rad], shape (n,).
        dq_d: Desired velocities [rad/s], shape (n,).
        ddq_d: Desired accelerations [rad/s^2], shape (n,).
        q_o: Virtual joints, the inverse of l_c at the ball [rad], shape (n,).
        dq_o: Their velocities [rad/s], shape (n,).
        time_to_catch: Time until q_o of the catch joint reaches q_alpha [s], as the ball flies;
            negative for ``PASSED`` after it. Infinite where no catch is to come, as for a ball that
            flies away or is outside the domain.
    """

    t: float
    status: MapStatus
    q_d: Array
    dq_d: Array
    ddq_d: Array
    q_o: Array
    dq_o: Array
    time_to_catch: float

    __repr__ = brief


def reference_of(t: float, rows: Array, *, inside: bool, time_to_catch: float) -> JointReference:
    """Return a reference of rows q_d, dq_d, ddq_d, q_o, dq_o [rad ...], shape (5 or more, n)."""
    return JointReference(
        t=t,
        status=MapStatus.INSIDE if inside else MapStatus.DOMAIN,
        q_d=rows[0],
        dq_d=rows[1],
        ddq_d=rows[2],
        q_o=rows[3],
        dq_o=rows[4],
        time_to_catch=time_to_catch,
    )


class Command(NamedTuple):
    """What arm and hand are commanded to do, within every limit.

    Attributes:
        t: Time from which it acts [s].
        joints: Positions q [rad], velocities dq [rad/s], accelerations ddq [rad/s^2] and torques
            tau [N m] of the active joints, rows that also have these names, shape (4, n).
        hand: Closing angle of the fingers [rad]; 0 is open.
        gaze: Pan, tilt [rad] and their rates [rad/s] that each camera's head is to have a tick
            later, shape (heads, 4); None where cameras stand still.
        brakes: Whether the joints' brakes are to be engaged, and to stay so. The torques still
            act until the brakes do, and are 0 from then on: the drives may be switched off.
    """

    t: float
    joints: Array
    hand: float
    gaze: Array | None = None
    brakes: bool = False

    def __repr__(self) -> str:
        """Return one line."""
        return line("Command", self._asdict().items())

    @property
    def q(self) -> Array:
        """Positions [rad], shape (n,)."""
        q: Array = self.joints[0]
        return q

    @property
    def dq(self) -> Array:
        """Velocities [rad/s], shape (n,)."""
        dq: Array = self.joints[1]
        return dq

    @property
    def ddq(self) -> Array:
        """Accelerations [rad/s^2], shape (n,)."""
        ddq: Array = self.joints[2]
        return ddq

    @property
    def tau(self) -> Array:
        """Torques [N m], shape (n,)."""
        tau: Array = self.joints[3]
        return tau


def _is_covariance(P: list[list[float]]) -> bool:
    """Say whether three rows of three numbers are a covariance, but for rounding."""
    (a, b, c), (d, e, f), (g, h, i) = P
    largest = max(a, e, i, 0.0)
    if not all(abs(x - y) <= _ROUNDED * largest for x, y in ((b, d), (c, g), (f, h))):
        return False
    most = 1.0 + _ROUNDED
    minors = b * b <= most * a * e and c * c <= most * a * i and f * f <= most * e * i
    volume = a * (e * i - f * f) - b * (b * i - f * c) + c * (b * f - e * c)
    return min(a, e, i) >= 0.0 and largest < inf and minors and volume >= -_ROUNDED * a * e * i


def all_of(name: str, values: object, kind: type[_Kind]) -> tuple[_Kind, ...]:
    """Return a user's values as a tuple of one class; a list is taken as well."""
    if not isinstance(values, tuple | list):
        raise InputError(name, f"a tuple of {kind.__name__}", checks.shown(values))
    return tuple(checks.instance(name, value, kind) for value in values)
