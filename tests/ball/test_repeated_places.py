"""A place that comes again to the last digit: a target that stops dead, or a tracker that does."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mitt.core.ball.filter import THROWN_BALL, BallFilter, FilterConfig
from mitt.core.signals import GRAVITY, Array, Sighting
from mitt.lab.trials.station import CARRIED

START = np.array((0.5, -0.4, 0.3))
"""Where a target begins [m]."""
SOON = 6
"""Sightings at rest after which a stop is known: a kick is believed after six rejections."""
LEAST = 0.03
"""Time that it takes at least [s]: at 1 kHz some sightings pass until one is beyond the gate."""


def seen(t: float, r_o: Array, sigma: float) -> Sighting:
    """Return a sighting."""
    return Sighting(t=t, found=True, r_o=r_o, covariance=sigma**2 * np.eye(3))


def rounded(r: Array, digits: int | None) -> Array:
    """Return a place in so many digits; exact for None."""
    return r if digits is None else np.round(r, digits)


@given(
    hz=st.sampled_from((60.0, 120.0, 240.0, 1000.0)),
    v=st.floats(0.1, 1.5),
    phase=st.floats(0.0, 1.0),
    sigma=st.sampled_from((0.0, 1e-5, 1e-4, 1e-3)),
    digits=st.sampled_from((None, 3, 4)),
    carried=st.booleans(),
)
@settings(max_examples=120, deadline=None)
def test_a_target_that_stops_dead_is_known_to_stand(
    hz: float, v: float, phase: float, sigma: float, digits: int | None, *, carried: bool
) -> None:
    """Positions without noise repeat themselves then: known within six sightings, or 30 ms."""
    sigma = sigma if digits is None else max(sigma, 10.0**-digits / np.sqrt(12.0))
    stop, f = 0.8 + phase / hz, BallFilter(CARRIED if carried else replace(CARRIED, driven_sigma=4))
    known = stop + max(SOON / hz, LEAST) + 1.0 / hz
    for k in range(round((stop + 0.5) * hz)):
        t = k / hz
        place = START + np.array((0.0, v * min(t, stop), 0.0))
        f.update(seen(t, rounded(place, digits), sigma))
        if t > known:
            s = f.state(t)
            assert s.tracked
            assert np.linalg.norm(s.r_o - place) < 2e-3 + 5.0 * sigma
            assert t - s.t_seen <= 2.0 / hz + 1e-9
    assert f.counts.restarts == 0


@pytest.mark.parametrize("hz", [60.0, 200.0, 1000.0])
def test_a_target_may_stop_where_it_has_been(hz: float) -> None:
    """There and back by 12 cm, to the last digit: a place that it has passed is no fault."""
    f, away = BallFilter(CARRIED), 0.12
    for k in range(round(2.0 * hz)):
        t = k / hz
        s = min(max(t - 0.6, 0.0), 0.3) / 0.3  # over and back within 0.3 s
        place = START + np.array((0.0, away * np.sin(np.pi * s), 0.0))
        f.update(seen(t, place, 1e-4))
        if t > 0.9 + max(SOON / hz, LEAST) + 1.0 / hz:
            assert np.linalg.norm(f.state(t).r_o - START) < 1e-3
    assert f.counts.repeated == 0


def flown(t: float) -> Array:
    """Return where a ball in flight is [m]."""
    fall = np.array((0.0, 0.0, -0.5 * GRAVITY * t * t))
    out: Array = np.array((3.6, 0.15, 0.2)) + t * np.array((-5.9, -0.2, 2.2)) + fall
    return out


@given(
    hz=st.sampled_from((60.0, 120.0, 1000.0)),
    length=st.floats(0.02, 0.25),
    sigma=st.sampled_from((0.0, 1e-4, 1e-3)),
    seed=st.integers(0, 10**6),
    origin=st.booleans(),
)
@settings(max_examples=60, deadline=None)
def test_a_tracker_that_loses_the_ball_bends_no_flight(
    hz: float, length: float, sigma: float, seed: int, *, origin: bool
) -> None:
    """It repeats the origin, or what it saw last, under new stamps: a dropout and nothing else."""
    rng, config = np.random.default_rng(seed), replace(THROWN_BALL, drag_mean=0.0)
    ball, clean, held = BallFilter(config), BallFilter(config), np.zeros(3)
    start = 0.2 if hz > 100.0 else 0.3
    for k in range(round(0.6 * hz)):
        t = k / hz
        z = flown(t) + sigma * rng.standard_normal(3)
        if start <= t < start + length:
            ball.update(seen(t, held, sigma))
        else:
            held = np.zeros(3) if origin else z
            ball.update(seen(t, z, sigma))
            clean.update(seen(t, z, sigma))
        a, b = ball.state(t), clean.state(t)
        assert np.linalg.norm(a.r_o - b.r_o) < 1e-3
        assert a.tracked == b.tracked
    assert ball.counts.kicks == ball.counts.restarts == 0


@pytest.mark.parametrize("hz", [60.0, 1000.0])
def test_a_carried_target_does_not_jump_to_the_origin(hz: float) -> None:
    """Half of the sightings, or thirty in a row, say the origin: the belt goes on."""
    lost: tuple[Callable[[int], bool], ...] = (lambda k: k % 2 == 1, lambda k: 80 <= k < 110)
    for wrong in lost:
        f = BallFilter(CARRIED)
        for k in range(round(2.0 * hz)):
            t = k / hz
            place = START + np.array((0.0, 0.3 * t, 0.0))
            f.update(seen(t, np.zeros(3) if wrong(k) else place, 1e-3))
            if t > 0.5:
                assert np.linalg.norm(f.state(t).r_o - place) < 5e-3
        assert f.counts.repeated > 20
        assert f.counts.kicks == 0
        assert f.state(2.0 - 1.0 / hz).t_first < 0.5


_KINDS = ("good", "good", "good", "wild", "origin", "nan", "lost", "again", "old", "ahead", "vague")


@given(
    kinds=st.lists(st.sampled_from(_KINDS), max_size=150),
    seed=st.integers(0, 10**6),
    step=st.sampled_from((0.001, 0.008, 0.016)),
    watchful=st.booleans(),
)
@settings(max_examples=150, deadline=None)
def test_each_sighting_is_counted_once(
    kinds: list[str], seed: int, step: float, *, watchful: bool
) -> None:
    """Whatever comes, in whatever order, with kicks and other balls: none is dropped in silence."""
    rng, f, t = np.random.default_rng(seed), BallFilter(FilterConfig(watchful=watchful)), 0.0
    kick = rng.standard_normal(3) * rng.choice((0.0, 3.0))
    for kind in kinds:
        t += step
        r = flown(t) + kick * max(t - 0.1, 0.0) + 1e-3 * rng.standard_normal(3)
        good = seen(t, r, 1e-3)
        late = replace(good, t=t - step * rng.integers(1, 80) - 0.3 * step)
        f.update(
            {
                "good": good,
                "wild": replace(good, r_o=r + rng.standard_normal(3)),
                "origin": replace(good, r_o=np.zeros(3)),
                "nan": replace(good, r_o=np.full(3, np.nan)),
                "lost": replace(good, found=False),
                "again": replace(good, t=t - step),
                "old": replace(late, r_o=flown(late.t)),
                "ahead": replace(good, t=t + rng.uniform(0.7, 3.0)),
                "vague": replace(good, covariance=np.eye(3)),
            }[kind]
        )
    c = f.counts
    assert c.used + sum(c.unused.values()) == len(kinds)
    assert min(c.used, c.rejected) >= 0
