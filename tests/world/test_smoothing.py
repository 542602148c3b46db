"""Smoothing: true to a flight, sharp at a bounce, derivatives that are derivatives."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mitt.signals import Array
from mitt.world.ballistics import fly
from mitt.world.smoothing import smooth

NOISE_M = np.array([1.6, 0.6, 0.85]) * 1e-3  # measured, README of the flights
FRAME = 1.0 / 179.0


def bounced(t: Array, hit: float) -> tuple[Array, Array]:
    """Return positions and velocities of a table-tennis ball that bounces at ``hit`` [s]."""
    before = fly(np.array([0.0, 0.0, 1.1]), np.array([4.4, 0.1, 2.0]), drag=0.12, duration=hit)
    after = before[1] * np.array([0.7, 0.9, -0.85])
    rows = [
        fly(np.array([0.0, 0.0, 1.1]), np.array([4.4, 0.1, 2.0]), drag=0.12, duration=s)
        if s < hit
        else fly(before[0], after, drag=0.12, duration=s - hit)
        for s in t
    ]
    return np.array([r for r, _ in rows]), np.array([dr for _, dr in rows])


@settings(max_examples=40)
@given(hit=st.floats(0.40, 0.60), seed=st.integers(0, 1000))
def test_a_noisy_bounce_is_found_and_stays_sharp(hit: float, seed: int) -> None:
    """One bounce, within 1.5 ms; the curve within the noise, the velocity within 0.25 m/s inside.

    A polynomial is worst at its ends; what the arm catches lies well inside a piece.
    """
    t = np.arange(0.0, 0.9, FRAME)
    r, dr = bounced(t, hit)
    curve = smooth(t, r + NOISE_M * np.random.default_rng(seed).standard_normal(r.shape))
    assert len(curve.edges) == 3
    assert curve.edges[1] == pytest.approx(hit, abs=0.0015)
    found = [curve.at(s) for s in t]
    inside = (np.abs(t - hit) > 0.05) & (t > 0.05) & (t < 0.85)
    assert np.abs(np.array([p for p, _ in found]) - r)[inside].max() < 0.003
    assert np.abs(np.array([v for _, v in found]) - dr)[inside].max() < 0.25


@settings(max_examples=30)
@given(hit=st.floats(0.40, 0.60))
def test_position_is_continuous_at_a_bounce_and_velocity_is_not(hit: float) -> None:
    """The two sides of a bounce meet to a nanometre; the vertical velocity flips at once."""
    t = np.arange(0.0, 0.9, FRAME)
    curve = smooth(t, bounced(t, hit)[0])
    left, right = curve.at(np.nextafter(curve.edges[1], 0.0)), curve.at(curve.edges[1])
    assert left[0] == pytest.approx(right[0], abs=1e-9)
    assert left[1][2] < -1.5
    assert right[1][2] > 1.5


@given(seed=st.integers(0, 1000))
def test_a_flight_without_bounce_is_one_piece(seed: int) -> None:
    """Neither the apex nor the noise is taken for a bounce."""
    t = np.arange(0.0, 0.6, FRAME)
    r = bounced(t, 5.0)[0] + NOISE_M * np.random.default_rng(seed).standard_normal((len(t), 3))
    assert len(smooth(t, r).edges) == 2


@given(s=st.floats(0.01, 0.89))
def test_velocity_is_the_derivative_of_position(s: float) -> None:
    """Central difference of the position, except across the bounce."""
    t = np.arange(0.0, 0.9, FRAME)
    curve, h = smooth(t, bounced(t, 0.5)[0]), 1e-5
    if abs(s - curve.edges[1]) < 2 * h:
        return
    difference = (curve.at(s + h)[0] - curve.at(s - h)[0]) / (2 * h)
    assert curve.at(s)[1] == pytest.approx(difference, abs=1e-5)


def test_a_wild_sample_is_left_out() -> None:
    """A sample 5 cm off does not bend the curve."""
    t = np.arange(0.0, 0.6, FRAME)
    r = bounced(t, 5.0)[0]
    wild = r + 1e-4 * np.random.default_rng(0).standard_normal(r.shape)
    wild[40] += 0.05
    curve = smooth(t, wild)
    assert not curve.used[40]
    assert curve.at(float(t[40]))[0] == pytest.approx(r[40], abs=1e-3)


def test_ten_samples_are_enough() -> None:
    """The shortest recording that is read can be smoothed."""
    t = np.linspace(0.0, 0.1, 10)
    r = bounced(t, 5.0)[0]
    assert smooth(t, r).at(0.05)[0] == pytest.approx(fly(r[0], np.array([4.4, 0.1, 2.0]),
        drag=0.12, duration=0.05)[0], abs=0.02)  # fmt: skip
