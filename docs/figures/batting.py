"""Balls hit back to a target, four times slower than life: throws of seed 0, scene lab."""

import numpy as np
from drawing import Part, moving_picture

from mitt.lab.report.painter import View
from mitt.lab.trials.bat_station import TARGET, bat_station
from mitt.lab.trials.batting import BatRunner
from mitt.lab.trials.source import source_of
from mitt.lab.world.scene import read_scene

#: Hits, and from when before and until when after the contact [s].
HITS = 3
BEFORE = 0.36
AFTER = 0.8
VIEW = View(eye=(1.75, -5.2, 0.95), target=(1.75, 0.0, 0.45), angle=0.42, size=(640, 300))

scene = read_scene("lab")
station = bat_station("wam", scene=scene, target=np.array(TARGET), limits="wam-48v")
source = source_of(station.arm, seed=0, count=20, drag=scene.ball.drag)
runner = BatRunner(station, source, pixels=False)
parts = []
for trial in runner.run():
    if trial.t_hit_s is not None and trial.status == "returned":
        t = trial.t_hit_s
        parts.append(Part(runner.world.trace(), t - BEFORE, t + AFTER, t + AFTER))
    if len(parts) == HITS:
        break
moving_picture("batting.gif", station.arm, scene, parts, VIEW, mark=TARGET)
