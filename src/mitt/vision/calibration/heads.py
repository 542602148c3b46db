"""The axes of a pan-tilt head from views of a board at known head angles.

Product of exponentials: T_world_cam(pan, tilt) = E(pan axis, pan) E(tilt axis, tilt) T_0, with T_0
the pose of the camera at both encoders' zero. So lens offsets and zero angles need no model of
their own. Each axis is a line: a direction and its point nearest to the camera. The board does not
move and is the world until ``hand`` says where the robot is.
R. W. Brockett, Robotic manipulators and the product of exponentials formula, 1984.
"""

from dataclasses import dataclass, replace

import numpy as np
import pinocchio
from numpy.typing import NDArray

from mitt.errors import InputError
from mitt.signals import Array
from mitt.vision.lens import Lens
from mitt.vision.poses import applied, inverse, turned

#: Half the step of the central differences [rad, m]; the error is near 1e-9 of a pixel.
_STEP = 1e-6
#: Fewest angles that fix two axes.
FEWEST = 5


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class HeadAxes:
    """A camera on two axes.

    Attributes:
        T_world_cam: Pose at both encoders' zero [m], shape (4, 4).
        pan_axis: Direction [1], shape (3,), in the world, of the axis that carries the other.
        pan_point: A point on it [m], shape (3,).
        tilt_axis: Direction [1], shape (3,), in the world at pan zero.
        tilt_point: A point on it [m], shape (3,).
    """

    T_world_cam: Array
    pan_axis: Array
    pan_point: Array
    tilt_axis: Array
    tilt_point: Array

    def pose(self, pan: float, tilt: float) -> Array:
        """Return T_world_cam, shape (4, 4), at head angles [rad]."""
        first = _about(self.pan_axis, self.pan_point, pan)
        return np.asarray(first @ _about(self.tilt_axis, self.tilt_point, tilt) @ self.T_world_cam)

    def seen_from(self, T: Array) -> "HeadAxes":
        """Return the head in another world: p_new = T @ p_old, shape (4, 4)."""
        R = T[:3, :3]
        return HeadAxes(
            T_world_cam=T @ self.T_world_cam,
            pan_axis=R @ self.pan_axis,
            pan_point=applied(T, self.pan_point[None])[0],
            tilt_axis=R @ self.tilt_axis,
            tilt_point=applied(T, self.tilt_point[None])[0],
        )


def _about(axis: Array, point: Array, angle: float) -> Array:
    """Return the turn by an angle [rad] about a line, shape (4, 4)."""
    T = np.eye(4)
    T[:3, :3] = pinocchio.exp3(axis * angle)
    T[:3, 3] = point - T[:3, :3] @ point
    return T


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class HeadProblem:
    """Corners of a board seen at head angles, and the head that should explain them.

    Attributes:
        lens: Lens of the camera.
        angles: Pan and tilt of each view [rad], shape (k, 2).
        view: View of each corner, shape (n,).
        on_board: Corners on the board, which is the world [m], shape (n, 3).
        uv: Where they were seen [px], shape (n, 2).
        head: The head.
    """

    lens: Lens
    angles: Array
    view: NDArray[np.int64]
    on_board: Array
    uv: Array
    head: HeadAxes

    @property
    def names(self) -> tuple[str, ...]:
        """Pose at zero, then direction and place of each axis."""
        return (
            "turn_x", "turn_y", "turn_z", "x", "y", "z",
            "pan_direction_1", "pan_direction_2", "pan_place_1", "pan_place_2",
            "tilt_direction_1", "tilt_direction_2", "tilt_place_1", "tilt_place_2",
        )  # fmt: skip

    def _predicted(self) -> Array:
        """Return the image points [px], shape (n, 2); infinite for a board behind the camera."""
        poses = np.array([inverse(self.head.pose(pan, tilt)) for pan, tilt in self.angles])
        mine = poses[self.view]
        p = np.einsum("nij,nj->ni", mine[:, :3, :3], self.on_board) + mine[:, :3, 3]
        return self.lens.project(p) if np.all(p[:, 2] > 0.0) else np.full_like(self.uv, np.inf)

    def residuals(self) -> Array:
        """Return seen minus predicted [px], shape (2 n,)."""
        return np.asarray((self.uv - self._predicted()).ravel())

    def jacobian(self) -> Array:
        """Return the derivative of the image points by central differences, shape (2 n, 14)."""
        columns = []
        for step in _STEP * np.eye(14):
            ahead, behind = self.moved(step)._predicted(), self.moved(-step)._predicted()
            columns.append((ahead - behind).ravel() / (2.0 * _STEP))
        return np.column_stack(columns)

    def moved(self, step: Array) -> "HeadProblem":
        """Return the problem with the head moved by a step."""
        h = self.head
        pan_axis, pan_point = _line(h.pan_axis, h.pan_point, step[6:10])
        tilt_axis, tilt_point = _line(h.tilt_axis, h.tilt_point, step[10:14])
        head = HeadAxes(
            T_world_cam=turned(h.T_world_cam, step[:6]),
            pan_axis=pan_axis, pan_point=pan_point, tilt_axis=tilt_axis, tilt_point=tilt_point,
        )  # fmt: skip
        return replace(self, head=head)


def _line(axis: Array, point: Array, step: Array) -> tuple[Array, Array]:
    """Return a line turned and shifted across itself by a step, shape (4,)."""
    across = np.linalg.svd(axis[None])[2][1:]
    new = pinocchio.exp3(across.T @ step[:2]) @ axis
    return new / np.linalg.norm(new), point + across.T @ step[2:]


def first_head(angles: Array, poses: Array) -> HeadAxes:
    """Return a first guess from the pose of the camera at each pair of angles.

    Relative turns between views differ by a turn about the pan axis where tilt agrees; in general
    the axes are those of the optical frame (tilt about x, pan about y), which least squares mends.

    Args:
        angles: Pan and tilt [rad], shape (k, 2).
        poses: T_world_cam at each, shape (k, 4, 4).

    Raises:
        InputError: The angles are too few, or one of them hardly changes.
    """
    if len(angles) < FEWEST:
        raise InputError("head axes", f"views at {FEWEST} pairs of angles or more", len(angles))
    spread = np.rad2deg(angles.std(axis=0))
    for name, size in zip(("pan", "tilt"), spread, strict=True):
        if size < 1.0:
            raise InputError("head axes", f"views at {name} angles that differ by 5 degrees",
                             f"{size:.2f} degrees of spread")  # fmt: skip
    start = int(np.argmin(np.linalg.norm(angles, axis=1)))
    pan_axis, tilt_axis = _directions(angles, poses)
    (pan, tilt), T_0 = angles[start], poses[start].copy()
    T_0[:3, :3] = pinocchio.exp3(-tilt_axis * tilt) @ pinocchio.exp3(-pan_axis * pan) @ T_0[:3, :3]
    at = T_0[:3, 3].copy()
    return HeadAxes(
        T_world_cam=T_0, pan_axis=pan_axis, pan_point=at, tilt_axis=tilt_axis, tilt_point=at
    )


def _directions(angles: Array, poses: Array) -> tuple[Array, Array]:
    """Return directions of both axes: turns of all pairs of views, to first order in the angles.

    A turn from view a to view b is, for small angles, pan axis times the difference of pan plus
    tilt axis times that of tilt; both follow by linear least squares, nearby views weighing more.
    """
    A, b = [], []
    for i in range(len(angles)):
        for j in range(i):
            by, turn = angles[i] - angles[j], pinocchio.log3(poses[i][:3, :3] @ poses[j][:3, :3].T)
            weight = 1.0 / (0.1 + float(np.linalg.norm(by))) ** 2
            A.append(weight * by)
            b.append(weight * turn)
    pan, tilt = np.linalg.lstsq(np.array(A), np.array(b), rcond=None)[0]
    return pan / np.linalg.norm(pan), tilt / np.linalg.norm(tilt)
