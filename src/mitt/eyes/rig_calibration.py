"""Where cameras, heads and rig stand, each one least-squares problem of ``least_squares.fit``.

- ``BoardProblem``: lenses and poses of a rig's cameras, from the corners of a flat board in many
  views. Bundle adjustment: every corner that any camera saw counts, also where the others did not
  see the board. The rig's frame is the optical frame of the first camera.
- ``HeadProblem``: the axes of a pan-tilt head, from views of a board at known head angles. Product
  of exponentials (R. W. Brockett 1984): T_world_cam(pan, tilt) = E(pan axis, pan)
  E(tilt axis, tilt) T_0, with T_0 the pose of the camera at both encoders' zero, so that lens
  offsets and zero angles need no model of their own. The board does not move and is the world until
  the hand says where the robot is.
- ``HandProblem``: where the rig stands before the robot, from the centroids of a ball that the hand
  held at known places. Image points are those of the pinhole camera (``Lens.straighten``).

A step of a pose is w [rad] and v [m], as of ``camera.turned``.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from mitt.errors import InputError
from mitt.eyes.camera import (
    Camera,
    applied,
    by_pose,
    inverse,
    laid,
    rotation,
    rotation_vector,
    turned,
)
from mitt.eyes.lens import NUMBERS, Lens, distort
from mitt.signals import Array

POSE = ("turn_x", "turn_y", "turn_z", "x", "y", "z")
"""Names of the six numbers of a pose's step."""
FEWEST_PLACES, FEWEST_ANGLES = 4, 5
"""Fewest places of the ball that fix a pose, with one to spare, and angles that fix two axes."""
_STEP = 1e-6
"""Half the step of the central differences [rad, m]; the error is near 1e-9 of a pixel."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Corners:
    """Corners of the board that were seen, all views and cameras in one list.

    Attributes:
        camera: Index of the camera, shape (n,).
        view: Index of the view, shape (n,).
        on_board: Where the corner lies on the board, z = 0 [m], shape (n, 3).
        uv: Where it was seen [px], shape (n, 2).
    """

    camera: NDArray[np.int64]
    view: NDArray[np.int64]
    on_board: Array
    uv: Array


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class BoardProblem:
    """Corners, and a rig that should explain them.

    Attributes:
        corners: What was seen.
        lenses: Numbers of the lenses, shape (c, 9).
        T_cam_rig: Poses of the cameras; the first is fixed, shape (c, 4, 4).
        T_rig_board: Poses of the board, shape (k, 4, 4).
        free: Which numbers of a lens are to be found, shape (9,).
        cameras: Names of the cameras.
    """

    corners: Corners
    lenses: Array
    T_cam_rig: Array
    T_rig_board: Array
    free: NDArray[np.bool_]
    cameras: tuple[str, ...]

    @property
    def names(self) -> tuple[str, ...]:
        """Lens numbers of each camera, poses of the cameras after the first, poses of the board."""
        lens = [n for n, free in zip(NUMBERS, self.free, strict=True) if free]
        return (
            *(f"{camera}.{name}" for camera in self.cameras for name in lens),
            *(f"{camera}.{name}" for camera in self.cameras[1:] for name in POSE),
            *(f"view{k}.{name}" for k in range(len(self.T_rig_board)) for name in POSE),
        )

    def _chain(self) -> tuple[Array, Array, Array, Array]:
        """Return R_board p, R_cam p_rig, p_cam, each shape (n, 3), and R_cam, shape (n, 3, 3)."""
        c = self.corners
        board, cam = self.T_rig_board[c.view], self.T_cam_rig[c.camera]
        on_rig = np.einsum("nij,nj->ni", board[:, :3, :3], c.on_board)
        in_cam = np.einsum("nij,nj->ni", cam[:, :3, :3], on_rig + board[:, :3, 3])
        return on_rig, in_cam, in_cam + cam[:, :3, 3], cam[:, :3, :3]

    def _bent(self, xy: Array) -> tuple[Array, Array, Array]:
        """Return ``distort`` with each corner's own lens."""
        bent, by_xy, by_k = np.empty_like(xy), np.empty((len(xy), 2, 2)), np.empty((len(xy), 2, 5))
        for k, numbers in enumerate(self.lenses):
            mine = self.corners.camera == k
            bent[mine], by_xy[mine], by_k[mine] = distort(xy[mine], numbers[4:])
        return bent, by_xy, by_k

    def residuals(self) -> Array:
        """Return seen minus predicted [px], shape (2 n,)."""
        p = self._chain()[2]
        if np.any(p[:, 2] <= 0.0) or self.lenses[:, :2].min() < 1.0:
            return np.full(2 * len(p), np.inf)
        lens = self.lenses[self.corners.camera]
        uv = self._bent(p[:, :2] / p[:, 2:])[0] * lens[:, :2] + lens[:, 2:4]
        return np.asarray((self.corners.uv - uv).ravel())

    def jacobian(self) -> Array:
        """Return the derivative of the image points with respect to a step, shape (2 n, p)."""
        on_rig, in_cam, p, R_cam = self._chain()
        c, n = self.corners, len(p)
        focal = self.lenses[c.camera, :2]
        xy = p[:, :2] / p[:, 2:]
        bent, by_xy, by_k = self._bent(xy)
        by_lens = np.zeros((n, 2, 9))
        by_lens[:, 0, 0], by_lens[:, 1, 1] = bent[:, 0], bent[:, 1]
        by_lens[:, 0, 2] = by_lens[:, 1, 3] = 1.0
        by_lens[:, :, 4:] = focal[:, :, None] * by_k
        by_p = np.zeros((n, 2, 3))
        by_p[:, 0, 0] = by_p[:, 1, 1] = 1.0 / p[:, 2]
        by_p[:, :, 2] = -p[:, :2] / p[:, 2:] ** 2
        by_p = focal[:, :, None] * (by_xy @ by_p)
        cameras, views = len(self.lenses), len(self.T_rig_board)
        each = np.arange(n)
        lens = np.zeros((n, 2, cameras, int(self.free.sum())))
        lens[each, :, c.camera] = by_lens[:, :, self.free]
        camera = np.zeros((n, 2, cameras, 6))
        camera[each, :, c.camera] = by_p @ by_pose(in_cam)
        board = np.zeros((n, 2, views, 6))
        board[each, :, c.view] = by_p @ R_cam @ by_pose(on_rig)
        parts = lens, camera[:, :, 1:], board  # the first camera is fixed
        return np.concatenate([part.reshape(2 * n, -1) for part in parts], axis=1)

    def moved(self, step: Array) -> "BoardProblem":
        """Return the problem with lenses and poses moved by a step."""
        count, cameras = int(self.free.sum()), len(self.lenses)
        lenses = self.lenses.copy()
        lenses[:, self.free] += step[: cameras * count].reshape(cameras, count)
        poses = step[cameras * count :].reshape(-1, 6)
        return replace(
            self,
            lenses=lenses,
            T_cam_rig=np.array(
                [self.T_cam_rig[0]]
                + [turned(T, s) for T, s in zip(self.T_cam_rig[1:], poses, strict=False)]
            ),
            T_rig_board=np.array(
                [turned(T, s) for T, s in zip(self.T_rig_board, poses[cameras - 1 :], strict=True)]
            ),
        )


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
    T[:3, :3] = rotation(axis * angle)
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
            *POSE,
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
    new = rotation(across.T @ step[:2]) @ axis
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
    if len(angles) < FEWEST_ANGLES:
        raise InputError(
            "head axes", f"views at {FEWEST_ANGLES} pairs of angles or more", len(angles)
        )
    spread = np.rad2deg(angles.std(axis=0))
    for name, size in zip(("pan", "tilt"), spread, strict=True):
        if size < 1.0:
            raise InputError("head axes", f"views at {name} angles that differ by 5 degrees",
                             f"{size:.2f} degrees of spread")  # fmt: skip
    start = int(np.argmin(np.linalg.norm(angles, axis=1)))
    pan_axis, tilt_axis = _directions(angles, poses)
    (pan, tilt), T_0 = angles[start], poses[start].copy()
    T_0[:3, :3] = rotation(-tilt_axis * tilt) @ rotation(-pan_axis * pan) @ T_0[:3, :3]
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
            by, turn = angles[i] - angles[j], rotation_vector(poses[i][:3, :3] @ poses[j][:3, :3].T)
            weight = 1.0 / (0.1 + float(np.linalg.norm(by))) ** 2
            A.append(weight * by)
            b.append(weight * turn)
    pan, tilt = np.linalg.lstsq(np.array(A), np.array(b), rcond=None)[0]
    return pan / np.linalg.norm(pan), tilt / np.linalg.norm(tilt)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class HandProblem:
    """Centroids of a ball at known places, and the pose that should explain them.

    Attributes:
        cameras: Cameras of the rig; their poses are in the rig's frame.
        camera: Camera of each centroid, shape (n,).
        p_world: Ball centre in the world [m], shape (n, 3).
        uv: Centroid [px], shape (n, 2).
        radius: Ball radius [m].
        T_rig_world: p_rig = T_rig_world @ p_world [m], shape (4, 4).
    """

    cameras: tuple[Camera, ...]
    camera: NDArray[np.int64]
    p_world: Array
    uv: Array
    radius: float
    T_rig_world: Array

    @property
    def names(self) -> tuple[str, ...]:
        """The six of a pose."""
        return POSE

    def _optical(self) -> tuple[Array, Array, Array]:
        """Return points [m], (n, 3), rotations from the rig, (n, 3, 3), f, cu, cv [px], (n, 3)."""
        R = np.array([c.rotation.T for c in self.cameras])[self.camera]
        at = np.array([c.centre for c in self.cameras])[self.camera]
        lens = np.array([(c.f_px, c.cu, c.cv) for c in self.cameras])[self.camera]
        p = np.einsum("nij,nj->ni", R, applied(self.T_rig_world, self.p_world) - at)
        return p, R, lens

    def residuals(self) -> Array:
        """Return seen minus predicted [px], shape (2 n,); the centroid as in ``triangulation``."""
        p, _, lens = self._optical()
        if np.any(p[:, 2] <= self.radius):
            return np.full(2 * len(p), np.inf)
        xy = p[:, :2] * p[:, 2:] / (p[:, 2:] ** 2 - self.radius**2)
        return np.asarray((self.uv - lens[:, :1] * xy - lens[:, 1:]).ravel())

    def jacobian(self) -> Array:
        """Return the derivative of the centroids with respect to a step, shape (2 n, 6)."""
        p, R, lens = self._optical()
        z, gap = p[:, 2], p[:, 2] ** 2 - self.radius**2
        by_p = np.zeros((len(p), 2, 3))
        by_p[:, 0, 0] = by_p[:, 1, 1] = z / gap
        by_p[:, :, 2] = -p[:, :2] * ((z * z + self.radius**2) / gap**2)[:, None]
        by_step = by_pose(self.p_world @ self.T_rig_world[:3, :3].T)
        return np.asarray((lens[:, :1, None] * (by_p @ R @ by_step)).reshape(-1, 6))

    def moved(self, step: Array) -> "HandProblem":
        """Return the problem with the pose moved by a step."""
        return replace(self, T_rig_world=turned(self.T_rig_world, step))


def first_pose(seen: Array, p_world: Array) -> Array:
    """Return a first T_rig_world, shape (4, 4), that a few wrong points do not spoil.

    Args:
        seen: Triangulated points in the rig's frame [m], shape (k, 3).
        p_world: The same in the world [m], shape (k, 3).

    Raises:
        InputError: The points are too few, or lie on one line.
    """
    if len(seen) < FEWEST_PLACES:
        raise InputError("ball in the hand", f"{FEWEST_PLACES} places or more that two cameras saw",
                         len(seen))  # fmt: skip
    spread = np.linalg.svd(p_world - p_world.mean(axis=0), compute_uv=False)
    if spread[1] < 0.02 * np.sqrt(len(seen)):
        raise InputError("ball in the hand", "places that do not lie on one line, 0.1 m apart",
                         f"{1e3 * spread[1] / np.sqrt(len(seen)):.0f} mm across it")  # fmt: skip
    weights = np.ones(len(seen))
    for _ in range(20):
        T = laid(p_world, seen, weights)
        error = np.linalg.norm(applied(T, p_world) - seen, axis=1)
        weights = 1.0 / np.maximum(error, max(0.2 * float(np.median(error)), 1e-9))
    return T


def placed(cameras: tuple[Camera, ...], T_rig_world: Array) -> tuple[Camera, ...]:
    """Return the cameras with their poses in the world."""
    T_world_rig = inverse(T_rig_world)
    return tuple(replace(c, T_world_cam=T_world_rig @ c.T_world_cam) for c in cameras)
