"""The arm as a line from shoulder to catch point, for figures and for the replay.

A link leaves its joint along the joint's own axis and turns off at a right angle where the next
joint is off that axis; the last one arrives along the palm's normal. So the WAM's elbow shows
both of its 45 mm offsets.
"""

import numpy as np

from mitt.robot.description import ArmModel, joint_motion, mounting
from mitt.signals import Array

#: Points nearer than this are one [m].
_SAME = 1e-4


def bones(model: ArmModel) -> list[Array]:
    """Return the corners of the line in the frame of each link [m], shape (k, 3) each, k >= 1."""
    out = []
    for link, after in zip(model.links, (*model.links[1:], None), strict=True):
        if after is not None:
            end = after.placement[:3, 3]
            corners = [np.zeros(3), link.axis * (link.axis @ end), end]
        else:
            plate = model.tool @ np.linalg.inv(mounting(model.hand)[1])
            end, normal = plate[:3, 3], plate[:3, 2]
            corners = [np.zeros(3), end - normal * (normal @ end), end, model.catch_point]
        out.append(_distinct(np.array(corners)))
    return out


def frames(model: ArmModel, q: Array) -> Array:
    """Return T_world_link of every link, shape (N, 4, 4), for q of the active joints (n,)."""
    T, active, out = model.mount, iter(q), []
    for link in model.links:
        value = float(next(active)) if link.held is None else link.held
        T = T @ link.placement @ joint_motion(link, value)
        out.append(T)
    return np.array(out)


def skeleton(model: ArmModel, q: Array) -> Array:
    """Return the corners of the line in the world [m], shape (k, 3), for q (n,)."""
    parts = zip(bones(model), frames(model, q), strict=True)
    return _distinct(np.concatenate([points @ T[:3, :3].T + T[:3, 3] for points, T in parts]))


def _distinct(points: Array) -> Array:
    """Return points without those that repeat the one before, shape (k, 3)."""
    steps = np.linalg.norm(np.diff(points, axis=0), axis=1)
    out: Array = points[np.concatenate(([True], steps > _SAME))]
    return out
