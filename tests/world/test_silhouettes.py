"""Outlines of arm and hand are where they are seen, whatever part of them the image shows."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from mitt.signals import Image
from mitt.world.imaging import whole_images
from mitt.world.silhouettes import draw_capsule

SIDE, MARGIN = 24, 60
"""Sides of a small image, and of what lies around it in a large one [px]."""

places = st.floats(-50.0, 74.0)


def whole(pixels: Image) -> NDArray[np.int64]:
    """Return the window that is a whole image."""
    window: NDArray[np.int64] = whole_images([(pixels.shape[0], pixels.shape[1])])[0]
    return window


@settings(max_examples=200)
@given(places, places, places, places, st.floats(1.0, 12.0))
def test_an_image_is_a_window_into_a_larger_one(
    u0: float, v0: float, u1: float, v1: float, radius: float
) -> None:
    """What is drawn into an image is what a larger image around it shows there."""
    small = np.zeros((SIDE, SIDE), np.uint8)
    large = np.zeros((SIDE + 2 * MARGIN, SIDE + 2 * MARGIN), np.uint8)
    seen, quiet = np.array([u0, v0, 1.0, u1, v1, 1.0, radius]), np.zeros(large.size, np.uint8)
    draw_capsule(small, np.array([1.0, 0.0, 0.0]), seen, 200, quiet, whole(small))
    draw_capsule(large, np.array([1.0, MARGIN, MARGIN]), seen, 200, quiet, whole(large))
    window = large[MARGIN : MARGIN + SIDE, MARGIN : MARGIN + SIDE]
    # The border pixels round towards the image: an outline that ends within a pixel of them.
    assert np.array_equal(small[1:-1, 1:-1], window[1:-1, 1:-1])
