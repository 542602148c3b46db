"""How far a calibrated rig is from the true one: the errors that ``mitt calibrate`` leaves.

The bundle adjustment of :mod:`mitt.robot.cameras.board_calibration` reaches the Cramer-Rao bound
(``tests/cameras/test_boards.py``), so its errors are drawn from it and need no images.
Corners of a board in so many views give lenses and the pose of each camera to the first one; a ball
in the hand, in as many places, then gives the pose of the rig before the robot, with the errors of
the first step in it. All is linear about the true rig.

| here      | meaning                                                       | unit   | shape  |
|-----------|---------------------------------------------------------------|--------|--------|
| ``bends`` | change of an image point with fu, fv, cu, cv [px], k1, k2     |        | (2, 6) |
| ``twist`` | shift and turn of a camera in its own frame                   | m, rad | (6,)   |
"""

from dataclasses import replace
from functools import lru_cache

import numpy as np

from mitt.core.arm.description import rotation
from mitt.core.eyes.camera import Camera, Rig
from mitt.core.eyes.lens import distort
from mitt.core.signals import Array

#: The board: inner corners across and down, side of a square [m]; as large as one carries about.
_CORNERS = (8, 5)
_SQUARE = 0.10
#: Where boards are held, lowest and highest [m], and how far they are tilted [rad].
_BOARDS = ((0.8, -0.5, -0.3), (2.6, 0.5, 0.8))
_TILT = 0.7
#: Where the ball is held: the region that the hand reaches before the cameras [m].
_HAND = ((0.35, -0.45, -0.2), (0.85, 0.45, 0.75))
#: Numbers of a lens that calibration finds; numbers of a pose.
_LENS = 6
_POSE = 6
_SEED = 2002


@lru_cache(maxsize=8)
def error_root(rig: Rig, views: int, noise: float, k: tuple[float, float]) -> Array:
    """Return a root of the covariance of a calibration, shape (12 n, r): errors are root @ normal.

    Of each camera: fu, fv, cu, cv, k1, k2 and its twist.

    Args:
        rig: The cameras, n of them.
        views: Number of views of the board, and of places of the ball.
        noise: Error of a corner or a centre, 1 sigma an axis [px].
        k: k1 and k2 of the lenses.
    """
    rng = np.random.default_rng(_SEED)
    from_boards = _boards(rig, views, noise, k, rng)
    return _placed(rig, views, noise, k, rng, from_boards)


def drawn_rig(rig: Rig, root: Array, rng: np.random.Generator) -> Rig:
    """Return the rig that takes the images, where calibration has found another.

    Images are straightened with the lens that was found; what is left of the lens is folded into
    focal length and principal point. The rest, 0.06 px over the image on average for the fixed rig
    and 20 views, is not drawn.

    Args:
        rig: The rig as calibrated, cameras that stand still.
        root: As of :func:`error_root`.
        rng: Source of the errors.
    """
    errors = (root @ rng.standard_normal(root.shape[1])).reshape(len(rig.cameras), -1)
    cameras = list(rig.cameras)
    for n, (camera, error) in enumerate(zip(rig.cameras, errors, strict=True)):
        longer, du, dv = pinhole_errors(camera, error[:_LENS])
        cameras[n] = replace(
            camera,
            f_px=camera.f_px * (1.0 + longer),
            cu=camera.cu + du,
            cv=camera.cv + dv,
            T_world_cam=_moved(camera.T_world_cam, error[_LENS:]),
        )
    return Rig(cameras=tuple(cameras))


def pinhole_errors(camera: Camera, lens: Array) -> Array:
    """Return the errors of a pinhole that are nearest to those of a lens all over the image.

    Args:
        camera: The camera.
        lens: Errors of fu, fv, cu, cv [px], k1, k2, shape (6,).

    Returns:
        Relative error of f, errors of cu and cv [px], shape (3,).
    """
    xy = image_grid(camera)
    moved = bends(camera, xy, (0.0, 0.0)) @ lens
    rows = np.zeros((len(xy), 2, 3))
    rows[:, :, 0] = camera.f_px * xy
    rows[:, 0, 1] = rows[:, 1, 2] = 1.0
    return np.asarray(np.linalg.lstsq(rows.reshape(-1, 3), moved.ravel(), rcond=None)[0])


def image_grid(camera: Camera) -> Array:
    """Return ideal points all over an image at unit distance, shape (225, 2)."""
    u, v = np.meshgrid(np.linspace(0, camera.width - 1, 15), np.linspace(0, camera.height - 1, 15))
    return np.column_stack((u.ravel() - camera.cu, v.ravel() - camera.cv)) / camera.f_px


def bends(camera: Camera, xy: Array, k: tuple[float, float]) -> Array:
    """Return how image points move with the numbers of a lens, shape (m, 2, 6).

    Args:
        camera: The camera.
        xy: Ideal points at unit distance, shape (m, 2).
        k: k1 and k2.
    """
    bent, _, by_k = distort(xy, np.array([*k, 0.0, 0.0, 0.0]))
    out = np.zeros((len(xy), 2, _LENS))
    out[:, 0, 0], out[:, 1, 1] = bent[:, 0], bent[:, 1]
    out[:, 0, 2] = out[:, 1, 3] = 1.0
    out[:, :, 4:] = camera.f_px * by_k[:, :, :2]
    return out


def _boards(
    rig: Rig, views: int, noise: float, k: tuple[float, float], rng: np.random.Generator
) -> Array:
    """Return the covariance of all lenses, and of all twists but the first, from a board."""
    n = len(rig.cameras)
    known = _LENS * n + _POSE * (n - 1)
    information = np.zeros((known, known))
    corners = _corners()
    for _ in range(views):
        R, p = _board_pose(rig, rng)
        J, B = [], []
        for c, camera in enumerate(rig.cameras):
            world = corners @ R.T + p
            own, by_point, ahead = _jacobian(rig, c, world, k)
            board = by_point @ camera.rotation.T @ R @ _by_body(corners)
            J.append(own[ahead].reshape(-1, known))
            B.append(board[ahead].reshape(-1, _POSE))
        J_all, B_all = np.concatenate(J), np.concatenate(B)
        across = J_all.T @ B_all
        information += J_all.T @ J_all - across @ np.linalg.pinv(B_all.T @ B_all) @ across.T
    return np.asarray(noise**2 * np.linalg.inv(information))


def _placed(
    rig: Rig,
    places: int,
    noise: float,
    k: tuple[float, float],
    rng: np.random.Generator,
    from_boards: Array,
) -> Array:
    """Return a root of the covariance of lenses and twists once the rig is placed by a ball."""
    n = len(rig.cameras)
    known = len(from_boards)
    low, high = np.array(_HAND)
    ball = low + (high - low) * rng.random((places, 3))
    J, P = [], []
    for c, camera in enumerate(rig.cameras):
        own, by_point, ahead = _jacobian(rig, c, ball, k)
        moved = by_point @ _by_twist(camera, ball) @ _own_twist(camera)
        J.append(own[ahead].reshape(-1, known))
        P.append(moved[ahead].reshape(-1, _POSE))
    J_all, P_all = np.concatenate(J), np.concatenate(P)
    solve = -np.linalg.solve(P_all.T @ P_all, P_all.T)
    inner = np.linalg.cholesky(from_boards)
    place = np.hstack((solve @ J_all @ inner, noise * solve))  # twist of the rig in the world
    free = np.hstack((inner, np.zeros((known, len(J_all)))))
    out = np.zeros((n, _LENS + _POSE, place.shape[1]))
    for c, camera in enumerate(rig.cameras):
        out[c, :_LENS] = free[_LENS * c : _LENS * (c + 1)]
        out[c, _LENS:] = _own_twist(camera) @ place
        if c > 0:
            at = _LENS * n + _POSE * (c - 1)
            out[c, _LENS:] += free[at : at + _POSE]
    return out.reshape(n * (_LENS + _POSE), -1)


def _jacobian(rig: Rig, c: int, world: Array, k: tuple[float, float]) -> tuple[Array, Array, Array]:
    """Return how a camera's image points move with what a board calibrates, shape (m, 2, 12 n - 6).

    That is all lenses and the twists of all cameras but the first. Then as of :func:`_seen`: how
    they move with the points in the camera's frame, and which of them are in the image.
    """
    n, camera = len(rig.cameras), rig.cameras[c]
    lens, by_point, ahead = _seen(camera, world, k)
    out = np.zeros((len(world), 2, _LENS * n + _POSE * (n - 1)))
    out[:, :, _LENS * c : _LENS * (c + 1)] = lens
    if c > 0:
        at = _LENS * n + _POSE * (c - 1)
        out[:, :, at : at + _POSE] = by_point @ _by_twist(camera, world)
    return out, by_point, ahead


def _corners() -> Array:
    """Return the corners of the board in its own frame [m], shape (m, 3)."""
    x, y = (_SQUARE * (np.arange(count) - 0.5 * (count - 1)) for count in _CORNERS)
    grid = np.array(np.meshgrid(x, y)).reshape(2, -1).T
    return np.column_stack((grid, np.zeros(len(grid))))


def _board_pose(rig: Rig, rng: np.random.Generator) -> tuple[Array, Array]:
    """Return how a board is held before the cameras: tilted, turned, somewhere in their view."""
    low, high = np.array(_BOARDS)
    p = low + (high - low) * rng.random(3)
    z = np.mean([camera.centre for camera in rig.cameras], axis=0) - p
    z /= np.linalg.norm(z)
    x = np.cross((0.0, 0.0, 1.0), z)
    x /= np.linalg.norm(x)
    R = np.column_stack((x, np.cross(z, x), z))
    angle = rng.uniform(0.0, 2.0 * np.pi)
    axis = np.array([np.cos(angle), np.sin(angle), 0.0])
    turn = rotation(np.array([0.0, 0.0, 1.0]), rng.uniform(-np.pi, np.pi))
    return R @ rotation(axis, _TILT * rng.random()) @ turn, p


def _seen(camera: Camera, world: Array, k: tuple[float, float]) -> tuple[Array, Array, Array]:
    """Return how images of points move, and which of them are in the image, shape (m,).

    With the lens, shape (m, 2, 6), and with the points in the camera's frame, shape (m, 2, 3).
    """
    X = (world - camera.centre) @ camera.rotation
    xy = X[:, :2] / X[:, 2:]
    bent, by_xy, _ = distort(xy, np.array([*k, 0.0, 0.0, 0.0]))
    by_X = np.zeros((len(X), 2, 3))
    by_X[:, 0, 0] = by_X[:, 1, 1] = 1.0 / X[:, 2]
    by_X[:, :, 2] = -xy / X[:, 2:]
    uv = camera.f_px * bent + (camera.cu, camera.cv)
    ahead = (X[:, 2] > 0.1) & np.all((uv >= 0.0) & (uv < (camera.width, camera.height)), axis=1)
    return bends(camera, xy, k), camera.f_px * by_xy @ by_X, ahead


def _cross(p: Array) -> Array:
    """Return the matrices of the cross products p x, shape (m, 3, 3)."""
    x, y, z = p.T
    none = np.zeros(len(p))
    rows = np.array([[none, -z, y], [z, none, -x], [-y, x, none]])
    return np.moveaxis(rows, 2, 0)


def _by_body(p: Array) -> Array:
    """Return how points of a body move with its twist in its own frame, shape (m, 3, 6)."""
    shift = np.broadcast_to(np.eye(3), (len(p), 3, 3))
    return np.concatenate((shift, -_cross(p)), axis=2)


def _by_twist(camera: Camera, world: Array) -> Array:
    """Return how points move in a camera's frame with the camera's twist, shape (m, 3, 6)."""
    return -_by_body((world - camera.centre) @ camera.rotation)


def _own_twist(camera: Camera) -> Array:
    """Return what takes a twist of the rig, in the world, to that of a camera in its own frame."""
    R = camera.rotation.T
    out = np.zeros((_POSE, _POSE))
    out[:3, :3], out[3:, 3:] = R, R
    out[:3, 3:] = -R @ _cross(camera.centre[None])[0]
    return out


def _moved(T: Array, twist: Array) -> Array:
    """Return a pose, shape (4, 4), after a small twist in its own frame."""
    angle, out = float(np.linalg.norm(twist[3:])), T.copy()
    if angle > 0.0:
        out[:3, :3] = T[:3, :3] @ rotation(twist[3:] / angle, angle)
    out[:3, 3] += T[:3, :3] @ twist[:3]
    return out
