"""The flight kernels against formulas, finer steps and central differences."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mitt.core.ball.flight import (
    STATES,
    MotionModel,
    acceleration,
    advance,
    advance_uncertain,
    forecast,
)
from mitt.core.errors import InputError
from mitt.core.signals import GRAVITY, Array, BallState

ROUNDING = 1e-12
"""Metres and metres a second."""
STEP_ERROR = 1e-6
"""Of the longest Runge-Kutta steps over a second, where the ball turns [m, m/s]."""
LINEAR = 5e-3
"""Relative error of the transition matrices over 0.3 s."""
SAMPLING = 0.05
"""Of covariances of 20000 samples, relative."""
HOPS = 1e-2
"""Relative, between covariances that travelled in steps of different length."""

speed = st.floats(-7.0, 7.0)
velocity = st.tuples(speed, speed, speed).map(np.array)
drag = st.floats(0.0, 0.2)


def fly(r: Array, dr: Array, k: float, dt: float) -> Array:
    """Return position and velocity after ``dt``, shape (6,)."""
    r, dr = r.copy(), dr.copy()
    advance(r, dr, k, dt)
    return np.concatenate((r, dr))


def state(r: Array, dr: Array, *, tracked: bool = True) -> BallState:
    """Return an estimate at time 1 with 1 mm and 10 mm/s of uncertainty."""
    P = np.diag([1e-6] * 3 + [1e-4] * 3)
    return BallState(
        t=1.0,
        tracked=tracked,
        r_o=r,
        dr_o=dr,
        ddr_o=np.zeros(3),
        drag=0.04,
        covariance=P,
        t_seen=0.9,
        t_first=0.5,
    )


@given(velocity, st.floats(-0.6, 0.6))
def test_a_ball_without_drag_flies_a_parabola(dr: Array, dt: float) -> None:
    """Without drag, position and velocity are those of free fall."""
    fall = np.array((0.0, 0.0, -GRAVITY))
    wanted = np.concatenate((dr * dt + 0.5 * fall * dt * dt, dr + fall * dt))
    assert fly(np.zeros(3), dr, 0.0, dt) == pytest.approx(wanted, abs=ROUNDING)


@settings(max_examples=30)
@given(velocity, drag, st.floats(0.01, 0.5))
def test_long_steps_agree_with_very_short_ones(dr: Array, k: float, dt: float) -> None:
    """Twenty-millisecond steps end where a midpoint rule with 2000 steps ends."""
    r, v, a = np.zeros(3), dr.copy(), np.empty(3)
    h = dt / 2000
    for _ in range(2000):
        acceleration(v, k, a)
        middle = v + 0.5 * h * a
        acceleration(middle, k, a)
        r, v = r + h * middle, v + h * a
    assert fly(np.zeros(3), dr, k, dt) == pytest.approx(np.concatenate((r, v)), abs=1e-5)


@given(velocity, drag, st.floats(0.0, 0.5))
def test_flight_can_be_reversed(dr: Array, k: float, dt: float) -> None:
    """Flying on and back again ends at the start."""
    there = fly(np.zeros(3), dr, k, dt)
    back = fly(there[:3], there[3:], k, -dt)
    assert back == pytest.approx(np.concatenate((np.zeros(3), dr)), abs=STEP_ERROR)


def test_drag_takes_energy_and_opposes_the_velocity() -> None:
    """Drag points against the velocity with k v^2."""
    dr, a = np.array((3.0, -4.0, 12.0)), np.empty(3)
    acceleration(dr, 0.04, a)
    assert a + np.array((0, 0, GRAVITY)) == pytest.approx(-0.04 * 13.0 * dr, abs=ROUNDING)


def carry(x: Array, P: Array, dt: float, law: Array) -> tuple[Array, Array]:
    """Return an estimate, shape (10,), and its covariance after ``dt``."""
    x, P = x.copy(), P.copy()
    advance_uncertain(x, P, dt, MotionModel(*law), np.empty((6, 4)), np.empty(P.shape))
    return x, P


@pytest.mark.parametrize("law", [(GRAVITY, 0.0, 0.0, 0.0, 1e9), (GRAVITY, 0.0, 0.0, 0.0, 0.5)])
@pytest.mark.parametrize("dt", [0.3, 0.004])
def test_covariance_travels_as_the_central_difference_says(
    law: tuple[float, ...], dt: float
) -> None:
    """Without process noise, P after a time is J P J' with J from central differences."""
    x = np.array((4.0, 0.1, 0.3, -6.0, 0.5, 2.0, 0.08, 0.3, -0.4, 0.2))
    J, eps = np.empty((STATES, STATES)), 1e-5
    for i, step in enumerate(eps * np.eye(STATES)):
        ends = [carry(x + sign * step, np.zeros(J.shape), dt, np.array(law))[0] for sign in (1, -1)]
        J[:, i] = (ends[0] - ends[1]) / (2 * eps)
    root = np.random.default_rng(5).normal(size=J.shape)
    P = root @ root.T
    wanted = J @ P @ J.T
    carried = carry(x, P, dt, np.array(law))[1]
    assert np.abs(carried - wanted).max() < LINEAR * np.abs(wanted).max()


def test_noise_is_that_of_many_random_pushes() -> None:
    """The covariance that a Gauss-Markov push and white noise build up is that of 20000 flights.

    Gravity and drag are zero, so the flights are sums that NumPy can do at once.
    """
    n, dt, h = 20_000, 0.2, 1e-3
    white, sigma, tau = 0.05, 3.0, 0.1
    rng = np.random.default_rng(6)
    r, v, push = np.zeros(n), np.zeros(n), sigma * rng.normal(size=n)
    left = np.exp(-h / tau)
    for _ in range(round(dt / h)):
        dv = push * h + np.sqrt(white * h) * rng.normal(size=n)
        r += h * (v + 0.5 * dv)
        v += dv
        push = left * push + sigma * np.sqrt(1.0 - left**2) * rng.normal(size=n)
    P = np.zeros((STATES, STATES))
    P[7, 7] = sigma**2
    law = np.array((0.0, white, 0.0, sigma, tau))
    carried = carry(np.zeros(STATES), P, dt, law)[1][np.ix_((0, 3, 7), (0, 3, 7))]
    assert carried == pytest.approx(np.cov((r, v, push)), rel=SAMPLING, abs=SAMPLING * 1e-3)


@given(velocity, drag, st.floats(0.0, 0.3))
def test_the_uncertain_flight_is_the_certain_one(dr: Array, k: float, dt: float) -> None:
    """Estimate and flight are carried to the same place."""
    x = np.concatenate((np.zeros(3), dr, (k, 0.0, 0.0, 0.0)))
    law = np.array((GRAVITY, 0.1, 0.1, 0.1, 1.0))
    assert carry(x, np.eye(STATES), dt, law)[0][:6] == pytest.approx(
        fly(np.zeros(3), dr, k, dt), abs=ROUNDING
    )


@given(velocity, st.floats(0.0, 0.6), st.floats(0.0, 0.6))
def test_forecast_in_two_hops_is_forecast_in_one(dr: Array, a: float, b: float) -> None:
    """Forecasts compose: mean and covariance do not depend on stops on the way."""
    start = state(np.array((4.0, 0.0, 0.5)), dr)
    one = forecast(start, 1.0 + a + b)
    two = forecast(forecast(start, 1.0 + a), 1.0 + a + b)
    assert two.r_o == pytest.approx(one.r_o, abs=STEP_ERROR)
    small = 5e-4 * np.abs(one.covariance).max()
    assert two.covariance == pytest.approx(one.covariance, rel=HOPS, abs=small)


@given(velocity, st.floats(0.0, 0.6))
def test_uncertainty_grows_and_stays_a_covariance(dr: Array, dt: float) -> None:
    """A forecast's covariance is symmetric, positive and no smaller in position."""
    start = state(np.zeros(3), dr)
    later = forecast(start, 1.0 + dt, drag_sigma=0.02).covariance
    assert np.array_equal(later, later.T)
    assert np.linalg.eigvalsh(later).min() > 0.0
    assert np.trace(later[:3, :3]) >= np.trace(start.covariance[:3, :3]) - ROUNDING


def test_forecast_leaves_the_estimate_alone_and_refuses_the_far_future() -> None:
    """A forecast is pure, returns an untracked state as it is, and is bounded."""
    start = state(np.zeros(3), np.array((1.0, 2.0, 3.0)))
    before = start.covariance.copy()
    forecast(start, 1.4)
    assert np.array_equal(start.r_o, np.zeros(3))
    assert np.array_equal(start.covariance, before)
    lost = state(np.zeros(3), np.zeros(3), tracked=False)
    assert forecast(lost, 1.4) is lost
    for t in (1e9, float("nan")):
        with pytest.raises(InputError, match="within"):
            forecast(start, t)
