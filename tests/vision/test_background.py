"""Difference images: what rests and what lights the scene drop out, the ball stays as it is."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from mitt.errors import InputError, ShapeError
from mitt.signals import Array, Frame, Image
from mitt.vision.background import OFFSET, subtract
from mitt.vision.camera import fixed_rig
from mitt.vision.eyes import Eyes
from mitt.vision.target import EXPECTED, GAIN, MEAN, MEMORY, WEIGHED, forget

HEIGHT, WIDTH = 64, 80
BALL = 184.0
"""Grey level of the ball."""
ROUNDING = 1.6
"""Grey levels that image, background and difference round by, the background's share enlarged."""


def memory_of(contrast: float = 0.0, mean: float = 24.0) -> Array:
    """Return a memory with a known contrast of the ball, or none."""
    memory = np.empty(MEMORY)
    forget(memory)
    memory[MEAN] = mean
    if contrast > 0.0:
        memory[GAIN], memory[WEIGHED], memory[EXPECTED] = contrast, 5.0, 20.0
    return memory


def patterned(seed: int, contrast: int) -> Image:
    """Return a background with random squares of 8 px."""
    rng = np.random.default_rng(seed)
    squares = rng.integers(0, contrast + 1, (HEIGHT // 8, WIDTH // 8))
    return (40 + np.kron(squares, np.ones((8, 8)))).astype(np.uint8)


def disc(u0: float, v0: float, radius: float) -> Array:
    """Return the share of each pixel that a disc covers, roughly."""
    v, u = np.mgrid[:HEIGHT, :WIDTH]
    return np.asarray(np.clip(radius + 0.5 - np.hypot(u - u0, v - v0), 0.0, 1.0))


def difference(pixels: NDArray[Any], background: Image, memory: Array) -> tuple[Image, float]:
    """Return the whole difference image and the light."""
    out = np.zeros((HEIGHT, WIDTH), np.uint8)
    window = np.array((0, HEIGHT - 1, 0, WIDTH - 1))
    rounded = np.clip(np.rint(pixels), 0.0, 255.0).astype(np.uint8)
    light = subtract(rounded, background, window, True, memory, out)
    return out, light


@settings(max_examples=30)
@given(st.integers(0, 2**32), st.integers(0, 200), st.floats(0.7, 1.3))
def test_a_scene_at_rest_leaves_nothing_whatever_its_pattern_and_light(
    seed: int, contrast: int, light: float
) -> None:
    """A background of any contrast, brighter or darker as a whole, is flat in the difference."""
    background = patterned(seed, contrast)
    pixels = np.clip(light * background.astype(np.float64), 0.0, 255.0)
    memory = memory_of()
    shown, found = difference(pixels, background, memory)
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
    shown, _ = difference(pixels, background, memory_of(contrast=BALL - 60.0, mean=60.0))
    assert np.abs(shown.astype(float) - plain).max() <= 6.0


def test_before_a_background_as_bright_as_the_ball_nothing_is_seen() -> None:
    """A lamp or a white arm at rest says nothing, instead of something wrong."""
    background = np.full((HEIGHT, WIDTH), 24, np.uint8)
    background[20:40, 30:60] = 200
    pixels = background.astype(float)
    pixels[25:35, 40:50] = BALL
    shown, _ = difference(pixels, background, memory_of(contrast=160.0))
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
    assert all(background.size == 0 for background in eyes.backgrounds)


def test_a_background_of_another_size_or_camera_is_refused() -> None:
    """One line says what was wanted."""
    eyes, small = Eyes(fixed_rig()), np.zeros((64, 64), np.uint8)
    with pytest.raises(ShapeError):
        eyes.learn_background([(Frame(t=0.0, camera=0, number=0, pixels=small),)])
    whole = np.zeros((128, 128), np.uint8)
    with pytest.raises(InputError, match="camera 1"):
        eyes.learn_background([(Frame(t=0.0, camera=0, number=0, pixels=whole),)])
