"""The robots by name: ``ros2``, ``sim`` in this process, and those of other packages."""

from mitt.cell.local import LocalPort, LocalRobot
from mitt.cell.prepare import PreparedCell, balls_of, endless, scene_of_cell
from mitt.cell.simulated import SimulatedCell
from mitt.files.cell import Cell
from mitt.link.clock import monotonic
from mitt.link.robot import Robot, driver_named
from mitt.link.sight import FrameSource, SharedFrames


def robot_of(prepared: PreparedCell) -> tuple[Robot, FrameSource | None]:
    """Return the robot of a cell by the name of its driver, and its cameras.

    Raises:
        UnknownNameError: No driver is called that.
        InputError: It does not load, its library is not there, or an option is not one.
    """
    cell, arm = prepared.cell, prepared.arm
    if cell.robot.driver == "sim":
        scene, port = scene_of_cell(cell, None), LocalPort(cell.source.sigma)
        source = balls_of(prepared, scene, seed=0, count=cell.throws or endless())
        simulated = SimulatedCell(cell, arm, scene, source, port, rig=prepared.rig, clock=monotonic)
        return LocalRobot(simulated, port), port
    shapes = [(camera.height, camera.width) for camera in prepared.rig.cameras]
    frames = SharedFrames(cell.source.memory, shapes) if cell.source.kind == "images" else None
    if cell.robot.driver == "ros2":
        from mitt.link.ros2 import Ros2Robot  # noqa: PLC0415 (needs the extra ros2)

        return Ros2Robot(cell, arm), frames
    return driver_named(cell.robot.driver)(cell, arm), frames


def check_driver(cell: Cell) -> None:
    """Refuse a cell whose driver is not there or does not know its options; joins no network.

    Raises:
        UnknownNameError: No driver is called that.
        InputError: It does not load, its library is not there, or an option is not one.
    """
    if cell.robot.driver == "ros2":
        from mitt.link.ros2 import options_of  # noqa: PLC0415 (needs the extra ros2)

        options_of(cell)
    elif cell.robot.driver != "sim":
        driver_named(cell.robot.driver)
