"""How a lens bends rays, and images bent or made straight.

The Brown-Conrady model in front of a pinhole.

With (x, y) = (X / Z, Y / Z) in the optical frame and r^2 = x^2 + y^2:

    x' = x (1 + k1 r^2 + k2 r^4 + k3 r^6) + 2 p1 x y + p2 (r^2 + 2 x^2)
    y' = y (1 + k1 r^2 + k2 r^4 + k3 r^6) + p1 (r^2 + 2 y^2) + 2 p2 x y
    u = fu x' + cu,  v = fv y' + cv

D. C. Brown, Close-range camera calibration, Photogrammetric Engineering 37 (1971) 855-866; order
of the coefficients as in OpenCV.

| here         | meaning                                       | unit | shape  |
|--------------|-----------------------------------------------|------|--------|
| ``numbers``  | fu, fv, cu, cv [px], k1, k2, p1, p2, k3 [1]    |      | (9,)   |
| ``xy``       | ideal image point at unit distance            | 1    | (n, 2) |
| ``uv``       | image point                                   | px   | (n, 2) |
"""

from dataclasses import dataclass
from typing import final

import numpy as np
from numpy.typing import NDArray

from mitt.core.errors import InputError, ShapeError
from mitt.core.eyes.camera import Camera
from mitt.core.kernels import kernel
from mitt.core.signals import Array, Image

#: Names of the numbers of a lens, in order.
NUMBERS = ("fu", "fv", "cu", "cv", "k1", "k2", "p1", "p2", "k3")

_STEPS = 20
"""Newton steps to undo a distortion; five suffice for lenses of less than 100 degrees."""
_PARTS = 256
"""Parts of a pixel that a weight of the interpolation counts in."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Lens:
    """A lens and the image behind it.

    Attributes:
        width: Columns [px].
        height: Rows [px].
        numbers: fu, fv, cu, cv [px], k1, k2, p1, p2, k3 [1], shape (9,).
    """

    width: int
    height: int
    numbers: Array

    def __post_init__(self) -> None:
        """Refuse numbers that are no lens."""
        if self.numbers.shape != (9,):
            raise ShapeError("lens", "(9,)", self.numbers.shape)
        focal = self.numbers[:2]
        if not np.all(np.isfinite(self.numbers)) or focal.min() <= 0.0:
            raise InputError("lens", "finite numbers and focal lengths > 0", self.numbers.tolist())
        if not 0.5 < focal[0] / focal[1] < 2.0:
            raise InputError("lens", "pixels that are nearly square", focal.tolist())

    def project(self, p_cam: Array) -> Array:
        """Return the image points [px], shape (n, 2), of points [m], shape (n, 3), ahead."""
        bent = distort(p_cam[:, :2] / p_cam[:, 2:], self.numbers[4:])[0]
        return np.asarray(bent * self.numbers[:2] + self.numbers[2:4])

    def undistort(self, uv: Array) -> Array:
        """Return the ideal points at unit distance [1], shape (n, 2), of image points [px].

        NaN where no point of the model appears, as far outside a strongly bent image.
        """
        seen = (uv - self.numbers[2:4]) / self.numbers[:2]
        xy = seen.copy()
        with np.errstate(all="ignore"):
            for _ in range(_STEPS):
                bent, by_xy, _ = distort(xy, self.numbers[4:])
                error = bent - seen
                if np.nanmax(np.abs(error), initial=0.0) < 1e-14:
                    break
                (a, b), (c, d) = by_xy[:, 0].T, by_xy[:, 1].T
                det = a * d - b * c
                det = np.where(det > 0.05, det, np.nan)  # folded over: not what a lens does
                e, f = error.T
                xy = xy - np.column_stack(((d * e - b * f) / det, (a * f - c * e) / det))
            left = np.abs(distort(xy, self.numbers[4:])[0] - seen).max(axis=1)
        xy[~(left < 1e-9)] = np.nan
        return np.asarray(xy)

    def pinhole(self, T_world_cam: Array) -> Camera:
        """Return the camera without distortion, with square pixels, to which ``straighten`` maps.

        Args:
            T_world_cam: Pose of the optical frame in the world [m], shape (4, 4).
        """
        fu, fv, cu, cv = self.numbers[:4]
        return Camera(
            width=self.width,
            height=self.height,
            f_px=float(np.sqrt(fu * fv)),
            cu=float(cu),
            cv=float(cv),
            T_world_cam=T_world_cam,
        )

    def straighten(self, uv: Array) -> Array:
        """Return where image points [px], shape (n, 2), lie in the image of ``pinhole``."""
        fu, fv = self.numbers[:2]
        return np.asarray(self.undistort(uv) * np.sqrt(fu * fv) + self.numbers[2:4])


def distort(xy: Array, k: Array) -> tuple[Array, Array, Array]:
    """Return bent points and their derivatives.

    Args:
        xy: Ideal points at unit distance [1], shape (n, 2).
        k: k1, k2, p1, p2, k3 [1], shape (5,).

    Returns:
        Bent points, shape (n, 2); derivatives with respect to ``xy``, shape (n, 2, 2), and to
        ``k``, shape (n, 2, 5).
    """
    x, y = xy[:, 0], xy[:, 1]
    k1, k2, p1, p2, k3 = k
    r2 = x * x + y * y
    radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))
    slope = 2.0 * (k1 + r2 * (2.0 * k2 + 3.0 * r2 * k3))  # d radial / d(x) = slope * x
    bent = np.column_stack(
        (
            x * radial + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x),
            y * radial + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y,
        )
    )
    across = slope * x * y + 2.0 * p1 * x + 2.0 * p2 * y
    by_xy = np.empty((len(xy), 2, 2))
    by_xy[:, 0, 0] = radial + slope * x * x + 2.0 * p1 * y + 6.0 * p2 * x
    by_xy[:, 0, 1] = by_xy[:, 1, 0] = across
    by_xy[:, 1, 1] = radial + slope * y * y + 6.0 * p1 * y + 2.0 * p2 * x
    by_k = np.empty((len(xy), 2, 5))
    by_k[:, :, 0] = xy * r2[:, None]
    by_k[:, :, 1] = xy * (r2**2)[:, None]
    by_k[:, :, 4] = xy * (r2**3)[:, None]
    by_k[:, 0, 2] = by_k[:, 1, 3] = 2.0 * x * y
    by_k[:, 1, 2] = r2 + 2.0 * y * y
    by_k[:, 0, 3] = r2 + 2.0 * x * x
    return bent, by_xy, by_k


@kernel
def _resample(
    image: Image, corners: NDArray[np.int64], weights: NDArray[np.int64], out: Image
) -> None:
    """Write an image whose pixels lie between those of another.

    Args:
        image: Grey values, shape (height, width).
        corners: Row and column of the pixel above and left of each place; -1 outside, shape (k, 2).
        weights: Of the column and the row behind it, of 256 parts, shape (k, 2).
        out: Result, shape (height, width); 0 outside.
    """
    flat = out.ravel()
    for k in range(len(flat)):
        v, u = corners[k]
        if v < 0:
            flat[k] = 0
            continue
        a, b = weights[k]
        above = (_PARTS - a) * np.int64(image[v, u]) + a * np.int64(image[v, u + 1])
        below = (_PARTS - a) * np.int64(image[v + 1, u]) + a * np.int64(image[v + 1, u + 1])
        flat[k] = ((_PARTS - b) * above + b * below + _PARTS * _PARTS // 2) // (_PARTS * _PARTS)


@final
class Resampler:
    """Makes one image out of another of the same size."""

    def __init__(self, places: Array, height: int, width: int) -> None:
        """Take where each pixel lies in the other image.

        Args:
            places: u, v of each pixel, row by row [px]; NaN for none, shape (height width, 2).
            height: Rows [px].
            width: Columns [px].
        """
        self._shape = (height, width)
        inside = np.all((places >= 0.0) & (places <= (width - 1, height - 1)), axis=1)
        at = np.where(inside[:, None], places, 0.0)
        corner = np.minimum(np.floor(at), (width - 2, height - 2)).astype(np.int64)
        self._weights = np.rint(_PARTS * (at - corner)).astype(np.int64)
        self._corners = np.where(inside[:, None], corner[:, ::-1], -1)

    def __call__(self, image: Image) -> Image:
        """Return the image [grey values], shape (height, width)."""
        out = np.empty(self._shape, dtype=np.uint8)
        _resample(image, self._corners, self._weights, out)
        return out


def is_bent(lens: Lens) -> bool:
    """Say whether the images of a lens differ from those of ``Lens.pinhole``."""
    return bool(np.any(lens.numbers[4:]) or lens.numbers[0] != lens.numbers[1])


def straightener(lens: Lens) -> Resampler:
    """Return what makes the image of ``lens.pinhole`` out of that of the lens."""
    f, c, k = lens.numbers[:2], lens.numbers[2:4], lens.numbers[4:]
    bent = distort((_pixels(lens) - c) / np.sqrt(f[0] * f[1]), k)[0] * f + c
    return Resampler(bent, lens.height, lens.width)


def bender(lens: Lens) -> Resampler:
    """Return what makes the image of the lens out of that of ``lens.pinhole``."""
    return Resampler(lens.straighten(_pixels(lens)), lens.height, lens.width)


def _pixels(lens: Lens) -> Array:
    """Return u, v of each pixel, row by row [px], shape (height width, 2)."""
    v, u = np.mgrid[: lens.height, : lens.width]
    return np.column_stack((u.ravel(), v.ravel())).astype(np.float64)
