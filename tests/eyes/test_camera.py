"""Pinhole cameras against OpenCV, and what the standing rig must see."""

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mitt.core.errors import InputError, ShapeError
from mitt.core.eyes.camera import Camera, Rig, fixed_rig, look_at
from mitt.core.signals import Array

ROUNDING = 1e-9
"""Pixels and metres."""

coordinate = st.floats(-2.0, 2.0)
in_front = st.tuples(st.floats(0.5, 5.0), coordinate, coordinate).map(np.array)


def camera(T_world_cam: Array, *, f_px: float = 220.0) -> Camera:
    """Return a camera at a pose."""
    return Camera(width=128, height=128, f_px=f_px, cu=63.5, cv=63.5, T_world_cam=T_world_cam)


@given(in_front, st.sampled_from(fixed_rig().cameras))
def test_a_ray_through_a_projection_meets_the_point(p: Array, seer: Camera) -> None:
    """Project a point and follow the ray back: it passes through the point."""
    d = p - seer.centre
    assert seer.ray(*seer.project(p)) == pytest.approx(d / np.linalg.norm(d), abs=ROUNDING)


@given(in_front, st.sampled_from(fixed_rig().cameras))
def test_projection_agrees_with_opencv(p: Array, seer: Camera) -> None:
    """cv2.projectPoints with the inverse pose gives the same pixel."""
    rvec, _ = cv2.Rodrigues(seer.rotation.T)
    K = np.array(((seer.f_px, 0, seer.cu), (0, seer.f_px, seer.cv), (0, 0, 1.0)))
    uv, _ = cv2.projectPoints(p[None], rvec, -seer.rotation.T @ seer.centre, K, None)
    assert seer.project(p) == pytest.approx(tuple(uv.ravel()), abs=1e-6)


def test_right_in_the_image_is_right_in_the_world() -> None:
    """A camera that looks along +x sees +y on its left and +z above."""
    T = look_at(np.zeros(3), np.array((1.0, 0.0, 0.0)))
    u, v = camera(T, f_px=100.0).project(np.array((2.0, 0.5, 0.25)))
    assert (u, v) == pytest.approx((63.5 - 25.0, 63.5 - 12.5), abs=ROUNDING)


def test_what_lies_behind_has_no_image() -> None:
    """Points behind the camera project to NaN."""
    assert np.isnan(fixed_rig().cameras[0].project(np.array((-5.0, 0.0, 0.0)))).all()


def test_impossible_cameras_are_refused() -> None:
    """Reflections, wrong shapes, no focal length, no camera, a target straight above."""
    good = fixed_rig().cameras[0]
    mirrored = good.T_world_cam @ np.diag((-1.0, 1.0, 1.0, 1.0))
    with pytest.raises(InputError, match="rotation"):
        camera(mirrored)
    with pytest.raises(ShapeError):
        camera(np.eye(3))
    for f_px in (0.0, float("nan")):
        with pytest.raises(InputError, match="f_px"):
            camera(np.eye(4), f_px=f_px)
    with pytest.raises(InputError):
        Rig(cameras=())
    with pytest.raises(InputError, match="vertical"):
        look_at(np.zeros(3), np.array((0.0, 0.0, 1.0)))


@pytest.mark.parametrize("radius", [0.04, 0.02])
def test_the_rig_sees_the_whole_flight(radius: float) -> None:
    """Every ball from 5.1 m away to the catch lies wholly in both images."""
    corners = [
        (x, side * y, z)
        for x, y, low, high in (
            (5.1, 0.75, -0.4, 1.4),
            (3.0, 0.65, -0.35, 1.4),
            (2.0, 0.5, -0.35, 1.1),
            (1.0, 0.4, -0.3, 0.6),
            (0.65, 0.3, -0.3, 0.5),
        )
        for side in (1.0, -1.0)
        for z in (low, high)
    ]
    for seer in fixed_rig().cameras:
        for corner in corners:
            p = np.array(corner)
            r_px = seer.f_px * radius / np.linalg.norm(p - seer.centre)
            u, v = seer.project(p)
            assert min(u, v) - r_px > 0.5, corner
            assert max(u - seer.width, v - seer.height) + r_px < -1.5, corner


def test_the_rig_can_be_built() -> None:
    """Cameras keep 1.2 m from the shoulder and at most 2.5 m from each other."""
    left, right = fixed_rig().cameras
    assert min(np.linalg.norm(left.centre), np.linalg.norm(right.centre)) >= 1.2
    assert np.linalg.norm(left.centre - right.centre) <= 2.5 + ROUNDING
