"""A ball is drawn the same whatever was drawn before."""

import numpy as np
from numpy.typing import NDArray

from mitt.lab.world.outline import PaintScratch, paint_ball, scratch_for

LENS = (200.0, 49.5, 30.0)
BALL = (0.02, 0.01, 1.0, 0.03, 0.012, 1.0, 0.04)


def drawn(width: int, work: PaintScratch) -> NDArray[np.float32]:
    """Return an image so wide of a ball that moves."""
    canvas = np.full((64, width), 30.0, np.float32)
    paint_ball(canvas, LENS, BALL, 200.0, (0, 63, 0, width - 1), work)
    return canvas


def test_scratch_serves_images_of_any_width_in_turn() -> None:
    """Narrow, wide, narrow: each as with scratch of its own."""
    work = scratch_for(100)
    for width in (50, 100, 70, 100, 50):
        assert np.array_equal(drawn(width, work), drawn(width, scratch_for(width)))
    assert drawn(100, work).max() > 150.0
