"""ChArUco boards in images, by OpenCV: corners found, a first guess of lens and poses.

Where there is no board, it is said what an image shows instead.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import chain, product
from typing import Any, TypeAlias, final

import numpy as np
from numpy.typing import NDArray

from mitt.core.errors import InputError, UnknownNameError
from mitt.core.eyes.camera import inverse
from mitt.core.eyes.lens import Lens
from mitt.core.signals import Array, Image
from mitt.robot.cameras.cameras import optional

OpenCv: TypeAlias = Any
"""A module or an object of OpenCV, which has no types."""

#: Fewest corners of a board in an image that are used.
FEWEST_CORNERS = 6
#: How much better markers fit one of two patterns that is the board's.
_CLEARLY = 3.0
#: Sizes of boards that are tried where markers lie otherwise [squares].
_SIZES = range(3, 15)
#: Fewest markers by which a board is named.
_SEVERAL = 4
#: Families of markers that are looked for.
_FAMILIES = ("4X4", "5X5", "6X6", "7X7", "ARUCO_ORIGINAL", "APRILTAG_36h11")


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
            raise InputError(
                "--board", "3 to 100 squares either way", f"{self.columns}x{self.rows}"
            )
        if not 0.0 < self.marker < self.square < 10.0:
            raise InputError(
                "--marker",
                "0 < marker < square < 10 m",
                f"marker {self.marker}, square {self.square}",
            )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class BoardCorners:
    """Corners of the board in one image.

    Attributes:
        ids: Number of each corner, shape (n,).
        uv: Where it is [px], shape (n, 2).
    """

    ids: NDArray[np.int64]
    uv: Array


Sight: TypeAlias = tuple[BoardCorners | None, BoardCorners | None]
"""An image's corners by the pattern of today, and by that before OpenCV 4.6."""


@final
class Board:
    """A board that can be found.

    Attributes:
        spec: What it is.
        corners: Every corner on the board, z = 0 [m], shape (m, 3).
        legacy: Whether it has the pattern of boards drawn before OpenCV 4.6; see :meth:`settle`.
    """

    def __init__(self, spec: BoardSpec) -> None:
        """Set the detector up."""
        self._cv2 = optional("cv2")
        aruco = self._cv2.aruco
        names = sorted(n.removeprefix("DICT_") for n in vars(aruco) if n.startswith("DICT_"))
        if spec.dictionary not in names:
            raise UnknownNameError("--dictionary", spec.dictionary, names)
        markers = aruco.getPredefinedDictionary(vars(aruco)[f"DICT_{spec.dictionary}"])
        needed = spec.columns * spec.rows // 2
        if needed > len(markers.bytesList):
            raise InputError("--dictionary", f"{needed} markers or more", spec.dictionary)
        self.spec, self.legacy = spec, False
        patterns = (False, True) if spec.rows % 2 == 0 else (False,)
        boards = [_drawn(self._cv2, spec, markers, legacy=legacy) for legacy in patterns]
        self.board = boards[0]
        self._boards = boards
        self._detectors = [aruco.CharucoDetector(board) for board in boards]
        self.corners = np.asarray(self.board.getChessboardCorners(), dtype=np.float64)

    def sight(self, pixels: Image) -> Sight:
        """Return the corners in an image by the pattern of today and by that before OpenCV 4.6.

        None where too few of them are seen, or where the markers lie as the other one has them. A
        board with an odd number of rows has one pattern, and so has a view that does not show it.
        """
        uv, ids, markers, names = self._detectors[0].detectBoard(pixels)
        today = self._seen(uv, ids)
        if len(self._boards) == 1 or names is None:
            return today, None
        now, before = (_misfit(self._cv2, x, markers, names.ravel()) for x in self._boards)
        if before > _CLEARLY * now:
            return today, None
        uv, ids, _, _ = self._detectors[1].detectBoard(
            pixels, markerCorners=markers, markerIds=names
        )
        return (None if now > _CLEARLY * before else today), self._seen(uv, ids)

    def settle(self, sights: Sequence[Sight]) -> bool:
        """Settle the pattern by what was seen of it; say whether a view shows which it is."""
        today, before = (sum(s[k] is not None and s[1 - k] is None for s in sights) for k in (0, 1))
        self.legacy = before > today if before or today else self.legacy
        return bool(before or today or len(self._boards) == 1)

    def _seen(self, uv: OpenCv, ids: OpenCv) -> BoardCorners | None:
        """Return corners that OpenCV found; None where they are too few, or lie on a line."""
        if ids is None or len(ids) < FEWEST_CORNERS:
            return None
        seen = BoardCorners(
            ids=ids.ravel().astype(np.int64), uv=uv.reshape(-1, 2).astype(np.float64)
        )
        rank = np.linalg.svd(self.corners[seen.ids] - self.corners[seen.ids].mean(axis=0))[1]
        return seen if rank[1] > 1e-3 else None

    def lens(
        self, views: list[BoardCorners], size: tuple[int, int], free: NDArray[np.bool_]
    ) -> Lens:
        """Return a first guess of a lens whose wanted numbers are ``free``, shape (9,)."""
        cv2 = self._cv2
        fixed = {
            4: cv2.CALIB_FIX_K1,
            5: cv2.CALIB_FIX_K2,
            6: cv2.CALIB_ZERO_TANGENT_DIST,
            8: cv2.CALIB_FIX_K3,
        }
        flags = sum(flag for number, flag in fixed.items() if not free[number])
        points = [self.corners[v.ids].astype(np.float32) for v in views]
        images = [v.uv.astype(np.float32) for v in views]
        try:
            _, K, bend, _, _ = cv2.calibrateCamera(points, images, size, None, None, flags=flags)
        except cv2.error as error:
            raise InputError(
                "board",
                "views that fix a lens",
                str(error.err)[:100],
                do="add views of a board that is tilted by 20 to 40 degrees",
            ) from error
        numbers = np.array((K[0, 0], K[1, 1], K[0, 2], K[1, 2], *np.ravel(bend)[:5]))
        # A focal length of 15 times the image's width, or a fifteenth of it, is not believed.
        likely = np.all(np.abs(np.log(numbers[:2].clip(1e-9) / size[0])) < np.log(15.0))
        return Lens(width=size[0], height=size[1], numbers=numbers) if likely else first_lens(size)

    def pose(self, seen: BoardCorners, lens: Lens) -> Array:
        """Return T_cam_board [m], shape (4, 4), of one view; the flat board's two are compared."""
        xy = lens.undistort(seen.uv)
        good = np.isfinite(xy).all(axis=1)
        points, xy = self.corners[seen.ids][good], xy[good]
        if len(xy) < 4:
            raise InputError("board", "corners that the lens can show", len(xy))
        flat = self._cv2.SOLVEPNP_IPPE
        found: OpenCv = self._cv2.solvePnPGeneric(points, xy, np.eye(3), None, flags=flat)
        T = np.eye(4)
        T[:3, :3] = self._cv2.Rodrigues(found[1][0])[0]
        T[:3, 3] = np.ravel(found[2][0])
        return T


def first_lens(size: tuple[int, int]) -> Lens:
    """Return the lens to begin with where views tell nothing: 53 degrees wide, not bent."""
    width, height = size
    middle = (0.5 * (width - 1), 0.5 * (height - 1))
    numbers = np.array((width, width, *middle, 0.0, 0.0, 0.0, 0.0, 0.0), dtype=np.float64)
    return Lens(width=width, height=height, numbers=numbers)


def between(ours: list[Array], theirs: list[Array]) -> Array:
    """Return T_their_our, shape (4, 4), from T_cam_board of two cameras in each common view.

    It is the one of all views that is nearest to the median.
    """
    poses = np.array([b @ inverse(a) for a, b in zip(ours, theirs, strict=True)])
    far = np.linalg.norm((poses - np.median(poses, axis=0))[:, :3], axis=(1, 2))
    return np.asarray(poses[int(np.argmin(far))])


def _misfit(cv2: OpenCv, board: OpenCv, corners: Sequence[Array], ids: Array) -> float:
    """Return how far markers in an image are from where they lie on a board [squares].

    Root mean square after the best perspective; infinite where fewer than two are the board's.
    ``corners`` of each marker have shape (1, 4, 2) [px], ``ids`` are their numbers.
    """
    square = board.getSquareLength()
    points = dict(zip(np.ravel(board.getIds()).tolist(), board.getObjPoints(), strict=True))
    known = [k for k, name in enumerate(ids.tolist()) if name in points]
    if len(known) < 2:
        return float("inf")
    seen = np.concatenate([np.reshape(corners[k], (4, 2)) for k in known]).astype(np.float64)
    places = [np.asarray(points[int(ids[k])], dtype=np.float64)[:, :2] / square for k in known]
    wanted = np.concatenate(places)
    H, _ = cv2.findHomography(seen, wanted, 0)
    if H is None:
        return float("inf")
    off = cv2.perspectiveTransform(seen[None], H)[0] - wanted
    return float(np.sqrt(np.mean(np.sum(off**2, axis=1))))


def _drawn(cv2: OpenCv, spec: BoardSpec, markers: OpenCv, *, legacy: bool) -> OpenCv:
    """Return a board of OpenCV, in the pattern of today or in that before its version 4.6."""
    board = cv2.aruco.CharucoBoard((spec.columns, spec.rows), spec.square, spec.marker, markers)
    board.setLegacyPattern(legacy)
    return board


def shown_instead(spec: BoardSpec, images: Sequence[Image]) -> str:
    """Return what images show in the place of a board, in words: of the first that shows any."""
    cv2 = optional("cv2")
    looked = chain(
        (_own_markers(cv2, spec, x) for x in images),
        (_other_markers(cv2, x) for x in images[:3]),
        (_checkerboard(cv2, spec, x) for x in images),
    )
    return next(filter(None, looked), "no markers")


def _own_markers(cv2: OpenCv, spec: BoardSpec, image: Image) -> str:
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


def _checkerboard(cv2: OpenCv, spec: BoardSpec, image: Image) -> str:
    """Return which board without markers is in an image; nothing without one."""
    quick = cv2.CALIB_CB_ADAPTIVE_THRESH | cv2.CALIB_CB_FAST_CHECK
    for columns, rows in ((spec.columns, spec.rows), (spec.rows, spec.columns)):
        if cv2.findChessboardCorners(image, (columns - 1, rows - 1), flags=quick)[0]:
            return f"a checkerboard of {columns}x{rows} squares without markers"
    return ""


def _other_markers(cv2: OpenCv, image: Image) -> str:
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
    cv2: OpenCv, spec: BoardSpec, markers: OpenCv, corners: Sequence[Array], ids: Array
) -> str:
    """Return which board has markers where an image has them."""
    needed = spec.columns * spec.rows // 2
    if ids.max() >= needed:
        return (
            f"markers {ids.min()}..{ids.max()}, a board of {spec.columns}x{spec.rows} has"
            f" 0..{needed - 1}"
        )
    for columns, rows in sorted(product(_SIZES, _SIZES), key=lambda size: size[0] * size[1]):
        count = columns * rows // 2
        if count <= ids.max() or len(markers.bytesList) < count:
            continue
        size = replace(spec, columns=columns, rows=rows)
        board = _drawn(cv2, size, markers, legacy=False)
        if _misfit(cv2, board, corners, ids) < 0.15 and size != spec:
            return f"a board of {columns}x{rows} squares"
    return f"{len(ids)} markers, but too few corners between them"
