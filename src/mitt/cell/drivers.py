"""The robots by name: ``ros2``, ``sim`` in this process, and those of other packages."""

from mitt.cell.local import LocalPort, LocalRobot
from mitt.cell.prepare import PreparedCell, balls_of, endless, scene_of_cell
from mitt.cell.simulated import SimulatedCell
from mitt.link.clock import monotonic
from mitt.link.robot import Robot, driver_named


def robot_of(prepared: PreparedCell) -> Robot:
    """Return the robot of a cell by the name of its driver.

    Raises:
        UnknownNameError: No driver is called that.
        InputError: It does not load, its library is not there, or an option is not one.
    """
    cell, arm = prepared.cell, prepared.arm
    if cell.robot.driver == "ros2":
        from mitt.link.ros2 import Ros2Robot  # noqa: PLC0415 (needs the extra ros2)

        return Ros2Robot(cell, arm)
    if cell.robot.driver != "sim":
        return driver_named(cell.robot.driver)(cell, arm)
    scene, port = scene_of_cell(cell, None), LocalPort(cell.source.sigma)
    source = balls_of(prepared, scene, seed=0, count=cell.throws or endless())
    simulated = SimulatedCell(cell, arm, scene, source, port, clock=monotonic)
    return LocalRobot(simulated, port)
