"""A robot in a ROS 2 graph: joint states and the ball in, commands out, over DDS without ROS.

At the end the other side of that graph: what a simulated cell publishes and takes.

Options of ``[robot.options]``, all topics with their leading /:

| option       | what                                                                             |
|--------------|----------------------------------------------------------------------------------|
| state        | JointState with the encoders, best effort                                        |
| command      | JointTrajectory; one that ends in ``/commands`` is a Float64MultiArray instead   |
| controller   | joints of that controller in its order, with commas; see ``Orders`` |
| hand         | name of the hand's joint; "" where it is not commanded                           |
| hand_command | topic for its angle, as of ``command``, with this one joint                      |
| brake        | Bool: true engages the brakes, false releases them and acknowledges a stop       |
| diagnostics  | DiagnosticArray; ``status`` names the robot's entry, "" for none                 |
| others       | names, with commas, that joint states may hold besides the arm's                 |
| interface    | network interface; the loopback if left out                                      |
| unbraked     | true for an arm that stays where it is without its drives and has no brakes      |
"""

from collections.abc import Iterable, Iterator, Sequence
from math import inf
from socket import if_nameindex
from typing import Any, final

import numpy as np

from mitt.arm.arm import Arm
from mitt.arm.description import roll_pitch_yaw
from mitt.cell import dds
from mitt.cell import ros2_messages as messages
from mitt.cell.frames import FrameWriter
from mitt.cell.robot import ReceivedCommand
from mitt.cell.ros2_messages import Orders, joints_of
from mitt.clock import monotonic
from mitt.errors import InputError, MittError
from mitt.files.cell import Cell
from mitt.signals import ArmState, Array, Command, Image, Sighting

#: Where a simulated cell says how a throw ended; never read inside the loop.
RESULTS = "/mitt/throw_result"
_KNOWN = {"state": "/joint_states", "command": "/joint_trajectory", "controller": "", "hand": "",
          "hand_command": "/hand_controller/commands", "brake": "", "diagnostics": "/diagnostics",
          "status": "", "others": "", "interface": "lo", "unbraked": False}  # fmt: skip
#: Time between two looks at who publishes, and for which nobody else may have been found before
#: commands are published [s].
_LOOK, _ALONE = 0.2, 1.0
#: Time after which a publisher that was not found is missed [s].
_FOUND = 0.5
#: How far a held joint may be from where the arm holds it [rad].
_HELD = 0.05
#: Longest for which a participant that was killed is still believed to be there [s]: the default
#: lease of Fast DDS is 20 s, that of Cyclone DDS 10 s.
_LEASE = 25.0


def options_of(cell: Cell) -> dict[str, Any]:
    """Return the options of a cell's robot, with what is left out."""
    given = cell.robot.options
    for key, value in given.items():
        if key not in _KNOWN:
            raise InputError(f"robot.options.{key}", f"one of {', '.join(_KNOWN)}", "another")
        if type(value) is not type(_KNOWN[key]):
            raise InputError(f"robot.options.{key}", type(_KNOWN[key]).__name__, repr(value)[:60])
    return _KNOWN | given


@final
class Joints:
    """Finds the arm's joints among the names of a message.

    Attributes:
        names: Names at the robot, in the arm's order.
    """

    def __init__(self, cell: Cell, arm: Arm, others: str = "", hand: str = "") -> None:
        """Take the names that the arm's joints have at the robot, and those that may be besides."""
        self.names = tuple(cell.robot.joints or arm.names)
        self._held = {x.name: float(x.held) for x in arm.model.links if x.held is not None}
        self._others = {*self._held, *(x.strip() for x in others.split(",")), hand} - {""}
        self._seen: tuple[str, ...] = ()
        self._index = np.zeros(arm.n, dtype=np.int64)

    def pick(self, names: tuple[str, ...], *rows: Array) -> list[Array]:
        """Return rows of the arm's joints, in its order; empty rows stay empty."""
        if names != self._seen:
            self._find(names)
        return [row[self._index] if len(row) else row for row in rows]

    def _find(self, names: tuple[str, ...]) -> None:
        """Find where each joint stands."""
        given, mine = ", ".join(names)[:200], ", ".join(self.names)
        if len(set(names)) != len(names):
            raise InputError("joint names", "each once", given)
        missing = [x for x in self.names if x not in names]
        unknown = [x for x in names if x not in self.names and x not in self._others]
        if missing or unknown:
            do = ("say how the robot calls the arm's joints in robot.joints" if missing else
                  "name what else it has in robot.options.others")  # fmt: skip
            raise InputError("joint names of the robot", mine, given, do=do)
        self._index = np.array([names.index(x) for x in self.names])
        self._seen = names

    def misplaced(self, q: Array, needed: Iterable[str]) -> str:
        """Say which held joint is not where the arm holds it; nothing if all are.

        ``q`` are positions of the names that were picked last [rad]; ``needed`` are held joints
        that a command moves, so that it has to be known where they are.
        """
        for name, angle in self._held.items():
            if name in self._seen:
                found = float(q[self._seen.index(name)])
                if not abs(found - angle) <= _HELD:
                    return (f"{name} is at {found:.2f} rad, and the arm's model holds it at"
                            f" {angle:.2f}: move it there, or say so in the arm")  # fmt: skip
            elif name in needed:
                return (f"joint states do not say where {name} is, which its controller moves:"
                        " publish it, or leave it out of robot.options.controller")  # fmt: skip
        return ""


def _kind_of(plain: bool) -> type[Any]:
    """Return the type of a controller's topic."""
    kind: type[Any] = dds.MultiArray if plain else dds.JointTrajectory
    return kind


@final
class Ros2Robot:
    """A robot and a point source in a ROS 2 graph; see :class:`mitt.cell.robot.Robot`.

    Attributes:
        brakes: Whether there is a topic for the brakes.
    """

    def __init__(self, cell: Cell, arm: Arm) -> None:
        """Join the graph."""
        of, source = options_of(cell), cell.source
        self._node = node = dds.Node(of["interface"])
        self._joints = Joints(cell, arm, of["others"], of["hand"])
        self._cell, self._of = cell, of
        self.brakes = bool(of["brake"]) or bool(of["unbraked"])
        self._state = node.subscribe(of["state"], dds.JointState, "sensor", wakes=True)
        kind = dds.PointStamped if source.message == "point" else dds.PoseStamped
        self._ball = node.subscribe(source.topic, kind, "sensor")
        self._diagnostics = (node.subscribe(of["diagnostics"], dds.Diagnostics, "command")
                             if of["status"] else None)  # fmt: skip
        self._search: Iterator[tuple[int, str] | None] | None = None
        self._results = node.subscribe(RESULTS, dds.String, "command")
        self._orders = Orders(cell, arm, of)
        self._told = _kind_of(self._orders.plain)
        self._foreign = node.subscribe(of["command"], self._told, "sensor", others=True)
        self._command: dds.Publisher | None = None
        self._brake = node.publish(of["brake"], dds.Bool, "command") if of["brake"] else None
        kind = _kind_of(self._orders.plain_hand)
        self._hand = node.publish(of["hand_command"], kind, "command") if of["hand"] else None
        # A velocity of zero moves no joint, an angle does.
        self._needed = self._orders.held if cell.robot.takes == "position" else {}
        self._misplaced = ""
        self._R, self._place = roll_pitch_yaw(np.array(source.rpy)), np.array(source.origin)
        self._covariance = source.sigma**2 * np.eye(3)
        self._trouble, self._taken = "", False
        self._graph, self._due, self._begun = "", 0.0, monotonic()
        self._twice_since = inf

    def read(self, timeout: float) -> Sequence[ArmState]:
        """Return all encoder readings since the last call; InputError where they do not fit."""
        raw = self._state.take()
        if not raw and self._node.wait(timeout):
            raw = self._state.take()
        return [self._reading(x) for x in raw]

    def _reading(self, raw: bytes) -> ArmState:
        """Return one reading; velocities that are not sent count as none."""
        said = messages.read_joint_state(raw)
        q, dq = self._joints.pick(said.names, said.q, said.dq)
        self._misplaced = self._joints.misplaced(said.q, self._needed)
        return ArmState(t=said.t, q=q, dq=dq if len(dq) else np.zeros(len(q)))

    def points(self) -> Sequence[Sighting]:
        """Return all positions of the ball since the last call, in the arm's base frame."""
        source, found = self._cell.source, []
        for raw in self._ball.take():
            t, frame, r_o = messages.read_point(raw)
            if frame != source.frame:
                raise InputError(f"frame of {source.topic}", source.frame, repr(frame)[:60],
                                 do="say it in source.frame")  # fmt: skip
            seen = self._R @ r_o + self._place
            good = bool(np.all(np.isfinite(seen)))
            found.append(Sighting(t=t - source.latency, found=good, covariance=self._covariance,
                                  r_o=seen if good else np.zeros(3)))  # fmt: skip
        return found

    def write(self, command: Command, answers: float) -> None:
        """Send a command: the hand's angle where that is new, then what the drives take."""
        if self._hand is not None and (said := self._orders.of_hand(command, answers)):
            self._hand.send(said)
        self._commands().send(self._orders.of_joints(command, answers))

    def engage_brakes(self) -> None:
        """Send that the brakes are to engage."""
        if self._brake is not None:
            self._brake.send(messages.flag(True))

    def release(self) -> None:
        """Send that the brakes are to be released and a stop is acknowledged, unless not alone."""
        self._trouble = ""
        if self._brake is not None and not self._graph:
            self._brake.send(messages.flag(False))

    def waits(self) -> str:
        """Return why this is no graph of one robot, one source and one commander.

        Raises:
            InputError: There have been others for longer than any lease.
        """
        if monotonic() > self._due:
            self._due = monotonic() + _LOOK
            self._graph = self._look()
        return self._graph or self._misplaced

    def trouble(self) -> str:
        """Return why the robot does not take commands; nothing if it does.

        Of what others say 32 fields are read at a time, and what cannot be read is left.
        """
        if self._search is None:
            for raw in [] if self._diagnostics is None else self._diagnostics.take(1):
                self._search = messages.search_diagnostics(raw, self._of["status"])
        for _ in range(32):
            if self._search is None:
                break
            try:
                found = next(self._search)
            except (StopIteration, MittError):
                self._search = None
                break
            if found is not None:
                self._trouble = found[1] or "error" if found[0] >= 2 else ""  # ERROR or STALE
        return self._trouble

    def _look(self) -> str:
        """Say why this is no graph of one robot, one source and one commander: who is meant?

        One that was killed is there until its lease ends, so others are waited for at first.
        """
        topics = {self._of["state"]: self._state, self._cell.source.topic: self._ball}
        twice = [name for name, heard in topics.items() if heard.speakers() > 1]
        foreign = self._foreign.speakers() > 0 or bool(self._foreign.take())
        if not twice and not foreign:
            self._twice_since = inf
            return self._alone()
        self._twice_since = min(self._twice_since, monotonic())
        if monotonic() - self._twice_since > _LEASE:
            name = twice[0] if twice else self._of["command"]
            given = "more" if twice else "another one that commands the arm"
            raise InputError(f"publishers on {name}", "one", given, do="end the others")
        if foreign:
            return f"another program commands the arm on {self._of['command']}: end it"
        return f"two publishers on {twice[0]}: end one"

    def _alone(self) -> str:
        """Publish commands once nobody else was found to; say what is waited for until then."""
        if self._taken:
            return ""
        passed = monotonic() - self._begun
        if passed > _FOUND and not self._state.speakers():
            return self._unheard()
        if passed < _ALONE:
            return "looking for others that command the arm"
        self._taken = self._commands().listeners() > 0
        return "" if self._taken else f"nobody takes commands on {self._of['command']}"

    def _unheard(self) -> str:
        """Say where joint states were looked for, and where else they may be."""
        used, state = self._of["interface"], self._of["state"]
        others = ", ".join(name for _, name in if_nameindex() if name != used)
        return (
            f"nobody publishes {state} on the interface {used}, domain {dds.domain_id()}: start the"
            f" driver, or mitt sim; who publishes on another is heard with robot.options.interface"
            f" ({others or 'there is none'})"
        )

    def _commands(self) -> dds.Publisher:
        """Return what publishes commands: others see that this program commands the arm."""
        if self._command is None:
            self._command = self._node.publish(self._of["command"], self._told, "command")
        return self._command

    def listened(self) -> bool:
        """Say whether anybody takes the commands."""
        return self._commands().listeners() > 0

    def news(self) -> Sequence[str]:
        """Return what a simulated cell has said of its throws."""
        try:
            return [messages.read_text(raw) for raw in self._results.take()]
        except MittError:
            return []

    def close(self) -> None:
        """Give the link up; Cyclone leaves the domain with the process."""


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
        self._node = node = dds.Node(of["interface"])
        points = cell.source.message == "point"
        self._state = node.publish(of["state"], dds.JointState, "sensor")
        kind = dds.PointStamped if points else dds.PoseStamped
        self._write_point = messages.point if points else messages.pose
        self._ball = node.publish(cell.source.topic, kind, "sensor")
        self._diagnostics = node.publish(of["diagnostics"], dds.Diagnostics, "command")
        self._results = node.publish(RESULTS, dds.String, "command")
        told = _kind_of(self._orders.plain)
        self._command = node.subscribe(of["command"], told, "command")
        told, topic = _kind_of(self._orders.plain_hand), of["hand_command"]
        self._hand = node.subscribe(topic, told, "command") if of["hand"] else None
        self._closing = 0.0
        self._brake = node.subscribe(of["brake"], dds.Bool, "command") if of["brake"] else None

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

    def command(self) -> ReceivedCommand | None:
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
