"""Setpoints for robots that take positions or velocities and follow them by a control of their own.

That control is taken to be of bandwidth w, and a setpoint to act a delay d after it was sent:

    position:  ddq = w^2 (q_s - q) + 2 w (dq_s - dq),  dq_s the difference of two setpoints
    velocity:  ddq = 2 w (v_s - dq)

mitt knows w and d, as a user does who has measured a step of the arm. It sends what the desired
motion will be by then, q_d + d dq_d + d^2 / 2 ddq_d and so on, with what makes up for the lag:

    position:  q_s = q_d + e,  2 w e' + w^2 e = ddq_d
    velocity:  v_s = dq_d + (w / 2) (q_d - q) + ddq_d / (2 w)

so that the arm obeys e'' + 2 w e' + w^2 e = 0 as with torques (:mod:`mitt.core.control.tracking`),
but for what changes within the delay. Filters and limits that a vendor adds are not in this model.

No setpoint is a position outside the joints' ranges or a speed beyond theirs, but on the way in
from outside. From one to the next a position changes by no more than the speeds allow, a speed by
no more than what a motion of the largest acceleration a, up and down, can ask for:
a (T + 2 d + 1 / w) + w T dq_max. A joint of which the reading is no number is taken to be where it
is desired.
"""

from math import exp, inf
from typing import final

import numpy as np

from mitt.core import checks
from mitt.core.arm.arm import Arm
from mitt.core.control.envelope import bounds_of
from mitt.core.signals import TICK, Array, Command

#: Row of a command that a robot follows.
ROWS = {"torque": 3, "velocity": 1, "position": 0}
#: Largest bandwidth [rad/s], delay [s] and time between two setpoints [s] that are taken for meant.
_QUICKEST = 1e5
_LATEST = 1.0
_LONGEST = 10.0


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
        self._arm = checks.instance("arm", arm, Arm)
        self._takes = checks.one_of("takes", takes, ("position", "velocity"))
        self._w = checks.number("bandwidth", bandwidth, least=1e-3, most=_QUICKEST)
        self._delay = checks.number("delay", delay, least=0.0, most=_LATEST)
        self._hardest = bounds_of(arm)["ddq_max"]
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
        place, speed, rate = checks.array("desired", desired, (3, arm.n), finite=True)
        q = self._read(q, place)
        passed = checks.number("passed", passed, least=1e-9, most=_LONGEST)
        most = np.minimum(arm.dq_max, checks.number("fastest", fastest, least=0.0))
        if self._takes == "velocity":
            led = speed + d * rate + 0.5 * w * (place - q) + 0.5 / w * rate
            before = np.clip(speed, -most, most) if self._last is None else self._last
            change = self._hardest * (passed + 2.0 * d + 1.0 / w) + w * passed * arm.dq_max
            self._last = np.clip(np.clip(led, -most, most), before - change, before + change)
            return self._last.copy()
        steady = rate / w**2
        ahead = steady if self._ahead is None else self._ahead
        self._ahead = steady + (ahead - steady) * exp(-0.5 * w * passed)
        wanted = np.clip(place + d * speed + 0.5 * d**2 * rate + ahead, arm.q_min, arm.q_max)
        return self._moved(wanted, q, passed * most)

    def _read(self, q: Array, place: Array) -> Array:
        """Return where the joints are [rad]; where they are desired, if a reading is no number."""
        q = checks.vector("q", q, self._arm.n)
        return np.where(np.isfinite(q), q, place)

    def _moved(self, wanted: Array, q: Array, step: Array) -> Array:
        """Return a position as near to one that is wanted as a step from the last one leads."""
        before = q if self._last is None else self._last
        self._last = np.clip(wanted, before - step, before + step)
        return self._last.copy()

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
        command = checks.instance("command", command, Command)
        joints = command.joints.copy()
        if command.brakes and not command.tau.any():
            q = self._read(q, command.q)
            passed = checks.number("passed", passed, least=1e-9, most=_LONGEST)
            joints[:3] = 0.0
            self._ahead = None
            if self._takes == "velocity":
                joints[0], self._last = q, None
            else:
                fastest = checks.number("fastest", fastest, least=0.0)
                step = passed * np.minimum(self._arm.dq_max, fastest)
                joints[0] = self._moved(q, q, step)
        else:
            told = self.of(command.joints[:3], q, passed=passed, fastest=fastest)
            joints[ROWS[self._takes]] = told
        return command._replace(joints=joints)
