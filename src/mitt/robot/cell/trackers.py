"""What sees the ball beside a robot's driver: a tracker, as motion capture, independent of the arm.

Trackers of other packages are entry points of the group ``mitt.trackers``: a function from a
:class:`mitt.io.cell.Cell` to a :class:`Tracker`. They run in a process of their own
(:mod:`mitt.robot.cell.tracker_host`). One of the same name of the group ``mitt.tracker_checks``
says whether it can be made, for ``--check`` and before the start: from cell and arm to lines that
say what the tracker has to be; it connects to nothing.
"""

from collections.abc import Sequence
from typing import Final, NamedTuple, Protocol, final, runtime_checkable

import numpy as np

from mitt.core.arm.arm import Arm
from mitt.core.arm.description import roll_pitch_yaw
from mitt.core.signals import Array, Sighting
from mitt.io.cell import Cell, SourcePart
from mitt.robot.cell.exchange import Call, sighting_of
from mitt.robot.cell.hosted import DriverError, HostedProcess
from mitt.robot.cell.plugins import Plugins
from mitt.robot.cell.robot import Robot, RobotProxy

#: Trackers: mitt's own, and those of other packages.
TRACKERS: Final = Plugins(
    "tracker",
    "mitt.trackers",
    "mitt.tracker_checks",
    key="source.tracker",
    folder="mitt.robot.trackers",
)
#: Time in which a tracker has to connect [s].
_MADE = 60.0
#: Time after which a call of a tracker is said not to return [s].
_HANGS = 0.5


@final
class TrackedPlace(NamedTuple):
    """Where a tracker saw the ball, and when.

    Attributes:
        t: Time of day at which it was exposed [s].
        r: Place in the tracker's frame [m], shape (3,); no numbers where the ball was not seen.
    """

    t: float
    r: Array


@runtime_checkable
class Tracker(Protocol):
    """What sees the ball."""

    def places(self, timeout: float) -> Sequence[TrackedPlace]:
        """Return what was seen since the last call, oldest first.

        Args:
            timeout: Time to wait where there is nothing yet [s].
        """

    def trouble(self) -> str:
        """Return why it sees nothing, as a server that has fallen silent; nothing if it does."""

    def close(self) -> None:
        """Give the link up."""


@final
class SourceFrame:
    """Makes sightings in the arm's base frame of places in that of the ball's source."""

    def __init__(self, source: SourcePart) -> None:
        """Take where the frame is, by how much its stamps are late, and how well it measures."""
        self._R, self._origin = roll_pitch_yaw(np.array(source.rpy)), np.array(source.origin)
        self._covariance, self._latency = source.sigma**2 * np.eye(3), source.latency

    def sighting(self, t: float, r: Array) -> Sighting:
        """Return the sighting of a stamp [s] and a place [m]; not found where that is no number."""
        seen = self._R @ np.asarray(r, dtype=np.float64) + self._origin
        good = bool(np.all(np.isfinite(seen)))
        return Sighting(
            t=t - self._latency,
            found=good,
            covariance=self._covariance,
            r_o=seen if good else np.zeros(3),
        )


@final
class HostedTracker:
    """A tracker in a process of its own: whatever its client does, the loop goes on."""

    def __init__(self, cell: Cell) -> None:
        """Start the process and wait until the tracker has connected.

        Raises:
            DriverError: It cannot, or does not.
        """
        name = f"tracker {cell.source.tracker!r}"
        self._process = HostedProcess(name, "mitt.robot.cell.tracker_host", 0, cell)
        try:
            self._process.await_made(_MADE)
        except BaseException:
            self.close()
            raise

    def points(self) -> Sequence[Sighting]:
        """Return all positions of the ball since the last call, in the arm's base frame."""
        return [sighting_of(row) for row in self._process.exchange.points.take()]

    def trouble(self) -> str:
        """Return why it sees nothing: what it says itself, or that it is gone or hangs."""
        process = self._process
        process.wait(0.0)
        if process.over:
            return process.over
        try:
            said = process.status(Call.TROUBLE)
        except DriverError as error:  # what its client raised
            return str(error)
        return said or process.hangs(_HANGS)

    def close(self) -> None:
        """Let the tracker close, and end its process."""
        self._process.close()


@final
class TrackedRobot(RobotProxy):
    """A robot, and beside it a tracker that sees the ball."""

    def __init__(self, robot: Robot, tracker: HostedTracker) -> None:
        """Take both; what the robot's own driver sees is left."""
        super().__init__(robot)
        self._tracker = tracker

    def points(self) -> Sequence[Sighting]:
        """Return all positions of the ball since the last call, by the tracker."""
        return self._tracker.points()

    def waits(self) -> str:
        """Return who is not there yet: the robot, or the tracker."""
        return self._robot.waits() or self._tracker.trouble()

    def close(self) -> None:
        """Give both links up, the robot's first."""
        try:
            self._robot.close()
        finally:
            self._tracker.close()


def check_tracker(cell: Cell, arm: Arm) -> list[str]:
    """Return what a cell's tracker has to be, a line each; nothing where it has none.

    Raises:
        UnknownNameError: No tracker is called that.
        InputError: It cannot be made, whatever is there to be connected to.
    """
    name = cell.source.tracker
    return [] if name is None else TRACKERS.check(name, cell, arm)
