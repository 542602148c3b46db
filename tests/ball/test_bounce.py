"""How far an estimate is doubted: after sightings that do not fit, and where none comes."""

import numpy as np
import pytest

from mitt.core.ball.filter import THROWN_BALL, BallFilter
from mitt.core.ball.flight import advance, change_by_bounce, doubt_flight
from mitt.core.signals import GRAVITY, TICK, Array, Sighting

NOISE = 1e-3
"""Of sightings, each axis [m]."""


def followed(change: Array, *, after: int) -> tuple[list[float], list[float]]:
    """Return error and 1-sigma in each frame from a kick on, ``after`` frames in all [m]."""
    rng, f = np.random.default_rng(4), BallFilter(THROWN_BALL)
    r, dr = np.array((3.5, 0.1, 0.4)), np.array((-5.5, 0.0, 1.0))
    errors, sigmas = list[float](), list[float]()
    for k in range(200 + after):
        seen = r + NOISE * rng.standard_normal(3)
        f.update(Sighting(t=TICK * k, found=True, r_o=seen, covariance=NOISE**2 * np.eye(3)))
        ball = f.state(TICK * k)
        if k > 200:
            errors.append(float(np.linalg.norm(ball.r_o - r)))
            sigmas.append(float(np.sqrt(np.trace(ball.covariance[:3, :3]))))
        advance(r, dr, 0.04, TICK)
        if k == 200:
            dr += change
    return errors, sigmas


@pytest.mark.parametrize("change", [(0.0, 0.0, 6.0), (2.0, 1.0, 4.0), (-3.0, 3.0, 0.0)])
def test_a_kick_is_within_three_sigma_all_the_time(change: tuple[float, ...]) -> None:
    """Not only once the velocity is forgotten, 8 ms later, but while sightings do not fit.

    One that is off by less than the gate, 5 sigma, still fits.
    """
    errors, sigmas = followed(np.array(change), after=40)
    assert np.all(np.array(errors) < 3.0 * np.array(sigmas) + 5.0 * NOISE)


def test_an_undisturbed_flight_is_not_doubted() -> None:
    """As long as sightings fit, sigma is what it would be without any doubt: below the noise."""
    _, sigmas = followed(np.zeros(3), after=40)
    assert max(sigmas) < NOISE


def test_a_bounce_turns_a_falling_ball_alone() -> None:
    """What falls comes up, slower, and is held back along the surface; what rose flies on."""
    change = np.zeros(3)
    for vx, vz, ago in ((-4.0, -3.0, 0.0), (3.0, -1.0, 0.05), (-2.0, 0.2, 0.01)):
        assert change_by_bounce(np.array((vx, 1.0, vz - GRAVITY * ago)), ago, change) == (vz < 0)
        if vz < 0:
            assert -vz < change[2] < -2.0 * vz
            assert change[0] * vx < 0.0
            assert abs(change[0]) < abs(vx)


@pytest.mark.parametrize("silence", [0.01, 0.03, 0.08])
def test_frames_without_the_ball_make_room_for_a_bounce_at_any_time(silence: float) -> None:
    """Wherever it bounced in the silence, it is within 3 sigma; a covariance stays one."""
    dr, change = np.array((-4.0, 0.3, -3.0)), np.zeros(3)
    covariance = 1e-8 * np.eye(6)
    doubt_flight(dr, silence, round(silence / TICK), change, covariance)
    assert np.linalg.eigvalsh(covariance).min() > 0.0
    for ago in np.linspace(0.0, silence, 7):
        for rebound in (0.5, 0.85):
            off = np.array((0.2 * 4.0, 0.0, (1.0 + rebound) * (3.0 - GRAVITY * ago))) * ago
            assert abs(off[2]) <= 3.0 * np.sqrt(covariance[2, 2])
    before = covariance.copy()
    doubt_flight(np.array((-4.0, 0.0, 1.0)), silence, 30, change, covariance)  # it rises
    doubt_flight(dr, silence, 0, change, covariance)  # no frame should have shown it
    assert np.array_equal(covariance, before)
