"""Setpoints for robots that take positions or velocities and follow them by a control of their own.

That control is taken to be of bandwidth w, and a setpoint to act a delay d after it was sent:

    position:  ddq = w^2 (q_s - q) + 2 w (dq_s - dq),  dq_s the difference of two setpoints
    velocity:  ddq = 2 w (v_s - dq)

mitt knows w and d, as a user does who has measured a step of the arm. It sends what the desired
motion will be by then, q_d + d dq_d + d^2 / 2 ddq_d and so on, with what makes up for the lag:

    position:  q_s = q_d + e,  2 w e' + w^2 e = ddq_d
    velocity:  v_s = dq_d + (w / 2) (q_d - q) + ddq_d / (2 w)

so that the arm obeys e'' + 2 w e' + w^2 e = 0 as with torques (:mod:`mitt.control.tracking`), but
for what changes within the delay. Filters and limits that a vendor adds are not in this model. No
setpoint is outside the joints' ranges, none is beyond their speeds or differs from the one before
by more than those allow.
"""

from math import exp, inf
from typing import final

import numpy as np

from mitt.errors import InputError
from mitt.robot.arm import Arm
from mitt.signals import TICK, Array, Command

#: Row of a command that a robot follows.
ROWS = {"torque": 3, "velocity": 1, "position": 0}


@final
class Setpoints:
    """Makes setpoints of a desired motion, for a joint control whose lag and delay are known."""

    def __init__(self, arm: Arm, takes: str, *, bandwidth: float, delay: float) -> None:
        """Take the arm, what the robot takes, and how it follows.

        Args:
            arm: The arm.
            takes: ``position`` or ``velocity``.
            bandwidth: Of its control, w [rad/s].
            delay: Time after which a setpoint acts, d [s].
        """
        if takes not in ("position", "velocity"):
            raise InputError("setpoints", "position or velocity", takes)
        self._takes, self._w, self._delay, self._arm = takes, bandwidth, delay, arm
        self._ahead: Array | None = None
        self._last: Array | None = None

    def restart(self) -> None:
        """Forget the motion so far."""
        self._ahead = self._last = None

    def of(self, desired: Array, q: Array, *, passed: float = TICK, fastest: float = inf) -> Array:
        """Return the setpoint of a tick: positions [rad] or velocities [rad/s], shape (n,).

        Args:
            desired: q_d, dq_d, ddq_d [rad, rad/s, rad/s^2], shape (3, n).
            q: Where the joints are [rad], shape (n,).
            passed: Time since the setpoint before [s].
            fastest: Speed beyond which no joint is sent, below that of its limit [rad/s].
        """
        w, d, arm = self._w, self._delay, self._arm
        place, speed, rate = desired
        most = np.minimum(arm.dq_max, fastest)
        if self._takes == "velocity":
            led: Array = speed + d * rate + 0.5 * w * (place - q) + 0.5 / w * rate
            return np.clip(led, -most, most)
        steady = rate / w**2
        ahead = steady if self._ahead is None else self._ahead
        before = q if self._last is None else self._last
        self._ahead = steady + (ahead - steady) * exp(-0.5 * w * passed)
        wanted = np.clip(place + d * speed + 0.5 * d**2 * rate + ahead, arm.q_min, arm.q_max)
        self._last = np.clip(wanted, before - most * passed, before + most * passed)
        return self._last

    def lead(
        self, command: Command, q: Array, *, passed: float = TICK, fastest: float = inf
    ) -> Command:
        """Return a command with the setpoint in the place of the row that the robot follows.

        Args:
            command: The desired motion; on brakes that hold the arm, the setpoint is to stay.
            q: Where the joints are [rad], shape (n,).
            passed: Time since the setpoint before [s].
            fastest: Speed beyond which no joint is sent, below that of its limit [rad/s].
        """
        joints = command.joints.copy()
        if command.brakes and not command.tau.any():
            joints[:3] = 0.0
            joints[0] = q
            self.restart()
        else:
            told = self.of(command.joints[:3], q, passed=passed, fastest=fastest)
            joints[ROWS[self._takes]] = told
        return command._replace(joints=joints)
