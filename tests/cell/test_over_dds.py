"""A catch over DDS tick by tick: each side waits for the other, so that no stall matters."""

import json
import os
import time
from collections.abc import Callable, Sequence
from typing import TypeVar

import pytest
from local_cell import FaultyRobot
from support import thorough

from mitt.core.errors import InputError
from mitt.core.signals import ArmState, Command
from mitt.io.cell import Cell, read_cell
from mitt.robot.cell.drivers import Connection
from mitt.robot.cell.live import Mode
from mitt.robot.cell.prepare import cell_map, feed_of, prepare, scene_of_cell
from mitt.robot.cell.robot import Robot
from mitt.robot.cell.session import loop_of
from mitt.robot.cell.simulated import SimulatedCell

try:
    from mitt.robot.cell.robot import ReceivedCommand
    from mitt.robot.cell.ros2 import Ros2Cell, Ros2Robot
except InputError:
    pytest.skip("no Cyclone DDS", allow_module_level=True)

T = TypeVar("T")


def soon(what: Callable[[], T]) -> T:
    """Return what a call returns as soon as that is something; else what it last returned."""
    end = time.monotonic() + 2.0
    while not (found := what()) and time.monotonic() < end:
        time.sleep(2e-5)
    return found


class WaitsForCommands(FaultyRobot):
    """A robot's driver that lets the cell go on by a tick, and waits for what it publishes."""

    def __init__(self, inner: Robot, cell: SimulatedCell, port: Ros2Cell) -> None:
        """Take the driver and the cell at the other end."""
        super().__init__(inner)
        self.cell, self.port, self.lost = cell, port, 0
        self._take, self._begun, self._sent = port.command, False, False
        port.command = self._commanded  # type: ignore[method-assign]

    def read(self, timeout: float) -> Sequence[ArmState]:
        """Let what was commanded act, and return the reading after it."""
        if timeout > 0.0:
            if self._begun:
                self.cell.act()
            self._begun = True
            self.cell.tick()
        return self._inner.read(2.0 if timeout > 0.0 else 0.0)

    def write(self, command: Command, answers: float) -> None:
        """Pass a command on."""
        super().write(command, answers)
        self._sent = True

    def _commanded(self) -> ReceivedCommand | None:
        """Return the command that is on its way, if one is."""
        if not self._sent:
            return self._take()
        self._sent = False
        told = soon(self._take)
        self.lost += told is None
        return told


def cell_that_takes(takes: str) -> Cell:
    """Return the shipped cell with topics of its own, and drives that take torques or else."""
    cell = read_cell("wam-sim")
    options = {
        **cell.robot.options,
        "command": f"/{takes}/commands",
        "state": f"/{takes}/states",
        "hand_command": f"/{takes}/hand",
        "brake": f"/{takes}/brake",
        "diagnostics": f"/{takes}/diagnostics",
    }
    robot = cell.robot.model_copy(update={"options": options, "takes": takes})
    source = cell.source.model_copy(update={"topic": f"/{takes}/ball"})
    return cell.model_copy(update={"robot": robot, "source": source})


@pytest.mark.slow
@pytest.mark.parametrize("takes", thorough(["torque"], ["position", "velocity"]))
def test_a_ball_is_caught_over_dds(takes: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """No limit exceeded; what came of it is told over DDS too.

    What an array of each kind carries is in ``test_ros2.py``; trajectories are taken by two
    processes in ``cli/test_run_command.py``.
    """
    monkeypatch.setenv("ROS_DOMAIN_ID", str(100 + os.getpid() % 60))
    monkeypatch.setattr("mitt.robot.cell.ros2._LOOK", 0.0)
    monkeypatch.setattr("mitt.robot.cell.ros2._ALONE", 0.3)
    prepared = prepare(cell_that_takes(takes))
    cell, arm, scene = prepared.cell, prepared.arm, scene_of_cell(prepared.cell, None)
    port, inner = Ros2Cell(cell, arm), Ros2Robot(cell, arm)
    simulated = SimulatedCell(
        prepared,
        scene,
        feed_of(prepared, scene, seed=3, count=1),
        port,
        clock=lambda: simulated.t,
        started=1.7e9,
    )
    robot = WaitsForCommands(inner, simulated, port)
    connection = Connection(robot, None, clock=lambda: simulated.t)
    loop = loop_of(prepared, cell_map(prepared), connection)
    soon(lambda: not loop.healthy())
    assert loop.healthy() == ""
    loop.begin()
    for _ in range(12_000):
        loop.cycle()
        if loop.mode is Mode.STOPPED or (simulated.done and loop.idle):
            break
    assert loop.why == ""
    assert simulated.statuses == ["caught"]
    assert simulated.violations == 0
    assert robot.lost <= 2
    assert [json.loads(x)["status"] for x in soon(inner.news)] == simulated.statuses
    inner.close()
