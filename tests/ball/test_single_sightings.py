"""No single sighting decides: wrong stamps, wrong places, points that are no ball, exact places."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mitt.core.ball.filter import THROWN_BALL, BallFilter
from mitt.core.ball.motion_models import RING, ROW
from mitt.core.errors import InputError
from mitt.core.signals import GRAVITY, Array, Sighting
from mitt.robot.cameras.filtering import fresh_noise, learn_noise

H = 1e-3
SIGMA = 1e-3
START = 100.0
"""Time between sightings [s], their noise [m], time of the first [s]."""
BALL = replace(THROWN_BALL, drag_mean=0.0)
GAP = BALL.max_gap


def true(t: float) -> Array:
    """Return where the ball is [m], ``t`` after the start [s]."""
    out: Array = np.array((3.6, 0.15, 0.2)) + t * np.array((-5.9, -0.2, 2.2))
    out[2] -= 0.5 * GRAVITY * t * t
    return out


def at(t: float, place: Array, sigma: float = SIGMA) -> Sighting:
    """Return a sighting so long after the start [s]."""
    return Sighting(t=START + t, found=True, r_o=place, covariance=sigma**2 * np.eye(3))


def flight(n: int, seed: int = 0) -> list[Sighting]:
    """Return noisy sightings of a flight."""
    rng = np.random.default_rng(seed)
    return [at(k * H, true(k * H) + SIGMA * rng.standard_normal(3)) for k in range(n)]


def shown(sightings: list[Sighting]) -> BallFilter:
    """Return a filter that has seen sightings."""
    f = BallFilter(BALL)
    for s in sightings:
        f.update(s)
    return f


def miss(f: BallFilter, t: float) -> float:
    """Return the error of an estimate so long after the start [m]; infinite without one."""
    s = f.state(START + t)
    return float(np.linalg.norm(s.r_o - true(t))) if s.tracked else np.inf


@given(
    st.one_of(st.floats(-1e6, START - GAP - 0.2), st.floats(START + GAP + 0.3, 1e9)),
    st.integers(1, 199),
    st.integers(0, 5),
)
@settings(max_examples=50)
def test_a_stamp_of_another_time_changes_nothing(stamp: float, place: int, seed: int) -> None:
    """Stale by more than the gap or far ahead, wherever it comes: the estimate, bit for bit."""
    seen = flight(200, seed)
    wrong = replace(seen[0], t=stamp, r_o=np.ones(3))
    a, b = shown(seen), shown([*seen[:place], wrong, *seen[place:]])
    for ahead in (-0.01, 0.0, 0.1, 0.4):
        x, y = a.state(seen[-1].t + ahead), b.state(seen[-1].t + ahead)
        assert x.tracked
        assert y.tracked
        assert np.array_equal(x.r_o, y.r_o)
        assert np.array_equal(x.covariance, y.covariance)
    assert b.counts.restarts == 0


@given(st.floats(-0.4, 0.4), st.integers(8, 199), st.integers(0, 3), st.integers(0, 10**6))
@settings(max_examples=60)
def test_a_place_where_the_ball_is_not_costs_nothing(
    shift: float, place: int, kind: int, seed: int
) -> None:
    """Half a metre off or more, at any stamp about the newest: the error stays that of the rest."""
    rng, seen = np.random.default_rng(seed), flight(200)
    away = rng.standard_normal(3)
    z = (
        true(place * H) + 0.5 * away / np.linalg.norm(away),
        np.zeros(3),
        np.ones(3),
        true(place * H) + 3.0 * away / np.linalg.norm(away),
    )[kind]
    stamp = (place - 0.5) * H + min(shift, 0.0)
    f = shown([*seen[:place], at(stamp, z), *seen[place:]])
    assert miss(f, 199 * H) < 1.5e-3
    g = shown([*seen, at(199 * H + abs(shift) + 1e-4, z)])
    x, y = shown(seen).state(seen[-1].t), g.state(seen[-1].t)
    assert np.array_equal(x.r_o, y.r_o)
    assert np.array_equal(x.covariance, y.covariance)


@pytest.mark.parametrize("start", [5.0, -7.0, 1e6])
def test_a_clock_that_was_set_is_believed_after_a_row(start: float) -> None:
    """The old track holds for one sighting less than the row, the new one has all of the row."""
    old = flight(50)
    new = [replace(s, t=s.t + start) for s in flight(50, seed=1)]
    f = shown(old)
    for k, s in enumerate(new):
        f.update(s)
        begun = f.state(old[-1].t).t_first != old[0].t
        assert begun == (k + 1 >= ROW)
        assert f.state(s.t).tracked == (k + 1 >= BALL.min_sightings)
    state, clean = f.state(new[-1].t), shown(new).state(new[-1].t)
    assert state.t_first == new[0].t
    assert np.array_equal(state.r_o, clean.r_o)
    assert np.array_equal(state.covariance, clean.covariance)
    assert f.counts.restarts == 1


def test_single_stamps_of_other_times_are_no_row() -> None:
    """Between good ones, far from one another, or one stamp again and again: the track goes on."""
    seen = flight(120)
    wild = [replace(seen[0], t=x) for x in (0.0, 0.0, 0.0, 0.0, 50.0, 200.0, 1e3, 1e4, 10.0)]
    f = shown([*seen[:60], *wild, *seen[60:]])
    between = shown([x for s in seen for x in (s, replace(s, t=s.t - 10.0))])
    for g in (f, between):
        assert g.counts.restarts == 0
        assert miss(g, 119 * H) < 1.5e-3


@pytest.mark.parametrize("every", [2, 3, 4, 5, 6, 7, 10])
@pytest.mark.parametrize("first", [0, 1, 2])
@pytest.mark.parametrize("where", ["origin", "anywhere", "two points"])
def test_one_wrong_position_in_a_few_is_survived(every: int, first: int, where: str) -> None:
    """From the first sighting on: known after twice as many as ever, and then never lost."""
    rng, seen, f = np.random.default_rng(every), flight(200), BallFilter(BALL)
    wrong: dict[str, Callable[[int], Array]] = {
        "origin": lambda _: np.zeros(3),
        "anywhere": lambda _: rng.uniform(-3.0, 3.0, 3),
        "two points": lambda k: np.full(3, 1.0 + (k // every) % 2),
    }
    for k, s in enumerate(seen):
        f.update(replace(s, r_o=wrong[where](k)) if k % every == first % every else s)
        if k >= 2 * BALL.min_sightings + 2:
            assert miss(f, k * H) < 5e-3


@pytest.mark.parametrize("length", [1, 3, 10, 30, 50])
@pytest.mark.parametrize("where", ["origin", "anywhere"])
def test_a_hidden_ball_is_not_where_the_tracker_says(length: int, where: str) -> None:
    """The origin, or one place after another, while the ball is hidden: the flight goes on."""
    rng, seen = np.random.default_rng(length), flight(200)
    f = BallFilter(BALL)
    for k, s in enumerate(seen):
        z = np.zeros(3) if where == "origin" else rng.uniform(-3.0, 3.0, 3)
        f.update(replace(s, r_o=z) if 100 <= k < 100 + length else s)
        if k >= 60:
            assert miss(f, k * H) < 5e-3
    assert f.counts.restarts == 0


def test_what_rests_is_a_target_to_the_last_digit() -> None:
    """A ball at rest, known exactly, is tracked; and a ball that flies off from there, too."""
    still, place = [at(k * H, true(0.0)) for k in range(50)], true(0.0)
    f = shown(still)
    assert np.allclose(f.state(START + 49 * H).r_o, place, atol=1e-3)
    for k in range(60):
        f.update(at(50 * H + k * H, true(k * H)))
    s = f.state(START + 109 * H)
    assert np.linalg.norm(s.r_o - true(59 * H)) < 5e-3


@pytest.mark.parametrize("count", [20, RING - 1, RING + 2, 100, 2 * RING, 150, 300])
def test_one_camera_that_sees_something_else_costs_no_track(count: int) -> None:
    """However long: after a bounce and ``count`` lines of another thing, the ball is kicked."""
    rng, f = np.random.default_rng(count), BallFilter(BALL)
    ray = np.array((1.0, 0.2, 0.1)) / np.linalg.norm((1.0, 0.2, 0.1))
    line = SIGMA**2 * np.eye(3) + np.outer(ray, ray)
    r, v = np.array((3.6, 0.15, 0.2)), np.array((-5.9, -0.2, 0.2))
    for k in range(100 + count + 40):
        if k == 100:
            v[2] += 3.0
        hidden = 100 <= k < 100 + count
        z = r + SIGMA * rng.standard_normal(3) + (np.array((0.0, 0.5, 0.0)) if hidden else 0.0)
        R = line if hidden else SIGMA**2 * np.eye(3)
        f.update(Sighting(t=k * H, found=True, r_o=z, covariance=R))
        assert k < BALL.min_sightings or f.state(k * H).tracked
        r, v = r + H * v, v - H * np.array((0.0, 0.0, GRAVITY))
    assert f.counts.restarts == 0


@pytest.mark.parametrize(
    "covariance",
    [
        np.zeros((3, 3)),
        np.diag((0.0, 1e-6, 1e-6)),
        np.full((3, 3), 1e-6),
        1e-6 * np.outer((3.0, 0.1, 0.7), (3.0, 0.1, 0.7)),
        1e-30 * np.eye(3),
    ],
)
def test_exact_positions_are_used(covariance: Array) -> None:
    """Known exactly in all or some directions: tracked to a tenth of a millimetre, no NaN."""
    seen = [replace(at(k * H, true(k * H)), covariance=covariance) for k in range(200)]
    f = shown(seen)
    assert f.counts.used == len(seen)
    assert miss(f, 199 * H) < 1e-4
    assert np.linalg.eigvalsh(f.state(seen[-1].t).covariance).min() > -1e-15


@given(st.integers(0, 10**6), st.floats(-9.0, 3.0))
def test_every_covariance_is_taken_and_no_other_matrix(seed: int, size: float) -> None:
    """Any A A', of any rank and size, but for its rounding; and never one of a negative square."""
    rng = np.random.default_rng(seed)
    A = 10.0**size * rng.standard_normal((3, rng.integers(1, 4)))
    P = A @ A.T
    assert (
        at(0.0, np.zeros(3)).covariance.shape
        == replace(at(0.0, np.zeros(3)), covariance=P).covariance.shape
    )
    direction = rng.standard_normal(3)
    direction /= np.linalg.norm(direction)
    negative = P - 2.0 * (direction @ P @ direction + 1e-3 * np.trace(P)) * np.outer(
        direction, direction
    )
    skew = P + 0.1 * np.trace(P) * np.array(((0.0, 1.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)))
    holes = np.where(rng.permutation(9).reshape(3, 3) == 0, (np.nan, np.inf, -np.inf), P)
    for wrong in (negative, skew, holes, -P):
        with pytest.raises(InputError, match=r"sighting.covariance: wanted a covariance"):
            Sighting(t=0.0, found=True, r_o=np.zeros(3), covariance=wrong)
        assert not Sighting(t=0.0, found=False, r_o=np.zeros(3), covariance=wrong).found


def learned(t: Array, z: Array) -> Array:
    """Return the variances that are learned from positions [m^2], shape (3,)."""
    noise = fresh_noise()
    for k in range(len(t)):
        learn_noise(noise, t[k], z[k])
    variance: Array = noise["variance"][0]
    return variance


@given(
    st.sampled_from((0.0, -1.0, 1e-9, 5.0, 1e300, np.nan, np.inf, -np.inf)),
    st.sampled_from((0.0, 1e3, np.nan, np.inf)),
    st.integers(0, 399),
)
@settings(max_examples=50)
def test_one_wrong_row_does_not_spoil_the_noise(stamp: float, place: float, k: int) -> None:
    """A stamp that repeats, goes back or far ahead, a place beside itself: the noise is learned."""
    rng, t = np.random.default_rng(k), np.arange(400) * H
    z = np.array([true(x) for x in t]) + 2e-3 * rng.standard_normal((400, 3))
    stamps = np.insert(t, k, t[k - 1] + stamp).astype(np.float64)
    sigma = np.sqrt(learned(stamps, np.insert(z, k, place, axis=0)))
    assert np.isfinite(sigma).all()
    assert sigma.min() > 1.2e-3
    assert sigma.max() < 3.5e-3
