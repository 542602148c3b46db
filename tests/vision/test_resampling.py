"""Images made straight: as OpenCV does it, and a ball lies where its rays say."""

import cv2
import numpy as np
import pytest

from mitt.vision.lens import Lens
from mitt.vision.resampling import bender, is_bent, straightener

#: Lenses: strong barrel, pincushion with unequal focal lengths.
BENT = [(220.0, 220.0, 63.5, 63.5, -0.35, 0.1, 2e-3, -1e-3, 0.0),
        (230.0, 210.0, 60.2, 66.1, 0.2, 0.0, 0.0, 1e-3, 0.01)]  # fmt: skip


def lens_of(numbers: tuple[float, ...]) -> Lens:
    """Return a lens of 128 x 112 pixels."""
    return Lens(width=128, height=112, numbers=np.array(numbers))


@pytest.mark.parametrize("numbers", BENT)
def test_a_straight_image_is_that_of_opencv(numbers: tuple[float, ...]) -> None:
    """Within 2 grey values of 255, on noise, at least 3 pixels from the edge of what is seen."""
    lens = lens_of(numbers)
    image = np.random.default_rng(3).integers(0, 256, (112, 128), dtype=np.uint8)
    f, (cu, cv) = np.sqrt(numbers[0] * numbers[1]), numbers[2:4]
    K = np.array([[numbers[0], 0.0, cu], [0.0, numbers[1], cv], [0.0, 0.0, 1.0]])
    pinhole = np.array([[f, 0.0, cu], [0.0, f, cv], [0.0, 0.0, 1.0]])
    u, v = cv2.initUndistortRectifyMap(
        K, np.array(numbers[4:]), np.eye(3), pinhole, (128, 112), cv2.CV_32FC1
    )
    theirs = cv2.remap(image, u, v, cv2.INTER_LINEAR)
    inside = (u > 3) & (u < 124) & (v > 3) & (v < 108)
    mine = straightener(lens)(image)
    apart = np.abs(mine.astype(int) - theirs.astype(int))
    # OpenCV rounds places to 1/32 px: 255 / 64 grey values an axis on noise.
    assert inside.mean() > 0.8
    assert apart[inside].max() <= 8
    assert apart[inside].mean() < 1.5


@pytest.mark.parametrize("numbers", BENT)
def test_bending_and_straightening_give_the_image_back(numbers: tuple[float, ...]) -> None:
    """A smooth image comes back within 6 grey values of 255; a spot lies where the lens says."""
    lens = lens_of(numbers)
    v, u = np.mgrid[:112, :128]
    for at in ((30.0, 25.0), (63.0, 55.0), (100.0, 90.0)):
        image = np.rint(220.0 * np.exp(-((u - at[0]) ** 2 + (v - at[1]) ** 2) / 50.0)).astype(
            np.uint8
        )
        bent = bender(lens)(image)
        back = straightener(lens)(bent)
        # Linear interpolation flattens a top by 220 / 25 / 4 = 2.2 grey values, twice; rounding.
        assert np.abs(back.astype(int) - image)[4:-4, 4:-4].max() <= 6
        weight = bent.astype(float)
        seen = np.array([[(weight * u).sum(), (weight * v).sum()]]) / weight.sum()
        assert np.allclose(lens.straighten(seen)[0], at, atol=0.15)


def test_a_lens_that_bends_nothing_changes_nothing() -> None:
    """And is known as such."""
    lens = lens_of((220.0, 220.0, 63.5, 55.5, 0.0, 0.0, 0.0, 0.0, 0.0))
    image = np.random.default_rng(4).integers(0, 256, (112, 128), dtype=np.uint8)
    assert not is_bent(lens)
    assert is_bent(lens_of(BENT[1]))
    assert np.array_equal(straightener(lens)(image), image)
