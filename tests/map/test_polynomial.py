"""The polynomial b: its terms, its zero at the catch, its derivatives."""

from collections.abc import Callable
from dataclasses import replace
from math import comb

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mitt.core.errors import ModelError
from mitt.core.map.polynomial import CatchBasis
from mitt.core.signals import Array

STEP = 1e-5
DIFFERENCE = 1e-6


def basis(order: int, n: int, catch_joint: int) -> CatchBasis:
    """Return a basis with distinct shifts and scales."""
    return CatchBasis(order, catch_joint, np.linspace(0.2, 0.9, n), np.linspace(0.8, 1.7, n))


shapes = st.tuples(st.integers(2, 6), st.integers(1, 4)).flatmap(
    lambda s: st.tuples(st.just(s[0]), st.just(s[1]), st.integers(0, s[1] - 1))
)


@given(shape=shapes)
def test_the_number_of_monomials_is_that_of_equation_11(shape: tuple[int, int, int]) -> None:
    """There are C(N - 2 + n, n) monomials, each at least quadratic in the catch joint."""
    order, n, i = shape
    powers = basis(*shape).powers
    assert len(powers) == comb(order - 2 + n, n)
    assert len({tuple(row) for row in powers}) == len(powers)
    assert powers[:, i].min() == 2
    assert powers.sum(axis=1).max() == order


@given(shape=shapes, seed=st.integers(0, 2**31))
def test_b_and_its_rate_vanish_at_the_catch(shape: tuple[int, int, int], seed: int) -> None:
    """At q_i = q_alpha monomials and rates are exactly zero, wherever the other joints are."""
    b, rng = basis(*shape), np.random.default_rng(seed)
    q, dq, ddq = rng.standard_normal((3, shape[1]))
    q[shape[2]] = b.centre[shape[2]]
    assert np.array_equal(b.jets(q, dq, ddq)[:2], np.zeros((2, len(b.powers))))


@given(shape=shapes, seed=st.integers(0, 2**31))
def test_terms_of_first_order_leave_the_position_and_free_the_velocity(
    shape: tuple[int, int, int], seed: int
) -> None:
    """At q_i = q_alpha all monomials are 0; the rates are s-dot times 1 and the other variables."""
    plain, rng = basis(*shape), np.random.default_rng(seed)
    b = replace(plain, first_order=True)
    order, n, i = shape
    count, linear = len(plain.powers), [k for k in range(n) if k != i and order > 2]
    assert np.array_equal(b.powers[:count], plain.powers)
    assert len({tuple(row) for row in b.powers}) == len(b.powers) == count + 1 + len(linear)
    q, dq, ddq = rng.standard_normal((3, n))
    q[i] = b.centre[i]
    phi, dphi, _ = b.jets(q, dq, ddq)
    x = (q - b.centre) / b.scale
    assert np.array_equal(phi, np.zeros(len(b.powers)))
    rates = dq[i] / b.scale[i] * np.array([1.0, *x[linear]])
    assert np.allclose(np.sort(dphi[count:]), np.sort(rates), atol=1e-12)
    assert np.array_equal(dphi[:count], np.zeros(count))


@given(shape=shapes, seed=st.integers(0, 2**31))
def test_jets_are_derivatives_in_time(shape: tuple[int, int, int], seed: int) -> None:
    """Both time derivatives agree with central differences along q + dq t + ddq t^2 / 2."""
    b, rng = basis(*shape), np.random.default_rng(seed)
    q, dq, ddq = rng.uniform(-0.8, 0.8, (3, shape[1]))

    def along(t: float) -> Array:
        return b.jets(q + dq * t + 0.5 * ddq * t * t, dq + ddq * t, ddq)

    now, ahead, back = along(0.0), along(STEP), along(-STEP)
    assert np.allclose(now[1:], (ahead - back)[:2] / (2 * STEP), atol=DIFFERENCE)
    plain = np.prod(((q - b.centre) / b.scale) ** b.powers, axis=1)
    assert np.allclose(now[0], plain, rtol=1e-12)


def test_a_basis_that_cannot_be_is_refused() -> None:
    """Orders below 2, a catch joint that is not there and a void scale raise ModelError."""
    makers: tuple[Callable[[], CatchBasis], ...] = (
        lambda: basis(1, 3, 2),
        lambda: basis(4, 3, 3),
        lambda: CatchBasis(4, 0, np.zeros(2), np.array([1.0, 0.0])),
    )
    for make in makers:
        with pytest.raises(ModelError):
            make()
