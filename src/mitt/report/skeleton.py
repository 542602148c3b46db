"""The arm as a line from shoulder to catch point, for figures and for the replay.

A link leaves its joint along the joint's own axis and turns off at a right angle where the next
joint is off that axis; the last one arrives along the palm's normal. So the WAM's elbow shows
both of its 45 mm offsets.
"""

from dataclasses import dataclass
from typing import final

import numpy as np

from mitt.robot.description import ArmModel, joint_motion
from mitt.signals import Array

#: Points nearer than this are one [m].
_SAME = 1e-4


@final
@dataclass(frozen=True, slots=True, eq=False)
class Bone:
    """The part of the line that moves with one link.

    Attributes:
        link: Index of the link.
        points: Corners in the link's frame [m], shape (k, 3), k >= 1.
    """

    link: int
    points: Array


def bones(model: ArmModel) -> tuple[Bone, ...]:
    """Return the line of an arm, link by link."""
    out = []
    for k, link in enumerate(model.links):
        if k + 1 < len(model.links):
            end = model.links[k + 1].placement[:3, 3]
            corner = link.axis * (link.axis @ end)
        else:
            end, normal = model.tool[:3, 3], model.tool[:3, 2]
            corner = end - normal * (normal @ end)
        corners = [np.zeros(3), corner, end]
        if k + 1 == len(model.links):
            corners.append(model.catch_point)
        out.append(Bone(k, _distinct(np.array(corners))))
    return tuple(out)


def frames(model: ArmModel, q: Array) -> Array:
    """Return T_world_link of every link, shape (N, 4, 4), for q of the active joints (n,)."""
    T, active = model.mount, iter(q)
    out = np.empty((len(model.links), 4, 4))
    for k, link in enumerate(model.links):
        value = float(next(active)) if link.held is None else link.held
        T = T @ link.placement @ joint_motion(link, value)
        out[k] = T
    return out


def skeleton(model: ArmModel, q: Array) -> Array:
    """Return the corners of the line in the world [m], shape (k, 3), for q (n,)."""
    T = frames(model, q)
    parts = [bone.points @ T[bone.link][:3, :3].T + T[bone.link][:3, 3] for bone in bones(model)]
    return _distinct(np.concatenate(parts))


def _distinct(points: Array) -> Array:
    """Return points without those that repeat the one before, shape (k, 3)."""
    steps = np.linalg.norm(np.diff(points, axis=0), axis=1)
    out: Array = points[np.concatenate(([True], steps > _SAME))]
    return out
