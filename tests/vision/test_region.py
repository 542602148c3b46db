"""Where the next image is searched first is known beforehand; where that suffices, only there."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from mitt.signals import Array, Image
from mitt.vision.segmentation import SegmenterConfig, detect, pack_segmenter, suffices
from mitt.vision.target import MEMORY, WORK, forget, region_of_interest

HEIGHT, WIDTH = 64, 80
SETTINGS = pack_segmenter(SegmenterConfig())


def image_of(rng: np.random.Generator, balls: list[tuple[float, float, float]]) -> Image:
    """Return noise with bright discs (u, v, radius)."""
    v, u = np.mgrid[:HEIGHT, :WIDTH]
    pixels = 24.0 + 2.2 * rng.standard_normal((HEIGHT, WIDTH))
    for at_u, at_v, radius in balls:
        cover = np.clip(radius + 0.5 - np.hypot(u - at_u, v - at_v), 0.0, 1.0)
        pixels += cover * (184.0 - pixels)
    return np.clip(pixels, 0.0, 255.0).astype(np.uint8)


def fresh() -> Array:
    """Return a memory without a target."""
    memory = np.empty(MEMORY)
    forget(memory)
    return memory


@settings(max_examples=40, deadline=None)
@given(
    st.integers(0, 2**32), st.floats(-2.5, 2.5), st.floats(-2.5, 2.5), st.floats(1.5, 6.0),
    st.booleans(), st.booleans(),
)  # fmt: skip
def test_the_rest_of_an_image_is_not_looked_at(
    seed: int, du: float, dv: float, radius: float, second: bool, learned: bool
) -> None:
    """Where the window suffices, images that differ beyond it leave the same bits in the memory.

    A ball crosses the image and leaves it, a second one standing in its way or not, with a
    background that was learned or without.
    """
    rng, memory, window = np.random.default_rng(seed), fresh(), np.empty(4, np.int64)
    work, other, weights = np.zeros((WORK, 4), np.int64), np.zeros((WORK, 4), np.int64), np.zeros(7)
    background, scratch, rest = np.empty((0, 0), np.uint8), *np.empty((2, HEIGHT, WIDTH), np.uint8)
    if learned:
        background = np.full((HEIGHT, WIDTH), 24, np.uint8)
    enough = 0
    for k in range(24):
        balls = [(40.0 + k * du, 30.0 + k * dv, radius)]
        pixels = image_of(rng, [*balls, (60.0, 40.0, 4.0)] if second else balls)
        window[:] = 0, HEIGHT - 1, 0, WIDTH - 1
        known = region_of_interest(memory, SETTINGS, window)
        assert known == (k > 0 and not np.isnan(memory[0]))
        part = rng.integers(0, 256, pixels.shape).astype(np.uint8)
        seen = slice(window[0], window[1] + 1), slice(window[2], window[3] + 1)
        part[seen] = pixels[seen]
        copy, before = memory.copy(), memory.copy()
        if known and suffices(part, background, scratch, window, copy, SETTINGS, other, weights):
            assert copy.tobytes() == before.tobytes()
            enough += 1
            part_seen = detect(part, background, scratch, copy, SETTINGS, other)
            assert part_seen == detect(pixels, background, rest, memory, SETTINGS, work)
            assert copy.tobytes() == memory.tobytes()
        else:
            detect(pixels, background, rest, memory, SETTINGS, work)
    assert enough > 0 or second
