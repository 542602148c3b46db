"""Segmentation: what rests and what lights the scene drops out, and where suffices to look."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from mitt.core.errors import InputError, ShapeError
from mitt.core.eyes.background import OFFSET, faulty_pixels, mean_background, subtract
from mitt.core.eyes.camera import fixed_rig
from mitt.core.eyes.eyes import Eyes
from mitt.core.eyes.segmentation import (
    TARGET,
    WORK,
    Segmenter,
    SegmenterConfig,
    detect,
    forget,
    pack_segmenter,
    region_of_interest,
    suffices,
)
from mitt.core.kernels import Record
from mitt.core.signals import Array, Frame, Image

HEIGHT = 64
WIDTH = 80
SETTINGS = pack_segmenter(SegmenterConfig())[0]
BALL = 184.0
"""Grey level of the ball."""
ROUNDING = 1.6
"""Grey levels that image, background and difference round by, the background's share enlarged."""


def target_of(contrast: float = 0.0, mean: float = 24.0) -> Record:
    """Return a target with a known contrast of the ball, or none, shape (1,)."""
    target = np.empty(1, TARGET)
    forget(target)
    target["mean"], target["learned"] = mean, 1
    if contrast > 0.0:
        target["gain"], target["weighed"], target["expected"] = contrast, 5.0, 20.0
    return target


def patterned(seed: int, contrast: int) -> Image:
    """Return a background with random squares of 8 px."""
    rng = np.random.default_rng(seed)
    squares = rng.integers(0, contrast + 1, (HEIGHT // 8, WIDTH // 8))
    return (40 + np.kron(squares, np.ones((8, 8)))).astype(np.uint8)


def disc(u0: float, v0: float, radius: float) -> Array:
    """Return the share of each pixel that a disc covers, roughly."""
    v, u = np.mgrid[:HEIGHT, :WIDTH]
    return np.asarray(np.clip(radius + 0.5 - np.hypot(u - u0, v - v0), 0.0, 1.0))


def difference(pixels: NDArray[Any], background: Image, target: Record) -> tuple[Image, float]:
    """Return the whole difference image and the light."""
    out = np.zeros((HEIGHT, WIDTH), np.uint8)
    window = np.array((0, HEIGHT - 1, 0, WIDTH - 1))
    rounded = np.clip(np.rint(pixels), 0.0, 255.0).astype(np.uint8)
    light = subtract(rounded, background, window, True, target[0], out)
    return out, light


@settings(max_examples=30)
@given(st.integers(0, 2**32), st.integers(0, 200), st.floats(0.7, 1.3))
def test_a_scene_at_rest_leaves_nothing_whatever_its_pattern_and_light(
    seed: int, contrast: int, light: float
) -> None:
    """A background of any contrast, brighter or darker as a whole, is flat in the difference."""
    background = patterned(seed, contrast)
    pixels = np.clip(light * background.astype(np.float64), 0.0, 255.0)
    shown, found = difference(pixels, background, target_of())
    if light * background.max() < 250.0 and contrast < 60:  # nothing is clipped
        assert found == pytest.approx(light, abs=0.03)
        assert np.abs(shown.astype(float) - OFFSET).max() <= ROUNDING + 0.03 * background.max()


@settings(max_examples=30)
@given(st.integers(0, 2**32), st.floats(15.0, 60.0), st.floats(15.0, 45.0), st.floats(0.9, 1.1))
def test_a_ball_looks_the_same_before_any_pattern_in_any_light(
    seed: int, u0: float, v0: float, light: float
) -> None:
    """With its contrast known, its share of a pixel shows alike before dark and bright squares."""
    background, cover = patterned(seed, 60), disc(u0, v0, 4.0)
    pixels = light * (background + cover * (BALL - background))
    plain = OFFSET + cover * (BALL - 60.0)
    shown, _ = difference(pixels, background, target_of(contrast=BALL - 60.0, mean=60.0))
    assert np.abs(shown.astype(float) - plain).max() <= 6.0


def test_before_a_background_as_bright_as_the_ball_nothing_is_seen() -> None:
    """A lamp or a white arm at rest says nothing, instead of something wrong."""
    background = np.full((HEIGHT, WIDTH), 24, np.uint8)
    background[20:40, 30:60] = 200
    pixels = background.astype(float)
    pixels[25:35, 40:50] = BALL
    shown, _ = difference(pixels, background, target_of(contrast=160.0))
    assert np.all(shown[22:38, 32:58] == round(OFFSET))


def test_the_mean_of_the_looks_is_the_background() -> None:
    """Ten looks are averaged, each camera by itself; ``reset`` forgets them."""
    eyes, rng = Eyes(fixed_rig()), np.random.default_rng(0)
    stacks = rng.integers(0, 256, (10, 2, 128, 128)).astype(np.uint8)
    views = [
        tuple(Frame(t=0.0, camera=n, number=k, pixels=stacks[k, n]) for n in range(2))
        for k in range(10)
    ]
    eyes.learn_background(views)
    for n in range(2):
        assert np.array_equal(eyes.backgrounds[n], np.rint(stacks[:, n].mean(axis=0)))
    eyes.reset()
    assert not eyes.memory.targets["learned"].any()
    assert not np.any(eyes.backgrounds)


def test_a_background_of_another_size_or_camera_is_refused() -> None:
    """One line says what was wanted."""
    eyes, small = Eyes(fixed_rig()), np.zeros((64, 64), np.uint8)
    with pytest.raises(ShapeError):
        eyes.learn_background([(Frame(t=0.0, camera=0, number=0, pixels=small),)])
    whole = np.zeros((128, 128), np.uint8)
    with pytest.raises(InputError, match="camera 1"):
        eyes.learn_background([(Frame(t=0.0, camera=0, number=0, pixels=whole),)])


def image_of(rng: np.random.Generator, balls: list[tuple[float, float, float]]) -> Image:
    """Return noise with bright discs (u, v, radius)."""
    pixels = 24.0 + 2.2 * rng.standard_normal((HEIGHT, WIDTH))
    for at_u, at_v, radius in balls:
        pixels += disc(at_u, at_v, radius) * (BALL - pixels)
    return np.clip(pixels, 0.0, 255.0).astype(np.uint8)


@settings(max_examples=40, deadline=None)
@given(
    st.integers(0, 2**32),
    st.floats(-2.5, 2.5),
    st.floats(-2.5, 2.5),
    st.floats(1.5, 6.0),
    st.booleans(),
    st.booleans(),
)
def test_the_rest_of_an_image_is_not_looked_at(
    seed: int, du: float, dv: float, radius: float, second: bool, learned: bool
) -> None:
    """Where the window suffices, images that differ beyond it leave the same bits in the memory.

    A ball crosses the image and leaves it, a second one standing in its way or not, with a
    background that was learned or without.
    """
    rng, memory, window = np.random.default_rng(seed), target_of(mean=0.0), np.empty(4, np.int64)
    work, other = np.zeros((2, 1), WORK)
    background, scratch, rest = np.empty((0, 0), np.uint8), *np.empty((2, HEIGHT, WIDTH), np.uint8)
    if learned:
        background = np.full((HEIGHT, WIDTH), 24, np.uint8)
    enough = 0
    for k in range(24):
        balls = [(40.0 + k * du, 30.0 + k * dv, radius)]
        pixels = image_of(rng, [*balls, (60.0, 40.0, 4.0)] if second else balls)
        window[:] = 0, HEIGHT - 1, 0, WIDTH - 1
        known = region_of_interest(memory[0], SETTINGS, window)
        assert known == (k > 0 and not np.isnan(memory["u"][0]))
        part = rng.integers(0, 256, pixels.shape).astype(np.uint8)
        seen = slice(window[0], window[1] + 1), slice(window[2], window[3] + 1)
        part[seen] = pixels[seen]
        copy, before = memory.copy(), memory.copy()
        images = part, background, scratch
        if known and suffices(*images, window, copy[0], SETTINGS, other[0]):
            assert copy.tobytes() == before.tobytes()
            enough += 1
            part_seen = detect(*images, copy[0], SETTINGS, other[0])
            assert part_seen == detect(pixels, background, rest, memory[0], SETTINGS, work[0])
            assert copy.tobytes() == memory.tobytes()
        else:
            detect(pixels, background, rest, memory[0], SETTINGS, work[0])
    assert enough > 0 or second


def _ordinary(kind: str, k: int) -> tuple[Array, tuple[float, float]]:
    """Return an image of an ordinary room without noise, and where its ball is."""
    v, u = np.mgrid[:120, :160]
    at, level = (20.0 + 5.0 * k, 90.0 - 6.0 * k + 0.25 * k * k), 184.0
    room = np.full((120, 160), 24.0)
    if kind == "window":
        room[4:34, 90:140] = 250.0
    elif kind == "gradient":
        room, level = 60.0 + 0.9 * u, 240.0
    elif kind == "darker ball":
        room[:], level = 230.0, 160.0
    elif kind == "larger ball at rest":
        room += 160.0 * np.clip(9.5 - np.hypot(u - 130, v - 100), 0.0, 1.0)
    elif kind == "lamps":
        for j in range(40):
            cover = np.clip(2.5 - np.hypot(u - 8 - j * 16 % 150, v - 5 - j // 9 * 7), 0.0, 1.0)
            room = np.maximum(room, 220.0 * cover)
    elif kind == "hot pixels":
        room[np.random.default_rng(5).integers(0, 120, 60), np.arange(3, 123, 2)] = 200.0
    share = np.clip(4.5 - np.hypot(u - at[0], v - at[1]), 0.0, 1.0)
    return room + share * (level - room), at


@pytest.mark.parametrize(
    "kind",
    ["window", "gradient", "darker ball", "larger ball at rest", "lamps", "hot pixels"],
)
def test_with_the_background_of_a_film_any_ball_is_found_in_an_ordinary_room(kind: str) -> None:
    """In every image, to a third of a pixel: the ball need not be the brightest thing."""
    rng, films = np.random.default_rng(0), []
    for k in range(20):
        image, at = _ordinary(kind, k)
        noisy = np.clip(np.rint(image + rng.normal(0.0, 2.0, image.shape)), 0.0, 255.0)
        films.append((noisy.astype(np.uint8), at))
    segmenter = Segmenter()
    segmenter.learn_background(mean_background([pixels for pixels, _ in films]))
    for k, (pixels, (u, v)) in enumerate(films):
        m = segmenter.step(Frame(t=0.01 * k, camera=0, number=k, pixels=pixels))
        assert m.found, k
        assert np.hypot(m.u - u, m.v - v) < 0.34, k


def test_pixels_out_of_order_are_listed_and_corners_are_not() -> None:
    """Single ones and pairs, hot or dead; none of a pattern of squares."""
    background = patterned(3, 60)
    assert faulty_pixels(background).shape == (2, 0)
    background[10, 20], background[30, 40:42], background[50, 70] = 255, 250, 0
    assert sorted(zip(*faulty_pixels(background).tolist(), strict=True)) == [
        (10, 20),
        (30, 40),
        (30, 41),
        (50, 70),
    ]


@settings(max_examples=20)
@given(st.floats(4.0, 12.0), st.floats(0.3, 3.0), st.integers(0, 2**32))
def test_a_ball_that_comes_into_the_image_is_not_taken_for_two(
    radius: float, speed: float, seed: int
) -> None:
    """It grows until it is whole; its mass says nothing of something that touches it."""
    rng, segmenter = np.random.default_rng(seed), Segmenter()
    for k in range(int((2.0 * radius + 12.0) / speed)):
        image = 24.0 + 160.0 * disc(40.0, -radius + k * speed, radius)
        noisy = np.clip(np.rint(image + rng.normal(0.0, 2.0, image.shape)), 0.0, 255.0)
        pixels = noisy.astype(np.uint8)
        m = segmenter.step(Frame(t=1e-3 * k, camera=0, number=k, pixels=pixels))
        assert not m.merged
    assert m.found
    assert not m.clipped
