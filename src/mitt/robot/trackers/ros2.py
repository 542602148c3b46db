"""A topic of a ROS 2 graph as a tracker, beside whatever robot.

Options of ``[source.options]``:

| option    | what                                               |
|-----------|----------------------------------------------------|
| interface | network interface; the loopback if left out        |

Topic, message and frame are ``source.topic``, ``source.message`` and ``source.frame``.
"""

from collections.abc import Sequence
from typing import Final, final

from mitt.core.arm.arm import Arm
from mitt.io.cell import Cell, SourcePart
from mitt.robot.cell import dds
from mitt.robot.cell.plugins import given_options
from mitt.robot.cell.ros2_ball import Ros2Ball
from mitt.robot.cell.trackers import TrackedPlace

_OPTIONS: Final = {"interface": "lo"}
_KEY: Final = "source.options.interface"


def check_ros2(cell: Cell, arm: Arm) -> list[str]:  # noqa: ARG001 (the arm is not asked for)
    """Refuse a network or a topic that cannot be; joins no network: the entry point."""
    of = given_options("source.options", cell.source.options, _OPTIONS)
    dds.check_network(of["interface"], key=_KEY)
    dds.check_topic(cell.source.topic)
    return [f"somebody has to publish {cell.source.topic}"]


def ros2_tracker(cell: Cell) -> "Ros2Tracker":
    """Return the tracker of a cell: the entry point."""
    of = given_options("source.options", cell.source.options, _OPTIONS)
    return Ros2Tracker(dds.Node(of["interface"], key=_KEY), cell.source)


@final
class Ros2Tracker:
    """A topic as a tracker; see :class:`mitt.robot.cell.trackers.Tracker`."""

    def __init__(self, node: dds.Node, source: SourcePart) -> None:
        """Subscribe to the topic."""
        self._node, self._ball = node, Ros2Ball(node, source, wakes=True)

    def places(self, timeout: float) -> Sequence[TrackedPlace]:
        """Return what came since the last call."""
        return self._ball.places() or (self._node.wait(timeout) and self._ball.places()) or ()

    def trouble(self) -> str:
        """Return why nothing comes."""
        if self._ball.twice():
            return "two publishers of the ball: end one"
        return self._ball.absent()

    def close(self) -> None:
        """Leave the graph."""
        self._node.close()
