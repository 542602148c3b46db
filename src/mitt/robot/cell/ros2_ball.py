"""The ball in a ROS 2 graph: for a robot in the same graph, and for the tracker ``ros2``."""

from typing import final

from mitt.core.errors import InputError
from mitt.io.cell import SourcePart
from mitt.robot.cell import dds
from mitt.robot.cell import ros2_messages as messages
from mitt.robot.cell.trackers import TrackedPlace


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
