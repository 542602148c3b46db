"""What goes wrong in a trial: a plan as data, drawn from the trial's seed, the same each time.

Faults act between the sensors and the catcher, on the way of the commands, in the plant, and on
the ball (``disturbances``). Each entry of a plan has its own stream of randomness, so that none
disturbs another or the trial; and it draws in every tick, whether it is active or not, so that no
draw depends on those before it.
"""

import heapq
from abc import abstractmethod
from collections import deque
from collections.abc import Iterator
from dataclasses import replace
from typing import Annotated, Literal, Protocol, assert_never, final

import numpy as np
from pydantic import Field, model_validator

from mitt.core.arm.description import rotation
from mitt.core.errors import InputError
from mitt.core.eyes.camera import Rig
from mitt.core.signals import TICK, Array, Command, Frame, Senses, Sighting
from mitt.lab.world.disturbances import (
    BeltChange,
    Bounce,
    Carried,
    Chance,
    DisturbedFlight,
    DisturbedTrial,
    Drag,
    Elastic,
    Fault,
    Flutter,
    Gust,
    Kick,
    Light,
    Push,
    Replacement,
    Spin,
    Spring,
    Taken,
    Turned,
    direction,
    disturbed_flight,
    disturbed_states,
)
from mitt.lab.world.flights import BallPath
from mitt.lab.world.prescribed import Prescribed, states_of
from mitt.lab.world.throws import Throw

Delay = Annotated[float, Field(ge=0.0, le=0.2)]
CameraIndex = Annotated[int, Field(ge=0, le=15)]
Seen = tuple[tuple[Frame, ...], tuple[Sighting, ...]]

#: First key of the random streams of faults, which plant and sensors do not use.
_STREAMS = 0xFA17
#: A delay is over when less than this is left of it [s].
_SLACK = 1e-9


class Sensor(Protocol):
    """The sensors: ``mitt.lab.world.sensors.Sensors`` is one."""

    def read(
        self, t: float, q: Array, dq: Array, r_o: Array, dr_o: Array, *, look: bool = True
    ) -> Senses:
        """Expose at time ``t`` and return what arrives; to be called once a tick."""

    def turn(self, gaze: Array | None, duration: float) -> None:
        """Let the heads of the cameras follow the catcher's gaze for ``duration`` [s]."""


class SensorFault(Fault):
    """A fault between the sensors and the catcher; it passes on what it does not change."""

    def shown(self, t: float, r_o: Array) -> Array:  # noqa: ARG002
        """Return where the exposure at a tick shows the ball [m], shape (3,)."""
        return r_o

    def delivered(self, senses: Senses) -> Senses:
        """Return what goes on to the catcher."""
        return senses


class Noise(SensorFault):
    """Each exposure shows the ball displaced; magnitude: 1 sigma an axis [m]."""

    kind: Literal["noise"] = "noise"
    magnitude: Annotated[float, Field(ge=0.0, le=1.0)]

    def shown(self, t: float, r_o: Array) -> Array:
        """Return the place with noise."""
        off = self.magnitude * self._rng.standard_normal(3)
        return np.asarray(r_o + off) if self.is_active(t) else r_o


class Outlier(SensorFault):
    """Some exposures show the ball elsewhere; magnitude: how far [m].

    Attributes:
        chance: Share of them.
    """

    kind: Literal["outlier"] = "outlier"
    magnitude: Annotated[float, Field(ge=0.0, le=5.0)] = 0.3
    chance: Chance = 0.01

    def shown(self, t: float, r_o: Array) -> Array:
        """Return the place, or one elsewhere."""
        hit = bool(self._rng.random() < self.chance)
        off = self.magnitude * direction(self._rng)
        return np.asarray(r_o + off) if hit and self.is_active(t) else r_o


class Dropout(SensorFault):
    """Lost frames or points; magnitude: share lost.

    Attributes:
        camera: The one camera that loses them, each by itself; all lose the same if left out.
            Without images a point needs both eyes, and is lost either way.
    """

    kind: Literal["dropout"] = "dropout"
    magnitude: Chance = 1.0
    camera: CameraIndex | None = None

    def delivered(self, senses: Senses) -> Senses:
        """Return what is not lost."""
        lost = self._rng.random() < self.magnitude
        if not lost or not self.is_active(senses.t, slack=_SLACK):
            return senses
        one = self.camera
        kept = () if one is None else tuple(f for f in senses.frames if f.camera != one)
        return replace(senses, frames=kept, points=())


class Frozen(SensorFault):
    """A camera shows what it saw last; magnitude: share of trials it happens in.

    Attributes:
        camera: Which camera; all if left out.
        numbered: Whether stamps and frame numbers go on rising meanwhile.
    """

    kind: Literal["frozen"] = "frozen"
    magnitude: Chance = 1.0
    camera: CameraIndex | None = None
    numbered: bool = False
    _hit: bool
    _frames: dict[int, Frame]
    _points: tuple[Sighting, ...]

    def _begin(self, trial: DisturbedTrial) -> None:  # noqa: ARG002
        self._hit, self._frames, self._points = bool(self._rng.random() < self.magnitude), {}, ()

    def delivered(self, senses: Senses) -> Senses:
        """Return what was seen last before the fault."""
        if not self._hit or not (senses.frames or senses.points):
            return senses
        if not self.is_active(senses.t, slack=_SLACK):
            self._frames = {frame.camera: frame for frame in senses.frames}
            self._points = senses.points
            return senses
        frames = tuple(self._frozen(frame) for frame in senses.frames)
        points = senses.points
        if self._points and self.camera is None:
            new, old = senses.points[-1], self._points[-1]
            points = (replace(old, t=new.t) if self.numbered else old,)
        return replace(senses, frames=frames, points=points)

    def _frozen(self, frame: Frame) -> Frame:
        """Return the last frame before the fault in place of one, if its camera is the one."""
        old = self._frames.get(frame.camera)
        if old is None or self.camera not in (None, frame.camera):
            return frame
        return replace(frame, pixels=old.pixels) if self.numbered else old


class _Delayed(SensorFault):
    """Delivers late, in each tick all that is due.

    Points come in the order of their exposure; of each camera the newest frame comes, as a driver
    overwrites what nobody has taken.
    """

    _waiting: list[tuple[float, int, Seen]]
    _count: int

    def _begin(self, trial: DisturbedTrial) -> None:  # noqa: ARG002
        self._waiting, self._count = [], 0

    def _hits(self) -> bool:
        """Tell, once a tick, whether what was exposed in it comes late."""
        return True

    def delivered(self, senses: Senses) -> Senses:
        t, hit, waiting = senses.t, self._hits(), self._waiting
        delay = self.magnitude if hit and self.is_active(t, slack=_SLACK) else 0.0
        if senses.frames or senses.points:
            heapq.heappush(waiting, (t + delay, self._count, (senses.frames, senses.points)))
            self._count += 1
        due: list[tuple[int, Seen]] = []
        while waiting and waiting[0][0] <= t + _SLACK:
            due.append(heapq.heappop(waiting)[1:])
        newest: dict[int, Frame] = {}
        points: list[Sighting] = []
        for _, (frames, seen) in sorted(due, key=lambda one: one[0]):
            newest |= {frame.camera: frame for frame in frames}
            points += seen
        return replace(senses, frames=tuple(newest.values()), points=tuple(points))


class Latency(_Delayed):
    """Frames and points that come late, all alike; magnitude: delay [s].

    Attributes:
        stamped: Whether they carry the time of their exposure, or that of their arrival.
    """

    kind: Literal["latency"] = "latency"
    magnitude: Delay
    stamped: bool = True

    def delivered(self, senses: Senses) -> Senses:
        """Return what is due, with its own stamps or new ones."""
        late = super().delivered(senses)
        return late if self.stamped else _restamped(late, senses.t)


class Late(_Delayed):
    """Some frames or points come later than those behind them; magnitude: delay [s].

    Attributes:
        chance: Share of them; a delay of two ticks swaps neighbours.
    """

    kind: Literal["late"] = "late"
    magnitude: Delay = 0.002
    chance: Chance = 0.1

    def _hits(self) -> bool:
        return bool(self._rng.random() < self.chance)


class Duplicate(SensorFault):
    """Frames or points that come twice; magnitude: share of them.

    A frame's copy takes the place of the next frame, a point's copy comes beside the next point.
    """

    kind: Literal["duplicate"] = "duplicate"
    magnitude: Chance = 0.1
    _last: Seen

    def _begin(self, trial: DisturbedTrial) -> None:  # noqa: ARG002
        self._last = (), ()

    def delivered(self, senses: Senses) -> Senses:
        """Return what arrives, and what came before a second time."""
        again = self._rng.random() < self.magnitude
        frames, points = self._last
        again = again and self.is_active(senses.t, slack=_SLACK) and bool(frames or points)
        self._last = (frames if again else senses.frames), senses.points
        if not again:
            return senses
        return replace(senses, frames=frames, points=(*points, *senses.points))


class Calibration(SensorFault):
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
    _A: Array

    def _begin(self, trial: DisturbedTrial) -> None:  # noqa: ARG002
        size = self.magnitude * self._rng.standard_normal()
        axis = direction(self._rng)
        self._A = rotation(axis, size) if self.part == "angles" else (1.0 + size) * np.eye(3)

    def shown(self, t: float, r_o: Array) -> Array:  # noqa: ARG002
        """Return the place as wrongly calibrated cameras see it, for worlds without images."""
        return np.asarray(self._A @ r_o)

    def rig(self, assumed: Rig, rng: np.random.Generator) -> Rig:
        """Return the rig that takes the images, where the catcher assumes another."""
        cameras, heads = list(assumed.cameras), list(assumed.heads)
        for n, camera in enumerate(cameras):
            axis, size = direction(rng), self.magnitude * rng.standard_normal()
            if self.part == "focal":
                cameras[n] = replace(camera, f_px=camera.f_px * (1.0 + size))
                continue
            moved = self._moved(camera.T_world_cam, axis, size)
            cameras[n] = replace(camera, T_world_cam=moved)
            if heads:
                base = self._moved(heads[n].T_world_base, axis, size)
                heads[n] = replace(heads[n], T_world_base=base)
        return Rig(cameras=tuple(cameras), heads=tuple(heads))

    def _moved(self, T: Array, axis: Array, size: float) -> Array:
        """Return a pose, shape (4, 4), turned about an axis or shifted along its own x axis."""
        out = T.copy()
        if self.part == "angles":
            out[:3, :3] = rotation(axis, size) @ T[:3, :3]
        else:
            out[:3, 3] += size * T[:3, 0]
        return out


class NotNumber(SensorFault):
    """NaN where a number should be; magnitude: share of the ticks.

    Attributes:
        where: In the positions of ``points``, the ``stamps`` of frames and points, or the
            ``encoders``.
    """

    kind: Literal["nan"] = "nan"
    magnitude: Chance = 0.01
    where: Literal["points", "stamps", "encoders"] = "points"

    def delivered(self, senses: Senses) -> Senses:
        """Return senses with NaN in them."""
        hit = self._rng.random() < self.magnitude
        if not hit or not self.is_active(senses.t, slack=_SLACK):
            return senses
        if self.where == "encoders":
            nan = np.full_like(senses.arm.q, np.nan)
            return replace(senses, arm=replace(senses.arm, q=nan, dq=nan.copy()))
        if self.where == "points":
            nan = np.full(3, np.nan)
            return replace(senses, points=tuple(replace(p, r_o=nan) for p in senses.points))
        return _restamped(senses, float("nan"))


class Clock(SensorFault):
    """A clock that is set forward or back; magnitude: jump [s].

    Attributes:
        clock: That of the ``tick``, with all that it stamps, or that of the ``camera`` alone.
    """

    kind: Literal["clock"] = "clock"
    magnitude: Annotated[float, Field(ge=-1e5, le=1e5)]
    clock: Literal["tick", "camera"] = "camera"

    def delivered(self, senses: Senses) -> Senses:
        """Return senses with other stamps."""
        if not self.is_active(senses.t, slack=_SLACK):
            return senses
        by = self.magnitude
        frames = tuple(replace(f, t=f.t + by) for f in senses.frames)
        points = tuple(replace(p, t=p.t + by) for p in senses.points)
        if self.clock == "camera":
            return replace(senses, frames=frames, points=points)
        arm = replace(senses.arm, t=senses.arm.t + by)
        return replace(senses, t=senses.t + by, arm=arm, frames=frames, points=points)


class Encoder(SensorFault):
    """Wrong encoder readings; magnitude: of a ``jump`` or a ``step`` [rad].

    Attributes:
        fault: ``stuck`` at the last reading, a ``jump`` to another, ``dropout`` (no number),
            the wrong ``sign``, or coarse by a ``step``.
        joint: Which active joint, from 0; all if left out.
    """

    kind: Literal["encoder"] = "encoder"
    fault: Literal["stuck", "jump", "dropout", "sign", "step"]
    magnitude: Annotated[float, Field(ge=-10.0, le=10.0)] = 0.1
    joint: Annotated[int, Field(ge=0, le=15)] | None = None
    _t: float
    _read: Array
    _stuck: Array

    @model_validator(mode="after")
    def _positive_step(self) -> "Encoder":
        """Refuse a step that counts nothing."""
        if self.fault == "step" and self.magnitude <= 0.0:
            raise ValueError("a magnitude above 0 for a step")
        return self

    def _begin(self, trial: DisturbedTrial) -> None:  # noqa: ARG002
        self._t, self._read, self._stuck = 0.0, np.empty(0), np.empty(0)

    def delivered(self, senses: Senses) -> Senses:
        """Return wrong readings of one joint or all; speeds follow from what is read."""
        arm, before, last = senses.arm, self._t, self._read
        self._t = senses.t
        if not self.is_active(senses.t):
            self._read = self._stuck = arm.q
            return senses
        chosen = np.full(len(arm.q), self.joint is None)
        if self.joint is not None:
            chosen[self.joint % len(arm.q)] = True
        q, dq = np.where(chosen, self._reading(arm.q), arm.q), np.zeros_like(arm.q)
        if len(last) == len(q) and senses.t > before:
            dq = (q - last) / (senses.t - before)
        self._read = q
        return replace(senses, arm=replace(arm, q=q, dq=np.where(chosen, dq, arm.dq)))

    def _reading(self, q: Array) -> Array:
        """Return what the encoders read instead of q [rad]."""
        match self.fault:
            case "stuck":
                return self._stuck if len(self._stuck) else q
            case "jump":
                return np.asarray(q + self.magnitude)
            case "dropout":
                return np.full_like(q, np.nan)
            case "sign":
                return -q
            case "step":
                return np.asarray(self.magnitude * np.rint(q / self.magnitude))


class ChannelFault(Fault):
    """A fault of the commands on their way to the motors, or of these."""

    @abstractmethod
    def through(self, t: float, command: Command) -> Command:
        """Return the command that goes on at a time [s]; once a tick."""


class CommandFault(ChannelFault):
    """Commands on their way to the motors; magnitude: delay [s].

    Attributes:
        lost: Share of the commands that never arrive; the motors keep the one before.
    """

    kind: Literal["command"] = "command"
    magnitude: Delay = 0.0
    lost: Chance = 0.0
    _waiting: deque[Command]
    _last: Command | None

    def _begin(self, trial: DisturbedTrial) -> None:  # noqa: ARG002
        self._waiting, self._last = deque(), None

    def through(self, t: float, command: Command) -> Command:
        """Return the newest command that has arrived."""
        lost, waiting = self._rng.random() < self.lost, self._waiting
        ticks = round(self.magnitude / TICK)
        waiting.append(command)
        if self.is_active(t):
            command = waiting[max(len(waiting) - 1 - ticks, 0)]
            command = self._last if lost and self._last is not None else command
        if len(waiting) > ticks:
            waiting.popleft()
        self._last = command
        return command


class Torque(ChannelFault):
    """Motors weaker than their limit set says; magnitude: share that is left."""

    kind: Literal["torque"] = "torque"
    magnitude: Annotated[float, Field(ge=0.01, le=1.0)] = 0.5
    _trial: DisturbedTrial

    def _begin(self, trial: DisturbedTrial) -> None:
        if trial.limits is None:
            raise InputError("fault torque", "the limits of the arm", "none")
        self._trial = trial

    def through(self, t: float, command: Command) -> Command:
        """Return torques within a share of the limits."""
        limits, active = self._trial.limits, list(self._trial.active)
        if limits is None or not self.is_active(t):
            return command
        every = np.zeros(len(limits.tau_peak))
        every[active] = command.tau
        tau = self.magnitude * limits.saturate(every / self.magnitude, np.zeros_like(every))
        return command._replace(joints=np.array([*command.joints[:3], tau[active]]))


class Payload(Fault):
    """Mass at the hand that no model knows, all the trial; magnitude: [kg]."""

    kind: Literal["payload"] = "payload"
    magnitude: Annotated[float, Field(ge=0.0, le=20.0)]


AnyFault = (
    Noise
    | Outlier
    | Dropout
    | Frozen
    | Latency
    | Late
    | Duplicate
    | Calibration
    | NotNumber
    | Clock
    | Encoder
    | Torque
    | CommandFault
    | Payload
    | Drag
    | Spin
    | Gust
    | Kick
    | Bounce
    | Spring
    | Carried
    | Flutter
    | Elastic
    | Light
    | BeltChange
    | Turned
    | Taken
)
"""One entry of a plan."""

FaultPlan = Annotated[
    tuple[Annotated[AnyFault, Field(discriminator="kind")], ...], Field(strict=False, max_length=32)
]
"""Entries in the order in which they act."""


def begun(plan: tuple[AnyFault, ...], seed: int, trial: DisturbedTrial) -> Iterator[AnyFault]:
    """Yield the entries of a plan as they are at the release of a trial."""
    for number, fault in enumerate(plan):
        yield fault.begun(np.random.default_rng([_STREAMS, number, seed]), trial)


def true_rig(assumed: Rig, plan: tuple[AnyFault, ...], rng: np.random.Generator) -> Rig:
    """Return the rig that takes the images, where the catcher assumes another.

    Args:
        assumed: The rig of the catcher.
        plan: All entries; without a calibration error the rig is the assumed one.
        rng: Source of the errors; not drawn from where there is none.
    """
    for fault in plan:
        if isinstance(fault, Calibration):
            assumed = fault.rig(assumed, rng)
    return assumed


@final
class FaultySensors:
    """Sensors with faults behind them, read like the sensors themselves."""

    def __init__(self, sensors: Sensor, faults: tuple[SensorFault, ...]) -> None:
        """Put the faults behind the sensors, the first nearest to them."""
        self._sensors, self._faults = sensors, faults

    def turn(self, gaze: Array | None, duration: float) -> None:
        """Let the heads of the cameras follow the catcher's gaze for ``duration`` [s]."""
        self._sensors.turn(gaze, duration)

    def read(
        self, t: float, q: Array, dq: Array, r_o: Array, dr_o: Array, *, look: bool = True
    ) -> Senses:
        """Expose at time ``t`` and return what arrives; to be called once a tick."""
        for fault in self._faults:
            r_o = fault.shown(t, r_o)
        senses = self._sensors.read(t, q, dq, r_o, dr_o, look=look)
        for fault in self._faults:
            senses = fault.delivered(senses)
        return senses


@final
class ActiveFaults:
    """What goes wrong in one trial.

    Attributes:
        ball: What comes at the arm instead of the throw, or the throw.
        payload: Mass at the hand that no model knows [kg].
    """

    def __init__(self, plan: tuple[AnyFault, ...], seed: int, trial: DisturbedTrial) -> None:
        """Draw the faults of a trial.

        Raises:
            InputError: Motors are to be weak, and no limit set was given.
        """
        self._plan, self._seed, self._trial = plan, seed, trial
        self.ball: Throw | BallPath = trial.flight.ball
        self.payload = 0.0
        self._sensor_faults: list[SensorFault] = []
        self._late: list[ChannelFault] = []
        self._weak: list[ChannelFault] = []
        self._pushes: list[Push] = []
        self._turns: list[Turned] = []
        for fault in begun(plan, seed, trial):
            match fault:
                case SensorFault():
                    self._sensor_faults.append(fault)
                case CommandFault():
                    self._late.append(fault)
                case Torque():
                    self._weak.append(fault)
                case Payload():
                    self.payload += fault.magnitude
                case Push():
                    self._pushes.append(fault)
                case Turned():
                    self._turns.append(fault)
                case Replacement():
                    self.ball = fault.path(replace(trial.flight, ball=self.ball))
                case _:
                    assert_never(fault)

    def untouched_flight(self, drag: float) -> DisturbedFlight:
        """Return the true flight if nobody touches the ball, for the clairvoyant alone.

        Args:
            drag: Drag coefficient of this trial's plant [1/m].
        """
        return disturbed_flight(self.ball, self._fresh_pushes(), drag=drag)

    def prescribed(self, drag: float) -> Prescribed | None:
        """Return the ball's motion until it is touched; None where a throw flies freely.

        Args:
            drag: Drag coefficient of this trial's plant [1/m].
        """
        if not self._pushes:
            return None if isinstance(self.ball, Throw) else Prescribed(states_of(self.ball))
        return Prescribed(disturbed_states(self.ball, self._fresh_pushes(), drag=drag))

    def _fresh_pushes(self) -> list[Push]:
        """Return what disturbs the flight, which has not done anything yet."""
        fresh = begun(self._plan, self._seed, self._trial)
        return [fault for fault in fresh if isinstance(fault, Push)]

    def sensors(self, sensors: Sensor, *, pixels: bool) -> Sensor:
        """Return the sensors with their faults; the same ones where there are none.

        Args:
            sensors: The sensors.
            pixels: Whether there are images; they carry an error of calibration themselves.
        """
        faults = tuple(
            fault
            for fault in self._sensor_faults
            if not (pixels and isinstance(fault, Calibration))
        )
        return FaultySensors(sensors, faults) if faults else sensors

    def command(self, t: float, command: Command) -> Command:
        """Return the command that the motors follow at a time [s]: late or lost, then limited."""
        for fault in (*self._late, *self._weak):
            command = fault.through(t, command)
        return command

    def turn(self, t: float) -> float | None:
        """Return how fast what is met is turned at a time [rad/s]; None where it is let alone."""
        return next((x for turned in self._turns if (x := turned.rate(t)) is not None), None)

    def push(self, t: float, r: Array, dr: Array) -> bool:
        """Disturb what rides, or is held, in place for a tick; return whether anything changed."""
        changed = [push.act(t, TICK, r, dr) for push in self._pushes]
        return any(changed)

    @property
    def on_ball_alone(self) -> bool:
        """Whether only the ball's flight, or the load of the hand, is disturbed."""
        return not (self._sensor_faults or self._late or self._weak or self._turns)


def _restamped(senses: Senses, t: float) -> Senses:
    """Return senses whose frames and points have another time [s]."""
    frames = tuple(replace(f, t=t) for f in senses.frames)
    return replace(senses, frames=frames, points=tuple(replace(p, t=t) for p in senses.points))
