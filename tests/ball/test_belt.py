"""A belt's encoder: travel at any time, and parts that are known by it alone."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mitt.core.ball.belt import RIDING, SILENT, BeltTravel
from mitt.core.ball.filter import BallFilter
from mitt.core.signals import Array, Sighting
from mitt.lab.world.targets import Ride

ALONG = np.array([0.6, 0.8, 0.0])
EVERY = 0.002
"""Time from one reading to the next [s]."""


def read_by(travel: BeltTravel, until: float, s: float, v: float, a: float, step: float) -> None:
    """Let an encoder of some step read a belt that speeds up evenly, from 0 on."""
    for k in range(round(until / EVERY) + 1):
        t = EVERY * k
        shown = s + v * t + 0.5 * a * t * t
        travel.read(t, shown if step == 0.0 else step * np.floor(shown / step))


@settings(max_examples=60, deadline=None)
@given(
    st.floats(-1e3, 1e3), st.floats(-2.0, 2.0), st.floats(-3.0, 3.0), st.sampled_from([0.0, 1e-4])
)
def test_travel_is_that_of_the_belt(s: float, v: float, a: float, step: float) -> None:
    """Between readings, and 10 ms beyond them; whatever its counter began with."""
    belt = BeltTravel(ALONG)
    read_by(belt, 0.5, s, v, a, step)
    for t, near in ((0.013, 2e-5), (0.3331, 2e-5), (0.51, 1e-6)):
        found, speed, _ = belt.at(t)
        spare = step * (1.0 if t < 0.5 else 3.0)
        assert found == pytest.approx(v * t + 0.5 * a * t * t, abs=near + spare)
        if t > 0.5:
            assert speed == pytest.approx(v + a * t, abs=1e-5 + 200.0 * step)


def test_travel_goes_on_over_a_counter_that_is_set_anew() -> None:
    """It jumps back to 0; and what is not newer, or no number, changes nothing."""
    belt = BeltTravel(ALONG)
    assert not belt.known
    for k in range(400):
        t = EVERY * k
        belt.read(t, 0.5 * t + (7.0 if k < 200 else -3.0))
        belt.read(t - 0.5 * EVERY, 99.0)
        belt.read(np.nan, 0.0)
    assert belt.at(0.79)[0] == pytest.approx(0.5 * 0.79, abs=1e-9)
    assert belt.at(0.8)[1] == pytest.approx(0.5, abs=1e-9)


def ride() -> Ride:
    """Return a part on a belt that speeds up, stops and runs back."""
    return Ride(
        start=np.array([0.1, -0.8, 0.05]),
        along=ALONG,
        begin=np.array([0.4, 0.9, 1.4]),
        speeds=np.array([0.5, 1.0, 0.0, -0.3]),
    )


def seen_by(belt: BeltTravel, f: BallFilter, t: float, r: Array) -> None:
    """Let a filter in a belt's frame take a sighting."""
    covariance = 1e-6 * np.eye(3)
    f.update(Sighting(t=t, found=True, r_o=belt.into(t, r), covariance=covariance))


def test_a_part_that_was_seen_once_is_known_by_the_encoder() -> None:
    """One sighting, 0.3 s late: whatever the belt does then, and with a scale off by 1 %."""
    part = ride()
    for scale, off in ((1.0, 2e-3), (1.01, 1.2e-2)):
        belt, f = BeltTravel(ALONG), BallFilter(RIDING)
        for k in range(1800):
            t = 1e-3 * k
            belt.read(t, scale * part.travel(t))
            if k == 400:
                seen_by(belt, f, 0.1, part.at(0.1)[0])
            if k < 400 or k % 50:
                continue
            now, (r, dr) = f.state(t), part.at(t)
            motion = np.array([now.r_o, now.dr_o, now.ddr_o])
            covariance = now.covariance.copy()
            belt.carry(t, motion, covariance)
            assert now.tracked
            assert np.linalg.norm(motion[0] - r) < off
            assert np.linalg.norm(motion[1] - dr) < 0.03 + abs(scale - 1.0)
            sigma = np.sqrt(ALONG @ covariance[:3, :3] @ ALONG)
            assert np.linalg.norm(motion[0] - r) < 4.0 * sigma
            assert sigma < 0.03


def test_a_silent_encoder_is_doubted() -> None:
    """The belt goes on as it ran, along it ever less surely."""
    belt = BeltTravel(ALONG)
    read_by(belt, 0.2, 0.0, 0.4, 0.0, 0.0)
    assert belt.at(0.7)[0] == pytest.approx(0.28, abs=1e-9)
    last = 0.0
    for silent in (0.5 * SILENT, 0.2, 0.5):
        motion, covariance = np.zeros((3, 3)), 1e-6 * np.eye(6)
        belt.carry(0.2 + silent, motion, covariance)
        sigma = float(np.sqrt(ALONG @ covariance[:3, :3] @ ALONG))
        assert sigma >= last
        last = sigma
        across = np.array([-0.8, 0.6, 0.0])
        assert across @ covariance[:3, :3] @ across == pytest.approx(1e-6)
    assert last > 0.05
