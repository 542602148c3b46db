"""The simulated robot's own controller: takes commands, and brakes by itself where none come."""

from math import pi
from typing import Protocol, final

import numpy as np

from mitt.control.setpoints import ROWS
from mitt.control.stop import plan_brake
from mitt.files.cell import RobotPart
from mitt.robot.arm import Arm
from mitt.signals import TICK, Array, Command
from mitt.world.servo import JointControl

#: Bandwidth with which the controller holds and brakes by itself [rad/s]: that of the catcher.
_BANDWIDTH = 80.0
#: Speed at which a joint counts as at rest [rad/s].
_REST = 0.02


class Told(Protocol):
    """A command as it arrives: q, dq, ddq, tau, shape (4, n), and the hand's angle [rad]."""

    @property
    def joints(self) -> Array:
        """Rows, shape (4, n); NaN where it does not say them."""

    @property
    def hand(self) -> float:
        """Closing angle [rad]."""


@final
class Controller:
    """What stands between commands and drives.

    It holds the arm on its brakes until it is released. From then on it expects commands; where
    none has come for the watchdog's time it brakes along Ruckig's stop, engages the brakes and
    stays so: a protective stop.

    Attributes:
        trouble: Why it takes no commands; nothing where it does.
        released: Whether it expects commands.
        stop_time: Time from the last protective stop to rest [s], and what its brake was planned
            to take; None until there was one.
    """

    def __init__(self, arm: Arm, robot: RobotPart) -> None:
        """Take the arm, and what the cell's file says of the robot."""
        self._arm, self._watchdog, self._row = arm, robot.watchdog, ROWS[robot.takes]
        w = 2.0 * pi * robot.servo
        self._control = (
            None if robot.takes == "torque" else JointControl(arm, robot.takes, bandwidth=w)
        )
        self.trouble, self.released = "", False
        self.stop_time: tuple[float, float] | None = None
        self._way = plan_brake(arm, 0.0, np.array([arm.q_ready, *np.zeros((2, arm.n))]))
        self._held: Array | None = None
        self._told: Told | None = None
        self._heard, self._since, self._hand = 0.0, np.inf, 0.0

    @property
    def commanded(self) -> bool:
        """Whether a command acts."""
        return self._told is not None

    @property
    def told(self) -> Array:
        """Rows q, dq, ddq, tau of the command that acts, shape (4, n); NaN where it says none."""
        rows = np.full((4, self._arm.n), np.nan)
        if self._told is not None and self._control is None:
            rows[:] = self._told.joints
        elif self._told is not None:
            rows[self._row] = self._told.joints[self._row]
        return rows

    def release(self, t: float, q: Array, dq: Array) -> None:
        """Release the brakes and forget a stop: hold the arm until a command comes."""
        self.trouble, self.released, self._told, self._heard = "", True, None, t
        self._take_over(t, q, dq)

    def engage(self, t: float, q: Array, dq: Array) -> None:
        """Engage the brakes as a command says."""
        if self.released:
            self.released, self._told = False, None
            self._take_over(t, q, dq)

    def command(self, t: float, q: Array, dq: Array, new: Told | None) -> Command:
        """Return what acts in the tick from ``t`` [s] on.

        Args:
            t: Time [s].
            q: Joint positions [rad], shape (n,).
            dq: Joint velocities [rad/s], shape (n,).
            new: A command that has come; None where none has.
        """
        if new is not None and self.released:
            if self._control is not None:
                self._control.take(new.joints[self._row], passed=max(t - self._heard, TICK))
            self._told, self._heard, self._hand = new, t, new.hand
        elif self.released and t - self._heard > self._watchdog:
            self.trouble = f"protective stop: no command for {1e3 * self._watchdog:.0f} ms"
            self.released, self._told, self._since = False, None, t
            self._take_over(t, q, dq)
        if np.isfinite(self._since) and np.all(np.abs(dq) < _REST):
            self.stop_time = (t - self._since, self._way.duration)
            self._since = np.inf
        told = self._own(t, q, dq) if self._told is None else self._followed(q, dq)
        still = not self.released and self._held is not None
        return Command(t=t, joints=told, hand=self._hand, brakes=still)

    def _take_over(self, t: float, q: Array, dq: Array) -> None:
        """Plan the stop from here, to hold wherever it ends."""
        self._held = None
        if self._control is not None:
            self._control.restart()
        self._way = plan_brake(self._arm, t, np.array([q, dq, np.zeros(self._arm.n)]))

    def _own(self, t: float, q: Array, dq: Array) -> Array:
        """Return the controller's own command: the speeds of its stop, then to hold.

        Where the drives lag behind the stop the arm ends elsewhere; it does not move on to there.
        """
        if self._held is None and np.all(np.abs(dq) < _REST):
            self._held = q.copy()
        wanted = self._way.at(t)
        wanted[0] = q if self._held is None else self._held
        return self._tracked(wanted, q, dq)

    def _followed(self, q: Array, dq: Array) -> Array:
        """Return the command that came: its torque, or that of the robot's own control."""
        assert self._told is not None
        told, still = self._told.joints, np.zeros(self._arm.n)
        if self._control is not None:
            arm = self._arm
            within = np.array(
                [np.clip(q, arm.q_min, arm.q_max), np.clip(dq, -arm.dq_max, arm.dq_max)]
            )
            within[self._row] = told[self._row]
            return np.array([*within, still, self._control.torque(q, dq)])
        return np.where(np.isnan(told), np.array([q, dq, still, still]), told)

    def _tracked(self, wanted: Array, q: Array, dq: Array) -> Array:
        """Return wanted q, dq, ddq with the torque that follows them, within the limits."""
        arm, w = self._arm, _BANDWIDTH
        ddq = wanted[2] + 2.0 * w * (wanted[1] - dq) + w**2 * (wanted[0] - q)
        tau = arm.limits.saturate(arm.torque(q, dq, ddq), arm.all_joints(dq))
        return np.array([*wanted, arm.active(tau)])
