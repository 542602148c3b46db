"""The verdict: what it refuses, what it names, and that it grows with what is asked."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support import ball_state

from mitt.core.map.demand import Tolerance, demand
from mitt.core.map.foresight import sharpness
from mitt.core.map.learn import Learned
from mitt.core.map.mapping import DirectMap
from mitt.core.map.prediction import flown
from mitt.core.signals import BallState
from mitt.core.verdict.feasibility import (
    Outcome,
    Verdict,
    has_come_back,
    judge,
    levelled,
    unsettled,
)

G = np.array([0.0, 0.0, -9.81])
#: A throw's direction at the catch: 21 degrees below the horizon.
DOWN = np.array([-0.933, 0.0, -0.36])
#: Agreement of the time of the catch with that of the flight's construction [s].
TIME = 1e-4

#: Hardly more than the limits.
STRICT = Tolerance(torque=1.25, speed=1.0)

yaws = st.floats(-0.2, 0.2)
leans = st.floats(-0.15, 0.15)


def thrown(
    f: DirectMap, *, speed: float = 6.0, yaw: float = 0.0, lean: float = 0.0, before: float = 0.4
) -> BallState:
    """Return a drag-free ball some time before it passes a point of the catch."""
    r_c = f.arm.position(np.array([yaw, np.pi / 4 + lean, f.design.q_catch]))
    dr_c = speed * DOWN
    return ball_state(r_c - dr_c * before + 0.5 * G * before**2, dr_c - G * before, G)


def verdict(f: DirectMap, ball: BallState) -> Verdict:
    """Return the verdict with the default tolerance, the arm in its ready pose."""
    return judge(f, ball, f.arm.q_ready, tolerance=Tolerance())


@settings(max_examples=40)
@given(yaw=yaws, lean=leans, before=st.floats(0.3, 0.5))
def test_a_throw_of_the_neighbourhood_is_feasible_and_its_time_is_right(
    learned: Learned, yaw: float, lean: float, before: float
) -> None:
    """At 5.5 m/s through the catch region: feasible, all shares below 1, caught on time."""
    ball = thrown(learned.map, speed=5.5, yaw=yaw, lean=lean, before=before)
    said = verdict(learned.map, ball)
    assert said.outcome is Outcome.FEASIBLE
    assert 0.0 < said.share <= 1.0
    assert said.t_catch == pytest.approx(ball.t + before, abs=TIME)
    assert np.isfinite(said.sigma)


@pytest.mark.parametrize("side", [-3.0, 3.0])
def test_a_throw_3_m_to_the_side_is_unreachable(learned: Learned, side: float) -> None:
    """It never enters the domain of the inverse, and that is what is named."""
    ball = thrown(learned.map)
    said = verdict(learned.map, replace(ball, r_o=ball.r_o + np.array([0.0, side, 0.0])))
    assert (said.outcome, said.binding_limit) == (Outcome.UNREACHABLE, "domain")
    assert np.isinf(said.t_catch)


@given(above=st.floats(1.2, 4.0))
def test_a_ball_that_passes_above_is_unreachable(learned: Learned, above: float) -> None:
    """No bounce brings down a ball that flies over the arm."""
    ball = thrown(learned.map)
    said = verdict(learned.map, replace(ball, r_o=ball.r_o + np.array([0.0, 0.0, above])))
    assert said.outcome is Outcome.UNREACHABLE


@given(
    q=st.tuples(*(st.floats(-0.4, 0.4) for _ in range(3))),
    before=st.floats(0.05, 1.2),
    led=st.booleans(),
)
def test_what_is_known_to_be_unsettled_gets_no_other_verdict(
    learned: Learned, q: tuple[float, float, float], before: float, led: bool
) -> None:
    """Wherever the ball comes from; a ball in the air is never called unsettled."""
    f, dr = learned.map, np.array([-3.0, 0.2, 0.5])
    r_c = f.arm.position(f.start + np.array(q))
    ball = replace(ball_state(r_c - before * dr, dr, np.zeros(3)), led=led)
    said = unsettled(f, ball)
    assert led or not said
    if said:
        verdict = judge(f, ball, f.arm.q_ready, tolerance=Tolerance())
        assert verdict.outcome is Outcome.UNSETTLED


@given(side=st.floats(-3.0, 3.0), before=st.floats(0.2, 1.2))
def test_a_led_ball_is_followed_when_it_comes_and_never_refused(
    learned: Learned, side: float, before: float
) -> None:
    """On a straight line through the catch, feasible within 0.5 s of it, else unsettled."""
    f = learned.map
    r_c, dr = f.arm.position(np.array([0.0, np.pi / 4, f.design.q_catch])), 2.5 * DOWN
    ball = replace(ball_state(r_c - before * dr, dr, np.zeros(3)), led=True)
    soon = before < 0.5 - TIME
    expected = Outcome.FEASIBLE if soon else Outcome.UNSETTLED
    assert before == pytest.approx(0.5, abs=2 * TIME) or verdict(f, ball).outcome is expected
    aside = replace(ball, r_o=ball.r_o + np.array([0.0, side, 0.0]))
    assert verdict(f, aside).outcome is not Outcome.UNREACHABLE


@given(below=st.floats(0.6, 1.5))
def test_a_ball_that_falls_short_is_open(learned: Learned, below: float) -> None:
    """A bounce may still bring it up: the verdict stays open."""
    ball = thrown(learned.map)
    said = verdict(learned.map, replace(ball, r_o=ball.r_o - np.array([0.0, 0.0, below])))
    assert said.outcome is Outcome.OPEN


@pytest.mark.parametrize("before", [0.1, 0.03, -0.03, -0.1])
def test_a_ball_that_falls_short_is_refused_once_the_arm_cannot_wait_for_it(
    learned: Learned, before: float
) -> None:
    """Seen too late, or past the place of the catch: its surrogate target takes too much."""
    ball = thrown(learned.map, before=before)
    said = verdict(learned.map, replace(ball, r_o=ball.r_o - np.array([0.0, 0.0, 0.8])))
    assert said.outcome is Outcome.UNREACHABLE


@given(speed=st.floats(7.1, 8.2))
def test_a_ball_a_little_too_fast_names_the_speed_of_the_elbow(
    learned: Learned, speed: float
) -> None:
    """Matching more than 7 m/s takes joint 4 beyond 20 rad/s: ``speed:j4``."""
    f = learned.map
    said = judge(f, thrown(f, speed=speed), f.arm.q_ready, tolerance=STRICT)
    assert (said.outcome, said.binding_limit) == (Outcome.UNREACHABLE, "speed:j4")


def test_a_ball_much_too_fast_is_unreachable(learned: Learned) -> None:
    """From 9 m/s on the torque of joint 2 is asked most."""
    said = verdict(learned.map, thrown(learned.map, speed=9.0))
    assert (said.outcome, said.binding_limit) == (Outcome.UNREACHABLE, "torque:j2")


@pytest.mark.parametrize(
    ("yaw", "lean", "binding"), [(1.2, 0.0, "region:j1"), (0.0, -0.75, "region:j2")]
)
def test_a_catch_outside_the_learned_region_names_the_joint(
    learned: Learned, yaw: float, lean: float, binding: str
) -> None:
    """Beyond 0.3 rad from what was learned the map is not trusted."""
    said = verdict(learned.map, thrown(learned.map, yaw=yaw, lean=lean))
    assert said.outcome is not Outcome.FEASIBLE
    assert said.binding_limit == binding


@given(yaw=yaws, lean=leans, speed=st.floats(4.5, 8.0))
def test_the_share_is_that_of_the_adapted_motion(
    learned: Learned, yaw: float, lean: float, speed: float
) -> None:
    """The largest share is what :func:`demand` finds along the flight, in units of tolerance."""
    f = learned.map
    ball = thrown(f, speed=speed, yaw=yaw, lean=lean)
    said = verdict(f, ball)
    adapted = f.adapt(ball, f.arm.q_ready, np.zeros(3))
    path = flown(ball, np.linspace(0.0, said.t_catch - ball.t, 25))
    motion = np.array([adapted.motion(row)[1][:3] for row in path])
    asked, tolerance = demand(f.arm, motion), Tolerance()
    half = 0.5 * (f.arm.q_max - f.arm.q_min)
    swing = np.abs(motion[:, 0] - 0.5 * (f.arm.q_max + f.arm.q_min)) / half
    shares = (
        f.arm.active(asked.torque).max() / tolerance.torque,
        f.arm.active(asked.speed).max() / tolerance.speed,
        swing.max(),
    )
    assert said.share == pytest.approx(max(shares), rel=1e-9)


@given(speed=st.floats(5.0, 9.0), factor=st.floats(1.0, 3.0))
def test_more_tolerance_never_refuses_more(learned: Learned, speed: float, factor: float) -> None:
    """The share falls as the tolerance grows; what was feasible stays so."""
    ball = thrown(learned.map, speed=speed)
    strict, wide = (
        judge(learned.map, ball, learned.map.arm.q_ready, tolerance=x)
        for x in (STRICT, Tolerance(torque=1.25 * factor, speed=factor))
    )
    assert wide.share <= strict.share
    assert strict.outcome is Outcome.UNREACHABLE or wide.outcome is Outcome.FEASIBLE


@given(scale=st.floats(1.0, 100.0))
def test_a_vaguer_ball_is_predicted_less_sharply(learned: Learned, scale: float) -> None:
    """The predicted 1-sigma grows with the covariance; without a catch it is infinite."""
    ball = thrown(learned.map)
    sharp = replace(ball, covariance=1e-6 * np.eye(6))
    vague = replace(ball, covariance=1e-6 * scale * np.eye(6))
    assert sharpness(learned.map, sharp) <= sharpness(learned.map, vague)
    away = replace(ball, dr_o=-ball.dr_o)
    assert np.isinf(sharpness(learned.map, away))


def test_the_stand_in_waits_level_at_the_nominal_height(learned: Learned) -> None:
    """It flies over the same ground as fast, level, and is itself a ball that can be caught."""
    f = learned.map
    ball = thrown(f)
    low = replace(ball, r_o=ball.r_o - np.array([0.0, 0.0, 0.8]))
    flat = levelled(f, low)
    assert np.array_equal(flat.r_o[:2], low.r_o[:2])
    assert np.array_equal(flat.dr_o[:2], low.dr_o[:2])
    assert flat.r_o[2] == f.arm.position(f.start)[2]
    assert flat.dr_o[2] == 0.0
    assert not has_come_back(f, low)
    assert has_come_back(f, ball)


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_a_ball_that_is_no_number_is_never_feasible(learned: Learned, bad: float) -> None:
    """NaN and infinity in any field of position and velocity are refused, not computed with."""
    for k in range(6):
        ball = thrown(learned.map)
        x = np.concatenate([ball.r_o, ball.dr_o])
        x[k] = bad
        assert verdict(learned.map, ball_state(x[:3], x[3:], G)).outcome is not Outcome.FEASIBLE


def test_a_verdict_is_said_in_a_few_words() -> None:
    """With the share and the time where there are any."""
    good = Verdict(
        outcome=Outcome.FEASIBLE, binding_limit="brake:j4", share=0.834, t_catch=0.4981, sigma=0.002
    )
    assert str(good) == "feasible: 83 % of brake:j4, catch at 0.498 s"
    far = Verdict(
        outcome=Outcome.UNREACHABLE,
        binding_limit="domain",
        share=np.inf,
        t_catch=np.inf,
        sigma=np.inf,
    )
    assert str(far) == "unreachable: domain (the ball does not come to where the map can meet it)"
