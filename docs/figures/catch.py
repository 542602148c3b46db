"""Three catches in a row, four times slower than life: the first throws of seed 0, scene lab."""

from drawing import Part, moving_picture

import mitt
from mitt.core.catcher.generators import Direct
from mitt.lab.report.painter import View
from mitt.lab.trials.runner import TrialRunner
from mitt.lab.trials.source import source_of
from mitt.lab.world.scene import read_scene

#: Throws, and from when before and until when after the catch [s].
THROWS = 3
BEFORE = 0.44
AFTER = 0.36
VIEW = View(eye=(1.55, -3.3, 0.75), target=(1.0, 0.0, -0.02), angle=0.52, size=(640, 340))

arm = mitt.load_arm("wam", limits="wam-80v")
scene = read_scene("lab")
f = mitt.learn(arm).map
runner = TrialRunner(f.arm, Direct(f), scene, pixels=True)
source = source_of(f.arm, seed=0, count=THROWS, drag=scene.ball.drag)
parts = []
for throw in range(THROWS):
    log = runner.throw(source, throw, log=True).log
    assert log is not None
    parts.append(Part(log.truth, log.t_catch - BEFORE, log.t_catch, log.t_catch + AFTER))
moving_picture("catch.gif", arm, scene, parts, VIEW)
