"""Images against formulas: light, blur, pattern, order."""

import numpy as np
import pytest

from mitt.core.eyes.camera import Camera, Rig
from mitt.core.signals import Array
from mitt.lab.world.imaging import Imager, ImageSensor

CAMERA = Camera(width=48, height=40, f_px=60.0, cu=23.5, cv=19.5, T_world_cam=np.eye(4))
QUIET = {"read_noise": 0.0, "electrons": 1e12, "texture": 0.0}
ROUNDING = 1.01
"""Grey levels: both images round."""
BESIDE = np.array((-0.2, 0.1, 1.0))
BAR = np.array([(-1.0, 0.0, 1.5, 1.0, 0.0, 1.5, 0.1, 0.0)])
"""A capsule across the image, 8 px high, behind a ball at 1 m."""


def shot(
    sensor: ImageSensor, r: Array | None = None, capsules: Array | None = None, t: float = 0.0
) -> Array:
    """Return one image of ``CAMERA`` as floats, shape (40, 48)."""
    imager = Imager(Rig(cameras=(CAMERA,)), sensor, np.random.default_rng(0))
    body = np.zeros((0, 8)) if capsules is None else capsules
    return imager.render(t, r, 0.1, capsules=body)[0].pixels.astype(float)


def sensor(**settings_: object) -> ImageSensor:
    """Return a sensor without noise."""
    return ImageSensor(**{**QUIET, **settings_})  # type: ignore[arg-type]


def test_blur_keeps_mass_and_centroid_and_adds_its_variance() -> None:
    """A ball of r px has the second moment r^2 / 4 an axis; blur adds sigma^2."""
    moments = []
    for blur in (1e-3, 1.0):
        image = shot(sensor(blur=blur, brightness=200.0), BESIDE) - 24.0
        v, u = np.mgrid[:40, :48]
        mass = image.sum()
        centre = (u * image).sum() / mass, (v * image).sum() / mass
        moments.append((mass, *centre, ((u - centre[0]) ** 2 * image).sum() / mass))
    sharp, soft = moments
    assert soft[0] == pytest.approx(sharp[0], rel=0.01)
    assert soft[1:3] == pytest.approx(sharp[1:3], abs=0.02)
    assert soft[3] - sharp[3] == pytest.approx(1.0, abs=0.06)


def test_light_scales_all_levels_and_repeats_with_its_period() -> None:
    """At 100 Hz an image is the same after 10 ms, and the mean over a period that of no light."""
    lit = sensor(light=(0.3, 100.0), brightness=100.0)
    over = np.array([shot(lit, BESIDE, t=1e-3 * k) for k in range(20)])
    assert np.array_equal(over[3], over[13])
    assert np.abs(over[:10].mean(axis=0) - shot(sensor(brightness=100.0), BESIDE)).max() <= ROUNDING
    ratio = over.max(axis=0) / np.maximum(over.min(axis=0), 1.0)
    assert np.median(ratio) == pytest.approx(1.3 / 0.7, rel=0.15)


def test_hand_and_arm_have_their_own_levels_and_a_lit_side() -> None:
    """The last number of a capsule says which it is; light comes from above."""
    hand = BAR.copy()
    hand[0, 7] = 1.0
    kind = sensor(body=100.0, hand=200.0)
    assert shot(kind, None, BAR)[20, 24] == pytest.approx(100.0, abs=1.0)
    assert shot(kind, None, hand)[20, 24] == pytest.approx(200.0, abs=1.0)
    shaded = shot(sensor(body=100.0, shading=0.5), None, BAR)
    column = shaded[:, 24][shaded[:, 24] > 40.0]
    assert column[1] > 120.0 > 80.0 > column[-2]


def test_a_ball_hides_the_arm_behind_it_and_is_hidden_by_one_before() -> None:
    """Balls and capsules are painted in the order of their depth."""
    before = BAR.copy()
    before[0, [2, 5]] = 0.6
    kind, middle = sensor(body=100.0, blur=1e-3), np.array((0.0, 0.0, 1.0))
    assert shot(kind, middle, BAR)[20, 24] == pytest.approx(184.0, abs=1.0)
    assert shot(kind, middle, before)[20, 24] == pytest.approx(100.0, abs=1.0)


def test_squares_have_their_contrast_and_size() -> None:
    """Half the contrast above and below the mean, a square at a time."""
    image = shot(sensor(pattern=(20.0, 8.0)))
    assert set(np.unique(image)) == {14.0, 34.0}
    assert np.all(image[:8, :8] == image[0, 0])
    assert np.all(image[:8, 8:16] == 48.0 - image[0, 0])


def test_a_second_ball_rolls_and_looks_before_a_throw_use_up_no_noise() -> None:
    """Its place follows from the time; images of the throw are the same with looks or without."""
    images = []
    for early in (False, True):
        imager = Imager(
            Rig(cameras=(CAMERA,)),
            ImageSensor(),
            np.random.default_rng(4),
            second=(0.0, 0.0, 1.0, 0.05),
            second_velocity=(2.0, 0.0, 0.0),
        )
        if early:
            assert len(imager.before(3, np.zeros((0, 8)))) == 3
        images.append([imager.render(0.1 * k, None, 0.1)[0].pixels for k in range(2)])
    assert np.array_equal(images[0][0], images[1][0])
    columns = [int(image[20].argmax()) for image in images[0]]
    assert columns[1] - columns[0] == pytest.approx(12, abs=2)
