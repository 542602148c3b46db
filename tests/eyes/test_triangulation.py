"""Triangulation against exact geometry, OpenCV and its own covariance."""

from dataclasses import replace

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mitt.core.ball.motion_models import invert_positive
from mitt.core.errors import InputError
from mitt.core.eyes.camera import Camera, Rig, fixed_rig, look_at
from mitt.core.eyes.triangulation import Triangulator
from mitt.core.signals import Array, Moments

EXACT = 1e-6
"""Metres, without noise."""
LINEAR_METHOD = 1e-6
"""OpenCV's method is linear but equal without noise [m]."""

RIG = fixed_rig()
THIRD = Camera(
    width=640,
    height=480,
    f_px=600.0,
    cu=319.5,
    cv=239.5,
    T_world_cam=look_at(np.array((2.0, -3.0, 1.0)), np.array((2.0, 0.0, 0.2))),
)
in_view = st.tuples(st.floats(0.8, 5.0), st.floats(-0.4, 0.4), st.floats(-0.25, 0.8)).map(np.array)


def outline_centre(camera: Camera, r: Array, radius: float) -> tuple[float, float]:
    """Return the centre of area of the sphere's outline, drawn as a polygon of tangent rays."""
    c = (r - camera.centre) @ camera.rotation
    d = np.linalg.norm(c)
    side = np.cross(c, (0.3, 0.5, 0.8))
    side /= np.linalg.norm(side)
    up = np.cross(c / d, side)
    phi = np.linspace(0.0, 2.0 * np.pi, 400, endpoint=False)
    rim = radius * np.sqrt(1.0 - (radius / d) ** 2)
    touching = c * (1.0 - (radius / d) ** 2) + rim * (
        np.outer(np.cos(phi), side) + np.outer(np.sin(phi), up)
    )
    x, y = touching[:, 0] / touching[:, 2], touching[:, 1] / touching[:, 2]
    cross = x * np.roll(y, -1) - np.roll(x, -1) * y
    u = ((x + np.roll(x, -1)) * cross).sum() / (3.0 * cross.sum())
    v = ((y + np.roll(y, -1)) * cross).sum() / (3.0 * cross.sum())
    return float(camera.cu + camera.f_px * u), float(camera.cv + camera.f_px * v)


def seen(rig: Rig, r: Array, radius: float, *, area: float = 20.0) -> tuple[Moments, ...]:
    """Return what the cameras of a rig would see of a ball, without noise."""
    moments = []
    for n, camera in enumerate(rig.cameras):
        u, v = outline_centre(camera, r, radius)
        moments.append(Moments(t=0.25, camera=n, found=True, area=area, u=u, v=v))
    return tuple(moments)


@given(in_view, st.floats(0.001, 0.15), st.booleans())
def test_the_centre_of_a_ball_is_found_exactly(r: Array, radius: float, third: bool) -> None:
    """From the exact outlines, two or three cameras give the centre, large balls included."""
    rig = Rig(cameras=(*RIG.cameras, THIRD)) if third else RIG
    sighting = Triangulator(rig, radius).step(seen(rig, r, radius))
    assert sighting.found
    assert sighting.t == 0.25
    assert sighting.r_o == pytest.approx(r, abs=EXACT)


@given(in_view)
def test_points_agree_with_opencv(r: Array) -> None:
    """For a ball without extent, cv2.triangulatePoints gives the same point."""
    moments, matrices, points = [], [], []
    for n, camera in enumerate(RIG.cameras):
        u, v = camera.project(r)
        moments.append(Moments(t=0.0, camera=n, found=True, area=20.0, u=u, v=v))
        K = np.array(((camera.f_px, 0, camera.cu), (0, camera.f_px, camera.cv), (0, 0, 1.0)))
        matrices.append(K @ np.linalg.inv(camera.T_world_cam)[:3])
        points.append(np.array(((u,), (v,))))
    h = cv2.triangulatePoints(*matrices, *points).ravel()
    ours = Triangulator(RIG, 1e-9).step(tuple(moments)).r_o
    assert ours == pytest.approx(h[:3] / h[3], abs=LINEAR_METHOD)


def test_errors_are_as_large_as_the_covariance_says() -> None:
    """With noise of the believed size, the normalised squared error is 3 on average."""
    rng, radius, area = np.random.default_rng(6), 0.04, 12.0
    triangulator = Triangulator(RIG, radius)
    r_px = np.sqrt(area / np.pi)
    sigma = np.hypot(0.0075, 0.058 / r_px**1.5)
    distances = []
    for _ in range(800):
        r = np.array((rng.uniform(0.8, 4.5), rng.uniform(-0.4, 0.4), rng.uniform(-0.2, 0.7)))
        noisy = tuple(
            Moments(
                t=m.t,
                camera=m.camera,
                found=True,
                area=area,
                u=m.u + sigma * rng.normal(),
                v=m.v + sigma * rng.normal(),
            )
            for m in seen(RIG, r, radius)
        )
        s = triangulator.step(noisy)
        e = s.r_o - r
        distances.append(e @ np.linalg.solve(s.covariance, e))
    assert np.mean(distances) == pytest.approx(3.0, abs=5.0 * np.sqrt(6.0 / 800))


def test_cameras_that_disagree_see_nothing() -> None:
    """Rays that miss each other by more than the bound give no sighting; near ones do."""
    triangulator = Triangulator(RIG, 0.04)
    first, second = seen(RIG, np.array((2.0, 0.0, 0.5)), 0.04)
    for shift, found in ((1.0, True), (12.0, False), (-12.0, False)):
        other = Moments(t=second.t, camera=1, found=True, area=20.0, u=second.u, v=second.v + shift)
        assert triangulator.step((first, other)).found == found


def _changed(m: Moments, **change: float | bool) -> Moments:
    values = {
        "t": m.t,
        "found": m.found,
        "area": m.area,
        "u": m.u,
        "v": m.v,
        "clipped": m.clipped,
    } | change
    return Moments(
        t=float(values["t"]),
        camera=m.camera,
        found=bool(values["found"]),
        area=float(values["area"]),
        u=float(values["u"]),
        v=float(values["v"]),
        clipped=bool(values["clipped"]),
    )


@pytest.mark.parametrize(
    "fault",
    [
        {"found": False},
        {"clipped": True},
        {"u": float("nan")},
        {"v": float("inf")},
        {"area": 0.0},
        {"t": 0.253},
        {"area": float("nan")},
    ],
)
def test_one_camera_is_not_enough(fault: dict[str, float | bool]) -> None:
    """A camera without a sound target at that instant leaves the ball unseen, never NaN."""
    first, second = seen(RIG, np.array((2.0, 0.0, 0.5)), 0.04)
    for pair in ((first, _changed(second, **fault)), (first,), ()):
        s = Triangulator(RIG, 0.04).step(pair)
        assert not s.found
        assert not s.r_o.any()
        assert not s.covariance.any()


@settings(max_examples=200)
@given(*(st.floats(-1e4, 1e4) for _ in range(4)))
def test_any_pixels_give_finite_sightings(u0: float, v0: float, u1: float, v1: float) -> None:
    """Whatever the pixels, a sighting is finite with a positive covariance, or not found."""
    s = Triangulator(RIG, 0.04).step(
        (
            Moments(t=0.0, camera=0, found=True, area=9.0, u=u0, v=v0),
            Moments(t=0.0, camera=1, found=True, area=9.0, u=u1, v=v1),
        )
    )
    assert np.isfinite(s.r_o).all()
    assert np.isfinite(s.covariance).all()
    assert not s.found or np.linalg.eigvalsh(s.covariance).min() > 0.0


def test_a_rig_of_one_is_refused() -> None:
    """One camera, or a ball without size, cannot be triangulated."""
    with pytest.raises(InputError, match="two cameras"):
        Triangulator(Rig(cameras=RIG.cameras[:1]), 0.04)
    with pytest.raises(InputError, match="ball_radius"):
        Triangulator(RIG, 0.0)


@given(st.lists(st.floats(-3.0, 3.0), min_size=9, max_size=9))
def test_the_small_inverse_is_numpys(values: list[float]) -> None:
    """invert_positive agrees with numpy, and refuses what is not positive definite."""
    root = np.array(values).reshape(3, 3)
    S, out = root @ root.T + 1e-3 * np.eye(3), np.empty((3, 3))
    assert invert_positive(S, out)
    assert out @ S == pytest.approx(np.eye(3), abs=1e-6)
    assert not invert_positive(S - (np.linalg.eigvalsh(S)[0] + 1e-2) * np.eye(3), out)


ROLLING = ((120.0, 0.008), (30.0, 0.02), (30.0, 0.03))
"""Frames a second [Hz], and the time in which each is read out [s]."""


def _place(t: float) -> tuple[Array, Array]:
    """Return place [m] and velocity [m/s] of a thrown ball without drag, for arrays of times."""
    r, dr, down = np.array((3.4, 0.1, 0.3)), np.array((-5.5, 0.0, 2.2)), np.array((0, 0, -9.81))
    return r + t * dr + 0.5 * t * t * down, dr + t * down


@pytest.mark.parametrize(("rate", "readout"), ROLLING)
def test_rolling_shutters_leave_errors_as_large_as_the_covariance_says(
    rate: float, readout: float
) -> None:
    """Of a ball that each camera sees when its row is exposed; for a global one it is far off."""
    rolling = tuple(replace(c, readout=readout) for c in RIG.cameras)
    rng, sigma = np.random.default_rng(0), float(np.hypot(0.0075, 0.058 * (np.pi / 20.0) ** 0.75))
    errors: dict[bool, list[float]] = {True: [], False: []}
    distances = []
    for _ in range(12):
        triangulators = {True: Triangulator(Rig(cameras=rolling), 0.04)}
        triangulators[False] = Triangulator(RIG, 0.04)
        for k in range(int(0.4 * rate)):
            moments = []
            for n, camera in enumerate(RIG.cameras):
                late = 0.0
                for _ in range(20):
                    _, v = outline_centre(camera, _place(k / rate + late)[0], 0.04)
                    late = readout * (v / (camera.height - 1) - 0.5)
                u, v = outline_centre(camera, _place(k / rate + late)[0], 0.04)
                noisy = np.array((u, v)) + rng.normal(0.0, sigma, 2)
                moments.append(
                    Moments(t=k / rate, camera=n, found=True, area=20.0, u=noisy[0], v=noisy[1])
                )
            for known, triangulator in triangulators.items():
                s = triangulator.step(tuple(moments))
                e = s.r_o - _place(s.t)[0]
                if s.found:
                    errors[known].append(float(np.linalg.norm(e)))
                if s.found and known:
                    distances.append(float(e @ np.linalg.solve(s.covariance, e)))
    assert len(distances) > 100
    assert 2.0 < np.mean(distances) < 4.0
    assert np.median(errors[True]) < 1.5e-3
    assert np.median(errors[False]) > 4e-3
