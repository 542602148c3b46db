"""Three catches in a row, four times slower than life: the first throws of seed 0, scene lab."""

import sys
from pathlib import Path

import numpy as np
from drawing import IMAGES
from PIL import Image

import mitt
from mitt.catcher.generators import Direct
from mitt.report.painter import View, painted
from mitt.report.pictures import body_faces, placed
from mitt.trials.runner import TrialRunner
from mitt.trials.source import source_of
from mitt.world.build import build_scene
from mitt.world.scene import read_scene

#: Throws, from when before and until when after the catch [s], and from frame to frame [ms].
THROWS, BEFORE, AFTER, EACH_MS = 3, 0.44, 0.36, 10
SHOWN_MS = 4 * EACH_MS
VIEW = View(eye=(1.55, -3.3, 0.75), target=(1.0, 0.0, -0.02), angle=0.52, size=(640, 340))

arm, scene = mitt.load_arm("wam", limits="wam-80v"), read_scene("lab")
f = mitt.learn(arm).map
runner = TrialRunner(f.arm, Direct(f), scene, pixels=True)
source = source_of(f.arm, seed=0, count=THROWS, drag=scene.ball.drag)
model = build_scene(scene, arm.model).model
bodies = [body_faces(model, body, arm, scene) for body in range(model.nbody)]
frames = []
for throw in range(THROWS):
    log = runner.throw(source, throw, log=True).log
    assert log is not None
    trace = log.truth
    first, last = np.searchsorted(trace.t, (log.t_catch - BEFORE, log.t_catch + AFTER))
    for k in range(first, last, EACH_MS):
        trail = trace.r_o[max(k - 96, 0) : k : 8] if trace.t[k] < log.t_catch else np.zeros((0, 3))
        frames.append(painted(*placed(model, bodies, trace.qpos[k], trail), scene.floor, view=VIEW))
palette = frames[30].quantize(128, Image.Quantize.FASTOCTREE)
flat = [frame.quantize(palette=palette, dither=Image.Dither.NONE) for frame in frames]
folder = Path(sys.argv[1]) if len(sys.argv) > 1 else IMAGES
flat[0].save(folder / "catch.gif", save_all=True, append_images=flat[1:], duration=SHOWN_MS, loop=0)
