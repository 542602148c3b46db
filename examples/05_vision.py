"""Vision alone: two images to a point, and a hundred of them to a track with its uncertainty.

The images are rendered here; hand in your own as ``Frame`` objects, one a camera.
"""

import numpy as np

from mitt.core.ball.filter import THROWN_BALL, BallFilter
from mitt.core.ball.flight import advance
from mitt.core.eyes.camera import fixed_rig
from mitt.core.eyes.eyes import Eyes
from mitt.lab.world.imaging import Imager, ImageSensor

RADIUS = 0.04
DRAG = 0.04
rig = fixed_rig()
cameras = Imager(rig, ImageSensor(), np.random.default_rng(0))
eyes = Eyes(rig)
track = BallFilter(THROWN_BALL)

eyes.step(cameras.render(-0.001, None, RADIUS))  # an empty scene shows the ground
r_o = np.array([3.6, 0.1, 0.3])
dr_o = np.array([-5.5, -0.1, 1.8])
for tick in range(100):
    sighting = eyes.step(cameras.render(0.001 * tick, r_o, RADIUS))
    if tick == 0:
        error = 1e3 * np.linalg.norm(sighting.r_o - r_o)
        sigma = 1e3 * np.sqrt(np.trace(sighting.covariance))
        print(f"two images: seen {sighting.found}, {error:.1f} mm off, {sigma:.1f} mm expected")
    track.update(sighting)
    advance(r_o, dr_o, DRAG, 0.001)

now = track.state(0.1)
position = 1e3 * np.linalg.norm(now.r_o - r_o)
velocity = np.linalg.norm(now.dr_o - dr_o)
print(f"after 100 ms: position {position:.2f} mm off, velocity {velocity:.3f} m/s off")
advance(r_o, dr_o, DRAG, 0.4)
then = track.state(0.5)
ahead = 1e3 * np.linalg.norm(then.r_o - r_o)
spread = 1e3 * np.sqrt(np.trace(then.covariance[:3, :3]))
print(f"0.4 s ahead: {ahead:.1f} mm off, {spread:.1f} mm expected")
