"""Five moments of a catch, side by side: the first throw of seed 0 in the scene lab."""

import sys
from pathlib import Path

import numpy as np
from drawing import IMAGES
from matplotlib.image import imsave

import mitt
from mitt.catcher.generators import Direct
from mitt.report.pictures import body_faces, painted, placed
from mitt.trials.runner import TrialRunner
from mitt.trials.source import source_of
from mitt.world.build import build_scene
from mitt.world.scene import read_scene

#: Instants relative to the catch [s], and pixels between two pictures.
MOMENTS, GAP = (-0.35, -0.12, -0.06, 0.0, 0.15), 4

arm, scene = mitt.load_arm("wam", limits="paper"), read_scene("lab")
f = mitt.learn(arm).map
runner = TrialRunner(arm, Direct(f), scene, pixels=True)
log = runner.throw(source_of(f.arm, seed=0, count=1, drag=scene.ball.drag), 0, log=True).log
assert log is not None

model = build_scene(scene, arm.model).model
bodies = [body_faces(model, body, arm, scene) for body in range(model.nbody)]
row = []
for moment in MOMENTS:
    k = int(np.argmin(np.abs(log.truth.t - log.t_catch - moment)))
    faces = placed(model, bodies, log.truth.qpos[k], np.zeros((0, 3)))
    canvas = painted(*faces, scene.floor)
    canvas.draw()
    picture = np.asarray(canvas.buffer_rgba())[:, :, :3]
    row += [picture, np.full((len(picture), GAP, 3), 255, np.uint8)]
folder = Path(sys.argv[1]) if len(sys.argv) > 1 else IMAGES
imsave(folder / "catch.png", np.ascontiguousarray(np.concatenate(row[:-1], axis=1)))
