"""Lenses and stereo pose from images of a ChArUco board."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mitt.errors import InputError
from mitt.link.cameras.source import Camera
from mitt.link.charuco import Board, Seen, between
from mitt.link.rig import CalibratedRig, RigCamera
from mitt.signals import Array
from mitt.study.rig.stage import Stage, weak
from mitt.vision.calibration.boards import BoardProblem, Corners
from mitt.vision.calibration.fit import Fit, fit
from mitt.vision.lens import NUMBERS, Lens
from mitt.vision.poses import inverse

#: Fewest views of one camera; most views used; most frames looked at in a video.
FEWEST, MOST_VIEWS, MOST_FRAMES = 3, 60, 20_000
#: Cells across and down the image in which coverage is counted, and the share wanted.
CELLS, COVERED = (6, 4), 0.6
#: Least mean motion of the board between two views that are kept, share of the image's width.
_APART = 0.02

Progress = Callable[[str, int, int], None]
Size = tuple[int, int]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class BoardViews:
    """What the cameras saw of the board.

    Attributes:
        names: Names of the cameras.
        sizes: Width and height of their images [px].
        views: For each view what each camera saw; None where it saw no board.
        numbers: Number of each view's frame in its source.
        frames: Frames looked at.
    """

    names: tuple[str, ...]
    sizes: tuple[Size, ...]
    views: tuple[tuple[Seen | None, ...], ...]
    numbers: tuple[int, ...]
    frames: int


def look_for_board(
    board: Board, sources: Sequence[Camera], names: tuple[str, ...], *, progress: Progress
) -> BoardViews:
    """Find the board in the k-th frames of all sources, k = 0, 1, ...

    Raises:
        InputError: The sources have different numbers of frames, or no frame.
    """
    kept: list[tuple[Seen | None, ...]] = []
    numbers: list[int] = []
    sizes: tuple[Size, ...] | None = None
    count = 0
    while count < MOST_FRAMES:
        frames = [source.read() for source in sources]
        got = [f for f in frames if f is not None]
        if not got:
            break
        if len(got) < len(frames):
            ended = ", ".join(s.name for s, f in zip(sources, frames, strict=True) if f is None)
            raise InputError("images", "as many from each camera", f"{count} only from {ended}")
        now = tuple((f.pixels.shape[1], f.pixels.shape[0]) for f in got)
        sizes = sizes or now
        if now != sizes:
            raise InputError("images", f"one size throughout, {sizes}", f"{now} at frame {count}")
        view = tuple(board.find(f.pixels) for f in got)
        if any(view) and all(_apart(view, old, sizes[0][0]) for old in kept):
            kept.append(view)
            numbers.append(count)
        count += 1
        progress("board", count, count + 1)
        if any(source.live for source in sources) and len(kept) == MOST_VIEWS:
            break
    if sizes is None:
        raise InputError("images", "at least one", "none")
    chosen = np.unique(np.linspace(0, len(kept) - 1, min(len(kept), MOST_VIEWS)).astype(int))
    return BoardViews(
        names=names,
        sizes=sizes,
        views=tuple(kept[k] for k in chosen),
        numbers=tuple(numbers[k] for k in chosen),
        frames=count,
    )


def _apart(a: tuple[Seen | None, ...], b: tuple[Seen | None, ...], width: int) -> bool:
    """Say whether two views differ: the board moved, or other cameras see it."""
    for one, two in zip(a, b, strict=True):
        if (one is None) != (two is None):
            return True
        if one is not None and two is not None:
            _, i, j = np.intersect1d(one.ids, two.ids, return_indices=True)
            motion = np.abs(one.uv[i] - two.uv[j]).mean() if len(i) else np.inf
            if motion > _APART * width:
                return True
    return False


def free_numbers(coefficients: int) -> NDArray[np.bool_]:
    """Return which numbers of a lens are found with 0, 1, 2, 4 or 5 distortion coefficients."""
    if coefficients not in (0, 1, 2, 4, 5):
        raise InputError("--coefficients", "0, 1, 2, 4 or 5", coefficients)
    return np.arange(9) < 4 + coefficients


def board_problem(board: Board, seen: BoardViews, free: NDArray[np.bool_]) -> BoardProblem:
    """Return the problem at OpenCV's first guess.

    Raises:
        InputError: A camera saw too few boards, or no board was seen by two cameras at once.
    """
    lenses = []
    for k, name in enumerate(seen.names):
        mine = [v for view in seen.views if (v := view[k]) is not None]
        if len(mine) < FEWEST:
            raise InputError(f"camera {name}", f"the board in {FEWEST} different views or more",
                             f"{len(mine)} of {seen.frames} images",
                             do="check --board, --square, --dictionary, light and focus",
                             )  # fmt: skip
        lenses.append(board.lens(mine, seen.sizes[k], free))
    poses = [[None if v is None else board.pose(v, lens) for v, lens in zip(view, lenses,
             strict=True)] for view in seen.views]  # fmt: skip
    T_cam_rig = [np.eye(4)]
    for k, name in enumerate(seen.names[1:], 1):
        both = [(p[0], p[k]) for p in poses if p[0] is not None and p[k] is not None]
        if not both:
            raise InputError(f"cameras {seen.names[0]} and {name}",
                             "a view in which both see the board", "none")  # fmt: skip
        T_cam_rig.append(between([a for a, _ in both], [b for _, b in both]))
    boards = []
    for view in poses:
        k = next(k for k, p in enumerate(view) if p is not None)
        boards.append(inverse(T_cam_rig[k]) @ view[k])
    return BoardProblem(
        corners=corners_of(board, seen),
        lenses=np.array([lens.numbers for lens in lenses]),
        T_cam_rig=np.array(T_cam_rig),
        T_rig_board=np.array(boards),
        free=free,
        cameras=seen.names,
    )


def corners_of(board: Board, seen: BoardViews) -> Corners:
    """Return all corners of all views in one list."""
    parts = [(k, n, v) for n, view in enumerate(seen.views) for k, v in enumerate(view) if v]
    return Corners(
        camera=np.concatenate([np.full(len(v.ids), k) for k, _, v in parts]),
        view=np.concatenate([np.full(len(v.ids), n) for _, n, v in parts]),
        on_board=np.concatenate([board.corners[v.ids] for _, _, v in parts]),
        uv=np.concatenate([v.uv for _, _, v in parts]),
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
    problem = board_problem(board, seen, free_numbers(coefficients))
    solved = fit(problem)
    rig = rig_of(solved, seen.sizes)
    numbers: dict[str, float | int | str | None] = {
        "views": len(seen.views), "frames": seen.frames, "rms_px": solved.rms,
        "status": solved.status,
    }  # fmt: skip
    warnings = list(weak(solved, _limits(rig, problem)))
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
    return rig, solved, Stage(name="boards", numbers=numbers, warnings=tuple(warnings))


def _base_line(solved: Fit[BoardProblem]) -> dict[str, float]:
    """Return length and standard deviation of the base line [m]."""
    t, name = solved.problem.T_cam_rig[1][:3, 3], solved.problem.cameras[1]
    at = [solved.problem.names.index(f"{name}.{x}") for x in "xyz"]
    along = t / np.linalg.norm(t)
    variance = float(along @ solved.covariance[np.ix_(at, at)] @ along)
    return {"baseline_m": float(np.linalg.norm(t)), "baseline_sigma_m": float(np.sqrt(variance))}


def coverage(uv: Array, size: Size) -> float:
    """Return the share of the image's cells in which a corner, shape (n, 2), lies."""
    bins = [np.linspace(-0.5, n - 0.5, cells + 1) for n, cells in zip(size, CELLS, strict=True)]
    return float(np.mean(np.histogram2d(uv[:, 0], uv[:, 1], bins=bins)[0] > 0))


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
