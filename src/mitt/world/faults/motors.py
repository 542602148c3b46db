"""Faults between command and motors: commands late or lost, motors weaker than they should be."""

from collections import deque
from typing import final

import numpy as np

from mitt.errors import InputError
from mitt.robot.limits import Limits
from mitt.signals import Array
from mitt.signals import Command as Order
from mitt.world.faults.draw import of_kind
from mitt.world.faults.plan import Command, Fault, Torque


@final
class Wire:
    """The way of the commands to the motors in one trial."""

    def __init__(
        self,
        plan: tuple[Fault, ...],
        seed: int,
        *,
        limits: Limits | None,
        active: tuple[int, ...],
        tick: float,
    ) -> None:
        """Lay the wire.

        Args:
            plan: All entries.
            seed: Seed of the trial.
            limits: Limit set that weak motors fall short of.
            active: Indices of the active joints among those of the limit set.
            tick: Time between two commands [s].

        Raises:
            InputError: Motors are to be weak, and no limit set was given.
        """
        self._weak = [fault for fault, _ in of_kind(plan, seed, Torque)]
        if self._weak and limits is None:
            raise InputError("fault torque", "the limits of the arm", "none")
        self._limits, self._active = limits, list(active)
        self._slow = [
            (fault, rng, deque[Order](), round(fault.magnitude / tick))
            for fault, rng in of_kind(plan, seed, Command)
        ]
        self._last: Order | None = None

    def through(self, t: float, command: Order) -> Order:
        """Return the command that the motors follow at a time [s]; once a tick."""
        for fault, rng, way, ticks in self._slow:
            lost = rng.random() < fault.lost
            way.append(command)
            if fault.holds(t):
                command = way[max(len(way) - 1 - ticks, 0)]
                command = self._last if lost and self._last is not None else command
            if len(way) > ticks:
                way.popleft()
        self._last = command
        for weak in self._weak:
            if weak.holds(t):
                told = np.array([*command.told[:3], self._cut(command.tau, weak.magnitude)])
                command = command._replace(told=told)
        return command

    def _cut(self, tau: Array, share: float) -> Array:
        """Return the torques within a share of the limits [N m]."""
        if self._limits is None:
            return tau
        every = np.zeros(len(self._limits.tau_peak))
        every[self._active] = tau
        cut = share * self._limits.saturate(every / share, np.zeros_like(every))
        return np.asarray(cut[self._active])
