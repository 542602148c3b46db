"""Order of arrival, honesty under disturbance, outliers, and one-eyed sightings."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mitt.core.ball.filter import BallFilter, FilterConfig
from mitt.core.ball.flight import advance
from mitt.core.signals import Array, BallState, Sighting

SIGMA = 1.5e-3
"""Noise of the sightings [m]."""
H = 2e-3
"""Time between them [s]."""
KNOWN = FilterConfig(
    drag_mean=0.04, drag_sigma=0.01, drag_density=0.0, accel_density=1e-3, other_motion=0.02
)
"""What the simulated balls are drawn from."""
CHI_6 = (5.0, 7.0)
"""Band of the mean normalised squared error of six numbers over 300 throws: 6 +- 5 sigma."""


def throw(rng: np.random.Generator, *, n: int = 250, kick: float = 0.0) -> Array:
    """Return positions and velocities drawn from the filter's model, shape (n, 6).

    A kick [m/s] in a random direction comes between a fifth and two fifths of the flight.
    """
    r = np.array((rng.uniform(3.3, 4.9), rng.uniform(-0.4, 0.4), rng.uniform(-0.2, 0.6)))
    dr = np.array((-rng.uniform(5.0, 6.5), rng.uniform(-0.7, 0.7), rng.uniform(1.5, 3.0)))
    k, at, way = max(rng.normal(0.04, 0.01), 0.0), rng.integers(n // 5, 2 * n // 5), np.zeros(3)
    way[:] = rng.normal(size=3)
    states = np.empty((n, 6))
    for i in range(n):
        states[i] = np.concatenate((r, dr))
        push = np.sqrt(KNOWN.accel_density * H) * rng.normal(size=3)
        if i == at:
            push += kick * way / np.linalg.norm(way)
        r += 0.5 * H * push
        advance(r, dr, k, H)
        dr += push
    return states


def sightings(states: Array, rng: np.random.Generator, *, wild: float = 0.0) -> list[Sighting]:
    """Return noisy sightings; a share of them is 0.3 m away."""
    seen = []
    for i, x in enumerate(states):
        r = x[:3] + SIGMA * rng.normal(size=3)
        if rng.uniform() < wild:
            away = rng.normal(size=3)
            r = r + 0.3 * away / np.linalg.norm(away)
        seen.append(Sighting(t=i * H, found=True, r_o=r, covariance=SIGMA**2 * np.eye(3)))
    return seen


def nees(state: BallState, truth: Array) -> float:
    """Return the normalised squared error of position and velocity."""
    e = np.concatenate((state.r_o, state.dr_o)) - truth
    return float(e @ np.linalg.solve(state.covariance, e))


@given(st.integers(0, 1000), st.integers(1, 10), st.sampled_from((0.0, 0.1)))
@settings(max_examples=25, deadline=None)
def test_the_order_of_arrival_does_not_matter(seed: int, late: int, wild: float) -> None:
    """Any reordering within 20 ms gives the estimate of the right order, and its counts."""
    rng = np.random.default_rng(seed)
    seen = sightings(throw(rng, n=120, kick=2.0), rng, wild=wild)
    order = np.argsort(np.arange(len(seen)) + rng.uniform(0.0, late, len(seen)))
    right, mixed = BallFilter(KNOWN), BallFilter(KNOWN)
    for s in seen:
        right.update(s)
    for i in order:
        mixed.update(seen[i])
    a, b = right.state(0.25), mixed.state(0.25)
    assert np.array_equal(a.r_o, b.r_o)
    assert np.array_equal(a.covariance, b.covariance)
    assert right.counts == mixed.counts


def test_repetitions_change_nothing_and_the_very_late_are_dropped() -> None:
    """A stamp seen before is ignored bit for bit, one older than the ring is counted late."""
    rng = np.random.default_rng(0)
    seen, f = sightings(throw(rng), rng), BallFilter(KNOWN)
    for s in seen:
        f.update(s)
    before = f.state(0.5)
    for s in seen[-20:]:
        f.update(s)
        f.update(Sighting(t=s.t, found=True, r_o=s.r_o + 0.01, covariance=s.covariance))
    f.update(Sighting(t=0.3011, found=True, r_o=seen[150].r_o, covariance=seen[0].covariance))
    after = f.state(0.5)
    assert (f.counts.duplicate, f.counts.late) == (40, 1)
    assert np.array_equal(before.r_o, after.r_o)
    assert np.array_equal(before.covariance, after.covariance)


@pytest.mark.parametrize("kick", [0.0, 0.3, 2.0])
def test_the_covariance_is_true_with_and_without_a_kick(kick: float) -> None:
    """Over 300 throws the normalised squared error is 6 on average, soon after a kick, too."""
    rng, found = np.random.default_rng(1), []
    for _ in range(300):
        states = throw(rng, kick=kick)
        f = BallFilter(KNOWN)
        for i, s in enumerate(sightings(states, rng)):
            f.update(s)
            if i in (160, 249):
                found.append(nees(f.state(s.t), states[i]))
    assert CHI_6[0] < np.mean(found) < CHI_6[1]


def test_outliers_cost_little_and_never_the_track() -> None:
    """0.3 m off, one or ten percent: the error at the end is within 1.3 of the clean one."""
    rms = []
    for share in (0.0, 0.01, 0.1):
        rng, errors = np.random.default_rng(2), []
        for _ in range(100):
            states, f = throw(rng), BallFilter(KNOWN)
            for s in sightings(states, rng, wild=share):
                f.update(s)
            errors.append(f.state(249 * H).r_o - states[-1, :3])
        rms.append(np.sqrt(np.mean(np.square(errors))))
    assert max(rms[1:]) < 1.3 * rms[0]


def test_a_ball_elsewhere_is_believed_after_eight_rejections() -> None:
    """Never locked out: a target that has jumped by 1 m is tracked again within 8 + 6 sightings."""
    rng = np.random.default_rng(3)
    for _ in range(20):
        states, f = throw(rng), BallFilter(KNOWN)
        states[150:, 1] += 1.0
        for i, s in enumerate(sightings(states, rng)):
            f.update(s)
            if i == 150 + 14:
                assert np.linalg.norm(f.state(s.t).r_o - states[i, :3]) < 0.01


def test_a_sighting_of_one_eye_tells_only_what_it_saw() -> None:
    """Ten metres long along the ray, 1 mm across: taken in, true across, no harm along."""
    rng, found, grown = np.random.default_rng(4), [], []
    for _ in range(60):
        states, f = throw(rng), BallFilter(KNOWN)
        for i, s in enumerate(sightings(states, rng)):
            if i < 150:
                f.update(s)
                continue
            ray = states[i, :3] / np.linalg.norm(states[i, :3])
            R = SIGMA**2 * (np.eye(3) - np.outer(ray, ray)) + 100.0 * np.outer(ray, ray)
            r = s.r_o + rng.normal() * 10.0 * ray
            f.update(Sighting(t=s.t, found=True, r_o=r, covariance=R))
        end = f.state(249 * H)
        found.append(nees(end, states[-1]))
        grown.append(np.linalg.eigvalsh(end.covariance).min())
    assert min(grown) > 0.0
    assert 4.0 < np.mean(found) < 8.0
