"""The other end of :mod:`mitt.link.ros2`: what a simulated cell publishes and takes."""

from collections.abc import Sequence
from typing import final

import numpy as np

from mitt.files.cell import Cell
from mitt.link import dds, messages
from mitt.link import dds_types as types
from mitt.link.frames import FrameWriter
from mitt.link.orders import Orders, Told, joints_of
from mitt.link.ros2 import RESULTS, options_of
from mitt.robot.arm import Arm
from mitt.signals import Array, Image


@final
class Ros2Cell:
    """Publishes what a cell's robot and its point source say, and takes commands."""

    def __init__(self, cell: Cell, arm: Arm) -> None:
        """Join the graph."""
        of = options_of(cell)
        self._of, self._frame = of, cell.source.frame
        self._names, self._active = joints_of(cell, arm), list(arm.model.active)
        self._q = np.array([x.held or 0.0 for x in arm.model.links])
        self._dq, self._orders = np.zeros(len(self._q)), Orders(cell, arm, of)
        self._memory = cell.source.memory
        self._frames: FrameWriter | None = None
        node = dds.Node(of["interface"])
        self._node, points = node, cell.source.message == "point"
        self._state = node.publish(of["state"], types.JointState, "sensor")
        kind = types.PointStamped if points else types.PoseStamped
        self._write_point = messages.point if points else messages.pose
        self._ball = node.publish(cell.source.topic, kind, "sensor")
        self._diagnostics = node.publish(of["diagnostics"], types.Diagnostics, "command")
        self._results = node.publish(RESULTS, types.String, "command")
        told = types.MultiArray if self._orders.plain else types.JointTrajectory
        self._command = node.subscribe(of["command"], told, "command")
        told = types.MultiArray if self._orders.plain_hand else types.JointTrajectory
        topic = of["hand_command"]
        self._hand = node.subscribe(topic, told, "command") if of["hand"] else None
        self._closing = 0.0
        self._brake = node.subscribe(of["brake"], types.Bool, "command") if of["brake"] else None

    def state(self, t: float, q: Array, dq: Array) -> None:
        """Publish a reading of the encoders; held joints are where they are held."""
        self._q[self._active], self._dq[self._active] = q, dq
        self._state.send(messages.joint_state(t, self._names, self._q, self._dq))

    def frames(self, t: float, images: Sequence[Image]) -> None:
        """Write images that were exposed together into the shared memory."""
        if self._frames is None:
            self._frames = FrameWriter(self._memory, len(images), *images[0].shape)
        self._frames.write(t, images)

    def ball(self, t: float, r_o: Array) -> None:
        """Publish a position of the ball."""
        self._ball.send(self._write_point(t, self._frame, r_o))

    def status(self, t: float, trouble: str) -> None:
        """Publish how the robot is."""
        level, said = (2, trouble) if trouble else (0, "ready")
        self._diagnostics.send(messages.diagnostics(t, self._of["status"], level, said))

    def result(self, said: str) -> None:
        """Publish how a throw ended."""
        self._results.send(messages.text(said))

    def command(self) -> Told | None:
        """Return the newest command since the last call; None where none came that fits."""
        for said in [] if self._hand is None else self._hand.take()[-1:]:
            angle = self._orders.read_hand(said)
            self._closing = angle if np.isfinite(angle) else self._closing
        raw = self._command.take()
        return self._orders.read(raw[-1], self._closing) if raw else None

    def close(self) -> None:
        """Take the shared memory away."""
        if self._frames is not None:
            self._frames.close()

    def brake(self) -> bool | None:
        """Return whether the brakes are to be engaged, or released; None where nothing was said."""
        raw = [] if self._brake is None else self._brake.take()
        return messages.read_flag(raw[-1]) if raw else None
