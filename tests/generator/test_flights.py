"""Flights in virtual joints: shapes held together, derivatives right, linear in alpha."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from support import parabola

from mitt.errors import ShapeError
from mitt.generator.learn import Flight, lift_flight
from mitt.generator.mapping import DirectMap

EXACT = 1e-9
#: Agreement of a derivative with a difference over 2 ms, share of the largest.
DIFFERENCE = 2e-3

seeds = st.integers(0, 2**31)


def test_arrays_that_do_not_fit_together_are_refused() -> None:
    """Ball and times of different length, or a belief of another shape, raise a ShapeError."""
    t, ball, seen = np.zeros(4), np.zeros((4, 3, 3)), np.zeros((3, 3))
    Flight(t=t, ball=ball, seen=seen)
    with pytest.raises(ShapeError, match="ball"):
        Flight(t=t[:3], ball=ball, seen=seen)
    with pytest.raises(ShapeError, match="seen"):
        Flight(t=t, ball=ball, seen=seen[:2])


@given(seed=seeds)
def test_a_lifted_motion_is_that_of_the_map(plain: DirectMap, seed: int) -> None:
    """q_d along the flight equals the map's own reference at each instant, for any alpha."""
    rng = np.random.default_rng(seed)
    flight = parabola(plain.arm, rng, instants=7)
    lifted = lift_flight(plain, flight)
    assert lifted is not None
    alpha = 0.1 * rng.standard_normal(plain.alpha.shape)
    bent = DirectMap(
        arm=plain.arm, design=plain.design, basis=plain.basis, alpha=alpha, H=plain.H,
        region=plain.region,
    )  # fmt: skip
    motion = lifted.motion(alpha)
    for row, ball in zip(motion, flight.ball, strict=True):
        assert np.allclose(row, bent.motion(ball)[1][:3], atol=EXACT * (1 + np.abs(row).max()))


@given(seed=seeds, share=st.floats(-2.0, 2.0))
def test_a_lifted_motion_is_linear_in_alpha(plain: DirectMap, seed: int, share: float) -> None:
    """q_d and its derivatives of a mixture of coefficients are the mixture of the motions."""
    rng = np.random.default_rng(seed)
    lifted = lift_flight(plain, parabola(plain.arm, rng, instants=5))
    assert lifted is not None
    a, b = rng.standard_normal((2, *plain.alpha.shape))
    mixed = lifted.motion(share * a + (1.0 - share) * b)
    parts = share * lifted.motion(a) + (1.0 - share) * lifted.motion(b)
    assert np.allclose(mixed, parts, rtol=1e-9, atol=1e-6)


@given(seed=seeds)
def test_the_rows_of_a_lifted_flight_are_derivatives(plain: DirectMap, seed: int) -> None:
    """Rates of the virtual joints and of the monomials are differences of the rows before."""
    flight = parabola(plain.arm, np.random.default_rng(seed), instants=411)
    lifted = lift_flight(plain, flight)
    assert lifted is not None
    for rows in (lifted.virtual, lifted.phi):
        for k in (0, 1):
            slope = np.gradient(rows[:, k], flight.t, axis=0)[1:-1]
            size = 1.0 + np.abs(rows[:, k + 1]).max()
            assert np.allclose(slope, rows[1:-1, k + 1], atol=DIFFERENCE * size)


def test_the_gap_is_what_an_arm_at_rest_must_make_up_for(plain: DirectMap) -> None:
    """D of eq. (12) is q_ready - q_o and -dq_o of what was believed at t_0."""
    flight = parabola(plain.arm, np.random.default_rng(2))
    moved = Flight(t=flight.t, ball=flight.ball, seen=flight.seen + 0.01)
    lifted = lift_flight(plain, moved)
    assert lifted is not None
    inside, virtual = plain.virtual(moved.seen)
    assert inside
    expected = np.concatenate([plain.arm.q_ready - virtual[0], -virtual[1]])
    assert np.allclose(lifted.gap, expected, atol=EXACT)


def test_a_flight_that_leaves_the_domain_is_none(plain: DirectMap) -> None:
    """One instant inside the unreachable ball about the shoulder is enough."""
    flight = parabola(plain.arm, np.random.default_rng(3))
    ball = flight.ball.copy()
    ball[-1, 0] *= 0.3
    assert lift_flight(plain, Flight(t=flight.t, ball=ball, seen=flight.seen)) is None
    assert lift_flight(plain, Flight(t=flight.t, ball=flight.ball, seen=0.1 * ball[0])) is None
