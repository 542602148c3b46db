"""A stand-in for a vendor's client library: its calls, and a simulated arm behind them.

This invented controller counts its joints from the elbow down, turns one of them the other way,
and speaks of degrees, percent, millimetres, and milliseconds since it was switched on.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from mitt.clock import monotonic, sleep_until
from mitt.core.signals import Command
from mitt.robot.cell.drivers import LocalRobot


class State(NamedTuple):
    """What the controller measures: ms, degrees, degrees per second."""

    time: float
    angles: list[float]
    speeds: list[float]


class AcmeClient:
    """A connection to the controller."""

    def __init__(
        self,
        arm: LocalRobot,
        *,
        order: Sequence[int] = (2, 1, 0),
        sense: Sequence[float] = (1.0, -1.0, 1.0),
        push: Sequence[float] = (1.0, -1.0, 1.0),
        unit: float = 180.0 / np.pi,
        in_time: bool = False,
    ) -> None:
        """Put a simulated arm behind the calls.

        Args:
            arm: It.
            order: Which joint of the arm each joint of the controller is.
            sense: Which way it turns, by its angles.
            push: Which way it turns, by its torques.
            unit: Its angle for one radian.
            in_time: Whether a tick takes a millisecond of real time.
        """
        self._arm, self._order, self._n = arm, list(order), len(order)
        self._sense, self._push, self._unit = np.array(sense), np.array(push), unit
        self._begun = monotonic() if in_time else -np.inf

    def states(self, wait_ms: float) -> list[State]:
        """Return all states since the last call; wait for one so long, if there is none."""
        if wait_ms > 0.0:
            sleep_until(self._begun + self._arm.t)
        scale = self._unit * self._sense
        return [
            State(1e3 * x.t, list(scale * x.q[self._order]), list(scale * x.dq[self._order]))
            for x in self._arm.read(1e-3 * wait_ms)
        ]

    def balls(self) -> list[tuple[float, list[float]]]:
        """Return when and where the ball was seen since the last call: ms, mm."""
        return [(1e3 * x.t, list(1e3 * x.r_o)) for x in self._arm.points()]

    def torques(self, torques: Sequence[float], grip: float) -> None:
        """Give the drives torques [N m], and the hand its closing [percent of a right angle]."""
        rows = np.full((4, self._n), np.nan)
        rows[3, self._order] = self._push * np.array(torques)
        self._arm.write(Command(t=0.0, joints=rows, hand=0.005 * np.pi * grip), self._arm.t)

    def enable(self) -> None:
        """Release the brakes, acknowledge a stop, and take torques."""
        self._arm.release()

    def disable(self) -> None:
        """Engage the brakes, then switch the drives off."""
        self._arm.engage_brakes()

    def fault(self) -> str:
        """Return why the controller takes no torques."""
        return self._arm.trouble()
