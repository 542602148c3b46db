"""Groups of bright pixels: all of them, the most like a ball first, wherever they are."""

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mitt.core.ball.flight import advance
from mitt.core.eyes.camera import fixed_rig
from mitt.core.eyes.eyes import Eyes
from mitt.core.eyes.groups import GROUP, LOOK, MOST_GROUPS, SCAN, find_groups, likeness
from mitt.core.kernels import Record
from mitt.core.signals import Array, Frame, Image
from mitt.lab.world.imaging import Imager, ImageSensor

TICKS = 80
SOON = 25
"""Looks at a throw, and those after which the ball is to be known."""
CLOSE = 0.05
"""Distance from the ball that is no other thing [m]."""
GATE = 0.85
"""Share of the frames in which the ball is as heavy as it should be, noise and all: without specks
it is 0.93 to 0.98, and less where it passes over one."""
V, U = np.mgrid[:128, :128]


def look_of(*, area: float = 0.0, least: int = 1) -> Record:
    """Return a look of pixels above 40 on a ground of 24, shape (1,)."""
    look = np.zeros(1, LOOK)
    look["level"], look["threshold"], look["area"], look["least"] = 24.0, 40.0, area, least
    return look


def groups_of(pixels: Image, look: Record, before: Image | None = None) -> tuple[Record, int]:
    """Return the groups that are kept, and how many were left out."""
    best, scan = np.zeros(MOST_GROUPS, GROUP), np.zeros(1, SCAN)
    earlier = np.empty((0, 0), np.uint8) if before is None else before
    count = find_groups(pixels, earlier, look[0], scan[0], best)
    return best[:count], int(scan["left_out"][0])


@settings(max_examples=60)
@given(st.integers(0, 2**32), st.floats(0.0, 1.0))
def test_groups_are_connected_components_the_most_like_a_ball_first(
    seed: int, share: float
) -> None:
    """OpenCV finds the same ones, whatever the image holds; those kept are the best of them."""
    rng = np.random.default_rng(seed)
    pixels = np.where(rng.random((30, 41)) < share, 200, 24).astype(np.uint8)
    look = look_of()
    count, _, stats, _ = cv2.connectedComponentsWithStats((pixels > 40).astype(np.uint8))
    every = np.zeros(count - 1, GROUP)
    for group, (left, top, width, height, area) in zip(every, stats[1:], strict=True):
        group["left"], group["top"], group["area"] = left, top, area
        group["right"], group["bottom"] = left + width - 1, top + height - 1
        group["mass"] = 176.0 * area
        group["likeness"] = likeness(group, look[0], False)
    found, left_out = groups_of(pixels, look)
    assert len(found) + left_out == len(every)
    alike = np.sort(every["likeness"])[::-1][: len(found)]
    assert found["likeness"] == pytest.approx(alike)
    places = set(every[["left", "top", "right", "bottom", "area", "mass"]].tolist())
    assert places.issuperset(found[["left", "top", "right", "bottom", "area", "mass"]].tolist())


def disc(u: float, v: float, radius: float) -> Array:
    """Return the share of each pixel that a disc covers, roughly."""
    return np.asarray(np.clip(radius + 0.5 - np.hypot(U - u, V - v), 0.0, 1.0))


@settings(max_examples=20)
@given(st.integers(0, 2**32), st.integers(20, 200))
def test_a_ball_below_any_number_of_specks_is_kept(seed: int, count: int) -> None:
    """Single pixels and pairs, wherever they are; they are counted."""
    rng = np.random.default_rng(seed)
    pixels = np.full((128, 128), 24, np.uint8)
    pixels[rng.integers(0, 120, count), rng.integers(0, 128, count)] = 250
    pixels = np.maximum(pixels, (184.0 * disc(64.0, 122.0, 3.0)).astype(np.uint8))
    found, left_out = groups_of(pixels, look_of())
    assert left_out > 0
    assert (found["left"][0] + found["right"][0], found["bottom"][0]) == (128, 125)


def test_what_moved_is_more_like_a_ball_than_what_rests() -> None:
    """A lamp that is larger and as round counts less once it was there before."""
    lamp = np.maximum(24.0, 250.0 * disc(30.0, 30.0, 9.0)).astype(np.uint8)
    pixels = np.maximum(lamp, (184.0 * disc(90.0, 80.0, 2.0)).astype(np.uint8))
    assert groups_of(pixels, look_of())[0]["left"][0] == 21
    assert groups_of(pixels, look_of(), lamp)[0]["left"][0] == 88


@pytest.mark.parametrize("size", [0.0, 1.7])
@pytest.mark.parametrize("count", [40, 200])
@pytest.mark.parametrize("learned", [False, True])
def test_a_thrown_ball_is_seen_beside_specks_and_lamps(
    size: float, count: int, learned: bool
) -> None:
    """Hot pixels, or lamps as large as the ball, of which a single image cannot tell it apart."""
    rng, rig = np.random.default_rng(count), fixed_rig()
    right, looks, crowded = 0, 0, False
    imager = Imager(rig, ImageSensor(), rng)
    bright = np.zeros((2, 128, 128))
    for image in bright:
        for u, v, scale in rng.uniform((2, 2, 0.6), (126, 60, 1.4), (count, 3)):
            if size == 0.0:
                image[int(v), int(u)] = 196.0
            else:
                image[:] = np.maximum(image, 196.0 * disc(u, v, size * scale))

    def lit(frames: tuple[Frame, ...]) -> tuple[Frame, ...]:
        """Return frames with the lamps."""
        for frame in frames:
            lamps = bright[frame.camera] + frame.pixels % 8
            np.copyto(frame.pixels, np.maximum(frame.pixels, lamps * (lamps > 8)).astype(np.uint8))
        return frames

    eyes = Eyes(rig)
    if learned:
        eyes.learn_background([lit(view) for view in imager.before(10, np.zeros((0, 8)))])
    r = rng.uniform((3.4, -0.4, 0.0), (4.2, 0.4, 0.5))
    dr = (np.array((0.8, 0.0, 0.1)) - r) / 0.5 + np.array((-0.4, 0.0, 2.4))
    for k in range(TICKS):
        sighting = eyes.step(lit(imager.render(1e-3 * k, r, 0.04, dr_o=dr)))
        crowded |= eyes.left_out > 0
        if k >= SOON:
            looks, right = looks + 1, right + sighting.found
            assert not sighting.found or np.linalg.norm(sighting.r_o - r) < CLOSE
        advance(r, dr, 0.04, 1e-3)
    assert right >= GATE * looks
    assert not (learned and crowded)
    assert learned or size == 0.0 or crowded
