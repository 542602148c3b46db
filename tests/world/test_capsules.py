"""Outlines of arm and hand are where they are seen, whatever part of them the image shows."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from mitt.lab.world.capsules import Canvas, Edges, Point, capsule_in_view, misses, paint_capsule

SIDE = 24
MARGIN = 60
"""Sides of a small image, and of what lies around it in a large one [px]."""
PLAIN = (0.0, 0.0, 0.0)
"""Neither a lit side nor a grain."""
ROUNDING = 1e-3
"""Grey levels of 200: a place in a large image is rounded otherwise than in a small one."""

places = st.floats(-50.0, 74.0)


def whole(canvas: Canvas) -> Edges:
    """Return the window that is a whole image."""
    return 0, canvas.shape[0] - 1, 0, canvas.shape[1] - 1


@settings(max_examples=200)
@given(places, places, places, places, st.floats(1.0, 12.0))
def test_an_image_is_a_window_into_a_larger_one(
    u0: float, v0: float, u1: float, v1: float, radius: float
) -> None:
    """What is drawn into an image is what a larger image around it shows there."""
    small = np.zeros((SIDE, SIDE), np.float32)
    large = np.zeros((SIDE + 2 * MARGIN, SIDE + 2 * MARGIN), np.float32)
    seen = (u0, v0, 1.0, u1, v1, 1.0, radius)
    paint_capsule(small, (1.0, 0.0, 0.0), seen, 200.0, PLAIN, whole(small))
    paint_capsule(large, (1.0, MARGIN, MARGIN), seen, 200.0, PLAIN, whole(large))
    window = large[MARGIN : MARGIN + SIDE, MARGIN : MARGIN + SIDE]
    assert np.abs(small - window).max() <= ROUNDING


ends = st.tuples(st.floats(-1.5, 1.5), st.floats(-1.5, 1.5), st.floats(-1.0, 3.0))
spans = st.tuples(st.integers(0, SIDE - 1), st.integers(0, SIDE - 1)).map(sorted)


@settings(max_examples=300)
@given(ends, ends, st.floats(0.01, 0.3), spans, spans)
def test_no_capsule_that_the_window_shows_is_skipped(
    a: Point, b: Point, radius: float, rows: list[int], columns: list[int]
) -> None:
    """One that is said to miss a window paints nothing into it."""
    lens, window = (20.0, 11.5, 11.5), (rows[0], rows[1], columns[0], columns[1])
    camera = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, *lens)
    ahead, seen = capsule_in_view(camera, np.array([(*a, *b, radius, 0.0)]), 0)
    if ahead and misses(lens, seen, window):
        canvas = np.zeros((SIDE, SIDE), np.float32)
        paint_capsule(canvas, lens, seen, 200.0, PLAIN, window)
        assert not canvas.any()
