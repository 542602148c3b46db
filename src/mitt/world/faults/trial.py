"""All faults of one trial: at the sensors, on the way of the commands, and on the ball."""

from collections import deque
from typing import Protocol, final

import numpy as np

from mitt.errors import InputError
from mitt.robot.limits import Limits
from mitt.signals import Array, Command, Senses
from mitt.world.faults.draw import drawn
from mitt.world.faults.flight import Undisturbed, pushes
from mitt.world.faults.paths import DisturbedFlight, disturbed_flight, replaced_ball
from mitt.world.faults.plan import Command as CommandFault
from mitt.world.faults.plan import Fault, Payload, Torque
from mitt.world.faults.senses import sensor_faults
from mitt.world.faults.sensor_fault import SensorFault
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

    def __init__(self, sensors: Sensor, stages: tuple[SensorFault, ...]) -> None:
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
            look = stage.exposes(t) and look
            r_o = stage.shown(t, r_o)
        senses = self._sensors.read(t, q, dq, r_o, dr_o, look=look)
        for stage in self._stages:
            senses = stage.delivered(senses)
        return senses


@final
class CommandChannel:
    """The commands on their way to the motors in one trial: late, lost, or too much for them."""

    def __init__(
        self,
        plan: tuple[Fault, ...],
        seed: int,
        *,
        limits: Limits | None,
        active: tuple[int, ...],
        tick: float,
    ) -> None:
        """Start with nothing on its way.

        Args:
            plan: All entries.
            seed: Seed of the trial.
            limits: Limit set that weak motors fall short of.
            active: Indices of the active joints among those of the limit set.
            tick: Time between two commands [s].

        Raises:
            InputError: Motors are to be weak, and no limit set was given.
        """
        self._weak = [fault for fault in plan if isinstance(fault, Torque)]
        if self._weak and limits is None:
            raise InputError("fault torque", "the limits of the arm", "none")
        self._limits, self._active = limits, list(active)
        self._slow = [
            (fault, rng, deque[Command](), round(fault.magnitude / tick))
            for fault, rng in drawn(plan, seed)
            if isinstance(fault, CommandFault)
        ]
        self._last: Command | None = None

    def through(self, t: float, command: Command) -> Command:
        """Return the command that the motors follow at a time [s]; once a tick."""
        for fault, rng, waiting, ticks in self._slow:
            lost = rng.random() < fault.lost
            waiting.append(command)
            if fault.is_active(t):
                command = waiting[max(len(waiting) - 1 - ticks, 0)]
                command = self._last if lost and self._last is not None else command
            if len(waiting) > ticks:
                waiting.popleft()
        self._last = command
        for weak in self._weak:
            if weak.is_active(t):
                tau = self._limited(command.tau, weak.magnitude)
                command = command._replace(joints=np.array([*command.joints[:3], tau]))
        return command

    def _limited(self, tau: Array, share: float) -> Array:
        """Return the torques within a share of the limits [N m]."""
        if self._limits is None:
            return tau
        every = np.zeros(len(self._limits.tau_peak))
        every[self._active] = tau
        limited = share * self._limits.saturate(every / share, np.zeros_like(every))
        return np.asarray(limited[self._active])


@final
class ActiveFaults:
    """What goes wrong in one trial.

    Attributes:
        ball: What comes at the arm instead of the throw, or the throw.
        payload: Mass at the hand that no model knows [kg].
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
        """Draw the faults of a trial.

        Args:
            plan: All entries.
            seed: Seed of the trial.
            flight: The undisturbed flight.
            limits: As for :class:`CommandChannel`, as are ``active`` and ``tick``.
            active: See ``limits``.
            tick: See ``limits``.
        """
        self._plan, self._seed, self._undisturbed, self._tick = plan, seed, flight, tick
        self.ball: Throw | BallPath = replaced_ball(plan, seed, flight)
        self.payload = sum(fault.magnitude for fault in plan if isinstance(fault, Payload))
        self._pushes = pushes(plan, seed, flight)
        self._channel = None
        if any(isinstance(fault, Torque | CommandFault) for fault in plan):
            self._channel = CommandChannel(plan, seed, limits=limits, active=active, tick=tick)

    def undisturbed_path(self, drag: float) -> DisturbedFlight:
        """Return the true flight if nobody touches the ball, for the clairvoyant alone.

        Args:
            drag: Drag coefficient of this trial's plant [1/m].
        """
        fresh = pushes(self._plan, self._seed, self._undisturbed)
        return disturbed_flight(self.ball, fresh, drag=drag, tick=self._tick)

    def sensors(self, sensors: Sensor, *, pixels: bool) -> Sensor:
        """Return the sensors with their faults; the same ones where there are none."""
        stages = sensor_faults(self._plan, self._seed, pixels=pixels)
        return Disturbed(sensors, stages) if stages else sensors

    def command(self, t: float, command: Command) -> Command:
        """Return the command that the motors follow."""
        return command if self._channel is None else self._channel.through(t, command)

    def pushes(self, t: float, until: float) -> bool:
        """Tell whether anything may disturb the flying ball between two times [s]."""
        return not all(push.is_inactive(t, until) for push in self._pushes)

    def push(self, t: float, h: float, r: Array, dr: Array) -> bool:
        """Disturb the flying ball in place for a step; return whether anything changed."""
        changed = [push.act(t, h, r, dr) for push in self._pushes]
        return any(changed)
