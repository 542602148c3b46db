"""Images bent by a lens made straight, and straight ones bent, by linear interpolation.

A straight image is that of ``Lens.pinhole``: what sees in it needs no lens.
"""

from typing import final

import numpy as np
from numpy.typing import NDArray

from mitt.jit import kernel
from mitt.signals import Array, Image
from mitt.vision.lens import Lens, distort

#: Parts of a pixel that a weight counts in; four weights of two such factors add up to their
#: square.
_PARTS = 256


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
