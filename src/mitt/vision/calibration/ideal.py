"""A calibrated head as two axes that meet at right angles, which servo laws are written for."""

from dataclasses import dataclass

import numpy as np
import pinocchio

from mitt.signals import Array
from mitt.vision.calibration.heads import HeadAxes


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class IdealHead:
    """The head whose axes meet at right angles that is nearest to a calibrated one.

    p_world = T_world_base Ry(pan - pan_0) Rx(tilt - tilt_0) (lens + R_tilt_cam p_cam), pan about
    the base's y, tilt about its x.

    Attributes:
        T_world_base: Base frame, origin midway between the axes [m], shape (4, 4).
        zero: Encoder readings pan_0, tilt_0 at which the camera looks along the base's z [rad],
            shape (2,).
        lens: Optical centre beyond both axes [m], shape (3,).
        roll: Turn of the image about the optical axis that is left [rad].
        gap: Distance of the two axes, which such a head has not [m].
        tilt_from_square: Angle by which they miss a right one [rad].
    """

    T_world_base: Array
    zero: Array
    lens: Array
    roll: float
    gap: float
    tilt_from_square: float


def ideal(head: HeadAxes) -> IdealHead:
    """Return the ideal head nearest to a calibrated one."""
    y, x = head.pan_axis, head.tilt_axis
    square = float(np.arcsin(np.clip(y @ x, -1.0, 1.0)))
    x = x - (y @ x) * y
    x /= np.linalg.norm(x)
    between = head.tilt_point - head.pan_point
    # Feet of the common perpendicular of both lines.
    c = float(head.pan_axis @ head.tilt_axis)
    a, b = float(between @ head.pan_axis), float(between @ head.tilt_axis)
    on_pan = head.pan_point + head.pan_axis * (a - b * c) / (1.0 - c * c)
    on_tilt = head.tilt_point + head.tilt_axis * (a * c - b) / (1.0 - c * c)
    T = np.eye(4)
    T[:3, :3] = np.column_stack((x, y, np.cross(x, y)))
    T[:3, 3] = 0.5 * (on_pan + on_tilt)
    R = T[:3, :3].T @ head.T_world_cam[:3, :3]  # = Ry(p) Rx(t) Rz(roll)
    pan, tilt = float(np.arctan2(R[0, 2], R[2, 2])), float(-np.arcsin(R[1, 2]))
    turn = pinocchio.exp3(np.array((0.0, pan, 0.0))) @ pinocchio.exp3(np.array((tilt, 0.0, 0.0)))
    rest = turn.T @ R
    return IdealHead(
        T_world_base=T,
        zero=-np.array((pan, tilt)),
        lens=turn.T @ T[:3, :3].T @ (head.T_world_cam[:3, 3] - T[:3, 3]),
        roll=float(np.arctan2(rest[1, 0], rest[0, 0])),
        gap=float(np.linalg.norm(on_pan - on_tilt)),
        tilt_from_square=square,
    )
