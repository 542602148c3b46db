"""Forward kinematics of one arm for many poses at once, in NumPy.

The kernels of :mod:`mitt.robot.kinematics` place one pose; a search looks at a hundred thousand.

| here     | meaning                                                      | unit  | shape     |
|----------|--------------------------------------------------------------|-------|-----------|
| ``tip``  | catch point l(q)                                             | m     | (B, 3)    |
| ``palm`` | palm's normal                                                | 1     | (B, 3)    |
| ``J``    | dl/dq_k of each joint                                        | m/rad | (B, N, 3) |
| ``W``    | rotation axis of each joint, zero where it slides            | 1     | (B, N, 3) |
| ``at``   | origin of each joint                                         | m     | (B, N, 3) |
"""

from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from mitt.robot.description import ArmModel
from mitt.signals import Array

Which: TypeAlias = NDArray[np.int64] | NDArray[np.bool_]
"""Which rows of an array: their indices, or a mask."""


class Poses(NamedTuple):
    """Where an arm is in each of B poses; see the module's table."""

    tip: Array
    palm: Array
    J: Array
    W: Array
    at: Array

    def take(self, rows: Which) -> "Poses":
        """Return some of the poses, by index or by mask."""
        return Poses(*(x[rows] for x in self))


def poses_of(model: ArmModel, q: Array) -> Poses:
    """Return where an arm is in poses of all its links, held ones included [rad], shape (B, N)."""
    count = len(q)
    at, W, slides = np.zeros((3, count, len(model.links), 3))
    R = np.broadcast_to(model.mount[:3, :3], (count, 3, 3))
    p = np.broadcast_to(model.mount[:3, 3], (count, 3))
    for k, link in enumerate(model.links):
        p = p + R @ link.placement[:3, 3]
        R = R @ link.placement[:3, :3]
        axis = R @ link.axis
        if link.prismatic:
            p, slides[:, k] = p + q[:, k, None] * axis, axis
        else:
            W[:, k] = axis
            R = R @ _turns(link.axis, q[:, k])
        at[:, k] = p
    tip = p + R @ model.catch_point
    J = np.cross(W, tip[:, None] - at) + slides
    return Poses(tip=tip, palm=R @ model.tool[:3, 2], J=J, W=W, at=at)


def _turns(axis: Array, angle: Array) -> Array:
    """Return rotations about one unit axis (Rodrigues), shape (B, 3, 3)."""
    x, y, z = axis
    K = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    sin, cos = np.sin(angle)[:, None, None], np.cos(angle)[:, None, None]
    R: Array = np.eye(3) + sin * K + (1.0 - cos) * (K @ K)
    return R
