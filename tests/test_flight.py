"""The flight kernels against formulas, finer steps and central differences."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mitt.errors import InputError
from mitt.flight import GRAVITY, acceleration, advance, advance_uncertain, forecast
from mitt.signals import Array, BallState

ROUNDING = 1e-12
"""Metres and metres a second."""
STEP_ERROR = 1e-6
"""Of the longest Runge-Kutta steps over a second, where the ball turns [m, m/s]."""
LINEAR = 5e-3
"""Relative error of the transition matrices over 0.3 s."""
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


def test_covariance_travels_as_the_central_difference_of_the_flight_says() -> None:
    """Without process noise, P after 0.3 s is J P J' with J from central differences."""
    x = np.array((4.0, 0.1, 0.3, -6.0, 0.5, 2.0, 0.08))
    J = np.zeros((7, 7))
    J[6, 6] = 1.0
    eps = 1e-5
    for i in range(7):
        ends = []
        for sign in (1.0, -1.0):
            y = x.copy()
            y[i] += sign * eps
            ends.append(fly(y[:3], y[3:6], float(y[6]), 0.3))
        J[:6, i] = (ends[0] - ends[1]) / (2 * eps)
    root = np.random.default_rng(5).normal(size=(7, 7))
    P = root @ root.T
    carried = P.copy()
    advance_uncertain(x.copy(), carried, 0.3, 0.0, 0.0, np.empty((2, 7, 7)))
    wanted = J @ P @ J.T
    assert np.abs(carried - wanted).max() < LINEAR * np.abs(wanted).max()


@given(velocity, st.floats(0.0, 0.6), st.floats(0.0, 0.6))
def test_forecast_in_two_hops_is_forecast_in_one(dr: Array, a: float, b: float) -> None:
    """Forecasts compose: mean and covariance do not depend on stops on the way."""
    start = state(np.array((4.0, 0.0, 0.5)), dr)
    one = forecast(start, 1.0 + a + b)
    two = forecast(forecast(start, 1.0 + a), 1.0 + a + b)
    assert two.r_o == pytest.approx(one.r_o, abs=STEP_ERROR)
    assert two.covariance == pytest.approx(one.covariance, rel=HOPS, abs=1e-9)


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
