"""The rig that takes the images, where the catcher is calibrated wrongly."""

from dataclasses import replace

import numpy as np

from mitt.robot.description import rotation
from mitt.signals import Array
from mitt.vision.camera import Rig
from mitt.world.faults.draw import direction
from mitt.world.faults.plan import Calibration, Fault


def true_rig(assumed: Rig, plan: tuple[Fault, ...], rng: np.random.Generator) -> Rig:
    """Return the rig that takes the images, where the catcher assumes another.

    Args:
        assumed: The rig of the catcher.
        plan: All entries; without a calibration error the rig is the assumed one.
        rng: Source of the errors; not drawn from where there is none.
    """
    cameras, heads = list(assumed.cameras), list(assumed.heads)
    for fault in (fault for fault in plan if isinstance(fault, Calibration)):
        for n, camera in enumerate(cameras):
            axis, size = direction(rng), fault.magnitude * rng.standard_normal()
            if fault.part == "focal":
                cameras[n] = replace(camera, f_px=camera.f_px * (1.0 + size))
                continue
            moved = _moved(camera.T_world_cam, fault, axis, size)
            cameras[n] = replace(camera, T_world_cam=moved)
            if heads:
                base = _moved(heads[n].T_world_base, fault, axis, size)
                heads[n] = replace(heads[n], T_world_base=base)
    return Rig(cameras=tuple(cameras), heads=tuple(heads))


def _moved(T: Array, fault: Calibration, axis: Array, size: float) -> Array:
    """Return a pose, shape (4, 4), turned about an axis or shifted along its own x axis."""
    out = T.copy()
    if fault.part == "angles":
        out[:3, :3] = rotation(axis, size) @ T[:3, :3]
    else:
        out[:3, 3] += size * T[:3, 0]
    return out
