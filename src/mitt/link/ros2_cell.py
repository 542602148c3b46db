"""The other end of :mod:`mitt.link.ros2`: what a simulated cell publishes and takes."""

from collections.abc import Sequence
from typing import NamedTuple, final

import numpy as np

from mitt.control.setpoints import ROWS
from mitt.errors import MittError
from mitt.files.cell import Cell
from mitt.link import dds, messages
from mitt.link import dds_types as types
from mitt.link.frames import FrameWriter
from mitt.link.ros2 import RESULTS, Joints, options_of
from mitt.robot.arm import Arm
from mitt.signals import Array, Image


@final
class Told(NamedTuple):
    """A command as a robot takes it: stamp of the reading that it answers [s], joints, hand [rad].

    ``joints`` are q, dq, ddq, tau of the active joints, shape (4, n); NaN where an array does not
    say them, as it does not say which reading it answers.
    """

    answers: float
    joints: Array
    hand: float


@final
class Ros2Cell:
    """Publishes what a cell's robot and its point source say, and takes commands."""

    def __init__(self, cell: Cell, arm: Arm) -> None:
        """Join the graph."""
        of = options_of(cell)
        self._of, self._frame = of, cell.source.frame
        self._joints, self._n = Joints(cell, arm, of["others"], of["hand"]), arm.n
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
        plain = of["command"].endswith("/commands")
        self._row, self._width = ROWS[cell.robot.takes], arm.n + bool(of["hand"])
        self._read = self._array if plain else self._trajectory
        told = types.MultiArray if plain else types.JointTrajectory
        self._command = node.subscribe(of["command"], told, "command")
        self._brake = node.subscribe(of["brake"], types.Bool, "command") if of["brake"] else None

    def state(self, t: float, q: Array, dq: Array) -> None:
        """Publish a reading of the encoders."""
        self._state.send(messages.joint_state(t, self._joints.names, q, dq))

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
        raw = self._command.take()
        if not raw:
            return None
        try:
            return self._read(raw[-1])
        except MittError:
            return None

    def _trajectory(self, raw: bytes) -> Told | None:
        """Return a trajectory of one point; None where it has other joints, or no numbers."""
        t, names, rows = messages.read_trajectory(raw)
        told = np.array(self._joints.pick(names, *rows))
        hand = float(rows[0, names.index(self._of["hand"])]) if self._of["hand"] in names else 0.0
        whole = np.all(np.isfinite(told)) and np.isfinite(hand)
        return Told(t, told, hand) if whole else None

    def _array(self, raw: bytes) -> Told | None:
        """Return what the drives take, then the hand; None where it is longer, or no numbers."""
        values = messages.read_array(raw)
        if len(values) != self._width or not np.all(np.isfinite(values)):
            return None
        told = np.full((4, self._n), np.nan)
        told[self._row] = values[: self._n]
        return Told(np.nan, told, float(values[self._n]) if self._width > self._n else 0.0)

    def close(self) -> None:
        """Take the shared memory away."""
        if self._frames is not None:
            self._frames.close()

    def brake(self) -> bool | None:
        """Return whether the brakes are to be engaged, or released; None where nothing was said."""
        raw = [] if self._brake is None else self._brake.take()
        return messages.read_flag(raw[-1]) if raw else None
