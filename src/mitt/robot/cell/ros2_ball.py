"""The ball in a ROS 2 graph: for a robot in the same graph, and as a tracker beside any other.

Options of ``[source.options]``, as a tracker:

| option    | what                                               |
|-----------|----------------------------------------------------|
| interface | network interface; the loopback if left out        |

Topic, message and frame are ``source.topic``, ``source.message`` and ``source.frame``.
"""

from collections.abc import Sequence
from typing import Final, final

from mitt.core.arm.arm import Arm
from mitt.core.errors import InputError
from mitt.io.cell import Cell, SourcePart
from mitt.robot.cell import dds
from mitt.robot.cell import ros2_messages as messages
from mitt.robot.cell.plugins import given_options
from mitt.robot.cell.trackers import TrackedPlace

_OPTIONS: Final = {"interface": "lo"}
_KEY: Final = "source.options.interface"


@final
class Ros2Ball:
    """Hears where the ball is."""

    def __init__(self, node: dds.Node, source: SourcePart, *, wakes: bool = False) -> None:
        """Subscribe to the topic; ``wakes``: a message ends a wait of the node."""
        kind = dds.PointStamped if source.message == "point" else dds.PoseStamped
        self._source, self._heard = (
            source,
            node.subscribe(source.topic, kind, "sensor", wakes=wakes),
        )

    def places(self) -> list[TrackedPlace]:
        """Return what came since the last call; InputError where it names another frame."""
        found = []
        for raw in self._heard.take():
            t, frame, r = messages.read_point(raw)
            if frame != self._source.frame:
                raise InputError(
                    f"frame of {self._source.topic}",
                    self._source.frame,
                    repr(frame)[:60],
                    do="say it in source.frame",
                )
            found.append(TrackedPlace(t, r))
        return found

    def twice(self) -> bool:
        """Whether more than one publishes it."""
        return self._heard.speakers() > 1

    def absent(self) -> str:
        """Say that nobody publishes it; nothing if somebody does."""
        if self._heard.speakers():
            return ""
        return (
            f"nobody publishes {self._source.topic}: start what sees the ball, or name its topic"
            " in source.topic"
        )


def check_ros2_ball(cell: Cell, arm: Arm) -> list[str]:  # noqa: ARG001 (the arm is not asked for)
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
