"""The robots by name: ``ros2``, ``sim`` in this process, and those of other packages."""

from collections.abc import Callable
from typing import NamedTuple, final

from mitt.cell.local import LocalRobot, local_robot
from mitt.cell.prepare import PreparedCell, endless
from mitt.files.cell import Cell
from mitt.link.clock import monotonic
from mitt.link.frames import FrameSource, SharedFrames
from mitt.link.robot import Robot, driver_named
from mitt.robot.arm import Arm


@final
class Connection(NamedTuple):
    """A robot, where images come from if any, and the steady clock by which readings come [s]."""

    robot: Robot
    frames: FrameSource | None
    clock: Callable[[], float]


def local_connection(cell: Cell, robot: LocalRobot) -> Connection:
    """Return the robot and the cameras of a simulated cell in this process, and its own clock."""
    frames = robot.port if cell.source.kind == "images" else None
    return Connection(robot, frames, lambda: robot.t)


def connect(prepared: PreparedCell) -> Connection:
    """Return the robot of a cell by the name of its driver, and its cameras.

    Raises:
        UnknownNameError: No driver is called that.
        InputError: It does not load, its library is not there, or an option is not one.
    """
    cell, arm = prepared.cell, prepared.arm
    if cell.robot.driver == "sim":
        local = local_robot(prepared, seed=0, count=cell.throws or endless())
        return local_connection(cell, local)
    shapes = [(camera.height, camera.width) for camera in prepared.rig.cameras]
    frames = SharedFrames(cell.source.memory, shapes) if cell.source.kind == "images" else None
    if cell.robot.driver == "ros2":
        from mitt.link.ros2 import Ros2Robot  # noqa: PLC0415 (needs the extra ros2)

        return Connection(Ros2Robot(cell, arm), frames, monotonic)
    return Connection(driver_named(cell.robot.driver)(cell, arm), frames, monotonic)


def check_driver(cell: Cell, arm: Arm) -> list[str]:
    """Return what the robot's controllers have to be, a line each; joins no network.

    Raises:
        UnknownNameError: No driver is called that.
        InputError: It does not load, its library is not there, or an option is not one.
    """
    if cell.robot.driver == "ros2":
        from mitt.link.orders import Orders  # noqa: PLC0415
        from mitt.link.ros2 import options_of  # noqa: PLC0415 (needs the extra ros2)

        return Orders(cell, arm, options_of(cell)).wanted()
    if cell.robot.driver != "sim":
        driver_named(cell.robot.driver)
    return []
