"""Panoramas: what was seen in a direction is there again, and noise does not move it."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mitt.core.ball.filter import THROWN_BALL, BallFilter
from mitt.core.ball.flight import advance
from mitt.core.eyes.eyes import Eyes
from mitt.core.eyes.head import active_rig
from mitt.core.eyes.panorama import PANORAMA, allow_beside, cut_out, mean_ratio, record
from mitt.core.signals import Image
from mitt.lab.world.imaging import Imager, ImageSensor, sensor_of
from mitt.lab.world.scene import named_scene

TURN = st.integers(-3000, 3000)
WHOLE = np.array((0, 29, 0, 40))
SOON = 60
"""Looks after which both heads see the ball [ms]: they wait for it with different phases."""
SHARE = 0.85
"""Share of the looks from the first sighting on in which the ball is seen where it is; lamps and
windows hide it from one head or both."""


def blank_panorama() -> Image:
    """Return a panorama of a head that has seen nothing."""
    return np.zeros((PANORAMA, PANORAMA), np.uint8)


@settings(max_examples=30)
@given(TURN, TURN, st.integers(0, 2**32))
def test_what_was_seen_in_a_direction_is_there_again(row: int, column: int, seed: int) -> None:
    """Wherever the image lies, beyond the panorama's ends too, and moved by some pixels."""
    seen = np.random.default_rng(seed).integers(1, 256, (30, 41)).astype(np.uint8)
    panorama, part = blank_panorama(), np.zeros_like(seen)
    record(panorama, (row, column), seen)
    cut_out(panorama, (row, column), WHOLE, part)
    assert np.array_equal(part, seen)
    cut_out(panorama, (row + 3, column - 5), WHOLE, part)
    assert np.array_equal(part[:-3, 5:], seen[3:, :-5])
    assert not np.any(part[-3:])


@settings(max_examples=10)
@given(st.floats(20.0, 220.0), st.integers(0, 2**32))
def test_what_is_recorded_does_not_drift_by_noise_or_light(level: float, seed: int) -> None:
    """Two hundred looks at an even wall, with noise and flicker: it stays as at first."""
    rng = np.random.default_rng(seed)
    panorama, part = blank_panorama(), np.zeros((128, 128), np.uint8)
    whole, first = np.array((0, 127, 0, 127)), 0.0
    for k in range(200):
        light = 1.0 + 0.05 * np.sin(2.5 * k)
        image = np.clip(light * level + rng.normal(0.0, 3.0, part.shape), 1.0, 255.0)
        pixels = np.rint(image).astype(np.uint8)
        cut_out(panorama, (0, 0), whole, part)
        ratio = mean_ratio(pixels, part, 1.0)
        record(panorama, (0, 0), np.clip(pixels / ratio + 0.5, 1.0, 255.0).astype(np.uint8))
        first = first or float(panorama[:128, :128].mean())
    assert panorama[:128, :128].mean() == pytest.approx(first, rel=0.02, abs=0.7)


def test_edges_of_lamps_may_be_a_pixel_beside_and_a_ball_may_not() -> None:
    """A lamp in another row and column is what was seen there; a ball before the wall is not."""
    wall = np.full((40, 40), 100, np.uint8)
    wall[10:14, 10:14] = 230
    laid, whole = np.zeros_like(wall), np.array((0, 39, 0, 39))
    allow_beside(wall, np.roll(wall, (1, -1), (0, 1)), 1.0, whole, laid)
    assert np.array_equal(laid, np.roll(wall, (1, -1), (0, 1)))
    ball = wall.copy()
    ball[20:30, 20:30] = 190
    allow_beside(wall, ball, 1.0, whole, laid)
    assert np.array_equal(laid, wall)


@pytest.mark.parametrize("brightness", [90.0, -90.0])
def test_heads_see_a_ball_in_an_ordinary_room(brightness: float) -> None:
    """Before a wall lit from one side, with windows, lamps, hot pixels, flicker and a shadow."""
    sensor = replace(sensor_of(named_scene("room")), brightness=brightness)
    right, looks = 0, 0
    for seed in (7002, 7003):
        rng, rig = np.random.default_rng(seed), active_rig()
        imager, eyes, belief = Imager(rig, sensor, rng), Eyes(rig), BallFilter(THROWN_BALL)
        eyes.learn_background(imager.before(10, np.zeros((0, 8))))
        r = rng.uniform((3.3, -0.5, -0.2), (4.6, 0.6, 0.6))
        dr = (np.array((0.8, 0.0, 0.0)) - r) / 0.55 + np.array((-0.4, 0.0, 2.7))
        for k in range(400):
            t = 1e-3 * k
            eyes.guide(belief.state(t), t, alone=True)
            sighting = eyes.step(imager.render(t, r, 0.04, dr_o=dr))
            if sighting.found:
                assert np.linalg.norm(sighting.r_o - r) < 0.05
                belief.update(sighting)
            looks, right = looks + (k > SOON), right + (k > SOON and sighting.found)
            imager.turn(eyes.gaze(belief.state(t), t + 1e-3), 1e-3)
            advance(r, dr, 0.04, 1e-3)
    assert right > SHARE * looks


def test_a_shadow_stays_on_the_wall_as_a_head_turns() -> None:
    """By so many pixels as the wall does."""
    sensor = ImageSensor(
        background=110.0,
        brightness=90.0,
        texture=0.0,
        read_noise=0.0,
        electrons=1e12,
        shadow=(0.5, 0.0),
    )
    rig = active_rig()
    imager = Imager(rig, sensor, np.random.default_rng(3))
    edges = []
    for turned in (0.0, 12.0):
        goal = np.array([(*head.search, 0.0, 0.0) for head in rig.heads])
        goal[:, 0] += turned / rig.cameras[0].f_px
        for _ in range(200):
            imager.turn(goal, 1e-3)
        line = imager.render(0.0, None, 0.04)[0].pixels[64].astype(float)
        edges.append(float(np.interp(82.5, line, np.arange(len(line)))))
    assert edges[0] - edges[1] == pytest.approx(12.0, abs=1.0)
