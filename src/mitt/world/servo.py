"""The joint control of a robot that takes positions or velocities instead of torques.

Its law is that of :mod:`mitt.control.setpoints`, as computed torque on the arm's nominal model,
with the torques within the arm's limits. In the place of the encoders' readings the robot uses its
joints' true positions, as its own control reads better encoders than it publishes.
"""

from collections import deque
from math import pi
from typing import final

import numpy as np

from mitt.control.setpoints import Setpoints
from mitt.errors import InputError
from mitt.robot.arm import Arm
from mitt.robot.description import ArmModel
from mitt.robot.limits import Limits
from mitt.signals import TICK, Array, Command
from mitt.world.scene import Actuation, Scene


def servo_of(scene: Scene, arm: ArmModel, limits: Limits | None) -> "JointServo | None":
    """Return the joint control of a scene's robot; None where it takes torques.

    Raises:
        InputError: The limits of the arm are not known, or a fault acts on commanded torques.
    """
    if scene.actuation.takes == "torque":
        return None
    unheard = sorted({x.kind for x in scene.faults} & {"torque", "command"})
    if unheard:
        raise InputError("faults", "others, for a robot that takes no torques", unheard,
                         do="take them out, or say actuation.takes = torque")  # fmt: skip
    if limits is None:
        raise InputError("actuation.takes", "torque, or an arm with limits", scene.actuation.takes)
    return JointServo(Arm(arm, limits), scene.actuation)


@final
class JointControl:
    """Follows positions or velocities with torques."""

    def __init__(self, arm: Arm, takes: str, *, bandwidth: float) -> None:
        """Take the arm as its maker knows it, what it takes, and the bandwidth w [rad/s]."""
        self._arm, self._takes, self._w = arm, takes, bandwidth
        self._last: Array | None = None
        self._rate = np.zeros(arm.n)

    def restart(self) -> None:
        """Forget the setpoints so far."""
        self._last, self._rate = None, np.zeros(self._arm.n)

    def take(self, new: Array, *, passed: float = TICK) -> None:
        """Take a setpoint over.

        Args:
            new: Positions [rad] or velocities [rad/s], shape (n,).
            passed: Time since the setpoint before [s].
        """
        if self._last is not None:
            self._rate = (new - self._last) / passed
        self._last = new

    def torque(self, q: Array, dq: Array) -> Array:
        """Return the torques that follow the last setpoint [N m], shape (n,).

        Args:
            q: Joint positions [rad], shape (n,).
            dq: Joint velocities [rad/s], shape (n,).
        """
        assert self._last is not None, "no setpoint"
        w, arm = self._w, self._arm
        if self._takes == "velocity":
            ddq = 2.0 * w * (self._last - dq)
        else:
            ddq = w**2 * (self._last - q) + 2.0 * w * (self._rate - dq)
        return arm.active(arm.limits.saturate(arm.torque(q, dq, ddq), arm.all_joints(dq)))


@final
class JointServo:
    """A robot of a scene: its control, and setpoints that act after a delay."""

    def __init__(self, arm: Arm, actuation: Actuation) -> None:
        """Take the arm as its maker knows it, and how its control follows."""
        takes, w, self._delay = actuation.takes, 2.0 * pi * actuation.servo, actuation.delay
        self._control = JointControl(arm, takes, bandwidth=w)
        self._setpoints = Setpoints(arm, takes, bandwidth=w, delay=actuation.delay * TICK)
        self._sent: deque[tuple[Array, float]] = deque()

    def start(self) -> None:
        """Forget the trial before."""
        self._sent.clear()
        self._control.restart()
        self._setpoints.restart()

    def torques(self, command: Command, q: Array, dq: Array) -> Command:
        """Return a command with the torques, and the closing angle, of the setpoint that acts now.

        Args:
            command: The command of this tick.
            q: Joint positions [rad], shape (n,).
            dq: Joint velocities [rad/s], shape (n,).
        """
        self._sent.append((self._setpoints.of(command.joints[:3], q), command.hand))
        new, hand = self._sent[0]
        if len(self._sent) > self._delay:
            self._sent.popleft()
        if command.brakes and not command.tau.any():  # the brakes act, the drives are off
            return command._replace(hand=hand)
        self._control.take(new)
        tau = self._control.torque(q, dq)
        return command._replace(joints=np.array([*command.joints[:3], tau]), hand=hand)
