"""Laws of the closing hand: it has closed when the ball is inside, and never opens again."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from mitt.core.arm.basket import Basket
from mitt.core.arm.description import Hand
from mitt.core.arm.hands import Closing, HandModel
from mitt.core.control.closing import FOLLOW_ON, TOUCH_BEFORE, close, fingers_of, has_closed
from mitt.core.signals import PASSED, TICK, Array

HAND = HandModel()
RADIUS = 0.04
FAR = np.array([[0.0, 0.0, 10.0], [0.0, 0.0, 0.0]])

#: Times to the catch as a map announces them: falling, noisy, or none in sight.
announced = st.lists(st.one_of(st.floats(-0.1, 0.6), st.just(np.inf)), min_size=1, max_size=120)


class Fingers:
    """The fingers of one throw."""

    palm = np.array([0.0, 0.0, 1.0])

    def __init__(self, hand: Hand | None, radius: float = RADIUS, restitution: float = 0.0) -> None:
        """Take the hand and what the ball is like."""
        self.fingers = fingers_of(hand, radius, restitution).copy()[0]

    def step(self, t: float, time: float, gap: Array = FAR, later: float = 0.0) -> float:
        """Return the angle that is commanded."""
        return float(close(self.fingers, t, time, gap, self.palm, later))

    def closed(self, t: float, *, hurry: bool) -> bool:
        """Say whether they have closed."""
        return bool(has_closed(self.fingers, t, hurry))

    @property
    def started(self) -> bool:
        """Whether they are closing."""
        return bool(self.fingers["t_begun"] < np.inf)


def lead_of(hand: Fingers, speed: float, acceleration: float, later: float = 0.0) -> float:
    """Count down to a catch on a parabola; return how long before it the fingers start [s]."""
    for k in range(-400, 1):
        time = -0.25e-3 * k
        gap = np.zeros((2, 3))
        gap[0, 2] = speed * time + 0.5 * acceleration * time**2
        gap[1, 2] = -speed - acceleration * time
        hand.step(0.25e-3 * k, time, gap, later)
        if hand.started:
            return time
    return 0.0


@given(times=announced, radius=st.floats(0.01, 0.06))
def test_a_started_closing_is_not_taken_back(times: list[float], radius: float) -> None:
    """Whatever the map announces, the hand starts at most once and its angle never falls."""
    hand = Fingers(HAND, radius)
    touches = HAND.closing_time(radius) - HAND.closing.firm
    angles, starts = [], set()
    for k, time in enumerate(times):
        angles.append(hand.step(k * TICK, time))
        starts.add(float(hand.fingers["t_begun"]))
    assert np.all(np.diff(angles) >= 0.0)
    assert len(starts - {np.inf}) <= 1
    assert hand.started == any(-PASSED <= time <= touches for time in times)
    assert max(angles) <= HAND.drive.closed


@given(
    speed=st.floats(0.1, 8.0),
    acceleration=st.floats(0.0, 150.0),
    radius=st.floats(0.02, 0.05),
    later=st.floats(0.0, 0.01),
    takes=st.floats(0.0, 0.3),
)
def test_the_fingers_have_closed_when_the_ball_is_inside(
    speed: float, acceleration: float, radius: float, later: float, takes: float
) -> None:
    """Whatever hand, ball, motion, delay: by then it has passed them, and not sooner they touch."""
    model = HandModel(closing=Closing(firm=takes))
    lead = lead_of(Fingers(model, radius), speed, acceleration, later)
    left = lead - model.closing_time(radius) - later
    then, touched = (speed * t + 0.5 * acceleration * t**2 for t in (max(left, 0.0), left + takes))
    near = model.ring(radius)[0] + model.closing.near
    late, close = (5e-4 * (speed + acceleration * t) for t in (0.03, max(left + takes, 0.0)))
    if lead < 0.1 and left < 0.029:
        assert then <= model.inside(radius) + late
        assert touched <= near + close
        assert then >= model.inside(radius) - late or touched >= near - close
    else:
        assert left <= 0.0301


@given(speed=st.floats(1.0, 8.0), slope=st.floats(0.0, 1.0), more=st.floats(0.0, 0.5))
def test_a_ball_that_passes_aside_is_met_later(speed: float, slope: float, more: float) -> None:
    """The farther off the palm's axis it passes the fingertips, the farther open they are then."""
    leads = []
    for tangent in (slope, slope + more):
        hand = Fingers(HAND)
        hand.palm = np.array([tangent, 0.0, 1.0]) / np.hypot(tangent, 1.0)
        leads.append(lead_of(hand, speed, 0.0))
    assert leads[1] <= leads[0] + 3e-4
    aside = HAND.ring(RADIUS)[0] * np.sin(np.arctan(slope + more))
    opened = HAND.closing_time(RADIUS, max(aside - 0.004, 0.0))
    assert leads[1] <= opened + HAND.inside(RADIUS) / speed + 1.5e-3


@given(e=st.floats(0.0, 1.0), harder=st.floats(0.0, 1.0), speed=st.floats(0.5, 8.0))
def test_a_springy_ball_is_met_farther_inside(e: float, harder: float, speed: float) -> None:
    """The harder a ball, the nearer to the palm; but closed for a while before the catch.

    One that is too fast for fingers that hold when it has passed them may be met sooner.
    """
    c = HAND.closing
    leads = [lead_of(Fingers(HAND, RADIUS, min(x, 1.0)), speed, 0.0) for x in (e, e + harder)]
    before = [x - HAND.closing_time(RADIUS) for x in leads]
    hard = c.hardness(min(e + harder, 1.0))
    early, ring = hard * c.early, HAND.ring(RADIUS)[0]
    near = (ring + c.near) / max(1.0 - hard, 1e-9) / speed - c.firm
    assert before[1] <= max(before[0], early, HAND.inside(RADIUS) / speed) + 1e-3
    assert before[1] >= min(early, near) - 5e-4


@given(times=st.lists(st.floats(0.06, 5.0), min_size=1, max_size=50))
def test_a_hand_stays_open_while_the_catch_is_far(times: list[float]) -> None:
    """Long before the catch, or with none in sight, the hand is open, however near the ball is."""
    hand = Fingers(HAND)
    for k, time in enumerate([*times, np.inf, np.nan]):
        assert hand.step(k * TICK, time, np.zeros((2, 3))) == 0.0
    assert not hand.started
    assert not hand.closed(10.0, hurry=True)


@given(times=st.lists(st.floats(-1e3, -PASSED, exclude_max=True), min_size=1, max_size=50))
def test_a_hand_stays_open_where_the_catch_is_long_over(times: list[float]) -> None:
    """As a rising ball that passed by before: nothing comes any more that it could close around."""
    for model in (HAND, Basket(), None):
        hand = Fingers(model)
        assert all(hand.step(k * TICK, time) == 0.0 for k, time in enumerate(times))
        assert not hand.started


@given(hurry=st.booleans(), ahead=st.floats(-0.02, 0.02), after=st.floats(0.0, 0.2))
def test_closed_is_told_by_the_clock(hurry: bool, ahead: float, after: float) -> None:
    """Closed is what the closing takes after the start, and not before the catch."""
    hand, takes = Fingers(HAND), HAND.closing_time(RADIUS)
    hand.step(1.0, ahead, np.zeros((2, 3)))
    after_catch = TOUCH_BEFORE if hurry else FOLLOW_ON
    due = max(takes + min(after_catch, 0.0), ahead + after_catch)
    if abs(after - due) > 1e-9:
        assert hand.closed(1.0 + after, hurry=hurry) == (after > due)


def test_without_a_hand_nothing_closes_but_the_catch_is_an_end() -> None:
    """An arm without a hand commands 0 for ever, and from the catch on it may brake."""
    hand = Fingers(None)
    assert [hand.step(k * TICK, 0.1) for k in range(5)] == [0.0] * 5
    assert not hand.closed(10.0, hurry=False)
    assert hand.step(5 * TICK, -TICK) == 0.0
    assert hand.closed(5 * TICK, hurry=False)


@given(times=announced)
def test_a_basket_never_closes_and_lets_the_arm_brake_at_the_catch(times: list[float]) -> None:
    """Its angle stays 0; the arm may brake once the ball is inside."""
    basket, start = Fingers(Basket()), np.inf
    for k, time in enumerate(times):
        assert basket.step(k * TICK, time) == 0.0
        start = min(start, k * TICK) if basket.started else start
    assert basket.started == any(-PASSED <= time <= Basket().enters for time in times)
    if basket.started:
        assert basket.closed(start + Basket().enters + FOLLOW_ON + TICK, hurry=False)
        assert not basket.closed(start + 0.5 * Basket().enters, hurry=True)
