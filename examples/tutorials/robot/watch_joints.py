"""Prints what a driver reads while somebody moves the arm by hand; commands nothing.

python watch_joints.py CELL.toml [SECONDS]
"""

import sys
from contextlib import closing

import numpy as np

from mitt.clock import monotonic
from mitt.io.cell import read_cell
from mitt.robot.cell.drivers import connect_robot
from mitt.robot.cell.prepare import prepare

prepared = prepare(read_cell(sys.argv[1]))
arm = prepared.arm
with closing(connect_robot(prepared).robot) as robot:
    end = monotonic() + float(sys.argv[2] if sys.argv[2:] else 60.0)
    count, last = 0, -1.0
    while monotonic() < end:
        for reading in robot.read(0.1):
            count += 1
            if reading.t - last < 0.5:
                continue
            last, q = reading.t, np.degrees(reading.q).round(1)
            joints = ", ".join(f"{name} {x:+.1f}" for name, x in zip(arm.names, q, strict=True))
            place = arm.position(reading.q).round(3).tolist()
            print(f"{last:.3f} s, reading {count}: {joints} deg; catch point at {place} m")
