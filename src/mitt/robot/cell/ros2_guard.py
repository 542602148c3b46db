"""``mitt guard``: between a cell and a controller that keeps its last command for ever.

A ``forward_command_controller`` has no timeout: when what commands it is killed, the drives go on
as they were told last. The guard is a program of its own, with nothing in it that computes. It
takes the arrays that ``mitt run`` sends to ``robot.options.guard`` and passes them on to
``robot.options.command`` as they are. Where none has come for ``robot.watchdog`` it sends zeros,
and engages the brakes where the cell names them, until commands come again.

It takes commands only while the controller is there and nobody else commands it, so that
``mitt run`` sees at its own end whether the way is whole.
"""

from collections.abc import Callable
from typing import final

import numpy as np

from mitt.clock import monotonic, pause
from mitt.core.arm.arm import Arm
from mitt.core.errors import InputError, MittError
from mitt.io.cell import Cell
from mitt.robot.cell import dds
from mitt.robot.cell import ros2_messages as messages
from mitt.robot.cell.ros2 import check_cell, ros2_options

#: Time between two looks at who is there, and between two zeros while no command comes [s].
_LOOK = 0.2
_ZEROS = 0.005
#: Longest wait for a message [s].
_WAIT = 0.05


def check_guard(cell: Cell, arm: Arm) -> str:
    """Return the topic that is guarded; joins no network.

    Raises:
        InputError: The cell names none, or could not be joined.
    """
    if cell.robot.driver != "ros2":
        raise InputError("mitt guard", "a cell with the driver ros2", cell.robot.driver)
    check_cell(cell, arm)
    topic = str(ros2_options(cell)["guard"])
    if not topic:
        raise InputError(
            "robot.options.guard",
            "a topic that ends in /commands, for mitt run to publish and the guard to pass on",
            "none",
        )
    return topic


@final
class Guard:
    """Passes commands on, and sends zeros where they cease.

    Attributes:
        passed: Commands passed on.
        refused: Arrays that no command could be, not passed on.
        silences: How often commands ceased while the arm was commanded to move.
    """

    def __init__(self, cell: Cell, arm: Arm, tell: Callable[[str], None]) -> None:
        """Join the graph; ``tell`` is given what happens, a line each."""
        check_guard(cell, arm)
        of = ros2_options(cell)
        self._of, self._tell, self._patience = of, tell, cell.robot.watchdog
        self._joints = len(check_cell(cell, arm).names)
        self._node = node = dds.Node(of["interface"])
        self._out = node.publish(of["command"], dds.MultiArray, "command")
        self._others = node.subscribe(of["command"], dds.MultiArray, "sensor", others=True)
        self._brake = node.publish(of["brake"], dds.Bool, "command") if of["brake"] else None
        self._into: dds.Subscriber | None = None
        self._zeros = messages.array_message(np.zeros(self._joints))
        self._heard, self._moves, self._silent = 0.0, False, False
        self._look_due, self._zeros_due = 0.0, 0.0
        self._said = ""
        self.passed = self.refused = self.silences = 0

    def step(self) -> None:
        """Wait for commands until the next one is due, pass them on, or send zeros."""
        now = monotonic()
        if now >= self._look_due:
            self._look_due = now + _LOOK
            self._look()
        quiet = self._heard + self._patience - now if self._moves else _WAIT
        wait = min(max(quiet, 0.0005), _ZEROS if self._silent else _WAIT)
        if self._into is None:  # nothing is there to wait for
            pause(wait)
        else:
            self._node.wait(wait)
            for raw in self._into.take():
                self._pass(raw)
        now = monotonic()
        if self._moves and now - self._heard > self._patience:
            self._fall_silent(now)
        if self._silent and now >= self._zeros_due:
            self._zeros_due = now + _ZEROS
            self._out.send(self._zeros)

    def _pass(self, raw: bytes) -> None:
        """Pass a command on."""
        try:
            _, values = messages.read_array(raw)
        except MittError:
            values = np.zeros(0)
        if len(values) != self._joints or not np.all(np.isfinite(values)):
            self.refused += 1
            return
        if self._silent:
            self._silent = False
            self._tell(f"commands come again on {self._of['guard']}")
        self._heard, self._moves = monotonic(), bool(np.any(values != 0.0))
        self.passed += 1
        self._out.send(raw)

    def _fall_silent(self, now: float) -> None:
        """Zero the command, as none comes."""
        self._out.send(self._zeros)
        self._moves, self._silent, self._zeros_due = False, True, now + _ZEROS
        self.silences += 1
        braked = ""
        if self._brake is not None:
            self._brake.send(messages.bool_message(True))
            braked = f", and {self._of['brake']} was told to engage"
        ms = 1e3 * self._patience
        self._tell(f"no command for {ms:.0f} ms: zeros on {self._of['command']}{braked}")

    def _look(self) -> None:
        """Take commands only while a controller is there, and nobody else commands it."""
        command, said = self._of["command"], ""
        if self._out.listeners() == 0:
            said = f"nobody takes commands on {command}"
        elif self._others.speakers() > 0:
            said = f"another program commands the arm on {command}: end it"
        self._others.take()
        if said and self._into is not None:
            self._into.close()
            self._into = None
        elif not said and self._into is None:
            self._into = self._node.subscribe(
                self._of["guard"], dds.MultiArray, "command", wakes=True
            )
        if said != self._said:
            self._said = said
            self._tell(said or f"passes {self._of['guard']} on to {command}")

    def close(self) -> None:
        """Zero the command where the arm was commanded to move, and leave the graph."""
        if self._moves:
            self._out.send(self._zeros)
        self._node.close()
