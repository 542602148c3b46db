"""Aiming: the shot hits, and without drag it is the textbook parabola."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mitt.signals import GRAVITY
from mitt.world.ballistics import fly, release_velocity

MISS_M = 1e-9
coordinate = st.floats(-3.0, 3.0)


@given(
    x=st.floats(2.0, 5.0), y=coordinate, z=coordinate, drag=st.floats(0.0, 0.2),
    duration=st.floats(0.3, 0.8),
)  # fmt: skip
def test_the_shot_hits(x: float, y: float, z: float, drag: float, duration: float) -> None:
    """Flying the released ball for the wanted time ends at the target."""
    start, target = np.array([x, y, z]), np.array([0.5, 0.1, 0.0])
    dr = release_velocity(start, target, drag=drag, duration=duration)
    assert fly(start, dr, drag=drag, duration=duration)[0] == pytest.approx(target, abs=MISS_M)


@given(duration=st.floats(0.05, 1.0))
def test_without_drag_a_flight_is_a_parabola(duration: float) -> None:
    """Position and velocity are those of free fall, and the arguments are left alone."""
    r, dr = np.array([3.0, 0.1, 0.5]), np.array([-6.0, 0.2, 2.0])
    end, speed = fly(r, dr, drag=0.0, duration=duration)
    g = np.array([0.0, 0.0, -GRAVITY])
    assert end == pytest.approx(r + dr * duration + 0.5 * g * duration**2, abs=MISS_M)
    assert speed == pytest.approx(dr + g * duration, abs=MISS_M)
    assert r.tolist() == [3.0, 0.1, 0.5]
