"""Segmentation and moments against OpenCV, brute force and rendered discs of known place."""

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mitt.core.errors import ShapeError
from mitt.core.eyes.blobs import MOMENTS, weigh
from mitt.core.eyes.camera import Camera, Rig, look_at
from mitt.core.eyes.segmentation import Segmenter, SegmenterConfig, measure_background
from mitt.core.signals import Frame, Image, Moments
from mitt.lab.world.imaging import Imager, ImageSensor

BIAS = 0.01
"""Mean error of the centroid [px]; the project's own bound."""
SPREAD = {0.8: 0.06, 1.4: 0.03, 2.5: 0.018, 5.0: 0.012}
"""Standard deviation of the centroid for a disc of that radius [px]; binary is 0.1 and more."""
SINGLE = 1e-4
"""Rounding of OpenCV's single precision [px]."""
LEVEL = 0.2
"""Level and noise of the ground [grey levels]."""

CAMERA = Camera(
    width=128,
    height=96,
    f_px=200.0,
    cu=63.5,
    cv=47.5,
    T_world_cam=look_at(np.zeros(3), np.array((1.0, 0.0, 0.0))),
)


FLAT = ImageSensor(texture=0.0)
"""A ground without patches."""
PATCHY = 0.05
"""Error of the centroid of a disc of 4 px and more before a patchy ground [px], rms."""


def at(u: float, v: float, *, r_px: float, sensor: ImageSensor | None = None) -> Frame:
    """Return a frame with a disc at (u, v)."""
    imager = Imager(Rig(cameras=(CAMERA,)), sensor or FLAT, np.random.default_rng(0))
    return _draw(imager, u, v, r_px)


def _draw(imager: Imager, u: float, v: float, r_px: float) -> Frame:
    """Draw a ball 10 m in front whose image has its centroid, not its centre, at (u, v)."""
    shrink = 1.0 - (r_px / CAMERA.f_px) ** 2
    ray = CAMERA.ray(CAMERA.cu + shrink * (u - CAMERA.cu), CAMERA.cv + shrink * (v - CAMERA.cv))
    return imager.render(0.0, 10.0 * ray / ray[0], 10.0 * r_px / CAMERA.f_px)[0]


def frame(pixels: Image) -> Frame:
    """Wrap an image."""
    return Frame(t=0.0, camera=0, number=0, pixels=pixels)


def ground(seed: int = 0) -> Image:
    """Return noise of 2.2 grey levels around 24, shape (96, 128)."""
    noise = np.random.default_rng(seed).normal(24.0, 2.2, (96, 128))
    return np.rint(noise).astype(np.uint8)


@pytest.mark.parametrize("r_px", SPREAD)
def test_centroids_are_unbiased_and_sharp(r_px: float) -> None:
    """Over random sub-pixel places the centroid errs little and not to one side."""
    rng = np.random.default_rng(4)
    imager = Imager(Rig(cameras=(CAMERA,)), FLAT, np.random.default_rng(1))
    errors = []
    for _ in range(1500):
        u, v = rng.uniform(20, 100), rng.uniform(20, 70)
        m = Segmenter().step(_draw(imager, u, v, r_px))
        assert m.found
        errors.append((m.u - u, m.v - v))
    assert np.abs(np.mean(errors, axis=0)).max() < BIAS
    assert np.std(errors, axis=0).max() < SPREAD[r_px]


@pytest.mark.parametrize("r_px", [4.0, 8.0, 16.0])
def test_centroids_are_sharp_before_a_patchy_ground(r_px: float) -> None:
    """The project's bound of 0.05 px rms holds with patches, gradients and noise."""
    rng = np.random.default_rng(5)
    imager = Imager(Rig(cameras=(CAMERA,)), ImageSensor(texture=3.0), np.random.default_rng(2))
    errors = []
    for _ in range(600):
        u, v = rng.uniform(30, 90), rng.uniform(30, 60)
        m = Segmenter().step(_draw(imager, u, v, r_px))
        errors.append((m.u - u, m.v - v))
    assert np.sqrt(np.mean(np.square(errors), axis=0)).max() < PATCHY


@pytest.mark.parametrize("gap", [7.0, 8.5, 9.5, 10.0, 12.5, 16.0])
def test_a_merged_pair_is_flagged_and_the_ball_found_again(gap: float) -> None:
    """A ball that passes a second one is never averaged with it, and keeps its identity."""
    tracking, flagged = Segmenter(), 0
    for k in range(90):
        u = 20.0 + 0.9 * k
        both = np.maximum(at(u, 48.0, r_px=5.0).pixels, at(60.0, 48.0 + gap, r_px=5.0).pixels)
        m = tracking.step(frame(both))
        flagged += m.merged
        if m.found and not m.merged:
            assert abs(m.u - u) < 1.5
            assert abs(m.v - 48.0) < 1.5
    assert (flagged > 0) == (gap < 11.0)
    assert tracking.step(frame(both)).u == pytest.approx(u, abs=0.1)


def test_a_frozen_camera_is_blind() -> None:
    """The same image, noise and all, counts as none from the fourth time on."""
    image = at(40, 40, r_px=4.0)
    segmenter = Segmenter()
    assert [segmenter.step(image).found for _ in range(6)] == [True] * 3 + [False] * 3
    assert segmenter.step(at(41, 40, r_px=4.0)).found


@settings(max_examples=40)
@given(st.floats(20, 100), st.floats(20, 70), st.floats(1.5, 12.0))
def test_moments_agree_with_opencv(u: float, v: float, r_px: float) -> None:
    """On a noise-free ground of zero, cv2.moments gives the same centroid and pixel count."""
    dark = ImageSensor(
        brightness=200.0, background=0.0, texture=0.0, body=0.0, read_noise=0.0, electrons=1e12
    )
    image = at(u, v, r_px=r_px, sensor=dark)
    m, cv = Segmenter().step(image), cv2.moments(image.pixels.astype(np.float32))
    assert (m.u, m.v) == pytest.approx((cv["m10"] / cv["m00"], cv["m01"] / cv["m00"]), abs=SINGLE)
    assert m.area == np.count_nonzero(image.pixels > 12)


def test_the_window_finds_what_the_whole_image_finds() -> None:
    """A tracked target gives the same moments as one found afresh, at any speed up to a jump."""
    tracking = Segmenter()
    for k in range(60):
        image = at(10.0 + 1.9 * k if k < 40 else 20.0, 40.0 + 0.3 * k, r_px=2.0)
        fresh, tracked = Segmenter().step(image), tracking.step(image)
        assert tracked.found
        assert (fresh.u, fresh.v, fresh.area) == pytest.approx(
            (tracked.u, tracked.v, tracked.area), abs=2e-2
        )


def test_no_ball_no_target() -> None:
    """Three hundred images of noise, single hot pixels included, hold no target."""
    segmenter = Segmenter()
    for seed in range(300):
        pixels = ground(seed)
        pixels[seed % 96, (7 * seed) % 128] = 255
        m = segmenter.step(frame(pixels))
        assert m == Moments(t=0.0, camera=0, found=False)


@pytest.mark.parametrize(
    ("u", "v", "clipped"),
    [(64, 48, False), (0.5, 48, True), (126.5, 48, True), (64, 0, True), (64, 95, True)],
)
def test_targets_at_the_border_say_so(u: float, v: float, clipped: bool) -> None:
    """A target that touches the border is flagged; one inside is not."""
    m = Segmenter().step(at(u, v, r_px=3.0))
    assert m.found
    assert m.clipped == clipped


def test_two_targets_are_not_averaged() -> None:
    """Lost, the larger wins; tracked, the one where it was wins, though the other is larger."""
    both = np.maximum(at(30, 48, r_px=2.5).pixels, at(90, 48, r_px=5.0).pixels)
    assert Segmenter().step(frame(both)).u == pytest.approx(90, abs=0.1)
    tracking = Segmenter()
    tracking.step(at(30, 48, r_px=2.5))
    assert tracking.step(frame(both)).u == pytest.approx(30, abs=0.1)


@given(
    st.lists(st.tuples(st.integers(0, 95), st.integers(0, 127), st.integers(0, 255)), max_size=200),
    st.integers(0, 1000),
)
def test_any_image_gives_finite_moments(dots: list[tuple[int, int, int]], seed: int) -> None:
    """Whatever the image holds, the centroid is finite and inside it, or nothing is found."""
    pixels = ground(seed)
    for v, u, value in dots:
        pixels[v, u] = value
    m = Segmenter().step(frame(pixels))
    assert np.isfinite((m.u, m.v, m.area)).all()
    assert not m.found or (-1.0 < m.u < 128.0 and -1.0 < m.v < 96.0 and m.area >= 2.0)


@pytest.mark.parametrize("value", [0, 24, 255])
def test_a_flat_image_holds_nothing(value: int) -> None:
    """Dark, grey or blinded sensors do not upset the segmentation."""
    assert not Segmenter().step(frame(np.full((96, 128), value, dtype=np.uint8))).found


def test_the_ground_is_measured_from_the_image_despite_a_ball() -> None:
    """Level and noise are those of the ground, and targets are found on a bright one too."""
    counts = np.empty(256, dtype=np.int64)
    level = measure_background(at(60, 40, r_px=15.0).pixels, counts)
    noise = np.sqrt(2.0**2 + 24.0 / 30.0 + 1.0 / 12.0)
    assert level == pytest.approx((24.0, noise), abs=LEVEL)
    bright = ImageSensor(brightness=60.0, background=180.0, texture=0.0, read_noise=3.0)
    m = Segmenter().step(at(60, 40, r_px=4.0, sensor=bright))
    assert (m.u, m.v) == pytest.approx((60, 40), abs=0.1)


def test_the_ground_is_measured_again() -> None:
    """After the light changed, noise is noise again within ``background_period`` frames."""
    segmenter = Segmenter(SegmenterConfig(background_period=8))
    segmenter.step(frame(ground()))
    brighter = ground() + np.uint8(30)
    found = [segmenter.step(frame(brighter)).found for _ in range(9)]
    assert found[0]
    assert not found[-1]


def test_what_is_no_image_is_refused() -> None:
    """A frame of the wrong dimension raises."""
    with pytest.raises(ShapeError):
        Segmenter().step(frame(np.zeros((4, 4, 3), dtype=np.uint8)))


def test_a_target_as_dark_as_the_ground_has_no_centroid() -> None:
    """Its mass is what rounding leaves, and its centroid would lie 1e15 pixels off."""
    pixels, runs = np.array([[10, 41, 30]], np.uint8), np.array([[1], [1]])
    moments = np.zeros(1, MOMENTS)
    assert weigh(pixels, 0, 1, runs, 40, 20.0, moments[0])
    assert moments["u"][0] == pytest.approx(1.0 + 20.0 / 21.0)
    level = np.nextafter(27.0, 0.0)
    assert 0.0 < pixels.sum() - 3.0 * level < 1e-13
    assert not weigh(pixels, 0, 1, runs, 40, level, moments[0])
