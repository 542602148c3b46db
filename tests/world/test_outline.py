"""A ball is drawn the same whatever was drawn before."""

import numpy as np

from mitt.signals import Array, Image
from mitt.world.outline import SCRATCH, draw_ball

LENS, LIGHT = (200.0, 49.5, 30.0), (200.0, 2.0, 40.0)
BALL = (0.02, 0.01, 1.0, 0.03, 0.012, 1.0, 0.04)
NOISE = np.random.default_rng(5).standard_normal(20_000)


def drawn(width: int, work: Array) -> Image:
    """Return an image so wide of a ball that moves."""
    pixels = np.full((64, width), 30, np.uint8)
    draw_ball(pixels, LENS, BALL, LIGHT, NOISE, 7, (0, 63, 0, width - 1), work)
    return pixels


def test_scratch_serves_images_of_any_width_in_turn() -> None:
    """Narrow, wide, narrow: each as with scratch of its own."""
    work = np.zeros(SCRATCH + 2 * 100 + 1)
    for width in (50, 100, 70, 100, 50):
        assert np.array_equal(drawn(width, work), drawn(width, np.zeros(SCRATCH + 201)))
    assert drawn(100, work).max() > 150
