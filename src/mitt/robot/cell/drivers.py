"""The robots of a cell by name: ``ros2``, ``sim`` in this process, and those of other packages.

In a simulated cell in this process time goes on by a tick with each reading, never by itself.
"""

from collections.abc import Callable, Sequence
from typing import NamedTuple, final

import numpy as np

from mitt.clock import monotonic
from mitt.core.arm.arm import Arm
from mitt.core.signals import ArmState, Array, Command, Image, Sighting
from mitt.io.cell import Cell
from mitt.robot.cell.frames import FrameSet, FrameSource, SharedFrames, memory_name
from mitt.robot.cell.hosted import HostedRobot
from mitt.robot.cell.prepare import PreparedCell, feed_of, scene_of_cell
from mitt.robot.cell.robot import DRIVERS, ReceivedCommand, Robot
from mitt.robot.cell.simulated import SimulatedCell
from mitt.robot.cell.trackers import HostedTracker, TrackedRobot, check_tracker


@final
class LocalPort:
    """Keeps what a simulated cell publishes until the robot of the same process reads it."""

    def __init__(self, sigma: float) -> None:
        """Keep nothing yet; ``sigma`` is that of the points [m]."""
        self._covariance = sigma**2 * np.eye(3)
        self.states, self.points = list[ArmState](), list[Sighting]()
        self.sets, self._number = list[FrameSet](), 0
        self.said, self.results = "", list[str]()
        self.told: ReceivedCommand | None = None
        self.braked: bool | None = None

    def state(self, t: float, q: Array, dq: Array) -> None:
        """Keep a reading."""
        self.states.append(ArmState(t=t, q=q, dq=dq))

    def ball(self, t: float, r_o: Array) -> None:
        """Keep a position."""
        self.points.append(Sighting(t=t, found=True, r_o=r_o, covariance=self._covariance))

    def frames(self, t: float, images: Sequence[Image]) -> None:
        """Keep images."""
        self._number += 1
        self.sets.append(FrameSet(t, self._number, tuple(images)))

    def open(self) -> str:
        """Nothing is ever wrong with these cameras."""
        return ""

    def take(self) -> Sequence[FrameSet]:
        """Return all images since the last call."""
        taken, self.sets = self.sets, []
        return taken

    def status(self, t: float, trouble: str) -> None:  # noqa: ARG002 (of the protocol)
        """Keep how the robot is."""
        self.said = trouble

    def result(self, said: str) -> None:
        """Keep how a throw ended."""
        self.results.append(said)

    def command(self) -> ReceivedCommand | None:
        """Return the newest command since the last call."""
        told, self.told = self.told, None
        return told

    def brake(self) -> bool | None:
        """Return what was said to the brakes since the last call."""
        said, self.braked = self.braked, None
        return said

    def close(self) -> None:
        """Nothing is to be taken away."""


@final
class LocalRobot:
    """The robot of a simulated cell in this process; see :class:`mitt.robot.cell.robot.Robot`.

    Attributes:
        brakes: It has brakes.
        simulated: The cell.
        port: What it publishes and hears; its images, where it has cameras.
    """

    brakes = True

    def __init__(self, simulated: SimulatedCell, port: LocalPort) -> None:
        """Take the cell and its port."""
        self.simulated, self.port, self._begun = simulated, port, False

    @property
    def t(self) -> float:
        """Time of the cell [s]: the steady clock of a loop here, as nothing is ever on its way."""
        return self.simulated.t

    def read(self, timeout: float) -> Sequence[ArmState]:
        """Let what was commanded act until the next reading, and return that."""
        while timeout > 0.0 and not self.port.states:
            if self._begun:
                self.simulated.act()
            self._begun = True
            self.simulated.tick()
        taken, self.port.states = self.port.states, []
        return taken

    def points(self) -> Sequence[Sighting]:
        """Return the positions since the last call."""
        taken, self.port.points = self.port.points, []
        return taken

    def write(self, command: Command, answers: float) -> None:
        """Leave a command for the next tick."""
        self.port.told = ReceivedCommand(answers, command.joints, command.hand)

    def engage_brakes(self) -> None:
        """Leave word for the brakes."""
        self.port.braked = True

    def release(self) -> None:
        """Leave word for the brakes and the watchdog."""
        self.port.braked = False

    def waits(self) -> str:
        """Return what keeps it from being commanded: nothing does."""
        return ""

    def conflict(self) -> str:
        """Return who else commands it: nobody can."""
        return ""

    def trouble(self) -> str:
        """Return why the robot takes no commands."""
        return self.port.said

    def news(self) -> Sequence[str]:
        """Return how throws ended since the last call."""
        taken, self.port.results = self.port.results, []
        return taken

    def close(self) -> None:
        """Nothing is to be given up."""


def local_robot(
    prepared: PreparedCell, *, seed: int, count: int | None, started: float = 0.0
) -> LocalRobot:
    """Return the robot of a cell that is simulated here; ``started`` is its first stamp [s]."""
    scene, port = scene_of_cell(prepared.cell, None), LocalPort(prepared.cell.source.sigma)
    feed = feed_of(prepared, scene, seed=seed, count=count)
    simulated = SimulatedCell(prepared, scene, feed, port, clock=monotonic, started=started)
    return LocalRobot(simulated, port)


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


def connect_robot(prepared: PreparedCell) -> Connection:
    """Return the robot of a cell by the name of its driver, and its cameras.

    Raises:
        UnknownNameError: No driver is called that.
        InputError: It does not load, its library is not there, or an option is not one.
        DriverError: It does not reach the robot.
    """
    cell, arm = prepared.cell, prepared.arm
    check_driver(cell, arm)
    if cell.robot.driver == "sim":
        local = local_robot(prepared, seed=0, count=cell.throws)
        return local_connection(cell, local)
    shapes = [(camera.height, camera.width) for camera in prepared.rig.cameras]
    frames = SharedFrames(cell.source.memory, shapes) if cell.source.kind == "images" else None
    return Connection(_tracked(cell, _robot_of(cell, arm)), frames, monotonic)


def _robot_of(cell: Cell, arm: Arm) -> Robot:
    """Return the robot of a driver: mitt's own of ROS 2 here, any other in its process."""
    if cell.robot.driver == "ros2":
        from mitt.robot.cell.ros2 import Ros2Robot  # noqa: PLC0415 (needs the extra ros2)

        return Ros2Robot(cell, arm)
    return HostedRobot(cell, arm)


def _tracked(cell: Cell, robot: Robot) -> Robot:
    """Return a robot with its tracker beside it, where its cell has one."""
    if cell.source.tracker is None:
        return robot
    try:
        return TrackedRobot(robot, HostedTracker(cell))
    except BaseException:
        robot.close()
        raise


def check_driver(cell: Cell, arm: Arm) -> list[str]:
    """Return what the robot's controllers have to be, a line each; joins no network.

    It judges for ``--check`` and for the start alike: :func:`connect_robot` calls it first.

    Raises:
        UnknownNameError: No driver is called that.
        InputError: The robot cannot be made, whatever is there to be connected to.
    """
    if cell.source.kind == "images":
        memory_name(cell.source.memory)
    if cell.robot.driver == "sim":
        return []
    asked = check_tracker(cell, arm)
    if cell.robot.driver == "ros2":
        from mitt.robot.cell.ros2 import check_cell  # noqa: PLC0415 (needs the extra ros2)

        return check_cell(cell, arm).wanted() + asked
    return DRIVERS.check(cell.robot.driver, cell, arm) + asked
