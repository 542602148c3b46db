"""Patterns of boards: where markers lie on one, and what an image shows that is not the board."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import chain, product
from typing import Any, final

import numpy as np

from mitt.cameras.source import optional
from mitt.errors import InputError
from mitt.signals import Array, Image

#: Sizes of boards that are tried where markers lie otherwise, and the error of a fit [squares].
_SIZES, _FITS = range(3, 15), 0.15
#: Fewest markers by which a board is named.
_SEVERAL = 4
#: Families of markers that are looked for, and most images in which they are.
_FAMILIES = ("4X4", "5X5", "6X6", "7X7", "ARUCO_ORIGINAL", "APRILTAG_36h11")
_SLOW = 3


@dataclass(frozen=True, slots=True, kw_only=True)
class BoardSpec:
    """A ChArUco board.

    Attributes:
        columns: Squares in a row.
        rows: Squares in a column.
        square: Side of a square [m].
        marker: Side of a marker [m].
        dictionary: Markers, as 4X4_50.
    """

    columns: int = 9
    rows: int = 6
    square: float = 0.03
    marker: float = 0.022
    dictionary: str = "4X4_50"

    def __post_init__(self) -> None:
        """Refuse a board that cannot be printed."""
        if min(self.columns, self.rows) < 3 or max(self.columns, self.rows) > 100:
            raise InputError("--board", "3 to 100 squares either way",
                             f"{self.columns}x{self.rows}")  # fmt: skip
        if not 0.0 < self.marker < self.square < 10.0:
            raise InputError("--marker", "0 < marker < square < 10 m",
                             f"marker {self.marker}, square {self.square}")  # fmt: skip


@final
class Layout:
    """Where the markers of a board lie."""

    def __init__(self, cv2: Any, board: Any) -> None:  # noqa: ANN401 (OpenCV has no types)
        """Take a board of OpenCV."""
        self._cv2 = cv2
        square = board.getSquareLength()
        points = (np.asarray(p, dtype=np.float64)[:, :2] / square for p in board.getObjPoints())
        self._points = dict(zip(np.ravel(board.getIds()).tolist(), points, strict=True))

    def misfit(self, corners: Sequence[Array], ids: Array) -> float:
        """Return how far markers in an image are from where they lie on the board [squares].

        Root mean square after the best perspective; infinite where fewer than two are the board's.

        Args:
            corners: Corners of each marker [px], shape (1, 4, 2) each.
            ids: Its number.
        """
        known = [k for k, name in enumerate(ids.tolist()) if name in self._points]
        if len(known) < 2:
            return float("inf")
        seen = np.concatenate([np.reshape(corners[k], (4, 2)) for k in known]).astype(np.float64)
        wanted = np.concatenate([self._points[int(ids[k])] for k in known])
        H, _ = self._cv2.findHomography(seen, wanted, 0)
        if H is None:
            return float("inf")
        off = self._cv2.perspectiveTransform(seen[None], H)[0] - wanted
        return float(np.sqrt(np.mean(np.sum(off**2, axis=1))))


def drawn_board(cv2_aruco: Any, spec: BoardSpec, markers: Any, *, legacy: bool) -> Any:  # noqa: ANN401
    """Return a board of OpenCV, in the pattern of today or in that before its version 4.6."""
    board = cv2_aruco.CharucoBoard((spec.columns, spec.rows), spec.square, spec.marker, markers)
    board.setLegacyPattern(legacy)
    return board


def shown_instead(spec: BoardSpec, images: Sequence[Image]) -> str:
    """Return what images show in the place of a board, in words: of the first that shows any."""
    cv2 = optional("cv2")
    looked = chain(
        (_own_markers(cv2, spec, x) for x in images),
        (_other_markers(cv2, x) for x in images[:_SLOW]),
        (_checkerboard(cv2, spec, x) for x in images),
    )
    return next(filter(None, looked), "no markers")


def _own_markers(cv2: Any, spec: BoardSpec, image: Image) -> str:  # noqa: ANN401 (no types)
    """Return how markers of the board's dictionary lie; nothing without several of them."""
    aruco = cv2.aruco
    markers = aruco.getPredefinedDictionary(vars(aruco)[f"DICT_{spec.dictionary}"])
    detector = aruco.ArucoDetector(markers)
    corners, ids, _ = detector.detectMarkers(image)
    if ids is not None and len(ids) >= _SEVERAL:
        return _other_board(cv2, spec, markers, corners, ids.ravel())
    for name, changed in (("mirrored", image[:, ::-1]), ("inverted", 255 - image)):
        found = detector.detectMarkers(np.ascontiguousarray(changed))[1]
        if found is not None and len(found) >= _SEVERAL:
            return f"a board that is {name}: print it anew, or set the camera right"
    return ""


def _checkerboard(cv2: Any, spec: BoardSpec, image: Image) -> str:  # noqa: ANN401 (no types)
    """Return which board without markers is in an image; nothing without one."""
    quick = cv2.CALIB_CB_ADAPTIVE_THRESH | cv2.CALIB_CB_FAST_CHECK
    for columns, rows in ((spec.columns, spec.rows), (spec.rows, spec.columns)):
        if cv2.findChessboardCorners(image, (columns - 1, rows - 1), flags=quick)[0]:
            return f"a checkerboard of {columns}x{rows} squares without markers"
    return ""


def _other_markers(cv2: Any, image: Image) -> str:  # noqa: ANN401 (no types)
    """Return which markers of other dictionaries are in an image; nothing without several."""
    aruco = cv2.aruco
    for family in _FAMILIES:
        sizes = [n for n in (50, 100, 250, 1000) if f"DICT_{family}_{n}" in vars(aruco)]
        name = f"DICT_{family}_{sizes[-1]}" if sizes else f"DICT_{family}"
        detector = aruco.ArucoDetector(aruco.getPredefinedDictionary(vars(aruco)[name]))
        ids = detector.detectMarkers(image)[1]
        if ids is not None and len(ids) >= _SEVERAL:
            size = next((f"_{n}" for n in sizes if n > ids.max()), "")
            return f"markers {ids.min()}..{ids.max()} of {family}{size}"
    return ""


def _other_board(
    cv2: Any,  # noqa: ANN401
    spec: BoardSpec,
    markers: Any,  # noqa: ANN401
    corners: Sequence[Array],
    ids: Array,
) -> str:
    """Return which board has markers where an image has them."""
    needed = spec.columns * spec.rows // 2
    if ids.max() >= needed:
        return (f"markers {ids.min()}..{ids.max()}, a board of {spec.columns}x{spec.rows} has"
                f" 0..{needed - 1}")  # fmt: skip
    for columns, rows in sorted(product(_SIZES, _SIZES), key=lambda size: size[0] * size[1]):
        count = columns * rows // 2
        if count <= ids.max() or len(markers.bytesList) < count:
            continue
        size = replace(spec, columns=columns, rows=rows)
        layout = Layout(cv2, drawn_board(cv2.aruco, size, markers, legacy=False))
        if layout.misfit(corners, ids) < _FITS and size != spec:
            return f"a board of {columns}x{rows} squares"
    return f"{len(ids)} markers, but too few corners between them"
