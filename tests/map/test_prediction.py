"""The predicted catch against a fine integration of the flight that knows nothing of kernels."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support import ball_state

from mitt.core.ball.flight import forecast
from mitt.core.map.foresight import foresee, sharpness
from mitt.core.map.learn import Learned
from mitt.core.map.mapping import DirectMap
from mitt.core.map.prediction import FADES, flown, spread
from mitt.core.signals import Array, BallState, MapStatus

G = np.array([0.0, 0.0, -9.81])
#: Step of the fine integration [s], agreement of the time of the catch [s] and of the flight [m].
FINE = 1e-3
TIME = 1e-5
PLACE = 1e-7

seeds = st.integers(0, 2**31)


def rate(x: Array, drag: float) -> Array:
    """Return d/dt of position and velocity, shape (6,)."""
    return np.concatenate([x[3:], G - drag * np.linalg.norm(x[3:]) * x[3:]])


def step(x: Array, drag: float, h: float) -> Array:
    """Return the state one classical Runge-Kutta step later, in plain NumPy."""
    a = rate(x, drag)
    b = rate(x + 0.5 * h * a, drag)
    c = rate(x + 0.5 * h * b, drag)
    d = rate(x + h * c, drag)
    out: Array = x + h / 6.0 * (a + 2.0 * b + 2.0 * c + d)
    return out


def throw(f: DirectMap, seed: int) -> BallState:
    """Return a ball that flies, drag included, through a random point of the catch."""
    rng = np.random.default_rng(seed)
    q = np.array([rng.uniform(-0.3, 0.3), np.pi / 4 + rng.uniform(-0.2, 0.2), f.design.q_catch])
    dr = np.array([-rng.uniform(4.0, 6.5), rng.uniform(-0.5, 0.5), -rng.uniform(0.5, 3.0)])
    x, drag = np.concatenate([f.arm.position(q), dr]), rng.uniform(0.0, 0.15)
    for _ in range(int(rng.integers(150, 450))):
        x = step(x, drag, -FINE)
    return replace(ball_state(x[:3], x[3:], rate(x, drag)[3:]), drag=drag)


def distance_to_go(f: DirectMap, r: Array) -> float:
    """Return s = q_o,i - q_alpha at a ball position [rad]."""
    status, q_o = f.to_joints(r)
    assert status is MapStatus.INSIDE
    return float(q_o[f.design.catch_joint] - f.design.q_catch)


@settings(max_examples=40)
@given(seed=seeds)
def test_the_predicted_catch_is_where_the_flight_passes_q_alpha(
    plain: DirectMap, seed: int
) -> None:
    """Integrated in steps of 1 ms, s changes its sign at the predicted time, to 10 us."""
    ball = throw(plain, seed)
    seen = foresee(plain, ball)
    x, t = np.concatenate([ball.r_o, ball.dr_o]), 0.0
    before = distance_to_go(plain, x[:3])
    while True:
        x, t = step(x, ball.drag, FINE), t + FINE
        after = distance_to_go(plain, x[:3])
        if before * after <= 0.0:
            break
        before = after
    crossing = t - FINE * after / (after - before)
    # The chord of s over 1 ms bends by less than 1e-5 s.
    assert seen.after == pytest.approx(crossing, abs=TIME + 1e-5)
    assert seen.q_o[plain.design.catch_joint] == pytest.approx(plain.design.q_catch, abs=1e-3)


@settings(max_examples=20)
@given(seed=seeds)
def test_the_flown_path_is_the_flight(plain: DirectMap, seed: int) -> None:
    """Positions, velocities and accelerations along the path agree with plain NumPy."""
    ball = throw(plain, seed)
    path = flown(ball, np.arange(0.0, 0.4, 0.05))
    x = np.concatenate([ball.r_o, ball.dr_o])
    for row in path:
        assert np.allclose(row[0], x[:3], atol=PLACE)
        assert np.allclose(row[1], x[3:], atol=10 * PLACE)
        assert np.allclose(row[2], rate(x, ball.drag)[3:], atol=100 * PLACE)
        for _ in range(50):
            x = step(x, ball.drag, FINE)


@settings(max_examples=20)
@given(seed=seeds, falls=st.booleans())
def test_a_led_ball_goes_on_with_a_push_that_fades(seed: int, falls: bool) -> None:
    """Plain NumPy in steps of 1 ms: the push fades by 1/e in 0.2 s, with weight or without."""
    rng = np.random.default_rng(seed)
    push, base = rng.uniform(-2.0, 2.0, 3), G if falls else np.zeros(3)
    r, dr = rng.uniform(1.0, 2.0, 3), rng.uniform(-4.0, 4.0, 3)
    led = replace(ball_state(r, dr, base + push), drag=0.0, led=True)
    path = flown(led, np.arange(0.0, 0.4, 0.05))
    fine = 1e-4
    for row in path:
        assert np.allclose(row[0], r, atol=1e-5)
        assert np.allclose(row[1], dr, atol=1e-4)
        assert np.allclose(row[2], base + push, atol=1e-3)
        for _ in range(500):
            middle = base + push * np.exp(-0.5 * fine / FADES)
            r, dr = r + fine * dr + 0.5 * fine**2 * middle, dr + fine * middle
            push = push * np.exp(-fine / FADES)


@given(y=st.floats(2.0, 6.0), side=st.sampled_from([-1.0, 1.0]))
def test_a_ball_far_to_the_side_is_never_caught(plain: DirectMap, y: float, side: float) -> None:
    """Without a catch the time is infinite, and the virtual joints are numbers all the same."""
    ball = ball_state(np.array([3.0, side * y, 0.3]), np.array([-6.0, 0.0, 1.0]), G)
    seen = foresee(plain, ball)
    if np.isinf(seen.after):
        assert not seen.below
    assert np.all(np.isfinite(seen.q_o))


@given(vx=st.floats(0.0, 8.0))
def test_a_ball_that_flies_away_is_never_caught(plain: DirectMap, vx: float) -> None:
    """Away from the arm there is no catch and nothing below it."""
    seen = foresee(plain, ball_state(np.array([3.0, 0.0, 0.3]), np.array([vx, 0.0, 1.0]), G))
    assert np.isinf(seen.after)
    assert not seen.below


def test_a_ball_that_falls_short_is_seen_to_pass_below(plain: DirectMap) -> None:
    """Under the reach of the arm a ball passes below; one over it does not."""
    low = ball_state(np.array([3.0, 0.0, -0.8]), np.array([-6.0, 0.0, 0.0]), G)
    high = ball_state(np.array([3.0, 0.0, 2.5]), np.array([-6.0, 0.0, 3.0]), G)
    assert foresee(plain, low).below
    assert not foresee(plain, high).below


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_a_ball_that_is_no_number_has_no_catch(plain: DirectMap, bad: float) -> None:
    """NaN and infinity in position or velocity: no catch, finite joints, no endless loop."""
    for k in range(6):
        x = np.array([3.0, 0.0, 0.3, -6.0, 0.0, 1.0])
        x[k] = bad
        seen = foresee(plain, ball_state(x[:3], x[3:], G))
        assert np.isinf(seen.after)
        assert np.all(np.isfinite(seen.q_o))


def test_a_catch_at_the_very_instant_of_a_step_is_seen(plain: DirectMap) -> None:
    """Where s is 0.0 to the bit after a whole number of strides, the catch is not lost."""
    nominal, dr_c = plain.arm.position(plain.start), np.array([-6.6, 0.0, -2.6])
    exact = 0
    for speed in np.linspace(0.9, 1.1, 300):
        dr = speed * dr_c
        ball = ball_state(nominal - 0.4 * dr + 0.08 * G, dr - 0.4 * G, G)
        assert foresee(plain, ball).after == pytest.approx(0.4, abs=TIME)
        exact += distance_to_go(plain, flown(ball, np.linspace(0.0, 0.4, 41))[-1, 0]) == 0.0
    assert exact > 0


@settings(max_examples=50)
@given(seed=seeds, after=st.floats(0.0, 0.6))
def test_the_spread_is_the_largest_axis_of_the_forecast(seed: int, after: float) -> None:
    """The closed form agrees with LAPACK's eigenvalues of the forecast covariance."""
    rng = np.random.default_rng(seed)
    L = rng.normal(size=(6, 6)) * np.repeat([0.01, 0.1], 3)[:, None]
    ball = replace(ball_state(*rng.normal(size=(3, 3))), covariance=L @ L.T)
    ahead = forecast(ball, ball.t + after).covariance[:3, :3]
    assert spread(ball, after) == pytest.approx(np.sqrt(np.linalg.eigvalsh(ahead)[-1]), rel=1e-9)


def test_a_catch_is_as_sharp_as_its_forecast_and_only_inside_the_region(learned: Learned) -> None:
    """Within the bounds it is the spread at the predicted catch; just outside there is none."""
    f = learned.map
    for seed in range(10):
        ball = throw(f, seed)
        seen = foresee(f, ball)
        wide = np.array([seen.q_o, seen.q_o])
        assert sharpness(replace(f, region=wide), ball) == spread(ball, seen.after)
        beside = wide + 0.3 + 1e-6  # a map is trusted 0.3 rad beyond what it was learned on
        assert sharpness(replace(f, region=beside), ball) == np.inf
