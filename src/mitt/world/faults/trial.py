"""All faults of one trial, ready to be asked by the world at its three seams."""

from typing import Protocol, final

import numpy as np

from mitt.robot.limits import Limits
from mitt.signals import Array, Command, Senses
from mitt.world.faults.delivery import Delayed, Jumpy, Lossy, Misread, Still, Twice
from mitt.world.faults.draw import drawn
from mitt.world.faults.encoders import Lying
from mitt.world.faults.exposure import Displaced, Slow, Turned
from mitt.world.faults.flight import Undisturbed, pushes
from mitt.world.faults.motors import Wire
from mitt.world.faults.paths import led
from mitt.world.faults.plan import (
    Calibration,
    Clock,
    Dropout,
    Duplicate,
    Encoder,
    Fault,
    FrameRate,
    Frozen,
    Late,
    Latency,
    Noise,
    NotNumber,
    Outlier,
    Payload,
    Torque,
)
from mitt.world.faults.plan import Command as CommandFault
from mitt.world.faults.rehearsal import Rehearsed, rehearse
from mitt.world.faults.stage import Stage
from mitt.world.flights import BallPath
from mitt.world.throws import Throw


class Sensor(Protocol):
    """The sensors: ``mitt.world.sensors.Sensors`` is one."""

    def read(
        self, t: float, q: Array, dq: Array, r_o: Array, dr_o: Array, *, look: bool = True
    ) -> Senses:
        """Expose at time ``t`` and return what arrives; to be called once a tick."""

    def turn(self, gaze: Array | None, duration: float) -> None:
        """Let the heads of the cameras follow the catcher's gaze for ``duration`` [s]."""


@final
class Disturbed:
    """Sensors with faults behind them, read like the sensors themselves."""

    def __init__(self, sensors: Sensor, stages: tuple[Stage, ...]) -> None:
        """Put the stages behind the sensors, the first nearest to them."""
        self._sensors, self._stages = sensors, stages

    def turn(self, gaze: Array | None, duration: float) -> None:
        """Let the heads of the cameras follow the catcher's gaze for ``duration`` [s]."""
        self._sensors.turn(gaze, duration)

    def read(
        self, t: float, q: Array, dq: Array, r_o: Array, dr_o: Array, *, look: bool = True
    ) -> Senses:
        """Expose at time ``t`` and return what arrives; to be called once a tick."""
        for stage in self._stages:
            look = stage.looks(t) and look
            r_o = stage.shown(t, r_o)
        senses = self._sensors.read(t, q, dq, r_o, dr_o, look=look)
        for stage in self._stages:
            senses = stage.told(senses)
        return senses


@final
class Troubles:
    """What goes wrong in one trial.

    Attributes:
        ball: What comes at the arm instead of the throw, or the throw.
        payload: Mass at the hand that no model knows [kg].
        near_arm: Whether encoders, clock or motors are not as they should be.
    """

    def __init__(
        self,
        plan: tuple[Fault, ...],
        seed: int,
        flight: Undisturbed,
        *,
        limits: Limits | None,
        active: tuple[int, ...],
        tick: float,
    ) -> None:
        """Draw a trial's troubles.

        Args:
            plan: All entries.
            seed: Seed of the trial.
            flight: The undisturbed flight.
            limits: As for :class:`Wire`.
            active: As for :class:`Wire`.
            tick: As for :class:`Wire`.
        """
        self._plan, self._seed, self._undisturbed, self._tick = plan, seed, flight, tick
        self.ball: Throw | BallPath = led(plan, seed, flight)
        self.payload = sum(fault.magnitude for fault in plan if isinstance(fault, Payload))
        self._pushes = pushes(plan, seed, flight)
        on_wire = any(isinstance(fault, Torque | CommandFault) for fault in plan)
        wire = Wire(plan, seed, limits=limits, active=active, tick=tick) if on_wire else None
        self._wire = wire
        self.near_arm = on_wire or any(
            isinstance(fault, Clock | Encoder | NotNumber) for fault in plan
        )

    def rehearsed(self, drag: float) -> Rehearsed:
        """Return the true flight if nobody touches the ball, for the clairvoyant alone.

        Args:
            drag: Drag coefficient of this trial's plant [1/m].
        """
        fresh = pushes(self._plan, self._seed, self._undisturbed)
        return rehearse(self.ball, fresh, drag=drag, tick=self._tick)

    def sensors(self, sensors: Sensor, *, pixels: bool) -> Sensor:
        """Return the sensors with their faults; the same ones where there are none."""
        stages = _stages(self._plan, self._seed, pixels=pixels)
        return Disturbed(sensors, stages) if stages else sensors

    def command(self, t: float, command: Command) -> Command:
        """Return the command that the motors follow."""
        return command if self._wire is None else self._wire.through(t, command)

    def pushes(self, t: float, until: float) -> bool:
        """Say whether anything may disturb the flying ball between two times [s]."""
        return not all(push.rests(t, until) for push in self._pushes)

    def push(self, t: float, h: float, r: Array, dr: Array) -> bool:
        """Disturb the flying ball in place for a step; say whether anything changed."""
        changed = False
        for push in self._pushes:
            changed = push.act(t, h, r, dr) or changed
        return changed


def _stages(plan: tuple[Fault, ...], seed: int, *, pixels: bool) -> tuple[Stage, ...]:
    """Return the stages between sensors and catcher, in the order of the plan."""
    stages = (_stage(fault, rng, pixels=pixels) for fault, rng in drawn(plan, seed))
    return tuple(stage for stage in stages if stage is not None)


def _stage(fault: Fault, rng: np.random.Generator, *, pixels: bool) -> Stage | None:
    """Return the stage of an entry; None where images carry the error themselves."""
    match fault:
        case Noise() | Outlier():
            return Displaced(fault, rng)
        case FrameRate():
            return Slow(fault, rng)
        case Calibration():
            return None if pixels else Turned(fault, rng)
        case Dropout():
            return Lossy(fault, rng)
        case Frozen():
            return Still(fault, rng)
        case Latency() | Late():
            return Delayed(fault, rng)
        case Duplicate():
            return Twice(fault, rng)
        case NotNumber():
            return Misread(fault, rng)
        case Clock():
            return Jumpy(fault, rng)
        case Encoder():
            return Lying(fault, rng)
        case _:
            return None
