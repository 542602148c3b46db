"""The time to the catch: the next root, and the catch that the flight comes to."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mitt.generator.generators import Direct
from mitt.generator.learn import Learned
from mitt.generator.mapping import NEAR, DirectMap, root_time
from mitt.generator.prediction import flown
from mitt.robot.hands import HandModel
from mitt.signals import PASSED, Array, BallState, MapStatus

G = np.array([0.0, 0.0, -9.81])
#: Step of the dense forecast [s], and what its chord is off [s].
FINE, CHORD = 1e-3, 1e-4
#: Share by which the ball's present motion may mislead within NEAR of the catch.
MISLEADS = 0.35

seeds = st.integers(0, 2**31)
numbers = st.floats(-1e3, 1e3).filter(lambda x: x == 0.0 or abs(x) > 1e-3)


@settings(max_examples=100)
@given(s=numbers, ds=numbers, dds=numbers)
def test_the_root_is_the_next_one(s: float, ds: float, dds: float) -> None:
    """It is a zero, not in the past, and none comes before it; infinite where none comes."""
    t = root_time(s, ds, dds)
    assert t >= 0.0
    ahead = np.linspace(0.0, 2.0, 400) if t == np.inf else np.linspace(0.0, 0.999 * t, 400)
    way = s + ds * ahead + 0.5 * dds * ahead**2
    if s == 0.0:
        assert t == 0.0
        return
    assert np.all(way[:-1] * s > -1e-9 * max(abs(s), 1.0))
    if t < np.inf:
        scale = abs(s) + abs(ds) * t + 0.5 * abs(dds) * t * t
        assert abs(s + ds * t + 0.5 * dds * t * t) <= 1e-9 * scale


@pytest.mark.parametrize(
    ("of", "time"),
    [
        ((1.0, -1.0, 2.0), np.inf), ((1.0, 0.0, -2.0), 1.0), ((1.0, -0.0, -2.0), 1.0),
        ((-1.0, 0.0, 2.0), 1.0), ((1.0, 1.0, 0.0), np.inf), ((1.0, -2.0, 0.0), 0.5),
        ((1.0, 0.0, 0.0), np.inf), ((0.0, 0.0, 0.0), 0.0), ((1.0, 1.0, -4.0), 1.0),
        ((np.nan, 1.0, 1.0), np.inf), ((1e200, -1e200, 1e200), np.inf),
    ],
)  # fmt: skip
def test_roots_that_are_known(of: tuple[float, float, float], time: float) -> None:
    """Rising, falling, turning, at rest, at the catch, and what is no number."""
    assert root_time(*of) == pytest.approx(time)


def coming(f: DirectMap, seed: int, descent: tuple[float, float]) -> tuple[BallState, float]:
    """Return a ball that comes through a random point of the catch, and how long before it."""
    rng = np.random.default_rng(seed)
    q = f.start + np.append(rng.uniform(-0.25, 0.25, 2), 0.0)
    speed, down, turn = rng.uniform(1.5, 7.0), rng.uniform(*descent), rng.uniform(-0.3, 0.3)
    level = np.array([-np.cos(turn), -np.sin(turn)])
    dr = speed * np.array([*np.cos(down) * level, -np.sin(down)])
    t = rng.uniform(0.02, 0.6)
    r = f.arm.position(q) - t * dr + 0.5 * t * t * G
    return BallState(t=0.0, r_o=r, dr_o=dr - t * G, covariance=1e-8 * np.eye(6)), t


def distance(f: DirectMap, r_o: Array) -> float:
    """Return the distance to go at a ball position [rad]; NaN outside the domain."""
    status, q_o = f.to_joints(r_o)
    return (
        float(q_o[f.design.catch_joint] - f.design.q_catch)
        if status is MapStatus.INSIDE
        else np.nan
    )


def dense(f: DirectMap, ball: BallState) -> float:
    """Return the first time at which the flight passes q_alpha [s]; infinite without, 1 s ahead."""
    path = flown(ball, np.arange(0.0, 1.0, FINE))
    s = np.array([distance(f, row[0]) for row in path])
    out = np.flatnonzero(np.isnan(s))
    s = s[: out[0]] if len(out) else s
    passes = np.flatnonzero(s[:-1] * s[1:] <= 0.0)
    if not len(passes):
        return np.inf
    k = int(passes[0])
    return FINE * (k + float(s[k] / (s[k] - s[k + 1])))


@pytest.mark.parametrize("descent", [(0.0, 0.8), (0.8, 1.2), (1.2, 1.5)])
def test_the_time_is_that_of_the_flight(learned: Learned, descent: tuple[float, float]) -> None:
    """Against a dense forecast: far ahead to 0.1 ms, near as well as the present motion tells."""
    f = learned.map
    for seed in range(50):
        ball, _ = coming(f, seed, descent)
        said, true = f.reference(ball).time_to_catch, dense(f, ball)
        if said <= NEAR:
            assert abs(said - true) <= MISLEADS * true + CHORD
        else:
            assert said == pytest.approx(max(true, NEAR), abs=CHORD)


def test_the_time_that_a_closing_takes_is_told_whatever_comes(learned: Learned) -> None:
    """Along feasible flights, steep lobs among them, the time falls below a lead at the lead."""
    f, lead, feasible = learned.map, HandModel().closing_time(0.04), 0
    g = Direct(f)
    for seed in range(30):
        ball, _ = coming(f, seed, (1.2, 1.5) if seed % 2 else (0.0, 1.2))
        if g.verdict(ball, f.arm.q_ready).outcome.value != "feasible":
            continue
        feasible, true = feasible + 1, dense(f, ball)
        times = np.arange(0.0, true, FINE)
        moving = [f.reference(x).time_to_catch for x in along(ball, times)]
        closes = times[np.flatnonzero(np.array(moving) <= lead)[0]]
        assert abs(closes - max(true - lead, 0.0)) <= 0.010
    assert feasible > 10


def along(ball: BallState, times: Array) -> list[BallState]:
    """Return a ball as it is at later times."""
    return [BallState(t=float(t), r_o=row[0], dr_o=row[1])
            for t, row in zip(times, flown(ball, times), strict=True)]  # fmt: skip


@settings(max_examples=50)
@given(seed=seeds)
def test_a_catch_has_just_passed_or_is_over(learned: Learned, seed: int) -> None:
    """Negative, and falling with the time, while it counts as just passed; then no more."""
    f, (ball, t) = learned.map, coming(learned.map, seed, (0.0, 0.8))
    for since in (1e-3, 5e-3, 0.7 * PASSED):  # beyond, the motion misleads by a tenth
        (later,) = along(ball, np.array([t + since]))
        assert f.reference(later).time_to_catch == pytest.approx(-since, abs=3e-4 + 0.1 * since)
    (later,) = along(ball, np.array([t + 2.0 * PASSED]))
    assert f.reference(later).time_to_catch > 0.0


@settings(max_examples=50)
@given(seed=seeds, vx=st.floats(0.5, 8.0))
def test_a_ball_that_flies_away_has_no_catch(learned: Learned, seed: int, vx: float) -> None:
    """From in front of the arm, and away from it: infinite, not a time that has passed."""
    rng = np.random.default_rng(seed)
    r = np.array([rng.uniform(1.1, 3.0), rng.uniform(-0.3, 0.3), rng.uniform(0.0, 0.8)])
    ball = BallState(t=0.0, r_o=r, dr_o=np.array([vx + 2.0, 0.0, rng.uniform(-1.0, 1.0)]))
    assert learned.map.reference(ball).time_to_catch == np.inf
