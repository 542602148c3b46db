"""What a robot's driver does for the catcher: it reads the encoders and takes commands.

A driver passes ``Command.brakes`` on to the brakes: after a stop with a joint whose encoder is in
doubt nothing else holds the arm. What has no brakes is therefore refused when the link is made,
unless the caller says that the arm stays where it is without its drives.

Drivers of other packages are entry points of the group ``mitt.robots``: a function from a
:class:`mitt.files.cell.Cell` and its :class:`mitt.robot.arm.Arm` to a :class:`Robot`.
"""

from collections.abc import Callable, Sequence
from importlib.metadata import entry_points
from typing import Protocol, final, runtime_checkable

from mitt import checks
from mitt.errors import InputError, UnknownNameError
from mitt.files.cell import Cell
from mitt.robot.arm import Arm
from mitt.signals import ArmState, Command, Sighting

#: Group of the entry points.
GROUP = "mitt.robots"


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
        """Give the drives what they take and the hand its angle; nothing waits for them.

        Args:
            command: The command.
            answers: Stamp of the reading that it answers [s].
        """

    def engage_brakes(self) -> None:
        """Engage the brakes and, once they act, switch the drives off. May be called again."""

    def release(self) -> None:
        """Release the brakes and acknowledge a protective stop: a person has said so."""

    def trouble(self) -> str:
        """Return why the robot does not take commands, as a protective stop; nothing if it does."""

    def news(self) -> Sequence[str]:
        """Return what a simulated cell has said of its throws since the last call, as JSON."""

    def close(self) -> None:
        """Give the link up."""


Driver = Callable[[Cell, Arm], Robot]
"""Makes the robot of a cell."""


@final
class RobotLink:
    """Passes commands on to a robot, the one to its brakes included.

    Attributes:
        robot: Its driver.
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
        self.robot, self.braked = robot, False

    def write(self, command: Command, answers: float) -> None:
        """Pass a command on: brakes first, so that nothing that fails later keeps them off."""
        if command.brakes:
            self.brake()
        self.robot.write(command, answers)

    def brake(self) -> None:
        """Engage the brakes, where there are any."""
        self.braked = True
        if self.robot.brakes:
            self.robot.engage_brakes()

    def release(self) -> None:
        """Let the robot take commands again: a person has said so."""
        self.braked = False
        self.robot.release()


def driver_named(name: str) -> Driver:
    """Return a driver of another package.

    Raises:
        UnknownNameError: No driver is called that.
        InputError: It does not load.
    """
    added = {entry.name: entry for entry in entry_points(group=GROUP)}
    if name not in added:
        raise UnknownNameError("robot.driver", name, ("ros2", "sim", *sorted(added)))
    try:
        driver: Driver = added[name].load()
    except (ImportError, AttributeError) as error:
        raise InputError(f"driver {name!r}", f"the entry point {added[name].value} to load", error,
                         do="repair that package") from error  # fmt: skip
    return driver
