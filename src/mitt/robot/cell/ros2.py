"""A robot in a ROS 2 graph: joint states and the ball in, commands out, over DDS without ROS.

At the end the other side of that graph: what a simulated cell publishes and takes.

Options of ``[robot.options]``, all topics with their leading /:

| option       | what                                                                             |
|--------------|----------------------------------------------------------------------------------|
| state        | JointState with the encoders, best effort; of several publishers too            |
| command      | JointTrajectory; one that ends in ``/commands`` is a Float64MultiArray instead   |
| guard        | topic that ``mitt guard`` passes on to ``command``, or zeroes when none comes    |
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
from contextlib import suppress
from math import inf
from socket import if_nameindex
from typing import Any, TypeAlias, final

import numpy as np
from numpy.typing import NDArray

from mitt.clock import monotonic
from mitt.core.arm.arm import Arm
from mitt.core.errors import InputError, MittError
from mitt.core.signals import TICK, ArmState, Array, Command, Image, Sighting
from mitt.io.cell import Cell
from mitt.robot.cell import dds
from mitt.robot.cell import ros2_messages as messages
from mitt.robot.cell.frames import FrameWriter
from mitt.robot.cell.plugins import given_options
from mitt.robot.cell.robot import ReceivedCommand, check_brakes
from mitt.robot.cell.ros2_ball import Ros2Ball
from mitt.robot.cell.ros2_messages import Orders, joints_of
from mitt.robot.cell.trackers import SourceFrame

#: Where a simulated cell says how a throw ended; never read inside the loop.
RESULTS = "/mitt/throw_result"
_KNOWN = {
    "state": "/joint_states",
    "command": "/joint_trajectory",
    "guard": "",
    "controller": "",
    "hand": "",
    "hand_command": "/hand_controller/commands",
    "brake": "",
    "diagnostics": "/diagnostics",
    "status": "",
    "others": "",
    "interface": "lo",
    "unbraked": False,
}
#: Time between two looks at who publishes, and for which nobody else may have been found before
#: commands are published [s].
_LOOK = 0.2
_ALONE = 1.0
#: Time after which a publisher that was not found is missed [s].
_FOUND = 0.5
#: Time for which a publisher that was heard last counts as there [s].
_GOES_ON = 0.5
#: Kinds of messages of joints that are known at a time.
_KINDS = 16
#: What two stamps of one instant may differ by because they are times of the day [s].
_ROUNDED = 1e-6
#: Time after which the robot's entry in the diagnostics is out of date [s]: the default timeout of
#: ``diagnostic_aggregator``.
_STALE_STATUS = 5.0
#: How far a held joint may be from where the arm holds it [rad].
_HELD = 0.05
#: Longest for which a participant that was killed is still believed to be there [s]: the default
#: lease of Fast DDS is 20 s, that of Cyclone DDS 10 s.
_LEASE = 25.0


def ros2_options(cell: Cell) -> dict[str, Any]:
    """Return the options of a cell's robot, with what is left out."""
    return given_options("robot.options", cell.robot.options, _KNOWN)


_Places: TypeAlias = tuple[NDArray[np.int64], NDArray[np.int64]]
"""Where in a message joints of the arm stand, and which these are."""


def check_cell(cell: Cell, arm: Arm) -> Orders:
    """Return the commands of a cell that can be joined; joins no network.

    Raises:
        InputError: An option, a topic, the interface or the domain cannot be.
    """
    of = ros2_options(cell)
    dds.check_network(of["interface"])
    topics = [
        cell.source.topic if _sees_ball(cell) else "",
        of["state"],
        of["command"],
        of["guard"],
        of["brake"],
        of["diagnostics"] if of["status"] else "",
        of["hand_command"] if of["hand"] else "",
    ]
    for name in topics:
        if name:
            dds.check_topic(name)
    check_brakes(bool(of["brake"]), unbraked=of["unbraked"])
    orders = Orders(cell, arm, of)
    if of["guard"] and not (orders.plain and cell.robot.takes != "position"):
        raise InputError(
            "robot.options.guard",
            "a robot.options.command that ends in /commands, of torques or velocities",
            f"{of['command']}, {cell.robot.takes}",
            do="leave the guard out: what else a controller takes ends by itself",
        )
    if of["guard"] == of["command"]:
        raise InputError("robot.options.guard", "another topic than command", of["guard"])
    return orders


def _sees_ball(cell: Cell) -> bool:
    """Say whether the ball comes through the robot's graph."""
    return cell.source.kind == "points" and cell.source.tracker is None


@final
class Joints:
    """Makes readings of the arm of messages that name joints.

    Several publishers may share the arm's joints, each in messages of its own. A reading is made
    once each joint has come anew; its stamp is that of the newest part, and what is older is
    carried on by the velocity that was sent with it. A joint belongs to one publisher.

    Attributes:
        names: Names at the robot, in the arm's order.
    """

    def __init__(self, cell: Cell, arm: Arm, others: str = "", hand: str = "") -> None:
        """Take the names that the arm's joints have at the robot, and those that may be besides."""
        self.names, self._n = tuple(cell.robot.joints or arm.names), arm.n
        self._held = {x.name: float(x.held) for x in arm.model.links if x.held is not None}
        self._others = {*self._held, *(x.strip() for x in others.split(",")), hand} - {""}
        self._most = cell.robot.ticks * TICK + _ROUNDED
        self._places: dict[tuple[str, ...], _Places] = {}
        self._parts = np.zeros((3, arm.n))  # angles, speeds, stamps of the newest parts
        self._fresh, self._whole = np.zeros(arm.n, dtype=bool), -inf
        self._from, self._heard = np.zeros(arm.n, dtype=np.uint64), np.full(arm.n, -inf)
        self._found: dict[str, float] = {}
        self._apart, self._twice = 0.0, ("", -inf)

    def take(self, said: messages.JointReading, publisher: int, now: float) -> ArmState | None:
        """Take what a publisher says; return a reading where each joint has come anew.

        Velocities that are not sent count as none. What another says of a joint that its own
        publisher has just told of is left out.

        Raises:
            InputError: Names that cannot be the robot's.
        """
        at, joints = self._places_of(said.names)
        for name in self._held:
            if name in said.names:
                self._found[name] = float(said.q[said.names.index(name)])
        rival = (self._from[joints] != publisher) & (now - self._heard[joints] < _GOES_ON)
        if np.any(rival):
            self._twice = (self.names[joints[int(np.argmax(rival))]], now)
            return None
        self._from[joints], self._heard[joints] = publisher, now
        dq = said.dq[at] if len(said.dq) else np.zeros(len(at))
        self._parts[:, joints] = said.q[at], dq, np.full(len(at), said.t)
        self._fresh[joints] = len(at) > 0
        return self._reading(now) if np.all(self._fresh) else None

    def _reading(self, now: float) -> ArmState | None:
        """Return a reading of parts; None where they are not of one instant: the older are left."""
        q, dq, stamps = self._parts
        t = float(np.max(stamps))
        older = t - stamps
        self._apart = float(np.max(older))
        if self._apart > self._most:
            self._fresh = older <= self._most
            return None
        self._fresh[:], self._whole = False, now
        carried = q + older * dq if self._apart > 0.0 else q.copy()
        return ArmState(t=t, q=carried, dq=dq.copy())

    def _places_of(self, names: tuple[str, ...]) -> _Places:
        """Return where in a message joints of the arm stand, and which these are."""
        found = self._places.get(names)
        if found is None:
            if len(self._places) >= _KINDS:
                self._places.clear()
            found = self._places[names] = self._find(names)
        return found

    def _find(self, names: tuple[str, ...]) -> _Places:
        """Find the arm's joints; a message without any is another's."""
        given, mine = ", ".join(names)[:200], [k for k, x in enumerate(self.names) if x in names]
        if mine and len(set(names)) != len(names):
            raise InputError("joint names", "each once", given)
        unknown = [x for x in names if x not in self.names and x not in self._others]
        if mine and unknown:
            lacks = [x for x in self.names if x not in names]
            do = "name what else it has in robot.options.others"
            if lacks:
                do += f", or say in robot.joints how the robot calls {', '.join(lacks)}"
            wanted = ", ".join(self.names)
            raise InputError("joint names of the robot", wanted, given, do=do)
        at = [names.index(self.names[k]) for k in mine]
        return np.array(at, dtype=np.int64), np.array(mine, dtype=np.int64)

    def missing(self, now: float) -> str:
        """Say which joints no message tells of; nothing where readings come, or no messages."""
        if now - self._whole < _GOES_ON or not self._places:
            return ""
        silent = now - self._heard > _GOES_ON
        if np.all(silent) and self._whole > -inf:  # the robot is away
            return ""
        if not np.any(silent):
            return (
                f"parts of the joint states are stamped {1e3 * self._apart:.3g} ms apart:"
                " publish all joints of the arm at one rate"
            )
        lacks = [name for name, x in zip(self.names, silent, strict=True) if x]
        told = {x: None for names in self._places for x in names if x not in lacks}
        return (
            f"joint states do not tell of {', '.join(lacks)}, but of"
            f" {', '.join(told)[:200] or 'no joint'}: say how the robot calls the arm's joints"
            " in robot.joints"
        )

    def twice(self, now: float) -> str:
        """Return the joint that two publishers tell of, nothing where none does now."""
        name, t = self._twice
        return name if now - t < _GOES_ON else ""

    def misplaced(self, needed: Iterable[str]) -> str:
        """Say which held joint is not where the arm holds it; nothing if all are.

        ``needed`` are held joints that a command moves: it has to be known where they are.
        """
        for name, angle in self._held.items():
            if name in self._found:
                found = self._found[name]
                if not abs(found - angle) <= _HELD:
                    return (
                        f"{name} is at {found:.2f} rad, and the arm's model holds it at"
                        f" {angle:.2f}: move it there, or say so in the arm"
                    )
            elif name in needed and self._whole > -inf:
                return (
                    f"joint states do not say where {name} is, which its controller moves:"
                    " publish it, or leave it out of robot.options.controller"
                )
        return ""


def _kind_of(plain: bool) -> type[Any]:
    """Return the type of a controller's topic."""
    kind: type[Any] = dds.MultiArray if plain else dds.JointTrajectory
    return kind


@final
class Ros2Robot:
    """A robot and a point source in a ROS 2 graph; see :class:`mitt.robot.cell.robot.Robot`.

    Both ends of each link are looked at, before anything moves and every 0.2 s while it does: who
    takes commands, brakes and hand, who says how the robot is, who sees the ball. Whoever else
    commands joints, brakes or hand is a conflict.

    Attributes:
        brakes: Whether there is a topic for the brakes.
    """

    def __init__(self, cell: Cell, arm: Arm) -> None:
        """Join the graph."""
        of, source, orders = ros2_options(cell), cell.source, check_cell(cell, arm)
        self._node = node = dds.Node(of["interface"])
        self._joints = Joints(cell, arm, of["others"], of["hand"])
        self._cell, self._of = cell, of
        self.brakes = bool(of["brake"]) or bool(of["unbraked"])
        self._state = node.subscribe(of["state"], dds.JointState, "sensor", wakes=True)
        self._ball = Ros2Ball(node, source) if _sees_ball(cell) else None
        self._diagnostics = (
            node.subscribe(of["diagnostics"], dds.Diagnostics, "command") if of["status"] else None
        )
        self._search: Iterator[tuple[int, str] | None] | None = None
        self._results = node.subscribe(RESULTS, dds.String, "command")
        self._orders = orders
        self._told = _kind_of(self._orders.plain)
        self._topic = of["guard"] or of["command"]
        self._foreign = node.subscribe(self._topic, self._told, "sensor", others=True)
        self._command: dds.Publisher | None = None
        self._join_brakes_and_hand()
        # A velocity of zero moves no joint, an angle does.
        self._needed = self._orders.held if cell.robot.takes == "position" else {}
        self._frame = SourceFrame(source)
        self._trouble, self._braked, self._status = "", "", -inf
        self._conflict, self._absent, self._due = "", "", 0.0
        self._begun, self._meddled = monotonic(), ("", -inf)
        self._twice_since = inf

    def _join_brakes_and_hand(self) -> None:
        """Publish what brakes and hand are told, and hear what others tell them."""
        of, node = self._of, self._node
        self._brake = self._brakes_told = self._hand = self._hand_told = None
        if of["brake"]:
            self._brake = node.publish(of["brake"], dds.Bool, "command")
            self._brakes_told = node.subscribe(of["brake"], dds.Bool, "sensor", others=True)
        if of["hand"]:
            kind = _kind_of(self._orders.plain_hand)
            self._hand = node.publish(of["hand_command"], kind, "command")
            self._hand_told = node.subscribe(of["hand_command"], kind, "sensor", others=True)

    def read(self, timeout: float) -> Sequence[ArmState]:
        """Return all encoder readings since the last call; InputError where they do not fit.

        A message that holds a part of the arm ends no wait, as long as time is left.
        """
        end = monotonic() + timeout
        while True:
            now = monotonic()
            found = [
                self._joints.take(messages.read_joint_state(raw), who, now)
                for who, raw in self._state.heard()
            ]
            readings = [x for x in found if x is not None]
            if readings or not (now < end and self._node.wait(end - now)):
                return readings

    def points(self) -> Sequence[Sighting]:
        """Return all positions of the ball since the last call, in the arm's base frame."""
        seen = [] if self._ball is None else self._ball.places()
        return [self._frame.sighting(t, r) for t, r in seen]

    def write(self, command: Command, answers: float) -> None:
        """Send a command: the hand's angle where that is new, then what the drives take."""
        if self._hand is not None and (said := self._orders.of_hand(command, answers)):
            self._hand.send(said)
        self._commands().send(self._orders.of_joints(command, answers))

    def engage_brakes(self) -> str:
        """Send that the brakes are to engage; say so where nobody hears it."""
        if self._brake is None:
            return "the cell names no brakes (robot.options.unbraked)"
        self._brake.send(messages.bool_message(True))
        return "" if self._brake.listeners() else f"nobody takes {self._of['brake']}"

    def release(self) -> None:
        """Send that the brakes are to be released and a stop is acknowledged, unless not alone."""
        self._trouble = self._braked = ""
        if self._brake is not None and not self._conflict:
            self._brake.send(messages.bool_message(False))

    def waits(self) -> str:
        """Return which end of which link is not there."""
        self._look()
        return self._absent

    def conflict(self) -> str:
        """Return who else has a hand in the arm, or which held joint is not where it is held.

        Raises:
            InputError: There have been others for longer than any lease.
        """
        self._look()
        return self._conflict or self._joints.misplaced(self._needed)

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
                self._status = monotonic()
                self._trouble = found[1] or "error" if found[0] >= 2 else ""  # ERROR or STALE
        return self._trouble or self._braked

    def _look(self) -> None:
        """Look at both ends of all links, now and then."""
        now = monotonic()
        if now > self._due:
            self._due = now + _LOOK
            self._conflict = self._others(now)
            self._absent = self._missing(now)

    def _others(self, now: float) -> str:
        """Say who else commands the arm, or publishes what it goes by.

        One that was killed is there until its lease ends, so others are waited for at first. Their
        commands to brakes and hand count when they come: who may send one is not known before.
        """
        self._note_meddling(now)
        topic, joint = self._topic, self._joints.twice(now)
        foreign = self._foreign.speakers() > 0 or bool(self._foreign.take())
        state = f"{joint} on {self._of['state']}" if joint else ""
        ball = self._cell.source.topic if self._ball is not None and self._ball.twice() else ""
        twice = state or ball
        if not twice and not foreign:
            self._twice_since = inf
            said, t = self._meddled
            return said if now - t < 1.0 else ""
        self._twice_since = min(self._twice_since, now)
        if now - self._twice_since > _LEASE:
            given = "another one that commands the arm" if foreign else "more"
            raise InputError(
                f"publishers on {topic if foreign else twice}", "one", given, do="end the others"
            )
        if foreign:
            return f"another program commands the arm on {topic}: end it"
        return f"two publishers of {twice}: end one"

    def _note_meddling(self, now: float) -> None:
        """Note what others told brakes and hand; brakes that they engaged are as a stop."""
        for raw in [] if self._brakes_told is None else self._brakes_told.take():
            topic = self._of["brake"]
            with suppress(MittError):
                engaged = messages.read_flag(raw)
                self._braked = f"another program engaged the brakes on {topic}" if engaged else ""
                if not engaged:
                    self._meddled = (f"another program released the brakes on {topic}", now)
        if self._hand_told is not None and self._hand_told.take():
            self._meddled = (
                f"another program commands the hand on {self._of['hand_command']}",
                now,
            )

    def _missing(self, now: float) -> str:
        """Say which end of which link is not there; commands are published once nobody else is."""
        passed, of = now - self._begun, self._of
        if self._command is None and self._conflict:
            return ""  # whoever else is there is to go first
        if passed > _FOUND and not self._state.speakers():
            return self._unheard()
        if missing := self._joints.missing(now) if passed > _FOUND else "":
            return missing
        if passed < _ALONE:
            return "looking for others that command the arm"
        if not self._commands().listeners():
            start = f": start mitt guard, and what takes {of['command']}" if of["guard"] else ""
            return f"nobody takes commands on {self._topic}{start}"
        if self._brake is not None and not self._brake.listeners():
            return (
                f"nobody takes {of['brake']}: start what engages the brakes, or name its topic"
                " in robot.options.brake"
            )
        if self._hand is not None and not self._hand.listeners():
            return (
                f"nobody takes {of['hand_command']}: start the hand's controller, or name its"
                " topic in robot.options.hand_command, or leave out robot.options.hand"
            )
        return self._unsaid(now)

    def _unsaid(self, now: float) -> str:
        """Say who does not say how the robot is, or where the ball is."""
        of = self._of
        if self._diagnostics is not None and now - self._status > _STALE_STATUS:
            return (
                f"no entry {of['status']} on {of['diagnostics']} for {_STALE_STATUS:.0f} s: a"
                " protective stop would not be known; name the robot's entry in"
                " robot.options.status, or leave that out"
            )
        return "" if self._ball is None else self._ball.absent()

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
            self._command = self._node.publish(self._topic, self._told, "command")
        return self._command

    def listened(self) -> bool:
        """Say whether anybody takes the commands."""
        return self._commands().listeners() > 0

    def news(self) -> Sequence[str]:
        """Return what a simulated cell has said of its throws."""
        try:
            return [messages.read_string(raw) for raw in self._results.take()]
        except MittError:
            return []

    def close(self) -> None:
        """Give the link up: others see at once that nobody commands the arm any more."""
        self._node.close()


@final
class Ros2Cell:
    """Publishes what a cell's robot and its point source say, and takes commands."""

    def __init__(self, cell: Cell, arm: Arm) -> None:
        """Join the graph."""
        of = ros2_options(cell)
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
        self._results.send(messages.string_message(said))

    def command(self) -> ReceivedCommand | None:
        """Return the newest command since the last call; None where none came that fits."""
        for said in [] if self._hand is None else self._hand.take()[-1:]:
            angle = self._orders.read_hand(said)
            self._closing = angle if np.isfinite(angle) else self._closing
        raw = self._command.take()
        return self._orders.read(raw[-1], self._closing) if raw else None

    def close(self) -> None:
        """Leave the graph, and take the shared memory away."""
        self._node.close()
        if self._frames is not None:
            self._frames.close()

    def brake(self) -> bool | None:
        """Return whether the brakes are to be engaged, or released; None where nothing was said."""
        raw = [] if self._brake is None else self._brake.take()
        return messages.read_flag(raw[-1]) if raw else None
