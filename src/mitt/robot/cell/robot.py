"""What a robot's driver does for the catcher: it reads the encoders and takes commands.

A driver passes ``Command.brakes`` on to the brakes: after a stop with a joint whose encoder is in
doubt nothing else holds the arm. What has no brakes is therefore refused when the link is made,
unless the caller says that the arm stays where it is without its drives.

Drivers of other packages are entry points of the group ``mitt.robots``: a function from a
:class:`mitt.io.cell.Cell` and its :class:`mitt.core.arm.arm.Arm` to a :class:`Robot`. They run in a
process of their own (:mod:`mitt.robot.cell.driver_host`), all calls from its main thread but one.
One of the same name of the group ``mitt.robot_checks`` says whether it can be made, for ``--check``
and before the start: from cell and arm to lines that say what the robot has to be; it connects to
nothing, and loads no maker's library.
"""

from collections.abc import Callable, Sequence
from contextlib import suppress
from functools import partial
from math import inf
from typing import Final, NamedTuple, Protocol, final, runtime_checkable

import numpy as np

from mitt.core import checks
from mitt.core.arm.arm import Arm
from mitt.core.control.setpoints import Setpoints
from mitt.core.errors import InputError
from mitt.core.signals import TICK, ArmState, Array, Command, Sighting
from mitt.io.cell import Cell
from mitt.robot.cell.plugins import Plugins

#: Drivers: mitt's own, and those of other packages.
DRIVERS: Final = Plugins(
    "driver",
    "mitt.robots",
    "mitt.robot_checks",
    key="robot.driver",
    folder="mitt.robot.drivers",
    others=("ros2", "sim"),
)
#: Time after which a setpoint says nothing of the next [s].
_STALE = 0.05


@runtime_checkable
class Robot(Protocol):
    """A driver of one arm, with the point source beside it.

    Attributes:
        brakes: Whether the arm has brakes that a command can engage.
    """

    brakes: bool

    def read(self, timeout: float) -> Sequence[ArmState]:
        """Return all encoder readings since the last call, oldest first, as stamped by the robot.

        Args:
            timeout: Time to wait for one where there is none yet [s].
        """

    def points(self) -> Sequence[Sighting]:
        """Return all positions of the ball since the last call, stamped by the robot's clock."""

    def write(self, command: Command, answers: float) -> None:
        """Give the drives what they take and the hand its angle; nothing waits for them."""

    def engage_brakes(self) -> str | None:
        """Engage the brakes and, once they act, switch the drives off. May be called again.

        Where another call has not returned it is called beside that, from another thread.

        What is returned says why nobody will, as far as that is known, as ``nobody takes /brake``.
        """

    def release(self) -> None:
        """Release the brakes and acknowledge a protective stop: a person has said so."""

    def waits(self) -> str:
        """Return who is not there yet, as one that takes commands; nothing if all are."""

    def conflict(self) -> str:
        """Return what a person has to see to before the arm may move, beside :meth:`trouble`.

        As another program that commands the arm; nothing if there is nothing. What was agreed to
        before it does not hold after it.
        """

    def trouble(self) -> str:
        """Return why the robot does not take commands, as a protective stop; nothing if it does."""

    def news(self) -> Sequence[str]:
        """Return what a simulated cell has said of its throws since the last call, as JSON."""

    def close(self) -> None:
        """Give the link up."""


class RobotProxy:
    """A robot that passes everything on to another one, but for what a subclass does itself.

    Attributes:
        brakes: As the other's.
    """

    def __init__(self, robot: Robot) -> None:
        """Take the robot that everything is passed on to."""
        self._robot, self.brakes = robot, robot.brakes

    def read(self, timeout: float) -> Sequence[ArmState]:
        """Return all encoder readings since the last call."""
        return self._robot.read(timeout)

    def points(self) -> Sequence[Sighting]:
        """Return all positions of the ball since the last call."""
        return self._robot.points()

    def write(self, command: Command, answers: float) -> None:
        """Give the drives what they take."""
        self._robot.write(command, answers)

    def engage_brakes(self) -> str | None:
        """Engage the brakes."""
        return self._robot.engage_brakes()

    def release(self) -> None:
        """Release the brakes."""
        self._robot.release()

    def waits(self) -> str:
        """Return who is not there yet."""
        return self._robot.waits()

    def conflict(self) -> str:
        """Return what a person has to see to."""
        return self._robot.conflict()

    def trouble(self) -> str:
        """Return why the robot does not take commands."""
        return self._robot.trouble()

    def news(self) -> Sequence[str]:
        """Return what a simulated cell says of its throws."""
        return self._robot.news()

    def close(self) -> None:
        """Give the link up."""
        self._robot.close()


Driver = Callable[[Cell, Arm], Robot]
"""Makes the robot of a cell."""

DriverCheck = Callable[[Cell, Arm], Sequence[str]]
"""Says what the robot of a cell has to be, a line each; InputError where it cannot be made."""


@final
class ReceivedCommand(NamedTuple):
    """A command as it arrives at a robot: stamp of the reading that it answers [s], joints, hand.

    ``joints`` are q, dq, ddq, tau of the active joints, shape (4, n), ``hand`` is its closing angle
    [rad]; NaN where a message does not say them, as an array says one row of joints.
    """

    answers: float
    joints: Array
    hand: float


@final
class RobotLink:
    """Passes commands on to a robot, the one to its brakes included.

    Attributes:
        robot: Its driver.
        braked: Whether the brakes were commanded to engage.
        released: Whether they may be released: they were told to be, and not to engage since.
    """

    def __init__(
        self, robot: Robot, *, unbraked: bool = False, setpoints: Setpoints | None = None
    ) -> None:
        """Take the robot.

        Args:
            robot: Its driver.
            unbraked: Whether an arm without brakes is accepted: it is only de-energised then.
            setpoints: Makes setpoints of the commands, for a robot that takes no torques.

        Raises:
            InputError: The robot has no brakes, or is no driver.
        """
        if not isinstance(robot, Robot):
            raise InputError("robot", "a driver (mitt.robot.cell.robot.Robot)", checks.shown(robot))
        check_brakes(robot.brakes, unbraked=unbraked)
        self.robot, self.braked, self.released = robot, False, False
        self._setpoints, self._answered = setpoints, -inf

    def write(self, command: Command, answers: float, q: Array, *, fastest: float = inf) -> None:
        """Pass a command on: brakes first, so that nothing that fails later keeps them off.

        Args:
            command: The command.
            answers: Stamp of the reading that it answers [s].
            q: Where the joints are estimated to be [rad], shape (n,).
            fastest: Speed beyond which no setpoint moves a joint [rad/s].
        """
        if command.brakes:
            self.brake()
        if self._setpoints is not None:
            passed = answers - self._answered
            passed = passed if 0.0 < passed < _STALE else TICK
            command = self._setpoints.lead(command, q, passed=passed, fastest=fastest)
        self._answered = answers
        self.robot.write(command, answers)

    def stay(self, q: Array, hand: float, answers: float) -> None:
        """Leave a robot that takes setpoints with one that moves nothing.

        It rests at ``q`` and is braked: a driver that fails here changes nothing.
        """
        if self._setpoints is not None:
            still = np.zeros(len(q))
            joints = np.array([q, still, still, still])
            with suppress(Exception):  # a driver's own
                self.robot.write(Command(t=answers, joints=joints, hand=hand), answers)

    def brake(self) -> str:
        """Engage the brakes, where there are any; return why nobody will, where that is known."""
        self.braked = True
        why = self.robot.engage_brakes() if self.robot.brakes else "the robot has none"
        self.released = False
        return why or ""

    def release(self) -> None:
        """Let the robot take commands again: a person has said so."""
        if self._setpoints is not None:
            self._setpoints.restart()
        self.braked, self.released = False, True
        self.robot.release()


def check_brakes(brakes: bool, *, unbraked: bool) -> None:
    """Refuse a robot without brakes, unless its arm stays where it is without its drives.

    Raises:
        InputError: It has none.
    """
    if not brakes and not unbraked:
        do = (
            "if the arm stays where it is without its drives, say unbraked=True, in a cell's"
            " file robot.options.unbraked = true"
        )
        raise InputError("robot", "brakes that a stop can engage", "none", do=do)


def driver_named(name: str) -> Driver:
    """Return a driver of mitt or of another package; what it makes raises what its client raises.

    Raises:
        UnknownNameError: No driver is called that.
        InputError: It does not load.
    """
    DRIVERS.load(name)
    return partial(DRIVERS.made, name, Robot)
