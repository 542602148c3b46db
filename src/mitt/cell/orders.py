"""Commands as controllers of ros2_control take them: which joints, which rows, in which message.

A topic that ends in ``/commands`` is that of a ``forward_command_controller``: an array, one number
for each joint of the controller, in its order. Any other is that of a
``joint_trajectory_controller``: one point, to be reached from now on. Joints of the controller
that the arm holds are told to stay where they are held. The hand has a message of its own.
"""

from math import nan
from typing import Any, final

import numpy as np

from mitt.arm.arm import Arm
from mitt.cell import ros2_messages as messages
from mitt.cell.robot import ReceivedCommand
from mitt.control.setpoints import ROWS
from mitt.errors import InputError, MittError
from mitt.files.cell import Cell
from mitt.signals import Command

#: Rows of a trajectory's point by what the drives take: what is not needed is left out, since a
#: controller refuses rows that it has no use for.
_TOLD = {"position": 1, "velocity": 2, "torque": 4}
#: What ros2_control calls them.
_INTERFACES = {"position": "position", "velocity": "velocity", "torque": "effort"}
#: Writes after which the hand's angle is sent again, though it is the same.
_AGAIN = 20


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
        raise InputError("robot.options.controller", f"each once of {', '.join(able)}",
                         ", ".join(named)[:200], do=do)  # fmt: skip
    return named


@final
class Orders:
    """Commands of a cell as messages.

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
            return messages.array(self._rows[self._row])
        return messages.trajectory(answers, self.names, self._rows[: _TOLD[self._takes]])

    def of_hand(self, command: Command, answers: float) -> bytes | None:
        """Return the message for the hand's controller; None where it knows the angle already."""
        self._since += 1
        if not self.hand or (command.hand == self._sent and self._since < _AGAIN):
            return None
        self._sent, self._since = command.hand, 0
        angle = np.array([command.hand])
        if self.plain_hand:
            return messages.array(angle)
        return messages.trajectory(answers, (self.hand,), angle[None])

    def read(self, raw: bytes, hand: float) -> ReceivedCommand | None:
        """Return a command for the joints; None where its controller would refuse it.

        ``hand`` is the angle that the hand was told [rad].
        """
        answers, told = nan, np.full((4, self._n), nan)
        try:
            if self.plain:
                values = messages.read_array(raw)
                if len(values) != len(self.names):
                    return None
                told[self._row] = values[self._place]
            else:
                answers, names, rows = messages.read_trajectory(raw)
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
            row = (messages.read_array(raw) if self.plain_hand
                   else messages.read_trajectory(raw)[2][0])  # fmt: skip
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
            lines.append(f"{topic}: most joint_trajectory_controllers refuse efforts; mitt sim"
                         " takes them; else end the topic in /commands")  # fmt: skip
        elif not self.plain:
            lines.append(f"{topic}: such a controller begins each command anew from where the arm"
                         " is; a topic that ends in /commands follows more closely")  # fmt: skip
        if self.hand:
            lines.append(f"{self._of['hand_command']}: wants a controller of the joint {self.hand}")
        return lines
