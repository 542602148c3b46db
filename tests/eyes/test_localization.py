"""Several bright balls: the one that flies is followed, from images alone."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mitt.core.ball.flight import advance
from mitt.core.eyes.camera import fixed_rig
from mitt.core.eyes.candidates import MOST, TRACK, fastest_track
from mitt.core.eyes.eyes import Eyes
from mitt.core.signals import Array
from mitt.lab.world.imaging import Imager, ImageSensor

TICKS = 120
SOON = 25
"""Looks at a throw, and those after which the ball is to be known."""
CLOSE = 0.05
"""Distance from the thrown ball that is no other ball [m]."""


def found_off(
    second: tuple[float, float, float, float],
    velocity: tuple[float, float, float],
    *,
    seed: int,
    learned: bool,
) -> Array:
    """Return how far from the thrown ball each sighting after ``SOON`` is [m]."""
    rng, rig = np.random.default_rng(seed), fixed_rig()
    imager = Imager(rig, ImageSensor(), rng, second=second, second_velocity=velocity)
    eyes = Eyes(rig)
    if learned:
        eyes.learn_background(imager.before(10, np.zeros((0, 8))))
    r = rng.uniform((3.4, -0.4, 0.0), (4.2, 0.4, 0.5))
    dr = (np.array((0.8, 0.0, 0.1)) - r) / 0.5 + np.array((-0.4, 0.0, 2.4))
    off = []
    for k in range(TICKS):
        sighting = eyes.step(imager.render(1e-3 * k, r, 0.04, dr_o=dr))
        if sighting.found and k >= SOON:
            off.append(float(np.linalg.norm(sighting.r_o - r)))
        advance(r, dr, 0.04, 1e-3)
    return np.array(off)


@pytest.mark.parametrize("learned", [True, False])
@settings(max_examples=15)
@given(
    st.floats(1.2, 3.2),
    st.sampled_from((-0.55, 0.55)),
    st.floats(-0.9, -0.3),
    st.floats(0.03, 0.08),
    st.integers(0, 2**32),
)
def test_a_ball_at_rest_is_never_the_target(
    learned: bool, x: float, y: float, z: float, radius: float, seed: int
) -> None:
    """Of any size and nearer, with a learned background and without: the thrown one is seen."""
    off = found_off((x, y, z, radius), (0.0, 0.0, 0.0), seed=seed, learned=learned)
    assert len(off) > 0.5 * (TICKS - SOON)
    assert off.max() < CLOSE


@settings(max_examples=15)
@given(
    st.floats(1.5, 3.0),
    st.floats(0.5, 2.0),
    st.floats(0.0, 2.0 * np.pi),
    st.floats(0.03, 0.08),
    st.integers(0, 2**32),
)
def test_a_rolling_ball_is_never_the_target(
    x: float, speed: float, way: float, radius: float, seed: int
) -> None:
    """At 0.5 to 2 m/s it moves, but less than what flies."""
    velocity = speed * np.cos(way), speed * np.sin(way), 0.0
    off = found_off((x, 0.5, -0.8, radius), velocity, seed=seed, learned=True)
    assert len(off) > 0.5 * (TICKS - SOON)
    assert off.max() < CLOSE


@settings(max_examples=60)
@given(st.floats(0.0, 1.5), st.floats(5.0, 10.0), st.integers(8, 24), st.integers(0, 2**32))
def test_a_slow_candidate_is_not_taken_for_a_thrown_ball(
    slow: float, fast: float, looks: int, seed: int
) -> None:
    """Places are known to 2 mm an axis: what rolls waits, also alone; what was thrown is taken."""
    rng, tracks = np.random.default_rng(seed), np.zeros(MOST, TRACK)
    for k, speed in enumerate((slow, fast)):
        tracks["r"][k], tracks["start"][k] = rng.normal(scale=0.002, size=(2, 3))
        tracks["r"][k, 0] += 1e-3 * looks * speed
        tracks["first"][k], tracks["last"][k], tracks["seen"][k] = 1, 1 + looks, looks
    assert fastest_track(tracks, 1, False, 5) == -1
    assert fastest_track(tracks, 1, True, 5) == 0
    assert fastest_track(tracks, 2, False, 5) == fastest_track(tracks, 2, True, 5) == 1
