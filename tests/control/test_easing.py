"""A jump of what is asked for becomes a smooth motion that ends with the catch."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mitt.core.control.easing import ease, easing_time
from mitt.core.signals import TICK, Array

#: Agreement with what is asked for, and with the polynomial [rad ...].
SAME = 1e-9


def motion(t: float, seed: int) -> Array:
    """Return q, dq, ddq of two joints on a smooth way, shape (3, 2)."""
    a, w, p = np.random.default_rng(seed).uniform([0.1, 2.0, 0.0], [0.5, 8.0, 6.0], (2, 3)).T
    return np.array(
        [a * np.sin(w * t + p), a * w * np.cos(w * t + p), -a * w * w * np.sin(w * t + p)]
    )


def shifted(by: Array, t: float) -> Array:
    """Return a difference of q, dq, ddq, shape (3, 2), carried on by a time [s]."""
    return np.array([by[0] + t * (by[1] + 0.5 * t * by[2]), by[1] + t * by[2], by[2]])


@given(seed=st.integers(0, 2**31), left=st.floats(0.0, 0.3))
def test_a_motion_without_jumps_is_followed(seed: int, left: float) -> None:
    """With steady acceleration exactly; else to j T^3 / 60, of a joint of up to 256 rad/s^3."""
    steady, ends = motion(0.0, seed), easing_time(left)
    desired, exact = steady.copy(), steady.copy()
    for k in range(1, 100):
        ease(exact, shifted(steady, k * TICK), TICK, ends)
        assert np.abs(exact - shifted(steady, k * TICK)).max() < SAME
        ease(desired, motion(k * TICK, seed), TICK, ends)
        assert np.abs(desired[0] - motion(k * TICK, seed)[0]).max() < 256.0 * ends**3 / 60.0


@given(seed=st.integers(0, 2**31), left=st.floats(0.04, 0.3), late=st.floats(0.0, 1.0))
def test_a_jump_is_none_and_has_ended_at_the_catch(seed: int, left: float, late: float) -> None:
    """No tick changes the acceleration by a tenth of a jump of the speed; at the catch it is over.

    The jump comes up to 0.04 s before the catch.
    """
    by = np.random.default_rng(seed).uniform(-1.0, 1.0, (3, 2)) * [[0.0], [0.5], [20.0]]
    by[1] += np.copysign(0.15, by[1])
    first = 1 + int(late * (left - 0.04) / TICK)
    desired = motion(0.0, seed)
    for k in range(1, round(left / TICK) + 1):
        asked, last = motion(k * TICK, seed), desired.copy()
        if k >= first:
            asked += shifted(by, (k - first) * TICK)
        ease(desired, asked, TICK, easing_time(left - k * TICK))
        moved = desired[1] - last[1] - 0.5 * TICK * (desired[2] + last[2])
        assert np.abs(moved).max() < 0.1 * np.abs(by[1]).max()
    assert np.abs(desired[0] - asked[0]).max() < 1e-4
    assert np.abs(desired[1] - asked[1]).max() < 0.02


@given(seed=st.integers(0, 2**31))
def test_noise_of_what_is_asked_for_hardly_shakes_the_arm(seed: int) -> None:
    """Speeds that jump in each tick, as while an estimate is unsure: a tenth of their jerk."""
    rng, desired = np.random.default_rng(seed), motion(0.0, seed)
    told, eased = [], []
    for k in range(1, 200):
        asked = motion(k * TICK, seed)
        asked[1] += 0.05 * rng.standard_normal(2)
        ease(desired, asked, TICK, easing_time(np.inf))
        told.append(asked[1])
        eased.append(desired[1].copy())
    jerk = [np.std(np.diff(x, n=2, axis=0), axis=0) for x in (eased, told)]
    assert np.all(jerk[0] < 0.1 * jerk[1])


@pytest.mark.parametrize("ends", [0.01, 0.05])
def test_a_difference_goes_on_as_the_polynomial_that_ends_it(ends: float) -> None:
    """The one of fifth degree with the difference at its start, and none at its end."""
    e = np.random.default_rng(3).uniform(-1.0, 1.0, (3, 2))
    before = shifted(asked := motion(TICK, 1), -TICK)
    desired = before + e
    ease(desired, asked, TICK, ends)
    at = []
    for m in range(3):
        taken = np.polynomial.polynomial.polyder(np.eye(6), m)
        at.append(np.polynomial.polynomial.polyvander([0.0, ends, TICK], 5 - m) @ taken)
    C = np.array([a[0] for a in at] + [a[1] for a in at])
    found = np.linalg.solve(C, np.concatenate([e, np.zeros((3, 2))]))
    for m in range(3):
        size = max(np.abs(at[m][2] @ found).max(), 1.0)
        assert np.abs(desired[m] - asked[m] - at[m][2] @ found).max() < SAME * size
