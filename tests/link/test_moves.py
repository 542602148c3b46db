"""Slow motions: from rest to rest, no faster than a person can watch."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from mitt.link.moves import slow_motion
from mitt.robot.load import load_arm
from mitt.signals import TICK

ARM = load_arm("wam", limits="paper")
SHARES = st.lists(st.floats(0.0, 1.0), min_size=6, max_size=6)


@given(SHARES)
@settings(max_examples=40)
def test_it_leads_from_rest_to_rest_within_its_bounds(shares: list[float]) -> None:
    """And its velocities are the differences of its positions."""
    a, b = ARM.q_min + np.reshape(shares, (2, 3)) * (ARM.q_max - ARM.q_min)
    rows = slow_motion(ARM, a, b, 0.15)
    assert np.allclose(rows[0], [a, np.zeros(3), rows[0, 2]], atol=1e-9)
    assert np.allclose(rows[-1], [b, np.zeros(3), np.zeros(3)], atol=1e-6)
    assert np.all(np.abs(rows[:, 1]) <= 1.0 + 1e-9)
    assert np.allclose(np.diff(rows[:, 0], axis=0) / TICK, rows[:-1, 1], atol=0.05)


def test_nowhere_to_go_takes_no_time() -> None:
    """A motion to where the arm is has a few rows, all there."""
    rows = slow_motion(ARM, ARM.q_ready, ARM.q_ready, 0.1)
    assert len(rows) <= 3
    assert np.allclose(rows[:, 0], ARM.q_ready)
