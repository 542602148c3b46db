"""Views of a ChArUco board: found in the images of all cameras, far enough from one another."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from mitt.errors import InputError
from mitt.link.cameras.source import Camera
from mitt.link.charuco import Board, Seen
from mitt.signals import Array
from mitt.vision.calibration.boards import Corners

#: Most views used; most frames looked at in a video.
MOST_VIEWS, MOST_FRAMES = 60, 20_000
#: Cells across and down the image in which coverage is counted.
CELLS = (6, 4)
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


def corners_of(board: Board, seen: BoardViews) -> Corners:
    """Return all corners of all views in one list."""
    parts = [(k, n, v) for n, view in enumerate(seen.views) for k, v in enumerate(view) if v]
    return Corners(
        camera=np.concatenate([np.full(len(v.ids), k) for k, _, v in parts]),
        view=np.concatenate([np.full(len(v.ids), n) for _, n, v in parts]),
        on_board=np.concatenate([board.corners[v.ids] for _, _, v in parts]),
        uv=np.concatenate([v.uv for _, _, v in parts]),
    )


def coverage(uv: Array, size: Size) -> float:
    """Return the share of the image's cells in which a corner, shape (n, 2), lies."""
    bins = [np.linspace(-0.5, n - 0.5, cells + 1) for n, cells in zip(size, CELLS, strict=True)]
    return float(np.mean(np.histogram2d(uv[:, 0], uv[:, 1], bins=bins)[0] > 0))
