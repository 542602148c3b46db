"""The axes of a pan-tilt head, from views of a board that stands still at known head angles.

Product of exponentials (R. W. Brockett 1984): T_world_cam(pan, tilt) = E(pan axis, pan)
E(tilt axis, tilt) T_0, with T_0 the pose of the camera at both encoders' zero, so that lens offsets
and zero angles need no model of their own. The board is the world until the hand says where the
robot is.
"""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mitt.core import checks
from mitt.core.errors import FileError, InputError
from mitt.core.eyes.camera import inverse, rotation_by_vector, rotation_vector, turned
from mitt.core.eyes.lens import Lens
from mitt.core.signals import Array
from mitt.io.csv_table import finite_cell, read_rows
from mitt.io.rig import HeadAxes, RigCamera
from mitt.robot.cameras.cameras import read_image
from mitt.robot.cameras.charuco import Board, BoardCorners
from mitt.robot.cameras.least_squares import POSE, CalibrationStage, Fit, fit, weak

#: The board seen from below its back: z up out of its face.
FACE_UP = np.diag((1.0, -1.0, -1.0, 1.0))
#: Fewest pairs of angles that fix two axes.
_FEWEST_ANGLES = 5
#: Half the step of the central differences [rad, m]; the error is near 1e-9 of a pixel.
_STEP = 1e-6


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
            "pan_direction_1",
            "pan_direction_2",
            "pan_place_1",
            "pan_place_2",
            "tilt_direction_1",
            "tilt_direction_2",
            "tilt_place_1",
            "tilt_place_2",
        )

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
            pan_axis=pan_axis,
            pan_point=pan_point,
            tilt_axis=tilt_axis,
            tilt_point=tilt_point,
        )
        return replace(self, head=head)


def _line(axis: Array, point: Array, step: Array) -> tuple[Array, Array]:
    """Return a line turned and shifted across itself by a step, shape (4,)."""
    across = np.linalg.svd(axis[None])[2][1:]
    new = rotation_by_vector(across.T @ step[:2]) @ axis
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
    if len(angles) < _FEWEST_ANGLES:
        raise InputError(
            "head axes", f"views at {_FEWEST_ANGLES} pairs of angles or more", len(angles)
        )
    spread = np.rad2deg(angles.std(axis=0))
    for name, size in zip(("pan", "tilt"), spread, strict=True):
        if size < 1.0:
            raise InputError(
                "head axes",
                f"views at {name} angles that differ by 5 degrees",
                f"{size:.2f} degrees of spread",
            )
    start = int(np.argmin(np.linalg.norm(angles, axis=1)))
    pan_axis, tilt_axis = _directions(angles, poses)
    (pan, tilt), T_0 = angles[start], poses[start].copy()
    T_0[:3, :3] = (
        rotation_by_vector(-tilt_axis * tilt) @ rotation_by_vector(-pan_axis * pan) @ T_0[:3, :3]
    )
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


def read_head_views(
    path: Path, board: Board, size: tuple[int, int]
) -> tuple[Array, list[BoardCorners], int]:
    """Return angles [rad], shape (k, 2), and corners of the views that a table lists.

    The table has columns image,pan_rad,tilt_rad, images of one size [px] relative to its folder.
    The last of what is returned is how many of its images show no board, and are left out.
    """
    path = checks.path("table of views", path)
    angles, sights = [], []
    for line, cells in read_rows(path, ("image", "pan_rad", "tilt_rad")):
        at = path.parent / cells["image"]
        pixels = read_image(at)
        if pixels.shape != (size[1], size[0]):
            given = f"{pixels.shape[1]} x {pixels.shape[0]}"
            raise FileError(str(at), f"an image of {size[0]} x {size[1]} pixels", given)
        sights.append(board.sight(pixels))
        angles.append(
            [
                finite_cell(path, line, name, cells[name], limit=7.0)
                for name in ("pan_rad", "tilt_rad")
            ]
        )
    board.settle(sights)
    views = [sight[board.legacy] for sight in sights]
    kept = [k for k, view in enumerate(views) if view is not None]
    found = [view for view in views if view is not None]
    return np.array(angles).reshape(-1, 2)[kept], found, len(views) - len(kept)


def head_problem(
    camera: RigCamera, board: Board, angles: Array, views: list[BoardCorners]
) -> HeadProblem:
    """Return the problem of a camera's head at its first guess."""
    poses = np.array([inverse(board.pose(v, camera.lens)) for v in views]).reshape(-1, 4, 4)
    numbers = [np.full(len(v.ids), k) for k, v in enumerate(views)]
    return HeadProblem(
        lens=camera.lens,
        angles=angles,
        head=first_head(angles, poses),
        view=np.concatenate([np.zeros(0, dtype=np.int64), *numbers]),
        on_board=np.concatenate([np.zeros((0, 3)), *(board.corners[v.ids] for v in views)]),
        uv=np.concatenate([np.zeros((0, 2)), *(v.uv for v in views)]),
    )


def calibrate_head(
    camera: RigCamera, board: Board, angles: Array, views: list[BoardCorners]
) -> tuple[RigCamera, Fit[HeadProblem], CalibrationStage]:
    """Return the camera with its head, the world being the board, z up out of its face."""
    solved = fit(head_problem(camera, board, angles, views))
    wider = (2e-3, "add views at angles farther apart, pan and tilt in turn")
    limits = {
        f"{axis}_{what}_{k}": wider
        for axis in ("pan", "tilt")
        for what in ("direction", "place")
        for k in (1, 2)
    }
    warnings = tuple(f"{camera.name}: {text}" for text in weak(solved, limits))
    head = solved.problem.head
    apart = abs(float(head.pan_axis @ head.tilt_axis))
    numbers: dict[str, float] = {
        "views": len(views),
        "rms_px": solved.rms,
        "axes_deg": float(np.rad2deg(np.arccos(min(apart, 1.0)))),
    }
    turned = head.seen_from(FACE_UP)
    moved = replace(camera, T_world_cam=turned.T_world_cam, head=turned, rms_px=solved.rms)
    return moved, solved, CalibrationStage(f"head {camera.name}", solved.status, numbers, warnings)
