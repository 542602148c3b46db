"""Outlines of arm and hand are where they are seen, whatever part of them the image shows."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from mitt.signals import Image
from mitt.world.capsules import Edges, Point, draw_body, draw_capsule, seen_from

SIDE, MARGIN = 24, 60
"""Sides of a small image, and of what lies around it in a large one [px]."""

places = st.floats(-50.0, 74.0)


def whole(pixels: Image) -> Edges:
    """Return the window that is a whole image."""
    return 0, pixels.shape[0] - 1, 0, pixels.shape[1] - 1


@settings(max_examples=200)
@given(places, places, places, places, st.floats(1.0, 12.0))
def test_an_image_is_a_window_into_a_larger_one(
    u0: float, v0: float, u1: float, v1: float, radius: float
) -> None:
    """What is drawn into an image is what a larger image around it shows there."""
    small = np.zeros((SIDE, SIDE), np.uint8)
    large = np.zeros((SIDE + 2 * MARGIN, SIDE + 2 * MARGIN), np.uint8)
    seen, quiet = (u0, v0, 1.0, u1, v1, 1.0, radius), np.zeros(large.size, np.uint8)
    draw_capsule(small, (1.0, 0.0, 0.0), seen, 200, quiet, 0, whole(small))
    draw_capsule(large, (1.0, MARGIN, MARGIN), seen, 200, quiet, 0, whole(large))
    window = large[MARGIN : MARGIN + SIDE, MARGIN : MARGIN + SIDE]
    # The border pixels round towards the image: an outline that ends within a pixel of them.
    assert np.array_equal(small[1:-1, 1:-1], window[1:-1, 1:-1])


ends = st.tuples(st.floats(-1.5, 1.5), st.floats(-1.5, 1.5), st.floats(-1.0, 3.0))
spans = st.tuples(st.integers(0, SIDE - 1), st.integers(0, SIDE - 1)).map(sorted)


@settings(max_examples=300)
@given(st.lists(st.tuples(ends, ends, st.floats(0.01, 0.3)), min_size=1, max_size=5), spans, spans)
def test_no_capsule_that_the_window_shows_is_skipped(
    shapes: list[tuple[Point, Point, float]], rows: list[int], columns: list[int]
) -> None:
    """Arm and hand in a window are what each capsule gives that is drawn for itself."""
    capsules = np.array([(*a, *b, radius) for a, b, radius in shapes])
    lens, window = (20.0, 11.5, 11.5), (rows[0], rows[1], columns[0], columns[1])
    camera = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, *lens)
    body, single = np.zeros((SIDE, SIDE), np.uint8), np.zeros((SIDE, SIDE), np.uint8)
    quiet = np.zeros(body.size, np.uint8)
    nowhere = (0.0, 0.0, -np.inf)
    assert draw_body(body, camera, capsules, 200, quiet, 0, window, nowhere, False) == 0
    for k in range(len(capsules)):
        ahead, seen = seen_from(camera, capsules, k)
        if ahead:
            draw_capsule(single, lens, seen, 200, quiet, 0, window)
    assert np.array_equal(body, single)
