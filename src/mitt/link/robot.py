"""What a robot's driver does for the catcher: it reads the encoders and takes commands.

A driver passes ``Command.brakes`` on to the brakes: after a stop with a joint whose encoder is in
doubt nothing else holds the arm. What has no brakes is therefore refused when the link is made,
unless the caller says that the arm stays where it is without its drives.
"""

from typing import Protocol, final, runtime_checkable

from mitt import checks
from mitt.errors import InputError
from mitt.signals import ArmState, Command


@runtime_checkable
class Robot(Protocol):
    """A driver of one arm.

    Attributes:
        brakes: Whether the arm has brakes that a command can engage.
    """

    brakes: bool

    def read(self) -> ArmState:
        """Return the newest encoder readings."""

    def write(self, command: Command) -> None:
        """Give the drives torques and the hand its angle; nothing waits for them."""

    def engage_brakes(self) -> None:
        """Engage the brakes and, once they act, switch the drives off. May be called again."""


@final
class RobotLink:
    """Passes commands on to a robot, the one to its brakes included.

    Attributes:
        braked: Whether the brakes were commanded to engage.
    """

    def __init__(self, robot: Robot, *, unbraked: bool = False) -> None:
        """Take the robot.

        Args:
            robot: Its driver.
            unbraked: Whether an arm without brakes is accepted: it is only de-energised then.

        Raises:
            InputError: The robot has no brakes, or is no driver.
        """
        if not isinstance(robot, Robot):
            raise InputError("robot", "a driver (mitt.link.robot.Robot)", checks.shown(robot))
        if not robot.brakes and not unbraked:
            do = "if the arm stays where it is without its drives, say unbraked=True"
            raise InputError("robot", "brakes that a stop can engage", "none", do=do)
        self._robot, self.braked = robot, False

    def read(self) -> ArmState:
        """Return the newest encoder readings."""
        return self._robot.read()

    def write(self, command: Command) -> None:
        """Pass a command on: brakes first, so that nothing that fails later keeps them off."""
        if command.brakes and self._robot.brakes:
            self._robot.engage_brakes()
        self.braked = command.brakes
        self._robot.write(command)
