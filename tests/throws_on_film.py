"""A simulated throw on film: two videos and the rig that took them, made at test time."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from mitt.core.ball.flight import advance
from mitt.core.eyes.camera import Camera, Rig, look_at
from mitt.core.eyes.lens import Lens
from mitt.core.signals import Array, Image
from mitt.io.rig import CalibratedRig, RigCamera
from mitt.lab.world.imaging import Imager, ImageSensor
from mitt.robot.cameras.video_writer import VideoWriter

RADIUS = 0.04
DRAG = 0.04
RATE = 1000.0


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Film:
    """What both cameras took.

    Attributes:
        left: Images of the left camera.
        right: Images of the right camera.
        r_o: True position of the ball in each [m], shape (n, 3).
        dr_o: True velocity [m/s], shape (n, 3).
    """

    left: list[Image]
    right: list[Image]
    r_o: Array
    dr_o: Array


def level_rig() -> Rig:
    """Return two cameras at one height, for which swapped lines of sight still meet."""
    cameras = (
        Camera(
            width=128,
            height=128,
            f_px=220.0,
            cu=63.5,
            cv=63.5,
            T_world_cam=look_at(
                np.array((-1.8, side * 1.25, 0.35)), np.array((2.8, side * -0.35, 0.35))
            ),
        )
        for side in (1.0, -1.0)
    )
    return Rig(cameras=tuple(cameras))


def calibrated(rig: Rig | None = None) -> CalibratedRig:
    """Return the rig of the catcher as a calibration would have found it."""
    cameras = (rig or level_rig()).cameras
    return CalibratedRig(
        frame="robot",
        cameras=tuple(
            RigCamera(name=name, lens=lens_of(c), T_world_cam=c.T_world_cam, rms_px=0.02)
            for name, c in zip(("left", "right"), cameras, strict=True)
        ),
    )


def lens_of(camera: Camera) -> Lens:
    """Return the lens of a camera without distortion."""
    numbers = np.array((camera.f_px, camera.f_px, camera.cu, camera.cv, 0, 0, 0, 0, 0.0))
    return Lens(width=camera.width, height=camera.height, numbers=numbers)


def film(frames: int = 120, *, seed: int = 5, rig: Rig | None = None) -> Film:
    """Return a throw of 5.5 m/s, an empty scene in its first five frames."""
    cameras = Imager(rig or level_rig(), ImageSensor(), np.random.default_rng(seed))
    r_o, dr_o = np.array([3.6, 0.1, 0.3]), np.array([-5.5, -0.1, 1.8])
    left, right, where, how = [], [], [], []
    for n in range(frames):
        t = n / RATE
        a, b = cameras.render(t, None if n < 5 else r_o, RADIUS)
        left.append(a.pixels)
        right.append(b.pixels)
        where.append(r_o.copy())
        how.append(dr_o.copy())
        advance(r_o, dr_o, DRAG, 1.0 / RATE)
    return Film(left=left, right=right, r_o=np.array(where), dr_o=np.array(how))


def write_film(folder: Path, taken: Film) -> tuple[Path, Path]:
    """Write a film as two lossless videos and return their paths."""
    paths = folder / "left.mkv", folder / "right.mkv"
    for path, images in zip(paths, (taken.left, taken.right), strict=True):
        with VideoWriter(path, rate=RATE, lossless=True) as writer:
            for image in images:
                writer.write(image)
    return paths
