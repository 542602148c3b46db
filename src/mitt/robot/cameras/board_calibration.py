"""Cameras from images of a ChArUco board that all see at once: lenses and stereo pose.

Bundle adjustment over the corners of the flat board in many views: every corner that any camera saw
counts, also where the others did not see the board. The rig's frame is the optical frame of the
first camera.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from mitt.clock import Progress
from mitt.core.errors import InputError
from mitt.core.eyes.camera import by_pose, inverse, turned
from mitt.core.eyes.lens import NUMBERS, Lens, distort
from mitt.core.signals import Array, Frame, Image
from mitt.io.rig import CalibratedRig, RigCamera
from mitt.robot.cameras.cameras import ImageSource
from mitt.robot.cameras.charuco import (
    Board,
    BoardCorners,
    Sight,
    between,
    first_lens,
    shown_instead,
)
from mitt.robot.cameras.least_squares import POSE, CalibrationStage, Fit, fit, weak
from mitt.robot.cameras.two_cameras import PairCounts, pairs

#: Most views used, and fewest of one camera.
MOST_VIEWS = 60
FEWEST = 3
#: Most instants that are looked at, as of a video.
_MOST_FRAMES = 20_000
#: Cells across and down the image in which coverage is counted.
CELLS = (6, 4)
#: Share of the images without a board from which they are told of.
_MANY = 0.2

View = tuple[BoardCorners | None, ...]
"""What each camera saw of the board at one instant; None where it saw no board."""


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
class BoardViews:
    """What the cameras saw of the board.

    Attributes:
        names: Names of the cameras.
        sizes: Width and height of their images [px].
        views: What was seen at each instant that is used.
        numbers: Number of each view's instant, that of its frames where they are taken by number.
        frames: Frames looked at.
        without: How many frames of each camera showed no board.
        instead: What some of these showed, in words, for each camera; empty where few did.
        apart: Largest difference of the times of cameras in one view, where they tell it [s].
        pattern: What to say of the pattern of the board; empty where it is that of today.
    """

    names: tuple[str, ...]
    sizes: tuple[tuple[int, int], ...]
    views: tuple[View, ...]
    numbers: tuple[int, ...]
    frames: int
    without: tuple[int, ...] = ()
    instead: tuple[str, ...] = ()
    apart: float = 0.0
    pattern: str = ""


def look_for_board(
    board: Board,
    sources: Sequence[ImageSource],
    names: tuple[str, ...],
    *,
    progress: Progress,
    max_skew: float | None = None,
) -> BoardViews:
    """Find the board in the frames of each instant.

    Args:
        board: The board.
        sources: The cameras.
        names: Of these.
        progress: Is told how far it is.
        max_skew: Largest difference of the times of two cameras' frames that are taken as one
            instant [s]; None: the k-th frames of all cameras are one, k = 0, 1, ...

    Raises:
        InputError: The k-th frames are taken, and one camera has fewer; or sizes differ.
    """
    kept: list[tuple[int, tuple[Sight, ...]]] = []
    sizes: tuple[tuple[int, int] | None, ...] = (None,) * len(sources)
    count, apart = 0, 0.0
    bare: list[list[Image]] = [[] for _ in sources]
    without = [0] * len(sources)
    for frames in _instants(sources, max_skew):
        got = [f for f in frames if f is not None]
        now = tuple(None if f is None else (f.pixels.shape[1], f.pixels.shape[0]) for f in frames)
        known = tuple(a or b for a, b in zip(sizes, now, strict=True))
        if any(x not in (None, y) for x, y in zip(now, known, strict=True)):
            raise InputError("images", f"one size throughout, {sizes}", f"{now} at frame {count}")
        sizes = known
        sights = tuple((None, None) if f is None else board.sight(f.pixels) for f in frames)
        view = _either(sights)
        for k, (seen, f) in enumerate(zip(view, frames, strict=True)):
            if seen is None and f is not None:
                without[k] += 1
                bare[k] = (bare[k] + [f.pixels])[-8:]
        width = max(f.pixels.shape[1] for f in got)
        if any(view) and all(_apart(view, _either(old), width) for _, old in kept):
            kept.append((count, sights))
            stamps = [source.stamp for source in sources if source.timed]
            if max_skew is not None:
                stamps = [f.t for f in got]
            apart = max(apart, max(stamps) - min(stamps)) if stamps else apart
        count += 1
        progress("board", count, count + 1)
        enough = any(source.live for source in sources) and len(kept) == MOST_VIEWS
        if enough or count == _MOST_FRAMES:
            break
    if count == 0:
        raise InputError("images", "at least one", "none")
    shown = board.settle([sight for _, sights in kept for sight in sights])
    views = [(n, tuple(sight[board.legacy] for sight in sights)) for n, sights in kept]
    views = [(n, view) for n, view in views if any(view)]
    chosen = np.unique(np.linspace(0, len(views) - 1, min(len(views), MOST_VIEWS)).astype(int))
    return BoardViews(
        names=names,
        sizes=tuple(x for x in sizes if x is not None),
        views=tuple(views[k][1] for k in chosen),
        numbers=tuple(views[k][0] for k in chosen),
        frames=count,
        without=tuple(without),
        instead=tuple(
            shown_instead(board.spec, x) if n > _MANY * count else ""
            for x, n in zip(bare, without, strict=True)
        ),
        apart=apart,
        pattern=_pattern(legacy=board.legacy, shown=shown and bool(kept)),
    )


def _instants(
    sources: Sequence[ImageSource], max_skew: float | None
) -> Iterator[tuple[Frame | None, ...]]:
    """Yield the frames of each instant, None of a camera that has none; see above."""
    if max_skew is not None and len(sources) == 2:
        left, right = sources
        for frames in pairs((left, right), PairCounts(), max_skew=max_skew, most=None):
            alone = (frames[0], None) if frames[0].camera == 0 else (None, frames[0])
            yield frames if len(frames) == 2 else alone
        return
    for count in range(_MOST_FRAMES):
        read = tuple(source.read() for source in sources)
        if all(f is None for f in read):
            return
        if None in read:
            ended = ", ".join(s.name for s, f in zip(sources, read, strict=True) if f is None)
            raise InputError("images", "as many from each camera", f"{count} only from {ended}")
        yield read


def _either(sights: tuple[Sight, ...]) -> View:
    """Return what each camera saw by either pattern."""
    return tuple(a or b for a, b in sights)


def _pattern(*, legacy: bool, shown: bool) -> str:
    """Return what to say of the pattern of a board; nothing where it is that of today."""
    if legacy:
        return "the board has the pattern of boards drawn before OpenCV 4.6, and is read so"
    return (
        ""
        if shown
        else (
            "no view shows the board's outer columns: if it was drawn before"
            " OpenCV 4.6, the place of the board is a square off; add a view of"
            " the whole board"
        )
    )


def _apart(a: View, b: View, width: int) -> bool:
    """Say whether two views differ: the board moved by 2 % of the width, or others see it."""
    for one, two in zip(a, b, strict=True):
        if (one is None) != (two is None):
            return True
        if one is not None and two is not None:
            _, i, j = np.intersect1d(one.ids, two.ids, return_indices=True)
            motion = np.abs(one.uv[i] - two.uv[j]).mean() if len(i) else np.inf
            if motion > 0.02 * width:
                return True
    return False


def free_numbers(coefficients: int) -> NDArray[np.bool_]:
    """Return which numbers of a lens are found with 0, 1, 2, 4 or 5 distortion coefficients."""
    if coefficients not in (0, 1, 2, 4, 5):
        raise InputError("--coefficients", "0, 1, 2, 4 or 5", coefficients)
    return np.arange(9) < 4 + coefficients


def board_problem(board: Board, seen: BoardViews, free: NDArray[np.bool_]) -> BoardProblem:
    """Return the problem at a first guess: OpenCV's, or plain lenses where those fit better.

    OpenCV's lens is none where the views leave it open, as when all boards face the camera.
    """
    guesses = []
    for k, (name, size) in enumerate(zip(seen.names, seen.sizes, strict=True)):
        mine = [v for view in seen.views if (v := view[k]) is not None]
        if len(mine) < FEWEST:
            raise InputError(
                f"camera {name}",
                f"the board in {FEWEST} different views or more",
                f"{len(mine)} of {seen.frames} images{_shown(seen, k)}",
                do="check --board, --square, --dictionary, light and focus",
            )
        guesses.append((board.lens(mine, size, free), first_lens(size)))
    starts = [_started(board, seen, free, lenses) for lenses in zip(*guesses, strict=True)]
    return min(starts, key=lambda problem: float(np.abs(problem.residuals()).max()))


def _shown(seen: BoardViews, k: int) -> str:
    """Return what a camera's images without a board show."""
    instead = seen.instead[k] if seen.instead else ""
    return f", and the others show {instead}" if instead else ""


def _left_out(seen: BoardViews) -> list[str]:
    """Return what to say of images that were left out."""
    said = [
        f"{name}: no board in {n} of {seen.frames} images{_shown(seen, k)}: they are left out"
        for k, (name, n) in enumerate(zip(seen.names, seen.without, strict=False))
        if n > _MANY * seen.frames
    ]
    if seen.apart > 2e-3:
        said.append(
            f"images of one view were taken up to {1e3 * seen.apart:.0f} ms apart: start"
            " the cameras by one trigger, set their clocks alike, or hold the board"
            " still"
        )
    return [*said, seen.pattern] if seen.pattern else said


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
    parts = [(k, n, v) for n, view in enumerate(seen.views) for k, v in enumerate(view) if v]
    corners = Corners(
        camera=np.concatenate([np.full(len(v.ids), k) for k, _, v in parts]),
        view=np.concatenate([np.full(len(v.ids), n) for _, n, v in parts]),
        on_board=np.concatenate([board.corners[v.ids] for _, _, v in parts]),
        uv=np.concatenate([v.uv for _, _, v in parts]),
    )
    return BoardProblem(
        corners=corners,
        lenses=np.array([lens.numbers for lens in lenses]),
        T_cam_rig=np.array(T_cam_rig),
        T_rig_board=np.array(boards),
        free=free,
        cameras=seen.names,
    )


def calibrate_boards(
    board: Board, seen: BoardViews, *, coefficients: int
) -> tuple[CalibratedRig, Fit[BoardProblem], CalibrationStage]:
    """Return the rig in the frame of its first camera, the solution, and what to say about it."""
    solved = fit(board_problem(board, seen, free_numbers(coefficients)))
    problem, cameras, few = solved.problem, [], []
    numbers: dict[str, float] = {
        "views": len(seen.views),
        "frames": seen.frames,
        "rms_px": solved.rms,
        **{f"{name}_without_board": n for name, n in zip(seen.names, seen.without, strict=False)},
    }
    r = problem.residuals().reshape(-1, 2)
    for k, (name, size) in enumerate(zip(seen.names, seen.sizes, strict=True)):
        mine, lens = problem.corners.camera == k, problem.lenses[k]
        rms = float(np.sqrt(np.mean(r[mine] ** 2)))
        covered = _coverage(problem.corners.uv[mine], size)
        cameras.append(
            RigCamera(
                name=name,
                lens=Lens(width=size[0], height=size[1], numbers=lens),
                T_world_cam=inverse(problem.T_cam_rig[k]),
                rms_px=rms,
            )
        )
        numbers |= {
            f"{name}_rms_px": rms,
            f"{name}_coverage": covered,
            f"{name}_f_px": float(np.sqrt(np.prod(lens[:2]))),
            f"{name}_f_sigma_px": solved.sigma_of(f"{name}.fu"),
        }
        if covered < 0.6:
            few.append(
                f"{name}: corners in {100 * covered:.0f} % of the image only: "
                "add views with the board near the edges and corners"
            )
    rig = CalibratedRig(frame="camera", cameras=tuple(cameras))
    if len(cameras) > 1:
        numbers |= _base_line(solved)
    warnings = [*weak(solved, _limits(rig, problem))]
    if solved.status != "converged":
        warnings.append("the fit did not settle: the views are too much alike")
    warnings += [*few, *_left_out(seen)]
    return rig, solved, CalibrationStage("boards", solved.status, numbers, tuple(warnings))


def _coverage(uv: Array, size: tuple[int, int]) -> float:
    """Return the share of the image's cells in which a corner, shape (n, 2), lies."""
    bins = [np.linspace(-0.5, n - 0.5, cells + 1) for n, cells in zip(size, CELLS, strict=True)]
    return float(np.mean(np.histogram2d(uv[:, 0], uv[:, 1], bins=bins)[0] > 0))


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
        wanted = dict.fromkeys(NUMBERS[:2], (0.01 * f, tilted))
        wanted |= dict.fromkeys(NUMBERS[2:4], (0.01 * lens.width, rolled))
        wanted |= {
            name: (2.0 / (f * reach**power), edges)
            for name, power in zip(NUMBERS[4:], (3, 5, 2, 2, 7), strict=True)
        }
        limits |= {
            f"{camera.name}.{name}": wanted[name]
            for name, free in zip(NUMBERS, problem.free, strict=True)
            if free
        }
    for k, camera in enumerate(rig.cameras[1:], 1):
        base = float(np.linalg.norm(problem.T_cam_rig[k][:3, 3]))
        for axis in "xyz":
            limits[f"{camera.name}.turn_{axis}"] = (3e-3, shared)
            limits[f"{camera.name}.{axis}"] = (0.01 * base, shared)
    return limits
