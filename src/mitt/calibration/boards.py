"""Lenses and stereo pose from images of a ChArUco board."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from mitt.calibration.stage import Stage, weak
from mitt.calibration.views import BoardViews, Size, corners_of, coverage
from mitt.errors import InputError
from mitt.link.charuco import Board, between, plain
from mitt.link.rig import CalibratedRig, RigCamera
from mitt.signals import Array
from mitt.vision.calibration.boards import BoardProblem
from mitt.vision.calibration.fit import Fit, fit
from mitt.vision.lens import NUMBERS, Lens
from mitt.vision.poses import inverse

#: Fewest views of one camera, and share of the image's cells with corners that is wanted.
FEWEST, COVERED = 3, 0.6


def free_numbers(coefficients: int) -> NDArray[np.bool_]:
    """Return which numbers of a lens are found with 0, 1, 2, 4 or 5 distortion coefficients."""
    if coefficients not in (0, 1, 2, 4, 5):
        raise InputError("--coefficients", "0, 1, 2, 4 or 5", coefficients)
    return np.arange(9) < 4 + coefficients


def board_problem(board: Board, seen: BoardViews, free: NDArray[np.bool_]) -> BoardProblem:
    """Return the problem at a first guess: OpenCV's, or plain lenses where those fit better.

    OpenCV's lens is none where the views leave it open, as when all boards face the camera.

    Raises:
        InputError: A camera saw too few boards, or no board was seen by two cameras at once.
    """
    guesses = []
    for k, (name, size) in enumerate(zip(seen.names, seen.sizes, strict=True)):
        mine = [v for view in seen.views if (v := view[k]) is not None]
        if len(mine) < FEWEST:
            raise InputError(
                f"camera {name}",
                f"the board in {FEWEST} different views or more",
                f"{len(mine)} of {seen.frames} images",
                do="check --board, --square, --dictionary, light and focus",
            )
        guesses.append((board.lens(mine, size, free), plain(size)))
    starts = [_started(board, seen, free, lenses) for lenses in zip(*guesses, strict=True)]
    return min(starts, key=lambda problem: float(np.abs(problem.residuals()).max()))


def _started(
    board: Board, seen: BoardViews, free: NDArray[np.bool_], lenses: Sequence[Lens]
) -> BoardProblem:
    """Return the problem with the poses that follow from lenses."""
    poses = [
        [None if v is None else board.pose(v, lens) for v, lens in zip(view, lenses, strict=True)]
        for view in seen.views
    ]
    T_cam_rig: list[Array] = [np.eye(4)]
    for k, name in enumerate(seen.names[1:], 1):
        both = [(a, b) for p in poses if (a := p[0]) is not None and (b := p[k]) is not None]
        if not both:
            raise InputError(
                f"cameras {seen.names[0]} and {name}", "a view in which both see the board", "none"
            )
        T_cam_rig.append(between([a for a, _ in both], [b for _, b in both]))
    boards = []
    for view in poses:
        k, pose = next((k, p) for k, p in enumerate(view) if p is not None)
        boards.append(inverse(T_cam_rig[k]) @ pose)
    return BoardProblem(
        corners=corners_of(board, seen),
        lenses=np.array([lens.numbers for lens in lenses]),
        T_cam_rig=np.array(T_cam_rig),
        T_rig_board=np.array(boards),
        free=free,
        cameras=seen.names,
    )


def rig_of(solved: Fit[BoardProblem], sizes: tuple[Size, ...]) -> CalibratedRig:
    """Return the rig of a solution, in the frame of its first camera."""
    problem, cameras = solved.problem, []
    r = problem.residuals().reshape(-1, 2)
    for k, name in enumerate(problem.cameras):
        mine = r[problem.corners.camera == k]
        cameras.append(
            RigCamera(
                name=name,
                lens=Lens(width=sizes[k][0], height=sizes[k][1], numbers=problem.lenses[k]),
                T_world_cam=inverse(problem.T_cam_rig[k]),
                rms_px=float(np.sqrt(np.mean(mine**2))),
            )
        )
    return CalibratedRig(frame="camera", cameras=tuple(cameras))


def calibrate_boards(
    board: Board, seen: BoardViews, *, coefficients: int
) -> tuple[CalibratedRig, Fit[BoardProblem], Stage]:
    """Return the rig, the solution behind it, and what to say about it."""
    solved = fit(board_problem(board, seen, free_numbers(coefficients)))
    problem = solved.problem
    rig = rig_of(solved, seen.sizes)
    numbers: dict[str, float] = {
        "views": len(seen.views), "frames": seen.frames, "rms_px": solved.rms,
    }  # fmt: skip
    warnings = list(weak(solved, _limits(rig, problem)))
    if solved.status != "converged":
        warnings.append("the fit did not settle: the views are too much alike")
    for k, (name, size) in enumerate(zip(seen.names, seen.sizes, strict=True)):
        share = coverage(problem.corners.uv[problem.corners.camera == k], size)
        numbers |= {f"{name}_rms_px": rig.cameras[k].rms_px, f"{name}_coverage": share,
                    f"{name}_f_px": float(np.sqrt(np.prod(problem.lenses[k, :2]))),
                    f"{name}_f_sigma_px": solved.sigma_of(f"{name}.fu")}  # fmt: skip
        if share < COVERED:
            warnings.append(f"{name}: corners in {100 * share:.0f} % of the image only: "
                            "add views with the board near the edges and corners")  # fmt: skip
    if len(rig.cameras) > 1:
        numbers |= _base_line(solved)
    return (
        rig,
        solved,
        Stage(name="boards", status=solved.status, numbers=numbers, warnings=tuple(warnings)),
    )


def _base_line(solved: Fit[BoardProblem]) -> dict[str, float]:
    """Return length and standard deviation of the base line [m]."""
    t, name = solved.problem.T_cam_rig[1][:3, 3], solved.problem.cameras[1]
    at = [solved.problem.names.index(f"{name}.{x}") for x in "xyz"]
    along = t / np.linalg.norm(t)
    variance = float(along @ solved.covariance[np.ix_(at, at)] @ along)
    return {"baseline_m": float(np.linalg.norm(t)), "baseline_sigma_m": float(np.sqrt(variance))}


def _limits(rig: CalibratedRig, problem: BoardProblem) -> dict[str, tuple[float, str]]:
    """Return how well each parameter should be known, and what helps."""
    tilted = "add views of the board tilted by 20 to 40 degrees to different sides"
    rolled = "add tilted views with the board turned by 90 degrees in its plane"
    edges = "add views with the board near the corners of the image"
    shared = "add views in which both cameras see the whole board, near and far"
    limits: dict[str, tuple[float, str]] = {}
    for camera in rig.cameras:
        lens = camera.lens
        f = float(np.sqrt(np.prod(lens.numbers[:2])))
        reach = float(np.hypot(lens.width, lens.height)) / (2.0 * f)
        powers = dict(zip(NUMBERS[4:], (3, 5, 2, 2, 7), strict=True))
        for name, free in zip(NUMBERS, problem.free, strict=True):
            if not free:
                continue
            if name in powers:
                limit, advice = 2.0 / (f * reach ** powers[name]), edges
            elif name in ("fu", "fv"):
                limit, advice = 0.01 * f, tilted
            else:
                limit, advice = 0.01 * lens.width, rolled
            limits[f"{camera.name}.{name}"] = (limit, advice)
    for k, camera in enumerate(rig.cameras[1:], 1):
        base = float(np.linalg.norm(problem.T_cam_rig[k][:3, 3]))
        for axis in "xyz":
            limits[f"{camera.name}.turn_{axis}"] = (3e-3, shared)
            limits[f"{camera.name}.{axis}"] = (0.01 * base, shared)
    return limits
