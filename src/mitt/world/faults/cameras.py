"""Cameras that stand or look otherwise than the catcher believes."""

from dataclasses import replace

import numpy as np

from mitt.robot.description import rotation
from mitt.vision.camera import Camera, Rig
from mitt.world.faults.draw import direction
from mitt.world.faults.plan import Calibration, Fault


def true_rig(believed: Rig, plan: tuple[Fault, ...], rng: np.random.Generator) -> Rig:
    """Return the rig that takes the images, where the catcher believes another.

    Args:
        believed: The rig of the catcher.
        plan: All entries; without a calibration error the rig is the believed one.
        rng: Source of the errors; not drawn from where there is none.
    """
    cameras = believed.cameras
    for fault in plan:
        if isinstance(fault, Calibration):
            cameras = tuple(_wrong(camera, fault, rng) for camera in cameras)
    return replace(believed, cameras=cameras)


def _wrong(camera: Camera, fault: Calibration, rng: np.random.Generator) -> Camera:
    """Return a camera with an error drawn for it."""
    axis, size = direction(rng), fault.magnitude * rng.standard_normal()
    if fault.part == "focal":
        return replace(camera, f_px=camera.f_px * (1.0 + size))
    T = camera.T_world_cam.copy()
    if fault.part == "angles":
        T[:3, :3] = rotation(axis, size) @ T[:3, :3]
    else:
        T[:3, 3] += size * T[:3, 0]
    return replace(camera, T_world_cam=T)
