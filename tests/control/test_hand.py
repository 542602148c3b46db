"""Laws of the closing hand: it starts once, never opens again, and never without a catch."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mitt.control.hand import ENTERS, FOLLOW_ON, TOUCH_BEFORE, Closing
from mitt.robot.basket import Basket
from mitt.robot.hands import HandModel
from mitt.signals import PASSED

TICK = 0.001
RADIUS = 0.04
LEAD = HandModel().closing.lead

#: Times to the catch as a map announces them: falling, noisy, or none in sight.
announced = st.lists(st.one_of(st.floats(-0.1, 0.6), st.just(np.inf)), min_size=1, max_size=120)


@given(times=announced, radius=st.floats(0.01, 0.06))
def test_a_started_closing_is_not_taken_back(times: list[float], radius: float) -> None:
    """Whatever the map announces, the hand starts at most once and its angle never falls."""
    hand = Closing(HandModel(), ball_radius=radius)
    angles, starts = [], set()
    for k, time in enumerate(times):
        angles.append(hand.step(k * TICK, time))
        starts.add(hand.t_start)
    assert np.all(np.diff(angles) >= 0.0)
    assert len(starts - {np.inf}) <= 1
    assert hand.started == any(-PASSED <= time <= LEAD for time in times)
    assert max(angles) <= HandModel().drive.closed


@given(times=st.lists(st.floats(0.0201, 5.0), min_size=1, max_size=50))
def test_a_hand_stays_open_while_the_catch_is_far(times: list[float]) -> None:
    """More than its lead before the catch, or with none in sight, the hand is open."""
    hand = Closing(HandModel(), ball_radius=RADIUS)
    for k, time in enumerate([*times, np.inf, np.nan]):
        assert hand.step(k * TICK, time if time > LEAD else np.inf) == 0.0
    assert not hand.started
    assert not hand.closed(10.0, hurry=True)


@given(times=st.lists(st.floats(-1e3, -PASSED, exclude_max=True), min_size=1, max_size=50))
def test_a_hand_stays_open_where_the_catch_is_long_over(times: list[float]) -> None:
    """As a rising ball that passed by before: nothing comes any more that it could close around."""
    for hand in (HandModel(), Basket(), None):
        closing = Closing(hand, ball_radius=RADIUS)
        assert all(closing.step(k * TICK, time) == 0.0 for k, time in enumerate(times))
        assert not closing.started


def test_the_hand_starts_its_lead_before_the_catch() -> None:
    """Counting down to the catch, the fingers start in the first tick within the lead."""
    hand = Closing(HandModel(), ball_radius=RADIUS)
    for k in range(-200, 100):
        hand.step(k * TICK, -k * TICK)
    assert abs(hand.t_start + LEAD) <= TICK


@given(e=st.floats(0.0, 1.0), harder=st.floats(0.0, 1.0))
def test_a_ball_that_springs_back_is_met_earlier(e: float, harder: float) -> None:
    """The lead grows with restitution, is that of soft balls up to 0.5, and brakes wait as long."""
    soft, hard = (Closing(HandModel(), ball_radius=RADIUS, restitution=x) for x in (e, e + harder))
    assert LEAD <= soft.grip[0] <= hard.grip[0] <= LEAD + HandModel().closing.extra_lead
    assert soft.grip[0] == LEAD or e > HandModel().closing.soft
    for hand in (soft, hard):
        assert hand.grip[6:] - hand.grip[0] == pytest.approx((TOUCH_BEFORE, FOLLOW_ON), abs=1e-12)


def test_at_the_catch_the_fingers_are_about_to_touch() -> None:
    """At the time of the catch they are led within the margin of the angle of touch."""
    model = HandModel()
    hand = Closing(model, ball_radius=RADIUS)
    angle = [hand.step(k * TICK, -k * TICK) for k in range(-30, 1)][-1]
    touch = model.touch_angle(RADIUS)
    assert abs(angle - touch) <= 2.0 * model.closing.margin


@given(hurry=st.booleans(), after=st.floats(0.0, 0.2))
def test_closed_is_told_by_the_clock(hurry: bool, after: float) -> None:
    """Closed is lead and following on after the start, in a hurry the first touch."""
    hand = Closing(HandModel(), ball_radius=RADIUS)
    hand.step(1.0, 0.0)
    due = LEAD + (TOUCH_BEFORE if hurry else FOLLOW_ON)
    if abs(after - due) > 1e-9:
        assert hand.closed(1.0 + after, hurry=hurry) == (after > due)


def test_a_hurry_never_waits_longer() -> None:
    """Where the arm is short of room it brakes earlier, but not before the fingers touch."""
    assert -LEAD < TOUCH_BEFORE < FOLLOW_ON


def test_without_a_hand_nothing_closes_but_the_catch_is_an_end() -> None:
    """An arm without a hand commands 0 for ever, and from the catch on it may brake."""
    hand = Closing(None, ball_radius=RADIUS)
    assert [hand.step(k * TICK, 0.1) for k in range(5)] == [0.0] * 5
    assert not hand.closed(10.0, hurry=False)
    assert hand.step(5 * TICK, -TICK) == 0.0
    assert hand.closed(5 * TICK, hurry=False)


@given(times=announced)
def test_a_basket_never_closes_and_lets_the_arm_brake_at_the_catch(times: list[float]) -> None:
    """Its angle stays 0; the arm may brake once what would be its closing is over."""
    basket = Closing(Basket(), ball_radius=RADIUS)
    for k, time in enumerate(times):
        assert basket.step(k * TICK, time) == 0.0
    assert basket.started == any(-PASSED <= time <= ENTERS for time in times)
    if basket.started:
        assert basket.closed(basket.t_start + ENTERS + FOLLOW_ON + TICK, hurry=False)
        assert not basket.closed(basket.t_start + 0.5 * ENTERS, hurry=True)
