"""The image sensor against brute force, and its noise against its settings."""

from collections.abc import Callable
from dataclasses import fields, replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mitt.core.errors import InputError
from mitt.core.eyes.camera import Camera, Rig, fixed_rig
from mitt.core.signals import Array
from mitt.lab.world.imaging import Imager, ImageSensor, bank_of, sensor_of
from mitt.lab.world.scene import Ball, Scene, Sensing

CLEAN = ImageSensor(
    brightness=200.0, background=20.0, texture=0.0, body=20.0, read_noise=0.0, electrons=1e12
)
QUANTUM = 0.51
"""Rounding to whole grey levels."""
SAMPLING = 6.0
"""Grey levels of 200: eight or sixteen lines a pixel row, against 40 x 40 rays a pixel."""

CAMERA = Camera(width=48, height=40, f_px=60.0, cu=23.5, cv=19.5, T_world_cam=np.eye(4))


def by_rays(r: Array, radius: float, fine: int = 40) -> Array:
    """Return the share of rays of each pixel of ``CAMERA`` that hit the ball, shape (40, 48)."""
    sub = (np.arange(fine) + 0.5) / fine - 0.5
    a = (np.add.outer(np.arange(CAMERA.width), sub).ravel() - CAMERA.cu) / CAMERA.f_px
    b = (np.add.outer(np.arange(CAMERA.height), sub).ravel() - CAMERA.cv) / CAMERA.f_px
    dot = a[None, :] * r[0] + b[:, None] * r[1] + r[2]
    length = a[None, :] ** 2 + b[:, None] ** 2 + 1.0
    hit = (dot > 0.0) & (r @ r - dot**2 / length <= radius**2)
    return np.asarray(hit.reshape(CAMERA.height, fine, CAMERA.width, fine).mean(axis=(1, 3)))


def shot(sensor: ImageSensor, r: Array | None, radius: float, seed: int = 0) -> Array:
    """Return one image of ``CAMERA`` as floats, shape (40, 48)."""
    imager = Imager(Rig(cameras=(CAMERA,)), sensor, np.random.default_rng(seed))
    return imager.render(0.0, r, radius)[0].pixels.astype(float)


@settings(max_examples=25)
@given(st.floats(-1.2, 1.2), st.floats(-1.2, 1.2), st.floats(0.5, 4.0), st.floats(0.01, 0.3))
def test_images_agree_with_brute_force_ray_casting(
    x: float, y: float, z: float, radius: float
) -> None:
    """Everywhere in and beyond the image, near and far, coverage is what rays say."""
    r = np.array((x, y, z))
    wanted = 20.0 + 200.0 * by_rays(r, radius)
    assert np.abs(shot(CLEAN, r, radius) - wanted).max() <= QUANTUM + SAMPLING


@pytest.mark.parametrize("r", [(0.0, 0.0, -2.0), (9.0, 0.0, 1.0), (0.0, -9.0, 1.0), (np.nan,) * 3])
def test_a_ball_out_of_view_leaves_the_ground(r: tuple[float, float, float]) -> None:
    """Behind the camera, beside the image or nowhere: the image is empty."""
    assert np.all(shot(CLEAN, np.array(r), 0.04) == 20.0)
    assert np.all(shot(CLEAN, None, 0.04) == 20.0)


def test_noise_on_the_ground_and_on_the_ball_is_as_set() -> None:
    """Read noise and shot noise add; both levels are right to the mean's own error."""
    sensor = ImageSensor(texture=0.0)
    big = np.array((0.0, 0.0, 0.5))
    imager = Imager(Rig(cameras=(CAMERA,)), sensor, np.random.default_rng(3))
    for r, level in ((None, sensor.background), (big, sensor.background + sensor.brightness)):
        stack = np.stack([imager.render(0.0, r, 0.1)[0].pixels[18:22, 20:28] for _ in range(400)])
        sigma = np.sqrt(sensor.read_noise**2 + level / sensor.electrons + 1.0 / 12.0)
        assert stack.mean() == pytest.approx(level, abs=5.0 * sigma / np.sqrt(stack.size))
        assert stack.std() == pytest.approx(sigma, rel=0.05)


def test_values_saturate_instead_of_wrapping() -> None:
    """Noise far beyond the grey scale is clipped at 0 and 255."""
    sensor = ImageSensor(
        brightness=150.0,
        background=100.0,
        texture=0.0,
        body=100.0,
        read_noise=200.0,
        electrons=30.0,
    )
    pixels = shot(sensor, np.array((0.0, 0.0, 0.3)), 0.1)
    assert 0.15 < (pixels == 0.0).mean() < 0.4
    assert 0.15 < (pixels == 255.0).mean() < 0.6


def test_same_seed_same_images_and_no_two_frames_alike() -> None:
    """Images follow from the seed; noise changes from frame to frame and camera to camera."""
    runs = []
    for seed in (1, 1, 2):
        imager = Imager(fixed_rig(), ImageSensor(), np.random.default_rng(seed))
        runs.append([imager.render(0.001 * k, np.array((3.0, 0, 0.5)), 0.04) for k in range(3)])
    for first, again in zip(runs[0], runs[1], strict=True):
        for a, b in zip(first, again, strict=True):
            assert np.array_equal(a.pixels, b.pixels)
    assert not np.array_equal(runs[0][0][0].pixels, runs[2][0][0].pixels)
    assert not np.array_equal(runs[0][0][0].pixels, runs[0][1][0].pixels)
    assert not np.array_equal(runs[0][0][0].pixels[:40], runs[0][0][1].pixels[:40])
    assert [f.number for frames in runs[0] for f in frames] == [0, 0, 1, 1, 2, 2]


def test_trials_share_the_banks_but_not_the_noise() -> None:
    """Cameras of two trials read the same banks, and their images are not correlated."""
    first, second = (
        Imager(fixed_rig(), ImageSensor(texture=0.0), np.random.default_rng(seed))
        for seed in (1, 2)
    )
    sensor = ImageSensor(texture=0.0)
    bank = sensor.background, sensor.texture, sensor.pattern
    assert bank_of(*bank) is bank_of(*bank)
    pairs = [
        (first.render(0.0, None, 0.04)[0].pixels, second.render(0.0, None, 0.04)[0].pixels)
        for _ in range(20)
    ]
    shares = [np.corrcoef(a.ravel(), b.ravel())[0, 1] for a, b in pairs]
    assert np.abs(shares).max() < 5.0 / 128.0


def test_frames_may_be_kept() -> None:
    """A frame stays as it was when later ones are drawn."""
    imager = Imager(fixed_rig(), ImageSensor(), np.random.default_rng(1))
    kept = imager.render(0.0, np.array((3.0, 0.0, 0.5)), 0.04)
    copies = [f.pixels.copy() for f in kept]
    for k in range(50):
        imager.render(1e-3 * k, np.array((2.0, 0.0, 0.5)), 0.04)
    assert all(np.array_equal(f.pixels, c) for f, c in zip(kept, copies, strict=True))


def test_impossible_sensors_are_refused() -> None:
    """Settings outside an 8-bit sensor raise."""
    made: tuple[Callable[[], ImageSensor], ...] = (
        lambda: ImageSensor(read_noise=-1.0),
        lambda: ImageSensor(brightness=250.0),
        lambda: ImageSensor(background=np.nan),
        lambda: ImageSensor(hand=256.0),
        lambda: ImageSensor(blur=4.0),
    )
    for make in made:
        with pytest.raises(InputError):
            make()


@pytest.mark.parametrize(
    "key", [x.name for x in fields(ImageSensor) if x.name in Sensing.model_fields]
)
def test_what_a_scene_says_of_its_sensors_arrives(key: str) -> None:
    """Each key that a sensor has by the same name, and the brightness of the ball."""
    other: dict[str, object] = {
        "pattern": (20.0, 6.0),
        "light": (0.2, 50.0),
        "shadow": (0.3, 100.0),
        "lamps": (2.0, 200.0),
        "windows": (1.0, 240.0),
        "hot": 7,
        "readout": 0.01,
    }
    value = other.get(key, 4e-4 if key == "exposure" else 0.25)
    scene = Scene(sensing=Sensing.model_validate({key: value}), ball=Ball(brightness=77.0))
    sensor = sensor_of(scene)
    assert getattr(sensor, key) == value
    assert sensor.brightness == 77.0


def test_a_room_shows_lamps_windows_and_hot_pixels_at_rest() -> None:
    """The same in every image, at their levels; hot pixels where no other camera has them."""
    sensor = ImageSensor(
        background=110.0,
        brightness=90.0,
        slope=20.0,
        lamps=(5.0, 220.0),
        windows=(2.0, 250.0),
        hot=20,
    )
    imager = Imager(fixed_rig(), sensor, np.random.default_rng(1))
    views = [imager.render(1e-3 * k, None, 0.04) for k in range(12)]
    left, right = (np.mean([view[n].pixels for view in views], axis=0) for n in range(2))
    assert 24 * 24 < np.count_nonzero(left > 235.0) < 0.5 * left.size
    assert np.count_nonzero((left > 210.0) & (left < 230.0)) > 5
    apart = np.abs(left - right) > 25.0
    assert 25 <= np.count_nonzero(apart) <= 40


@pytest.mark.parametrize("readout", [0.008, 0.02])
def test_a_rolling_shutter_shows_a_ball_when_its_row_is_exposed(readout: float) -> None:
    """High in the image earlier, low in it later than the middle, whose time the image bears."""
    rig, r, dr = fixed_rig(), np.array((2.0, 0.1, 0.0)), np.array((-1.0, 4.0, 2.0))
    clean = ImageSensor(texture=0.0, read_noise=0.0, electrons=1e9, readout=readout)
    for z in (-0.6, 0.1, 0.9):
        r[2] = z
        frames = Imager(rig, clean, np.random.default_rng(1)).render(0.0, r, 0.04, dr_o=dr)
        for camera, frame in zip(rig.cameras, frames, strict=True):
            mass = np.clip(frame.pixels.astype(float) - 26.0, 0.0, None)
            v, u = (np.sum(mass * axis) / mass.sum() for axis in np.mgrid[:128, :128])
            late = readout * (v / 127.0 - 0.5)
            assert (u, v) == pytest.approx(camera.project(r + late * dr), abs=0.15)


def test_lamps_that_flicker_show_in_bands_and_not_in_a_whole_period() -> None:
    """A rolling shutter shows them row by row; an exposure of their period averages them."""
    rig, still = fixed_rig(), replace(CLEAN, brightness=100.0, background=100.0)
    for exposure, readout, least, most in (
        (5e-4, 0.0, 0.0, 0.6),
        (5e-4, 0.02, 8.0, 30.0),
        (0.01, 0.02, 0.0, 0.6),
    ):
        sensor = replace(still, exposure=exposure, readout=readout, light=(0.1, 100.0))
        imager = Imager(rig, sensor, np.random.default_rng(5))
        rows = imager.render(0.0, None, 0.04)[0].pixels.mean(axis=1)
        assert least <= np.ptp(rows) <= most
