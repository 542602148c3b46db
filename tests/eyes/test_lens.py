"""Lenses: OpenCV bends rays and images alike, and what is bent comes back."""

import cv2
import numpy as np
import pytest
from boards import true_lens
from hypothesis import given
from hypothesis import strategies as st

from mitt.core.errors import InputError, ShapeError
from mitt.core.eyes.lens import Lens, bender, distort, is_bent, straightener
from mitt.core.signals import Array

BENT = np.array([-0.21, 0.09, 1.3e-3, -7e-4, -0.012])


def grid(reach: float = 0.45) -> Array:
    """Return points at unit distance, shape (49, 2)."""
    x = np.linspace(-reach, reach, 7)
    return np.stack(np.meshgrid(x, x), axis=-1).reshape(-1, 2)


def test_opencv_projects_alike() -> None:
    """Image points of points ahead agree with cv2.projectPoints to 1e-9 px."""
    lens = Lens(width=640, height=480, numbers=np.array([700.0, 690.0, 320.0, 241.0, *BENT]))
    p = np.column_stack((grid(), np.ones(49))) * 1.7
    K = np.array([[700.0, 0, 320], [0, 690, 241], [0, 0, 1]])
    theirs = cv2.projectPoints(p, np.zeros(3), np.zeros(3), K, BENT)[0].reshape(-1, 2)
    assert np.abs(lens.project(p) - theirs).max() < 1e-9


@given(
    k1=st.floats(-0.3, 0.3),
    k2=st.floats(-0.05, 0.1),
    p1=st.floats(-2e-3, 2e-3),
    p2=st.floats(-2e-3, 2e-3),
    k3=st.floats(-0.02, 0.02),
)
def test_undistort_undoes_distort(k1: float, k2: float, p1: float, p2: float, k3: float) -> None:
    """Any lens of moderate distortion is inverted to 1e-9 over 65 degrees of view."""
    numbers = np.array([700.0, 705.0, 322.0, 238.0, k1, k2, p1, p2, k3])
    lens = Lens(width=640, height=480, numbers=numbers)
    uv = lens.project(np.column_stack((grid(), np.ones(49))))
    assert np.abs(lens.undistort(uv) - grid()).max() < 1e-9


def test_derivatives_are_central_differences() -> None:
    """Both derivatives of the distortion agree with differences to 1e-8."""
    _, by_xy, by_k = distort(grid(), BENT)
    h = 1e-6
    for k, step in enumerate(h * np.eye(2)):
        d = (distort(grid() + step, BENT)[0] - distort(grid() - step, BENT)[0]) / (2 * h)
        assert np.abs(d - by_xy[:, :, k]).max() < 1e-8
    for k, step in enumerate(h * np.eye(5)):
        d = (distort(grid(), BENT + step)[0] - distort(grid(), BENT - step)[0]) / (2 * h)
        assert np.abs(d - by_k[:, :, k]).max() < 1e-8


def test_a_straightened_point_is_where_the_pinhole_sees_it() -> None:
    """The camera without distortion projects to the straightened image point."""
    lens, p = true_lens(), np.array((0.3, -0.2, 1.5))
    uv = lens.straighten(lens.project(p[None]))[0]
    assert uv == pytest.approx(lens.pinhole(np.eye(4)).project(p), abs=1e-9)


def test_a_point_that_no_ray_reaches_is_nan() -> None:
    """Far outside, where barrel distortion folds the image over, there is no answer."""
    lens = Lens(width=640, height=480, numbers=np.array([300.0, 300, 320, 240, -0.4, 0, 0, 0, 0]))
    assert np.isnan(lens.undistort(np.array([[2000.0, 240.0]]))).all()


@pytest.mark.parametrize(
    "numbers", [np.zeros(9), np.full(9, np.nan), np.array([700.0, 100, *[0] * 7])]
)
def test_numbers_that_are_no_lens_are_refused(numbers: Array) -> None:
    """No focal length, NaN, and pixels seven times as wide as high."""
    with pytest.raises(InputError):
        Lens(width=640, height=480, numbers=numbers)
    with pytest.raises(ShapeError):
        Lens(width=640, height=480, numbers=numbers[:4])


#: Lenses: strong barrel, pincushion with unequal focal lengths.
BENT_LENSES = [(220.0, 220.0, 63.5, 63.5, -0.35, 0.1, 2e-3, -1e-3, 0.0),
        (230.0, 210.0, 60.2, 66.1, 0.2, 0.0, 0.0, 1e-3, 0.01)]  # fmt: skip


def lens_of(numbers: tuple[float, ...]) -> Lens:
    """Return a lens of 128 x 112 pixels."""
    return Lens(width=128, height=112, numbers=np.array(numbers))


@pytest.mark.parametrize("numbers", BENT_LENSES)
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


@pytest.mark.parametrize("numbers", BENT_LENSES)
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
    assert is_bent(lens_of(BENT_LENSES[1]))
    assert np.array_equal(straightener(lens)(image), image)
