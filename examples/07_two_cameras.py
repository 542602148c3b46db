"""Calibration: a rig of two cameras finds its place before the robot from a ball in the hand.

The arm holds a ball at twenty known places; each camera gives the ball's centroid in its image.
"""

from dataclasses import replace

import numpy as np

from mitt import load_arm
from mitt.core.eyes.camera import Rig, fixed_rig, look_at, turned
from mitt.core.eyes.segmentation import Segmenter
from mitt.lab.world.imaging import Imager, ImageSensor
from mitt.robot.cameras.hand_calibration import HandProblem, placed
from mitt.robot.cameras.least_squares import fit

RADIUS = 0.04
rng = np.random.default_rng(0)
arm = load_arm("wam")
poses = [look_at(np.array((-1.8, y, 0.35)), np.array((2.8, 0.0, 0.35))) for y in (1.25, -1.25)]
pairs = zip(fixed_rig().cameras, poses, strict=True)
rig = Rig(cameras=tuple(replace(camera, T_world_cam=T) for camera, T in pairs))
imager = Imager(rig, ImageSensor(), rng)
hand = np.array([arm.position(arm.q_ready + rng.uniform(-0.25, 0.25, 3)) for _ in range(20)])
seen = [Segmenter().step(f) for p in hand for f in imager.render(0.0, p, RADIUS)]

guess = turned(np.eye(4), np.array([0.05, -0.04, 0.06, 0.1, -0.1, 0.05]))
problem = HandProblem(
    cameras=rig.cameras,  # here the rig's frame is the robot's, so the answer is the identity
    camera=np.array([m.camera for m in seen]),
    p_world=np.repeat(hand, 2, axis=0),
    uv=np.array([(m.u, m.v) for m in seen]),
    radius=RADIUS,
    T_rig_world=guess,
)
solved = fit(problem, robust=True)
cameras = placed(rig.cameras, solved.problem.T_rig_world)
off = max(np.linalg.norm(a.centre - b.centre) for a, b in zip(cameras, rig.cameras, strict=True))
print(f"{solved.status}: centroids fit to {solved.rms:.3f} px")
turn = 1e3 * max(solved.sigma_of(f"turn_{axis}") for axis in "xyz")
print(f"cameras {1e3 * off:.1f} mm off, 2.5 m behind the hand; turned by {turn:.1f} mrad, 1 sigma")
