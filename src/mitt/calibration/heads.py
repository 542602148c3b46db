"""Axes of pan-tilt heads from images of a board that stands still, taken at known angles."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from mitt import checks
from mitt.calibration.charuco import Board, Seen
from mitt.calibration.stage import Stage, weak
from mitt.cameras.recorded import read_image
from mitt.errors import FileError
from mitt.files.rig import RigCamera
from mitt.signals import Array
from mitt.vision.calibration.fit import Fit, fit
from mitt.vision.calibration.heads import HeadProblem, first_head
from mitt.vision.poses import inverse
from mitt.world.tables import number, read_rows

#: The board seen from below its back: z up out of its face.
FACE_UP = np.diag((1.0, -1.0, -1.0, 1.0))


def read_head_views(
    path: Path, board: Board, size: tuple[int, int]
) -> tuple[Array, list[Seen], int]:
    """Return angles [rad], shape (k, 2), and corners of the views that a table lists.

    The last of what is returned is how many of its images show no board, and are left out.

    Args:
        path: CSV file with columns image,pan_rad,tilt_rad; images relative to its folder.
        board: The board.
        size: Width and height of the images [px].

    Raises:
        FileError: The table or an image cannot be read, or the image has another size.
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
        angles.append([number(path, line, name, cells[name], limit=7.0)
                       for name in ("pan_rad", "tilt_rad")])  # fmt: skip
    board.settle(sights)
    views = [sight[board.legacy] for sight in sights]
    kept = [k for k, view in enumerate(views) if view is not None]
    found = [view for view in views if view is not None]
    return np.array(angles).reshape(-1, 2)[kept], found, len(views) - len(kept)


def head_problem(camera: RigCamera, board: Board, angles: Array, views: list[Seen]) -> HeadProblem:
    """Return the problem of a camera's head at its first guess."""
    poses = np.array([inverse(board.pose(v, camera.lens)) for v in views]).reshape(-1, 4, 4)
    numbers = [np.full(len(v.ids), k) for k, v in enumerate(views)]
    return HeadProblem(
        lens=camera.lens,
        angles=angles,
        view=np.concatenate([np.zeros(0, dtype=np.int64), *numbers]),
        on_board=np.concatenate([np.zeros((0, 3)), *(board.corners[v.ids] for v in views)]),
        uv=np.concatenate([np.zeros((0, 2)), *(v.uv for v in views)]),
        head=first_head(angles, poses),
    )


def calibrate_head(
    camera: RigCamera, board: Board, angles: Array, views: list[Seen]
) -> tuple[RigCamera, Fit[HeadProblem], Stage]:
    """Return the camera with its head, the world being the board, z up out of its face."""
    solved = fit(head_problem(camera, board, angles, views))
    wider = (2e-3, "add views at angles farther apart, pan and tilt in turn")
    limits = {f"{axis}_{what}_{k}": wider for axis in ("pan", "tilt")
              for what in ("direction", "place") for k in (1, 2)}  # fmt: skip
    warnings = tuple(f"{camera.name}: {text}" for text in weak(solved, limits))
    head = solved.problem.head
    apart = abs(float(head.pan_axis @ head.tilt_axis))
    numbers: dict[str, float] = {
        "views": len(views), "rms_px": solved.rms,
        "axes_deg": float(np.rad2deg(np.arccos(min(apart, 1.0)))),
    }  # fmt: skip
    turned = head.seen_from(FACE_UP)
    moved = replace(camera, T_world_cam=turned.T_world_cam, head=turned, rms_px=solved.rms)
    return moved, solved, Stage(f"head {camera.name}", solved.status, numbers, warnings)
