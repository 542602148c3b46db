"""Commands the hostile driver's arm a thousand times a second until ended: FILE of notes."""

import sys
import time

import numpy as np

from mitt.clock import hurried
from mitt.core.signals import Command
from mitt.io.cell import arm_of, read_cell
from mitt.robot.cell.hosted import HostedRobot

cell = read_cell("wam-sim")
arm = arm_of(cell)
options: dict[str, str | float | bool] = {"call": "", "fault": "nothing", "notes": sys.argv[1]}
robot = cell.robot.model_copy(update={"driver": "hostile", "options": options})
hosted = HostedRobot(cell.model_copy(update={"robot": robot}), arm)
with hurried():
    hosted.release()
    while True:
        hosted.read(0.02)
        joints = np.zeros((4, arm.n))
        hosted.write(Command(t=0.0, joints=joints, hand=0.0), time.time())
