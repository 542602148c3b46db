"""The ROS 2 messages that a cell speaks, to and from CDR bytes, and commands as such messages.

| message                             | for                                    |
|-------------------------------------|----------------------------------------|
| ``sensor_msgs/JointState``          | encoders                               |
| ``geometry_msgs/PointStamped``      | the ball                               |
| ``geometry_msgs/PoseStamped``       | the ball, from motion capture          |
| ``trajectory_msgs/JointTrajectory`` | commands, one point                    |
| ``std_msgs/Float64MultiArray``      | commands, what the drives take         |
| ``std_msgs/Bool``                   | brakes                                 |
| ``diagnostic_msgs/DiagnosticArray`` | state of the robot                     |
| ``std_msgs/String``                 | what a simulated cell says of a throw  |

A diagnostic message, in which others write what they like, is read as slowly as a live loop likes.
"""

from collections.abc import Iterator
from math import isnan, nan
from typing import Any, NamedTuple, final

import numpy as np

from mitt.core.arm.arm import Arm
from mitt.core.control.setpoints import ROWS
from mitt.core.errors import InputError, MittError
from mitt.core.signals import Array, Command
from mitt.io.cdr import Reader, Writer
from mitt.io.cell import Cell
from mitt.robot.cell.robot import ReceivedCommand

#: Rows of a trajectory's point by what the drives take: what is not needed is left out, since a
#: controller refuses rows that it has no use for.
_TOLD = {"position": 1, "velocity": 2, "torque": 4}
#: What ros2_control calls them.
_INTERFACES = {"position": "position", "velocity": "velocity", "torque": "effort"}
#: Time that a trajectory's point is given to be reached [ns]: two updates at 500 Hz.
_REACH_NS = 4_000_000


@final
class JointReading(NamedTuple):
    """A JointState: stamp [s], names, positions [rad], velocities [rad/s] (empty where none)."""

    t: float
    names: tuple[str, ...]
    q: Array
    dq: Array


def read_joint_state(raw: bytes) -> JointReading:
    """Return what a JointState says; velocities of another length than the names are left out."""
    r = Reader(raw)
    t, _ = r.header()
    names, q, dq = r.strings(), r.sequence(), r.sequence()
    if len(q) != len(names):
        raise InputError("joint states", f"{len(names)} positions, one a name", len(q))
    return JointReading(t, names, q, dq if len(dq) == len(names) else np.zeros(0))


def joint_state(t: float, names: tuple[str, ...], q: Array, dq: Array) -> bytes:
    """Return a JointState without efforts."""
    return Writer().header(t, "").strings(names).sequence(q).sequence(dq).uint32(0).done()


def read_point(raw: bytes) -> tuple[float, str, Array]:
    """Return stamp [s], frame and position [m] of a PointStamped or a PoseStamped."""
    r = Reader(raw)
    t, frame = r.header()
    return t, frame, r.doubles(3)


def point(t: float, frame: str, r_o: Array) -> bytes:
    """Return a PointStamped."""
    return Writer().header(t, frame).doubles(r_o).done()


def pose(t: float, frame: str, r_o: Array) -> bytes:
    """Return a PoseStamped without turn."""
    return point(t, frame, np.append(r_o, [0.0, 0.0, 0.0, 1.0]))


def trajectory(answers: float, names: tuple[str, ...], rows: Array) -> bytes:
    """Return a JointTrajectory of one point that begins when it is taken: its stamp is 0.

    Its frame, of which a controller makes nothing, names the reading that it answers.

    Args:
        answers: Stamp of that reading [s].
        names: Joints.
        rows: Positions, velocities, accelerations and efforts, or the first of them, shape
            (k, names); those after them are left empty.
    """
    w = Writer().header(0.0, repr(float(answers))).strings(names).uint32(1)
    for row in (*rows, *[np.zeros(0)] * (4 - len(rows))):
        w.sequence(row)
    return w.uint32(0).uint32(_REACH_NS).done()


def read_trajectory(raw: bytes) -> tuple[float, tuple[str, ...], Array]:
    """Return which reading a JointTrajectory answers, its names and its last point's rows.

    The rows have shape (4, names), NaN where one is left out; so is the stamp of the reading where
    the frame names none.
    """
    r = Reader(raw)
    _, frame = r.header()
    names, count = r.strings(), r.count()
    if count == 0:
        raise InputError("a trajectory", "at least one point", "none")
    rows = np.zeros((4, len(names)))
    for _ in range(count):
        for k in range(4):
            row = r.sequence()
            if len(row) not in (0, len(names)):
                raise InputError("a trajectory", f"{len(names)} numbers a row", len(row))
            rows[k] = row if len(row) else np.nan
        r.uint32()
        r.uint32()
    return _stamp(frame), names, rows


def array_message(x: Array, answers: float = nan) -> bytes:
    """Return a Float64MultiArray of one row.

    The label of its layout, of which a controller makes nothing, names the reading that it answers.

    Args:
        x: The numbers.
        answers: Stamp of that reading [s]; NaN for an array without a layout.
    """
    w = Writer()
    if isnan(answers):
        w.uint32(0)
    else:
        w.uint32(1).string(repr(float(answers))).uint32(len(x)).uint32(len(x))
    return w.uint32(0).sequence(x).done()


def read_array(raw: bytes) -> tuple[float, Array]:
    """Return which reading a Float64MultiArray answers, and its numbers.

    The stamp of the reading is NaN where no label names one.
    """
    r, answers = Reader(raw), nan
    for _ in range(r.count()):  # labels, sizes and strides of its layout
        answers = _stamp(r.string())
        r.uint32()
        r.uint32()
    r.uint32()
    return answers, r.sequence()


def _stamp(said: str) -> float:
    """Return the stamp of a reading that a text names [s]; NaN where it names none."""
    try:
        return float(said)
    except ValueError:
        return nan


def bool_message(x: bool) -> bytes:
    """Return a Bool."""
    return Writer().byte(int(x)).done()


def read_flag(raw: bytes) -> bool:
    """Return what a Bool says."""
    return Reader(raw).byte() != 0


def string_message(x: str) -> bytes:
    """Return a String."""
    return Writer().string(x).done()


def read_string(raw: bytes) -> str:
    """Return what a String says."""
    return Reader(raw).string()


def diagnostics(t: float, name: str, level: int, message: str) -> bytes:
    """Return a DiagnosticArray of one entry; levels are 0 fine, 1 warning, 2 error, 3 stale."""
    w = Writer().header(t, "").uint32(1).byte(level)
    return w.string(name).string(message).string("").uint32(0).done()


def search_diagnostics(raw: bytes, name: str) -> Iterator[tuple[int, str] | None]:
    """Look for an entry of a DiagnosticArray, a field at a time: others write what they like there.

    Yields:
        None as long as it was not found; then its level and message, and no more.
    """
    if name.encode() + b"\0" not in raw:
        return
    r = Reader(raw)
    r.header()
    for _ in range(r.count()):
        level, found, message = r.byte(), r.string(), r.string()
        if found == name:
            yield level, message
            return
        r.string()
        yield None
        for _ in range(r.count()):
            r.string()
            r.string()
            yield None


def joints_of(cell: Cell, arm: Arm) -> tuple[str, ...]:
    """Return the names at the robot of all joints of the arm, held ones too, in its order."""
    active = iter(cell.robot.joints or arm.names)
    return tuple(next(active) if x.held is None else x.name for x in arm.model.links)


def _controlled(cell: Cell, arm: Arm, said: str) -> tuple[str, ...]:
    """Return the joints of the controller, in its order.

    Those that are named, or else all of the arm; without those that it holds where it takes
    torques, since nobody says what holds them.
    """
    known, takes = joints_of(cell, arm), cell.robot.takes
    held = {x.name for x in arm.model.links if x.held is not None}
    able = tuple(x for x in known if takes != "torque" or x not in held)
    named = tuple(x.strip() for x in said.split(",") if x.strip()) or able
    missing = [x for x in able if x not in held and x not in named]
    if missing or set(named) - set(able) or len(set(named)) != len(named):
        do = "name the joints of the controller in its order; it moves no others"
        raise InputError(
            "robot.options.controller",
            f"each once of {', '.join(able)}",
            ", ".join(named)[:200],
            do=do,
        )
    return named


@final
class Orders:
    """Commands of a cell as messages, as controllers of ros2_control take them.

    A topic that ends in ``/commands`` is that of a ``forward_command_controller``: an array, one
    number for each joint of the controller, in its order. Any other is that of a
    ``joint_trajectory_controller``: one point, to be reached from now on. Joints of the controller
    that the arm holds are told to stay where they are held. The hand has a message of its own.

    Attributes:
        names: Joints of the controller, in its order.
        plain: Whether it takes arrays.
        plain_hand: Whether the hand's does.
        held: Angles of those that the arm holds [rad], by name.
        hand: Name of the hand's joint; nothing where the hand is not commanded.
    """

    def __init__(self, cell: Cell, arm: Arm, of: dict[str, Any]) -> None:
        """Take the cell, its arm, and the options of its driver."""
        self.names, self._takes = _controlled(cell, arm, of["controller"]), cell.robot.takes
        self.plain, self.hand = of["command"].endswith("/commands"), of["hand"]
        self.plain_hand = of["hand_command"].endswith("/commands")
        active = cell.robot.joints or arm.names
        self._place = np.array([self.names.index(x) for x in active])
        angles = dict(zip(joints_of(cell, arm), (x.held for x in arm.model.links), strict=True))
        self.held = {x: float(a) for x, a in angles.items() if a is not None and x in self.names}
        self._rows = np.zeros((4, len(self.names)))
        self._rows[0] = [self.held.get(x, 0.0) for x in self.names]
        self._row, self._n, self._of = ROWS[self._takes], arm.n, of
        self._sent, self._since = nan, 0

    def of_joints(self, command: Command, answers: float) -> bytes:
        """Return the message for the joints' controller; ``answers`` is the reading's stamp [s]."""
        self._rows[:, self._place] = command.joints
        if self.plain:
            return array_message(self._rows[self._row], answers)
        return trajectory(answers, self.names, self._rows[: _TOLD[self._takes]])

    def of_hand(self, command: Command, answers: float) -> bytes | None:
        """Return the message for the hand's controller; None where it was told in the last 20."""
        self._since += 1
        if not self.hand or (command.hand == self._sent and self._since < 20):
            return None
        self._sent, self._since = command.hand, 0
        angle = np.array([command.hand])
        if self.plain_hand:
            return array_message(angle)
        return trajectory(answers, (self.hand,), angle[None])

    def read(self, raw: bytes, hand: float) -> ReceivedCommand | None:
        """Return a command for the joints; None where its controller would refuse it.

        ``hand`` is the angle that the hand was told [rad].
        """
        answers, told = nan, np.full((4, self._n), nan)
        try:
            if self.plain:
                answers, values = read_array(raw)
                if len(values) != len(self.names):
                    return None
                told[self._row] = values[self._place]
            else:
                answers, names, rows = read_trajectory(raw)
                if sorted(names) != sorted(self.names):
                    return None
                told[:] = rows[:, [names.index(self.names[k]) for k in self._place]]
        except MittError:
            return None
        return (
            ReceivedCommand(answers, told, hand) if np.all(np.isfinite(told[self._row])) else None
        )

    def read_hand(self, raw: bytes) -> float:
        """Return the angle that the hand is told [rad]; NaN where the message says none."""
        try:
            row = read_array(raw)[1] if self.plain_hand else read_trajectory(raw)[2][0]
        except MittError:
            return nan
        return float(row[0]) if len(row) == 1 else nan

    def wanted(self) -> list[str]:
        """Return what the controllers have to be, a line each."""
        kind, topic = _INTERFACES[self._takes], self._of["command"]
        joints = f"joints [{', '.join(self.names)}]"
        if self.plain:
            said = f"forward_command_controller with {joints} in this order, interface_name {kind}"
        else:
            said = f"joint_trajectory_controller with {joints}, command_interfaces [{kind}]"
        if not self.plain and self._takes == "velocity":
            said += ", allow_nonzero_velocity_at_trajectory_end true"
        lines = [f"{topic}: wants a {said}"]
        if not self.plain and self._takes == "torque":
            lines.append(
                f"{topic}: most joint_trajectory_controllers refuse efforts; mitt sim"
                " takes them; else end the topic in /commands"
            )
        elif self.plain:
            lines.append(
                f"{topic}: such a controller keeps its last command for ever: what stops"
                " the arm after robot.watchdog has to be elsewhere"
                if not self._of["guard"]
                else f"{topic}: start mitt guard with this cell beside: it sends zeros where no"
                " command came for robot.watchdog"
            )
        else:
            lines.append(
                f"{topic}: such a controller begins each command anew from where the arm"
                " is; a topic that ends in /commands follows more closely"
            )
        if self.hand:
            lines.append(f"{self._of['hand_command']}: wants a controller of the joint {self.hand}")
        return lines
