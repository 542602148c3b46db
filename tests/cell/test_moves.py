"""Slow motions: from rest to rest, no faster than a person can watch."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from ruckig import InputParameter, Ruckig, Synchronization, Trajectory

from mitt.core.signals import TICK
from mitt.io.load import build_arm
from mitt.lab.trials.slow_motion import sample_motion, slow_motion

ARM = build_arm("wam", limits="paper")
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


@given(SHARES)
@settings(max_examples=40)
def test_its_samples_are_those_of_ruckig(shares: list[float]) -> None:
    """At every tick, and after the end, also where joints are not in step."""
    a, b = ARM.q_min + np.reshape(shares, (2, 3)) * (ARM.q_max - ARM.q_min)
    for synchronization in (Synchronization.Phase, Synchronization.No):
        request, way = InputParameter(3), Trajectory(3)
        request.synchronization = synchronization
        request.current_position, request.target_position = a.tolist(), b.tolist()
        request.max_velocity, request.max_acceleration = [0.5, 0.4, 1.0], [2.0, 3.0, 4.0]
        request.max_jerk = [40.0, 30.0, 50.0]
        Ruckig(3).calculate(request, way)
        t = np.append(np.arange(0.0, way.duration + 0.01, 0.01), way.duration + 1.0)
        wanted = [way.at_time(min(x, way.duration))[:3] for x in t.tolist()]
        assert np.allclose(sample_motion(way, t)[:, :2], np.array(wanted)[:, :2], atol=1e-9)
        inside = np.abs(sample_motion(way, t)[:, 2] - np.array(wanted)[:, 2]).max(axis=1) > 1e-6
        assert np.count_nonzero(inside) <= 1  # at the very end Ruckig says the last acceleration


def test_nowhere_to_go_takes_no_time() -> None:
    """A motion to where the arm is has a few rows, all there."""
    rows = slow_motion(ARM, ARM.q_ready, ARM.q_ready, 0.1)
    assert len(rows) <= 3
    assert np.allclose(rows[:, 0], ARM.q_ready)
