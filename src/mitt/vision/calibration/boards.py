"""Lenses and poses of a rig's cameras from the corners of a flat board in many views.

Bundle adjustment: every corner that any camera saw counts, also where the others did not see the
board. The rig's frame is the optical frame of the first camera.

| here          | meaning                                             | unit | shape     |
|---------------|-----------------------------------------------------|------|-----------|
| ``lenses``    | numbers of each camera's lens, as in ``vision.lens``  |      | (c, 9)    |
| ``T_cam_rig`` | p_cam = T_cam_rig @ p_rig                           | m    | (c, 4, 4) |
| ``T_rig_board`` | pose of the board in each view                    | m    | (k, 4, 4) |
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from mitt.signals import Array
from mitt.vision.lens import NUMBERS, distort
from mitt.vision.poses import by_pose, turned


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
        six = ("turn_x", "turn_y", "turn_z", "x", "y", "z")
        return (
            *(f"{camera}.{name}" for camera in self.cameras for name in lens),
            *(f"{camera}.{name}" for camera in self.cameras[1:] for name in six),
            *(f"view{k}.{name}" for k in range(len(self.T_rig_board)) for name in six),
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
        J = np.zeros((n, 2, len(self.names)))
        rows, at = np.arange(n), np.arange(int(self.free.sum()))
        J[rows[:, None], :, c.camera[:, None] * len(at) + at] = by_lens[:, :, self.free].swapaxes(
            1, 2
        )
        start, six = len(self.lenses) * len(at), np.arange(6)
        moving = c.camera > 0
        columns = start + 6 * (c.camera[moving, None] - 1) + six
        J[rows[moving, None], :, columns] = (by_p[moving] @ by_pose(in_cam[moving])).swapaxes(1, 2)
        start += 6 * (len(self.lenses) - 1)
        J[rows[:, None], :, start + 6 * c.view[:, None] + six] = (
            by_p @ R_cam @ by_pose(on_rig)
        ).swapaxes(1, 2)
        return np.asarray(J.reshape(2 * n, -1))

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
