"""The driver at a simulated arm, as fast as it goes; with a word, a mistake of a first try."""

import sys
from pathlib import Path
from typing import Any

from acme_client import AcmeClient
from acme_driver import AcmeRobot

from mitt.io.cell import read_cell
from mitt.robot.cell.drivers import Connection, local_robot
from mitt.robot.cell.live import Mode
from mitt.robot.cell.prepare import cell_map, prepare
from mitt.robot.cell.session import loop_of

#: Controllers that are not as the driver believes.
MISTAKES: dict[str, dict[str, Any]] = {
    "order": {"order": (0, 1, 2)},  # joints come from the base up
    "radians": {"unit": 1.0},  # angles are in radians
    "torque": {"push": (1.0, 1.0, 1.0)},  # torques have the arm's sense, angles have not
    "sense": {"sense": (1.0, 1.0, 1.0), "push": (1.0, 1.0, 1.0)},  # all have the arm's sense
}

prepared = prepare(read_cell(Path(__file__).with_name("cell.toml")))
arm = local_robot(prepared, seed=5, count=2)  # throws two balls
mistake = MISTAKES[sys.argv[1]] if sys.argv[1:] else {}
robot = AcmeRobot(AcmeClient(arm, **mistake), prepared.cell, prepared.arm)
connection = Connection(robot, None, lambda: arm.t)  # no cameras; time goes on with its ticks
loop = loop_of(prepared, cell_map(prepared), connection)

print("before it moves:", loop.healthy() or "nothing is wrong")
loop.begin()
while loop.mode is not Mode.STOPPED and arm.t < 15.0 and not (arm.simulated.done and loop.idle):
    loop.cycle()
print("loop:", loop.mode.value, loop.why)
true, ready = (q.round(2).tolist() for q in (arm.simulated.truth.q, prepared.arm.q_ready))
print("true angles [rad]:", true, "ready:", ready)
print("balls:", ", ".join(arm.simulated.statuses) or "none thrown")
loop.finish()
