"""The servos of the heads: limits held, goals reached, encoders that count."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from mitt.core.eyes.head import active_rig
from mitt.lab.world.imaging import Heads

TICK = 0.001
ROUNDING = 1e-9


@given(st.lists(st.tuples(*[st.floats(-30.0, 30.0)] * 4), min_size=1, max_size=30))
def test_no_goal_drives_a_head_beyond_its_limits(goals: list[tuple[float, ...]]) -> None:
    """Whatever is wanted, tick after tick: speed and acceleration stay within the limits."""
    rig = active_rig()
    heads, before = Heads(rig), np.zeros((2, 2))
    for goal in goals:
        heads.turn(np.array((goal, goal)), TICK)
        rates = heads.angles[:, 2:].copy()
        assert np.abs(rates).max() <= rig.heads[0].max_speed + ROUNDING
        assert np.abs(rates - before).max() <= rig.heads[0].max_accel * TICK + ROUNDING
        before = rates


def test_a_far_goal_is_reached_in_little_more_than_bang_bang_time() -> None:
    """0.15 rad in 50 ms (bang-bang: 24.5 ms) to 2 mrad, with an overshoot below 2 %."""
    heads = Heads(active_rig())
    start = heads.angles[:, :2].copy()
    goal = np.hstack((start + 0.15, np.zeros((2, 2))))
    far = []
    for _ in range(60):
        heads.turn(goal, TICK)
        far.append(heads.angles[0, 0] - start[0, 0])
    assert abs(far[49] - 0.15) < 2e-3
    assert max(far) < 1.02 * 0.15


def test_a_moving_goal_is_followed_without_lag() -> None:
    """At a steady 1 rad/s the error dies out: the rate is fed forward."""
    heads = Heads(active_rig())
    start = heads.angles[:, :2].copy()
    for k in range(1, 101):
        heads.turn(np.hstack((start + TICK * k, np.ones((2, 2)))), TICK)
    assert np.abs(heads.angles[:, :2] - start - 0.1).max() < 1e-5


def test_encoders_count_and_a_goal_that_is_none_stops_the_head() -> None:
    """Readings are within half a step; no goal, or one that is not finite, brings it to rest."""
    heads = Heads(active_rig())
    heads.turn(np.array(((0.1, 0.2, 5.0, 3.0),) * 2), TICK)
    half = 0.5 * active_rig().heads[0].encoder_step
    assert np.abs(np.array(heads.read(0)) - heads.angles[0, :2]).max() <= half + ROUNDING
    for wanted in (None, np.full((2, 4), np.nan)):
        for _ in range(100):
            heads.turn(wanted, TICK)
        assert np.abs(heads.angles[:, 2:]).max() < 1e-3
