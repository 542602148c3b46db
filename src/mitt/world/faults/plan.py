"""Faults and disturbances as data: each with its kind, start, length and magnitude.

They act between sensor and estimator, between command and plant, and on the ball. Rows are those
of the tests in ``tests/faults``.
"""

from typing import Annotated, Literal

from pydantic import Field, model_validator

from mitt.files.schema import Settings

Chance = Annotated[float, Field(ge=0.0, le=1.0)]
Delay = Annotated[float, Field(ge=0.0, le=0.2)]
CameraIndex = Annotated[int, Field(ge=0, le=15)]


class Entry(Settings):
    """What all kinds share.

    Attributes:
        start: When it begins, after release [s].
        length: How long it lasts [s]; to the end if left out.
    """

    magnitude: float
    start: Annotated[float, Field(ge=0.0, le=60.0)] = 0.0
    length: Annotated[float, Field(gt=0.0, le=60.0)] | None = None

    @property
    def end(self) -> float:
        """When it is over [s]."""
        return float("inf") if self.length is None else self.start + self.length

    def is_active(self, t: float, *, slack: float = 0.0) -> bool:
        """Tell whether it acts at a time [s]; ``slack`` before its time [s], for rounded times."""
        return self.start - slack <= t < self.end - slack


class Noise(Entry):
    """Each exposure shows the ball displaced; magnitude: 1 sigma an axis [m]."""

    kind: Literal["noise"] = "noise"
    magnitude: Annotated[float, Field(ge=0.0, le=1.0)]


class Outlier(Entry):
    """A share ``chance`` of exposures shows the ball elsewhere (row 6); magnitude: how far [m]."""

    kind: Literal["outlier"] = "outlier"
    magnitude: Annotated[float, Field(ge=0.0, le=5.0)] = 0.3
    chance: Chance = 0.01


class FrameRate(Entry):
    """Cameras that expose less often than each tick; magnitude: frames a second [Hz]."""

    kind: Literal["frame-rate"] = "frame-rate"
    magnitude: Annotated[float, Field(ge=1.0, le=1000.0)]


class Dropout(Entry):
    """Lost frames or points (rows 1, 8); magnitude: share lost.

    Attributes:
        camera: The one camera that loses them, each by itself; all lose the same if left out.
            Without images a point needs both eyes, and is lost either way.
    """

    kind: Literal["dropout"] = "dropout"
    magnitude: Chance = 1.0
    camera: CameraIndex | None = None


class Frozen(Entry):
    """A camera shows what it saw last (row 5); magnitude: share of trials it happens in.

    Attributes:
        camera: Which camera; all if left out.
        numbered: Whether stamps and frame numbers go on rising meanwhile.
    """

    kind: Literal["frozen"] = "frozen"
    magnitude: Chance = 1.0
    camera: CameraIndex | None = None
    numbered: bool = False


class Latency(Entry):
    """Frames and points that come late, all alike (row 2); magnitude: delay [s].

    Attributes:
        stamped: Whether they carry the time of their exposure, or that of their arrival.
    """

    kind: Literal["latency"] = "latency"
    magnitude: Delay
    stamped: bool = True


class Late(Entry):
    """Some frames or points come later than those behind them (rows 2, 3); magnitude: delay [s].

    Attributes:
        chance: Share of them; a delay of two ticks swaps neighbours.
    """

    kind: Literal["late"] = "late"
    magnitude: Delay = 0.002
    chance: Chance = 0.1


class Duplicate(Entry):
    """Frames or points that come twice (row 4); magnitude: share of them.

    A frame's copy takes the place of the next frame, a point's copy comes beside the next point.
    """

    kind: Literal["duplicate"] = "duplicate"
    magnitude: Chance = 0.1


class Calibration(Entry):
    """Cameras with another pose or lens than the catcher assumes; magnitude: 1 sigma.

    It holds for the whole trial. Without images, points are turned about the shoulder, or moved
    from it or towards it, by as much.

    Attributes:
        part: What is wrong, drawn a camera: its ``angles`` about three axes [rad], its ``place``
            along the base line [m], its ``focal`` length [share].
    """

    kind: Literal["calibration"] = "calibration"
    magnitude: Annotated[float, Field(ge=0.0, le=0.3)]
    part: Literal["angles", "place", "focal"] = "angles"


class NotNumber(Entry):
    """NaN where a number should be (row 9); magnitude: share of the ticks.

    Attributes:
        where: In the positions of ``points``, the ``stamps`` of frames and points, or the
            ``encoders``.
    """

    kind: Literal["nan"] = "nan"
    magnitude: Chance = 0.01
    where: Literal["points", "stamps", "encoders"] = "points"


class Clock(Entry):
    """A clock that is set forward or back (row 10); magnitude: jump [s].

    Attributes:
        clock: That of the ``tick``, with all that it stamps, or that of the ``camera`` alone.
    """

    kind: Literal["clock"] = "clock"
    magnitude: Annotated[float, Field(ge=-1e5, le=1e5)]
    clock: Literal["tick", "camera"] = "camera"


class Encoder(Entry):
    """Wrong encoder readings (row 19); magnitude: of a ``jump`` or a ``step`` [rad].

    Attributes:
        fault: ``stuck`` at the last reading, a ``jump`` to another, ``dropout`` (no number),
            the wrong ``sign``, or coarse by a ``step``.
        joint: Which active joint, from 0; all if left out.
    """

    kind: Literal["encoder"] = "encoder"
    fault: Literal["stuck", "jump", "dropout", "sign", "step"]
    magnitude: Annotated[float, Field(ge=-10.0, le=10.0)] = 0.1
    joint: Annotated[int, Field(ge=0, le=15)] | None = None

    @model_validator(mode="after")
    def _positive_step(self) -> "Encoder":
        """Refuse a step that counts nothing."""
        if self.fault == "step" and self.magnitude <= 0.0:
            raise ValueError("a magnitude above 0 for a step")
        return self


class Torque(Entry):
    """Motors weaker than their limit set says (row 18); magnitude: share that is left."""

    kind: Literal["torque"] = "torque"
    magnitude: Annotated[float, Field(ge=0.01, le=1.0)] = 0.5


class Command(Entry):
    """Commands on their way to the motors; magnitude: delay [s].

    Attributes:
        lost: Share of the commands that never arrive; the motors keep the one before.
    """

    kind: Literal["command"] = "command"
    magnitude: Delay = 0.0
    lost: Chance = 0.0


class Payload(Entry):
    """Mass at the hand that no model knows (row 18), all the trial; magnitude: [kg]."""

    kind: Literal["payload"] = "payload"
    magnitude: Annotated[float, Field(ge=0.0, le=20.0)]


class Drag(Entry):
    """Drag that the catcher does not know; magnitude: factor on the ball's drag."""

    kind: Literal["drag"] = "drag"
    magnitude: Annotated[float, Field(ge=0.0, le=20.0)]


class Spin(Entry):
    """A ball that spins about a random axis (Magnus); magnitude: lift per squared speed [1/m]."""

    kind: Literal["spin"] = "spin"
    magnitude: Annotated[float, Field(ge=0.0, le=1.0)]


class Gust(Entry):
    """Wind from a random level direction; magnitude: speed of the air [m/s]."""

    kind: Literal["gust"] = "gust"
    magnitude: Annotated[float, Field(ge=0.0, le=60.0)]


class Kick(Entry):
    """A sudden change of the ball's velocity (row 20) in a random direction; magnitude: [m/s].

    Attributes:
        share: When, as a share of the time until the undisturbed ball is nearest to the catch
            point of the waiting arm, plus ``start``.
    """

    kind: Literal["kick"] = "kick"
    magnitude: Annotated[float, Field(ge=0.0, le=20.0)]
    share: Annotated[float, Field(ge=0.0, le=2.0)] = 0.7


class Bounce(Entry):
    """A smooth plate in the ball's way (row 20), tilted about a random side; magnitude: angle.

    The plate touches the ball alone and does not hide it. Magnitude is the angle between plate
    and flight [rad]; the ball leaves with its speed along the normal times the restitution.

    Attributes:
        share: Where, as a share of the flight as for a kick.
        restitution: Coefficient of restitution.
        size: Half the side of the square plate [m].
    """

    kind: Literal["bounce"] = "bounce"
    magnitude: Annotated[float, Field(gt=0.0, le=1.5)] = 0.15
    share: Annotated[float, Field(ge=0.0, le=2.0)] = 0.6
    restitution: Chance = 0.7
    size: Annotated[float, Field(gt=0.0, le=5.0)] = 0.5


class Spring(Entry):
    """A ball on a spring instead of a throw; magnitude: its speed in the middle [m/s].

    It starts at rest where the throw would have been released, and swings about the point of
    that throw nearest to the waiting hand, without gravity and drag, until it is touched.
    """

    kind: Literal["spring"] = "spring"
    magnitude: Annotated[float, Field(ge=0.5, le=15.0)] = 5.0


class Carried(Entry):
    """A ball carried by somebody's hand instead of a throw; magnitude: its top speed [m/s].

    It starts at rest in the middle of the throw's way, gathers speed smoothly, wanders sideways
    by ``wander`` [m] and reaches the point of the throw nearest to the waiting hand at that speed.
    """

    kind: Literal["carried"] = "carried"
    magnitude: Annotated[float, Field(ge=0.5, le=15.0)] = 2.5
    wander: Annotated[float, Field(ge=0.0, le=0.3)] = 0.03


Fault = (
    Noise | Outlier | FrameRate | Dropout | Frozen | Latency | Late | Duplicate | Calibration
    | NotNumber | Clock | Encoder | Torque | Command | Payload | Drag | Spin | Gust | Kick
    | Bounce | Spring | Carried
)  # fmt: skip
"""One entry of a plan."""

FaultPlan = Annotated[
    tuple[Annotated[Fault, Field(discriminator="kind")], ...], Field(strict=False, max_length=32)
]
"""Entries in the order in which they act."""
