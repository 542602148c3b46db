"""Kinds of faults of cameras, clocks and encoders, between the world and the catcher."""

from typing import Annotated, Literal

from pydantic import Field, model_validator

from mitt.world.faults.entry import Chance, Delay, Entry

CameraIndex = Annotated[int, Field(ge=0, le=15)]


class Noise(Entry):
    """Each exposure shows the ball displaced; magnitude: 1 sigma an axis [m]."""

    kind: Literal["noise"] = "noise"
    magnitude: Annotated[float, Field(ge=0.0, le=1.0)]


class Outlier(Entry):
    """Some exposures show the ball elsewhere (row 6); magnitude: how far off [m].

    Attributes:
        chance: Share of the exposures.
    """

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
    """Cameras that stand or look otherwise than the catcher believes; magnitude: 1 sigma.

    It holds for the whole trial, whatever its start. Without images, points are turned about the
    shoulder, or moved from it or towards it, by as much.

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
    """Encoders that lie (row 19); magnitude: of a ``jump`` or a ``step`` [rad].

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
