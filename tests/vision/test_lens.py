"""Lenses: OpenCV bends rays alike, and what is bent comes back."""

import cv2
import numpy as np
import pytest
from boards import true_lens
from hypothesis import given
from hypothesis import strategies as st

from mitt.errors import InputError, ShapeError
from mitt.signals import Array
from mitt.vision.lens import Lens, distort

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
    k1=st.floats(-0.3, 0.3), k2=st.floats(-0.05, 0.1), p1=st.floats(-2e-3, 2e-3),
    p2=st.floats(-2e-3, 2e-3), k3=st.floats(-0.02, 0.02),
)  # fmt: skip
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
