"""Boards of the older pattern are read as such; what is shown in the place of a board is named."""

from collections.abc import Sequence
from dataclasses import replace

import cv2
import numpy as np
import pytest
from boards import SIZE, SPEC, drawn, true_lens

from mitt.core.errors import InputError
from mitt.core.eyes.camera import turned
from mitt.core.signals import Array, Image
from mitt.robot.cameras.board_calibration import board_problem, free_numbers, look_for_board
from mitt.robot.cameras.cameras import ImageSource
from mitt.robot.cameras.charuco import Board, BoardSpec, shown_instead


class Taken(ImageSource):
    """Images that were taken."""

    def __init__(self, images: list[Image], camera: int = 0, times: Sequence[float] = ()) -> None:
        """Take them, by their number or at times [s]."""
        super().__init__("taken", camera, None if times else 1.0)
        self._left = iter(zip(times or [0.0] * len(images), images, strict=True))

    def _grab(self) -> tuple[float, Image] | None:
        """Return the next one."""
        return next(self._left, None)

    def close(self) -> None:
        """Nothing is open."""


def _poses(board: Board) -> list[Array]:
    """Return four poses: two with the whole board, two with its middle only, nearer."""
    centre = board.corners.mean(axis=0)
    poses = []
    for turn, away, side in (
        (0.1, 0.75, 0.0),
        (-0.3, 0.4, 0.0),
        (0.25, 0.42, 0.03),
        (0.4, 0.8, 0.1),
    ):
        T = turned(np.eye(4), np.array((turn, 0.5 * turn, 0.1, 0.0, 0.0, 0.0)))
        T[:3, 3] = np.array((side, 0.0, away)) - T[:3, :3] @ centre
        poses.append(T)
    return poses


def _images(spec: BoardSpec, *, legacy: bool = False) -> tuple[list[Image], list[Array]]:
    """Return images of a board, and where its corners are in them."""
    board, lens, rng = Board(spec), true_lens(0.0), np.random.default_rng(1)
    board.board.setLegacyPattern(legacy)
    poses = _poses(board)
    images = [drawn(board, lens, T, rng) for T in poses]
    places = [lens.project(board.corners @ T[:3, :3].T + T[:3, 3]) for T in poses]
    return images, places


@pytest.mark.parametrize("order", [(0, 1, 2, 3), (1, 2, 3, 0)])
@pytest.mark.parametrize("legacy", [False, True])
@pytest.mark.parametrize("size", [(9, 6), (8, 6), (7, 5)])
def test_every_corner_has_its_own_number(
    size: tuple[int, int], legacy: bool, order: tuple[int, ...]
) -> None:
    """Whole and partial views, whichever comes first, of either pattern; odd rows have one."""
    spec = replace(SPEC, columns=size[0], rows=size[1])
    images, places = _images(spec, legacy=legacy)
    board = Board(spec)
    seen = look_for_board(
        board, [Taken([images[k] for k in order])], ("left",), progress=lambda *_: None
    )
    assert seen.without == (0,)
    assert len(seen.views) == len(order)
    for (view,), n in zip(seen.views, seen.numbers, strict=True):
        k = order[n]
        assert view is not None
        assert np.abs(view.uv - places[k][view.ids]).max() < 1.5
    assert board.legacy == (legacy and size[1] % 2 == 0)
    assert bool(seen.pattern) == board.legacy


@pytest.mark.parametrize("lost", [None, 0, 2])
def test_images_that_tell_their_times_are_paired_by_them(lost: int | None) -> None:
    """A camera that lost one has no view at that instant, and all others are of one instant."""
    images, places = _images(SPEC)
    left = Taken(images, 0, [0.0, 1.0, 2.0, 3.0])
    kept = [k for k in range(4) if k != lost]
    right = Taken([images[k] for k in kept], 1, [k + 0.01 for k in kept])
    seen = look_for_board(
        Board(SPEC), [left, right], ("left", "right"), progress=lambda *_: None, max_skew=0.4
    )
    assert len(seen.views) == 4
    for k, (one, other) in enumerate(seen.views):
        assert one is not None
        assert np.abs(one.uv - places[k][one.ids]).max() < 1.5
        assert (other is None) == (k == lost)
        assert other is None or np.array_equal(other.uv, one.uv)
    assert seen.without == (0, 0)
    assert seen.apart == pytest.approx(0.01)


def test_a_pattern_that_no_view_shows_is_said() -> None:
    """The middle of a board looks alike in both."""
    images, _ = _images(SPEC)
    seen = look_for_board(Board(SPEC), [Taken(images[1:3])], ("left",), progress=lambda *_: None)
    assert "outer columns" in seen.pattern


def _flat(spec: BoardSpec) -> Image:
    """Return the picture of a board with a white rim."""
    picture = Board(spec).board.generateImage((60 * spec.columns, 60 * spec.rows))
    return np.asarray(cv2.copyMakeBorder(picture, 60, 60, 60, 60, cv2.BORDER_CONSTANT, value=255))


def _checkers() -> Image:
    """Return the picture of a checkerboard."""
    squares = np.kron(np.indices((6, 9)).sum(axis=0) % 2, np.ones((60, 60))) * 255.0
    return np.asarray(np.pad(squares, 60, constant_values=255.0), dtype=np.uint8)


_OTHERS = {
    "a board of 6x9 squares": _flat(replace(SPEC, columns=6, rows=9)),
    "a board of 7x5 squares": _flat(replace(SPEC, columns=7, rows=5)),
    "markers 0..26 of 5X5_50": _flat(replace(SPEC, dictionary="5X5_50")),
    "a checkerboard of 9x6 squares without markers": _checkers(),
    "mirrored": np.ascontiguousarray(_flat(SPEC)[:, ::-1]),
    "inverted": 255 - _flat(SPEC),
    "no markers": np.full(SIZE[::-1], 128, dtype=np.uint8),
    "a board of 9x6 has 0..26": _flat(replace(SPEC, columns=10, rows=8)),
}


@pytest.mark.parametrize("what", _OTHERS)
def test_what_is_shown_in_the_place_of_a_board_is_named(what: str) -> None:
    """In words, with a size or a dictionary that can be typed."""
    assert what in shown_instead(SPEC, [_OTHERS[what]])


def test_images_without_the_board_are_counted_and_said() -> None:
    """The refusal of a camera names what it showed."""
    images = [_OTHERS["a board of 6x9 squares"]] * 4
    board = Board(SPEC)
    seen = look_for_board(board, [Taken(images)], ("left",), progress=lambda *_: None)
    assert seen.without == (4,)
    with pytest.raises(InputError, match=r"0 of 4 images, and the others show a board of 6x9"):
        board_problem(board, seen, free_numbers(0))
