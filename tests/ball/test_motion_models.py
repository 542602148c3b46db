"""Targets that do not fly: at rest, led, swinging; and the speed of changing one's mind."""

from dataclasses import replace

import numpy as np
import pytest

from mitt.core.ball.filter import fresh_filter, update
from mitt.core.ball.flight import advance
from mitt.core.signals import Array
from mitt.robot.cameras.filtering import UNKNOWN_BALL, filter_flight

NOISE = 1.5e-3
"""Of each coordinate [m]."""


def rms(x: Array) -> float:
    """Return the root mean square of the lengths of rows."""
    return float(np.sqrt(np.mean(np.sum(np.square(x), axis=1))))


@pytest.mark.parametrize("hz", [60.0, 180.0, 1000.0])
@pytest.mark.parametrize("speed", [0.0, 1.0])
def test_gravity_does_not_pull_at_what_does_not_fly(hz: float, speed: float) -> None:
    """At rest or led steadily: 100 ms ahead within 8 mm rms, velocity within 60 mm/s."""
    rng, t = np.random.default_rng(0), np.arange(0.0, 1.2, 1.0 / hz)
    velocity = speed * np.array((0.6, -0.8, 0.0))
    true = 1.0 + t[:, None] * velocity
    track = filter_flight(t, true + NOISE * rng.normal(size=true.shape), ahead=0.1)
    late = t > 0.3
    assert rms((track.r - true)[late]) < NOISE * np.sqrt(3.0)
    assert rms((track.dr - velocity)[late]) < 0.06
    assert rms((track.ahead - true - 0.1 * velocity)[late]) < 8e-3


def test_a_swinging_target_is_followed() -> None:
    """On a spring, 0.1 m at 2 Hz, 16 m/s^2: position better than the sightings, sigma true."""
    rng, t = np.random.default_rng(1), np.arange(0.0, 2.0, 1e-3)
    true = np.outer(0.1 * np.sin(4.0 * np.pi * t), (0.6, 0.0, 0.8))
    track = filter_flight(t, true + NOISE * rng.normal(size=true.shape))
    error, late = track.r - true, t > 0.3
    assert rms(error[late]) < 0.6 * NOISE * np.sqrt(3.0)
    assert 0.6 < rms(error[late]) / rms(track.sigma[late]) < 1.5


def test_a_ball_let_go_is_known_to_fly() -> None:
    """Held for half a second, then thrown: 60 ms after the release it is a flight again."""
    rng, h, best = np.random.default_rng(2), 2e-3, []
    ball = fresh_filter(UNKNOWN_BALL)
    r, dr = np.array((4.0, 0.0, 0.3)), np.array((-5.0, 0.3, 4.0))
    for i in range(400):
        z = r + NOISE * rng.normal(size=3)
        update(ball, i * h, z, NOISE**2 * np.eye(3))
        best.append(int(ball["now"]["best"][0]))
        if i >= 250:
            advance(r, dr, 0.04, h)
    assert set(best[100:250]) == {1}
    assert set(best[300:]) == {0}


def test_a_known_ball_in_flight_costs_one_model() -> None:
    """While flight fits, the other models are inactive."""
    rng, h = np.random.default_rng(3), 1e-3
    ball = fresh_filter(replace(UNKNOWN_BALL, watchful=False))
    r, dr = np.array((4.0, 0.0, 0.3)), np.array((-6.0, 0.3, 2.0))
    for i in range(400):
        update(ball, i * h, r + NOISE * rng.normal(size=3), NOISE**2 * np.eye(3))
        assert not ball["now"]["active"][0]
        advance(r, dr, 0.08, h)
