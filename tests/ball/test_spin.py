"""Spin: the law of its lift, both ways; flights with it, and what the ball filter says of it."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mitt.core.ball.filter import BallFilter, FilterConfig
from mitt.core.ball.flight import STILL, advance, advance_spinning
from mitt.core.ball.spin import MOST_SPIN, lift_constant, lift_of, spin_shown, steady_lift
from mitt.core.signals import GRAVITY, Array, Sighting

RADIUS = 0.04
K = lift_constant(RADIUS, 0.07)
DRAG = 0.04
#: Spin, its 1-sigma an axis [rad/s], and a speed of balls [m/s].
SPINS = 120.0
COMES = 6.0
seeds = st.integers(0, 2**31)


def drawn(seed: int) -> tuple[Array, Array, Array]:
    """Return position, velocity and spin of a ball that is thrown."""
    rng = np.random.default_rng(seed)
    v = rng.uniform([-6.0, -0.7, 1.0], [-4.5, 0.7, 3.5])
    return np.array([3.5, 0.0, 0.2]), v, SPINS / np.sqrt(3.0) * rng.standard_normal(3)


def reference(r: Array, v: Array, spin: Array, t: float) -> Array:
    """Return where a ball flies by the formula of the module, in 4000 steps of Heun's method."""

    def pulled(v: Array) -> Array:
        speed = float(np.linalg.norm(v))
        across = float(np.linalg.norm(np.cross(spin, v))) / speed
        lift = K * speed / (speed + 2.0 * RADIUS * across) * np.cross(spin, v)
        return np.asarray(lift - DRAG * speed * v - [0.0, 0.0, GRAVITY])

    h = t / 4000
    for _ in range(4000):
        first = pulled(v)
        second = pulled(v + h * first)
        r = r + h * v + 0.5 * h * h * first
        v = v + 0.5 * h * (first + second)
    return r


@settings(max_examples=10)
@given(seed=seeds)
def test_a_ball_that_spins_flies_by_the_law_of_its_lift(seed: int) -> None:
    """To 10 um in half a second; without spin to the bit as any ball, whatever ``weak`` is."""
    r, v, spin = drawn(seed)
    end, speed = r.copy(), v.copy()
    advance_spinning(end, speed, DRAG, lift_of(spin, K, RADIUS), 0.5)
    assert end == pytest.approx(reference(r, v, spin, 0.5), abs=1e-5)
    plain = [r.copy(), v.copy()], [r.copy(), v.copy()], [r.copy(), v.copy()]
    advance(*plain[0], DRAG, 0.5)
    advance_spinning(*plain[1], DRAG, STILL, 0.5)
    advance_spinning(*plain[2], DRAG, lift_of(np.zeros(3), K, RADIUS), 0.5)
    assert np.array_equal(plain[0], plain[1])
    assert np.array_equal(plain[0], plain[2])


@given(seed=seeds)
def test_the_spin_is_found_back_from_what_a_flight_shows(seed: int) -> None:
    """From the acceleration at an instant, where the spin is as fast as it may be shown."""
    _, v, spin = drawn(seed)
    speed = float(np.linalg.norm(v))
    across = float(np.linalg.norm(np.cross(spin, v))) / speed
    w = K * speed / (speed + 2.0 * RADIUS * across) * spin
    assert spin_shown(w, v, K, RADIUS) == pytest.approx(spin, rel=1e-6, abs=1e-6)
    fast = spin_shown(1e3 * w, v, K, RADIUS)
    assert float(np.linalg.norm(np.cross(fast, v))) <= MOST_SPIN * speed * (1.0 + 1e-9)
    assert not spin_shown(w, v, 0.0, RADIUS).any()


def estimated(seed: int) -> tuple[Array, Array, Array, BallFilter, float]:
    """Return r_o, dr_o, w of a ball after 0.4 s that flies by a steady lift, and what saw it."""
    rng = np.random.default_rng([seed, 1])
    r, v, _ = drawn(seed)
    sigma = K * SPINS / 2.5
    w = sigma * rng.standard_normal(3)
    known = FilterConfig(
        drag_mean=DRAG,
        drag_sigma=0.004,
        drag_density=1e-6,
        accel_density=1e-4,
        lift_sigma=sigma,
        lift_time=1e4,
    )
    of, drag = BallFilter(known), DRAG + 0.004 * float(rng.standard_normal())
    for k in range(400):
        seen = r + 1e-3 * rng.standard_normal(3)
        of.update(Sighting(t=1e-3 * k, found=True, r_o=seen, covariance=1e-6 * np.eye(3)))
        if k < 399:
            advance_spinning(r, v, drag, steady_lift(w), 1e-3)
            v += np.sqrt(1e-4 * 1e-3) * rng.standard_normal(3)
    return r, v, w, of, 0.399


def test_the_estimate_of_a_spin_is_as_good_as_it_says() -> None:
    """Normalised squared errors of w, and of position and velocity, over 40 flights.

    Within the 99.8 % interval of chi-squared: neither boastful nor timid. A spin is known far
    better than before the flight, across the flight's plane best.
    """
    errors, motions, sharper = [], [], []
    for seed in range(40):
        r, v, w, of, t = estimated(seed)
        found, P = of.lift(t)
        errors.append((found - w) @ np.linalg.solve(P, found - w))
        ball = of.state(t)
        off = np.concatenate([ball.r_o - r, ball.dr_o - v])
        motions.append(off @ np.linalg.solve(ball.covariance, off))
        assert ball.lift == pytest.approx(found)
        assert ball.ddr_o == pytest.approx(
            np.cross(ball.lift, ball.dr_o)
            - ball.drag * np.linalg.norm(ball.dr_o) * ball.dr_o
            - [0.0, 0.0, GRAVITY],
            abs=1e-9,
        )
        sharper.append(np.sqrt(np.linalg.eigvalsh(P)) / (K * SPINS / 2.5))
    # chi-squared of 120 and 240 degrees of freedom, 0.1 and 99.9 %, over 40
    assert 2.0 < np.mean(errors) < 4.3
    assert 4.4 < np.mean(motions) < 7.9
    least, _, most = np.mean(sharper, axis=0)
    assert least < 0.05
    assert most < 0.8


def test_a_filter_without_a_spin_has_none() -> None:
    """Its push is not a lift; before a track it is what is known beforehand."""
    of = BallFilter(FilterConfig(push_sigma=0.04))
    r, v, _ = drawn(1)
    for k in range(50):
        of.update(Sighting(t=1e-3 * k, found=True, r_o=r, covariance=1e-6 * np.eye(3)))
        advance(r, v, DRAG, 1e-3)
    w, P = of.lift(0.05)
    assert not w.any()
    assert not P.any()
    assert np.array_equal(BallFilter(FilterConfig(lift_sigma=0.3)).lift(0.0)[1], 0.09 * np.eye(3))
    assert not of.state(0.05).lift.any()
