"""Boards seen by cameras that are known: corners by projection, and images really drawn."""

import cv2
import numpy as np

from mitt.core.eyes.camera import applied, turned
from mitt.core.eyes.lens import Lens
from mitt.core.signals import Array, Image
from mitt.robot.cameras.board_calibration import BoardViews
from mitt.robot.cameras.charuco import Board, BoardCorners, BoardSpec

SPEC = BoardSpec(columns=9, rows=6, square=0.06, marker=0.045)
SIZE = (640, 480)
#: Pixels a square in the picture of the board that is warped into the images.
_SQUARE_PX = 60


def true_lens(bend: float = 1.0) -> Lens:
    """Return a lens of 700 px with some distortion."""
    numbers = np.array([700.0, 703.0, 322.0, 238.0, -0.2, 0.08, 1e-3, -5e-4, 0.0])
    numbers[4:] *= bend
    return Lens(width=SIZE[0], height=SIZE[1], numbers=numbers)


def true_stereo() -> Array:
    """Return T_right_left of two cameras 0.6 m apart, turned towards each other."""
    T = np.eye(4)
    T[:3, 3] = (-0.6, 0.01, 0.05)
    return turned(T, np.array((0.02, 0.2, 0.01, 0.0, 0.0, 0.0)))


def board_pose(board: Board, rng: np.random.Generator, tilt: float) -> Array:
    """Return a random T_left_board before both cameras."""
    T = turned(np.eye(4), np.array((*rng.uniform(-tilt, tilt, 2), rng.uniform(-1.5, 1.5), 0, 0, 0)))
    centre = np.array((rng.uniform(-0.3, 0.9), rng.uniform(-0.45, 0.45), rng.uniform(0.9, 2.6)))
    T[:3, 3] = centre - T[:3, :3] @ board.corners.mean(axis=0)
    return T


def seen_by(
    board: Board, lens: Lens, T_cam_board: Array, rng: np.random.Generator, noise: float
) -> BoardCorners | None:
    """Return the corners in one image with noise [px]; None where fewer than nine are in it."""
    p = applied(T_cam_board, board.corners)
    uv = lens.project(p)
    inside = (p[:, 2] > 0.1) & (uv > 1.0).all(axis=1) & (uv < np.array(SIZE) - 2.0).all(axis=1)
    flat = board.corners[inside][:, :2]
    if inside.sum() < 9 or np.linalg.matrix_rank(flat - flat[0]) < 2:
        return None
    noisy = uv[inside] + noise * rng.standard_normal((int(inside.sum()), 2))
    return BoardCorners(ids=np.flatnonzero(inside), uv=noisy)


def many_views(
    board: Board, count: int, rng: np.random.Generator, *, noise: float = 0.2, tilt: float = 0.5
) -> BoardViews:
    """Return views in which both cameras see at least nine corners."""
    lens, T = true_lens(), true_stereo()
    views: list[tuple[BoardCorners | None, ...]] = []
    while len(views) < count:
        pose = board_pose(board, rng, tilt)
        view = tuple(seen_by(board, lens, P @ pose, rng, noise) for P in (np.eye(4), T))
        if all(view):
            views.append(view)
    return BoardViews(
        names=("left", "right"),
        sizes=(SIZE, SIZE),
        views=tuple(views),
        numbers=tuple(range(count)),
        frames=count,
    )


def drawn(board: Board, lens: Lens, T_cam_board: Array, rng: np.random.Generator) -> Image:
    """Return an image of the board through a lens without distortion, blurred and noisy."""
    columns, rows = board.board.getChessboardSize()
    scale, fine = _SQUARE_PX, 2
    flat = board.board.generateImage((columns * scale, rows * scale), marginSize=0)
    side = board.board.getSquareLength()
    # Pixel (a, b) of the flat picture lies at ((a + 1/2) side / scale, ...) on the board.
    to_board = np.array(
        ((side / scale, 0, side / scale / 2), (0, side / scale, side / scale / 2), (0, 0, 1))
    )
    fu, fv, cu, cv = lens.numbers[:4]
    K = np.array(
        (
            (fine * fu, 0, fine * (cu + 0.5) - 0.5),
            (0, fine * fv, fine * (cv + 0.5) - 0.5),
            (0, 0, 1),
        )
    )
    H = K @ T_cam_board[:3, (0, 1, 3)] @ to_board
    size = (fine * SIZE[0], fine * SIZE[1])
    big = cv2.warpPerspective(flat, H, size, flags=cv2.INTER_AREA, borderValue=170)
    image = cv2.resize(cv2.GaussianBlur(big, (0, 0), 1.0), SIZE, interpolation=cv2.INTER_AREA)
    noisy = 20.0 + 0.8 * image + 2.0 * rng.standard_normal(image.shape)
    return np.asarray(np.clip(noisy, 0, 255), dtype=np.uint8)
