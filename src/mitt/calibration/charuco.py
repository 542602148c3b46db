"""ChArUco boards in images, by OpenCV: corners found, and a first guess of lens and poses."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias, final

import numpy as np
from numpy.typing import NDArray

from mitt.calibration.patterns import BoardSpec as BoardSpec  # noqa: PLC0414 (public here)
from mitt.calibration.patterns import Layout, drawn_board
from mitt.cameras.source import optional
from mitt.errors import InputError, UnknownNameError
from mitt.signals import Array, Image
from mitt.vision.lens import Lens
from mitt.vision.poses import inverse

#: Fewest corners of a board in an image that are used.
FEWEST_CORNERS = 6
#: Focal length over the image's width, and its inverse, beyond which a guess is not believed.
_LIKELY = 15.0
#: How much better markers fit one of two patterns that is the board's.
_CLEARLY = 3.0


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Seen:
    """Corners of the board in one image.

    Attributes:
        ids: Number of each corner, shape (n,).
        uv: Where it is [px], shape (n, 2).
    """

    ids: NDArray[np.int64]
    uv: Array


Sight: TypeAlias = tuple[Seen | None, Seen | None]
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
        """Set the detector up.

        Raises:
            UnknownNameError: OpenCV has no such dictionary.
        """
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
        boards = [drawn_board(aruco, spec, markers, legacy=legacy) for legacy in patterns]
        self.board = boards[0]
        self._layouts = [Layout(self._cv2, board) for board in boards]
        self._detectors = [aruco.CharucoDetector(board) for board in boards]
        self.corners = np.asarray(self.board.getChessboardCorners(), dtype=np.float64)

    def sight(self, pixels: Image) -> Sight:
        """Return the corners in an image by the pattern of today and by that before OpenCV 4.6.

        None where too few of them are seen, or where the markers lie as the other one has them. A
        board with an odd number of rows has one pattern, and so has a view that does not show it.
        """
        uv, ids, markers, names = self._detectors[0].detectBoard(pixels)
        today = self._seen(uv, ids)
        if len(self._layouts) == 1 or names is None:
            return today, None
        now, before = (layout.misfit(markers, names.ravel()) for layout in self._layouts)
        if before > _CLEARLY * now:
            return today, None
        uv, ids, _, _ = self._detectors[1].detectBoard(
            pixels, markerCorners=markers, markerIds=names
        )
        return (None if now > _CLEARLY * before else today), self._seen(uv, ids)

    def find(self, pixels: Image) -> Seen | None:
        """Return the corners in an image, by the pattern that was settled; None without a board."""
        return self.sight(pixels)[self.legacy]

    def settle(self, sights: Sequence[Sight]) -> bool:
        """Settle the pattern by what was seen of it; say whether a view shows which it is."""
        today, before = (sum(s[k] is not None and s[1 - k] is None for s in sights) for k in (0, 1))
        self.legacy = before > today if before or today else self.legacy
        return bool(before or today or len(self._layouts) == 1)

    def _seen(self, uv: Any, ids: Any) -> Seen | None:  # noqa: ANN401 (arrays of OpenCV, or None)
        """Return corners that OpenCV found; None where they are too few, or lie on a line."""
        if ids is None or len(ids) < FEWEST_CORNERS:
            return None
        seen = Seen(ids=ids.ravel().astype(np.int64), uv=uv.reshape(-1, 2).astype(np.float64))
        rank = np.linalg.svd(self.corners[seen.ids] - self.corners[seen.ids].mean(axis=0))[1]
        return seen if rank[1] > 1e-3 else None

    def lens(self, views: list[Seen], size: tuple[int, int], free: NDArray[np.bool_]) -> Lens:
        """Return a first guess of a lens.

        Args:
            views: What the camera saw.
            size: Width and height [px].
            free: Which numbers of the lens are wanted, shape (9,).

        Raises:
            InputError: OpenCV finds none.
        """
        cv2 = self._cv2
        fixed = {4: cv2.CALIB_FIX_K1, 5: cv2.CALIB_FIX_K2, 6: cv2.CALIB_ZERO_TANGENT_DIST,
                 8: cv2.CALIB_FIX_K3}  # fmt: skip
        flags = sum(flag for number, flag in fixed.items() if not free[number])
        points = [self.corners[v.ids].astype(np.float32) for v in views]
        images = [v.uv.astype(np.float32) for v in views]
        try:
            _, K, bend, _, _ = cv2.calibrateCamera(points, images, size, None, None, flags=flags)
        except cv2.error as error:
            raise InputError("board", "views that fix a lens", str(error.err)[:100],
                             do="add views of a board that is tilted by 20 to 40 degrees",
                             ) from error  # fmt: skip
        numbers = np.array((K[0, 0], K[1, 1], K[0, 2], K[1, 2], *np.ravel(bend)[:5]))
        likely = np.all(np.abs(np.log(numbers[:2].clip(1e-9) / size[0])) < np.log(_LIKELY))
        return Lens(width=size[0], height=size[1], numbers=numbers) if likely else plain(size)

    def pose(self, seen: Seen, lens: Lens) -> Array:
        """Return T_cam_board [m], shape (4, 4), of one view; the flat board's two are compared."""
        xy = lens.undistort(seen.uv)
        good = np.isfinite(xy).all(axis=1)
        points, xy = self.corners[seen.ids][good], xy[good]
        if len(xy) < 4:
            raise InputError("board", "corners that the lens can show", len(xy))
        found: Any = self._cv2.solvePnPGeneric(
            points, xy, np.eye(3), None, flags=self._cv2.SOLVEPNP_IPPE
        )
        T = np.eye(4)
        T[:3, :3] = self._cv2.Rodrigues(found[1][0])[0]
        T[:3, 3] = np.ravel(found[2][0])
        return T


def plain(size: tuple[int, int]) -> Lens:
    """Return the lens to begin with where views tell nothing: 53 degrees wide, not bent."""
    width, height = size
    middle = (0.5 * (width - 1), 0.5 * (height - 1))
    numbers = np.array((width, width, *middle, 0.0, 0.0, 0.0, 0.0, 0.0), dtype=np.float64)
    return Lens(width=width, height=height, numbers=numbers)


def between(ours: list[Array], theirs: list[Array]) -> Array:
    """Return T_their_our, shape (4, 4): the one of all common views that is nearest to the median.

    Args:
        ours: T_cam_board of one camera in each common view.
        theirs: The same of the other.
    """
    poses = np.array([b @ inverse(a) for a, b in zip(ours, theirs, strict=True)])
    far = np.linalg.norm((poses - np.median(poses, axis=0))[:, :3], axis=(1, 2))
    return np.asarray(poses[int(np.argmin(far))])
