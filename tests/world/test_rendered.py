"""Our images of the ball against those of MuJoCo's renderer, where there is GL."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from rendered_views import SIDE
from support import thorough

from mitt.core.eyes.camera import Camera, Rig, pack_cameras, sphere_centroid
from mitt.core.signals import Array
from mitt.lab.world.imaging import Imager, ImageSensor

CLOSE = 0.1
"""Distance of the centroids [px]; the project's own bound."""
VIEWS = 100
FINE = 4
"""Random views of each lens; pixels of the renderer for one of ours, a side."""
CLEAN = ImageSensor(
    brightness=200.0, background=0.0, texture=0.0, body=0.0, read_noise=0.0, electrons=1e12
)


def balls(f_px: float, seed: int) -> Array:
    """Return random balls wholly in view, 1 to 20 px of radius, shape (VIEWS, 4)."""
    rng = np.random.default_rng(seed)
    r_px = np.exp(rng.uniform(0.0, np.log(20.0), VIEWS))
    z = f_px * 0.04 / r_px
    reach = 0.5 * SIDE - 2.0 - 1.1 * r_px
    x, y = (rng.uniform(-1.0, 1.0, VIEWS) * reach * z / f_px for _ in range(2))
    return np.column_stack((x, y, z, np.full(VIEWS, 0.04)))


def rendered(views: Array, f_px: float, folder: Path) -> Array:
    """Return MuJoCo's images, shape (VIEWS, k, k); skip where no GL answers."""
    np.savez(folder / "views.npz", balls=views, f_px=f_px, fine=FINE)
    script = Path(__file__).parent.with_name("rendered_views.py")
    said = ""
    for gl in ("egl", "osmesa"):
        command = [sys.executable, str(script), "views.npz", "images.npz"]
        environment = {**os.environ, "MUJOCO_GL": gl}
        run = subprocess.run(
            command, cwd=folder, env=environment, capture_output=True, text=True, check=False
        )
        if run.returncode == 0:
            return np.asarray(np.load(folder / "images.npz")["images"], dtype=np.float64)
        said = run.stderr.strip().splitlines()[-1] if run.stderr.strip() else str(run.returncode)
    pytest.skip(f"no GL for MuJoCo's renderer, neither EGL nor OSMesa: {said}")


def centroid(image: Array, fine: int) -> tuple[float, float]:
    """Return the centroid of an image in pixels of the camera."""
    row, column = np.indices(image.shape)
    total = image.sum()
    u, v = (column * image).sum() / total, (row * image).sum() / total
    return (u + 0.5) / fine - 0.5, (v + 0.5) / fine - 0.5


@pytest.mark.parametrize("f_px", thorough([220.0], [730.0]))
def test_our_balls_are_where_mujoco_renders_them(f_px: float, tmp_path: Path) -> None:
    """The centroids of 100 random views agree, and so does the formula that triangulation uses."""
    views = balls(f_px, seed=int(f_px))
    camera = Camera(width=SIDE, height=SIDE, f_px=f_px, cu=63.5, cv=63.5, T_world_cam=np.eye(4))
    imager = Imager(Rig(cameras=(camera,)), CLEAN, np.random.default_rng(0))
    packed = pack_cameras(Rig(cameras=(camera,)))[0]
    for view, image in zip(views, rendered(views, f_px, tmp_path), strict=True):
        theirs = centroid(image, FINE)
        ours = centroid(imager.render(0.0, view[:3], view[3])[0].pixels.astype(float), 1)
        formula = sphere_centroid(packed, (view[0], view[1], view[2]), view[3])
        assert np.hypot(ours[0] - theirs[0], ours[1] - theirs[1]) < CLOSE
        assert np.hypot(formula[0] - theirs[0], formula[1] - theirs[1]) < CLOSE
