"""Maps that catch in different places: the best is chosen, and a change of maps is no jump."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support import ball_state

from mitt.core.arm.arm import Arm
from mitt.core.catcher.family import Family
from mitt.core.catcher.generators import Direct
from mitt.core.errors import InputError
from mitt.core.map.demand import Tolerance
from mitt.core.map.learn import Learned
from mitt.core.map.map_design import MapDesign
from mitt.core.map.neighbourhood import Neighbourhood, learn
from mitt.core.signals import Array, BallState
from mitt.core.verdict.feasibility import Outcome, Verdict, judge
from mitt.core.verdict.pieces import Pieces, Unfinished

G = np.array([0.0, 0.0, -9.81])
seeds = st.integers(0, 2**31)


@pytest.fixture(scope="module")
def several(arm: Arm, learned: Learned) -> Family:
    """The paper's map, and one that lets the ball in along the palm's normal."""
    inward = learn(arm, design=MapDesign(q_catch=0.6, inward=3.0), around=Neighbourhood(flights=40))
    return Family((Direct(learned.map), Direct(inward.map)))


def chosen(f: Family, ball: BallState, q: Array, dq: Array) -> Family:
    """Return the choice that the verdict on a ball rests on."""
    return f.consider(ball, q, dq, Pieces())[1]


def in_pieces(
    f: Family, ball: BallState, q: Array, dq: Array, count: int
) -> tuple[Verdict, Family, int]:
    """Return verdict and choice, some pieces at a time, and how many times it took."""
    pieces, times = Pieces(0), 0
    while True:
        pieces.grant(count)
        times += 1
        try:
            return *f.consider(ball, q, dq, pieces), times
        except Unfinished:
            continue


def some_ball(seed: int, speed: float) -> BallState:
    """Return a ball 0.35 s before it passes the paper's catch region."""
    rng = np.random.default_rng(seed)
    r_c = np.array([0.785, rng.uniform(-0.15, 0.15), 0.057 + rng.uniform(-0.1, 0.1)])
    dr_c = speed * np.array([-0.933, 0.0, -0.36])
    return ball_state(r_c - dr_c * 0.35 + 0.5 * G * 0.35**2, dr_c - G * 0.35, G)


@settings(max_examples=30)
@given(seed=seeds, speed=st.floats(4.0, 9.0))
def test_what_one_map_catches_several_catch(several: Family, seed: int, speed: float) -> None:
    """The verdict is feasible if that of any map is, and then it is that map's."""
    ball, q = some_ball(seed, speed), several.maps[0].map.arm.q_ready
    each = [f.verdict(ball, q) for f in several.maps]
    said = several.verdict(ball, q)
    assert said in each
    any_feasible = any(x.outcome is Outcome.FEASIBLE for x in each)
    assert (said.outcome is Outcome.FEASIBLE) == any_feasible


@settings(max_examples=20)
@given(seed=seeds, speed=st.floats(4.0, 9.0), low=st.booleans(), count=st.integers(1, 4))
def test_a_choice_in_pieces_is_the_one_at_once(
    several: Family, seed: int, speed: float, low: bool, count: int
) -> None:
    """Whatever is granted at a time: start and way of each map that is asked are a piece each."""
    ball = low_ball(seed, 0.4) if low else some_ball(seed, speed)
    q, still = several.map.map.arm.q_ready, np.zeros(3)
    said, choice, times = in_pieces(several, ball, q, still, count)
    at_once = chosen(several, ball, q, still)
    assert said == several.verdict(ball, q, still)
    assert choice.chosen == at_once.chosen
    assert times >= 2 / count


@settings(max_examples=20)
@given(seed=seeds, speed=st.floats(4.0, 9.0), other=st.floats(4.0, 9.0))
def test_what_is_adapted_is_what_the_verdict_rests_on(
    several: Family, seed: int, speed: float, other: float
) -> None:
    """Also where the ball is another by then: for that one, nothing is chosen again."""
    q, still = several.map.map.arm.q_ready, np.zeros(3)
    choice = chosen(several, some_ball(seed, speed), q, still)
    later = some_ball(seed, other)
    assert choice.adapt(later, q, still).chosen == choice.chosen
    assert choice.wait(later, q, still).chosen == choice.chosen


@settings(max_examples=30)
@given(seed=seeds, speed=st.floats(4.0, 9.0), moving=st.floats(0.0, 2.0))
def test_a_change_of_maps_is_no_jump(
    several: Family, seed: int, speed: float, moving: float
) -> None:
    """Eq. (12): whatever is chosen starts where the arm is and as fast as it moves."""
    rng, ball = np.random.default_rng(seed), some_ball(seed, speed)
    q = several.map.map.arm.q_ready + rng.uniform(-0.1, 0.1, 3)
    dq = moving * rng.uniform(-1.0, 1.0, 3)
    followed = several.adapt(ball, several.map.map.arm.q_ready, np.zeros(3))
    followed = chosen(followed, ball, q, dq).adapt(ball, q, dq)
    reference = followed.reference(ball)
    assert followed.chosen is not None
    assert np.allclose(reference.q_d, q, atol=1e-7)
    assert np.allclose(reference.dq_d, dq, atol=1e-6)


def test_a_ball_too_fast_to_match_is_given_to_the_other_map(several: Family) -> None:
    """At 5 m/s the preferred map follows; at 9 m/s, beyond its limits, the inward one does."""
    q, still = several.map.map.arm.q_ready, np.zeros(3)
    assert several.adapt(some_ball(1, 5.0), q, still).chosen == 0
    fast = some_ball(1, 9.0)
    strict = Tolerance(torque=1.25, speed=1.0)
    assert judge(several.maps[0].map, fast, q, tolerance=strict).outcome is Outcome.UNREACHABLE
    assert several.adapt(fast, q, still).chosen == 1


def test_a_ball_that_leaves_no_room_for_the_brake_is_given_to_the_other_map(
    several: Family,
) -> None:
    """At 6 m/s the preferred map keeps its limits, but joint 4 would have to stop at full torque.

    The ball meets the other map's hand along the palm's normal, with the joint at less speed.
    """
    q, still, ball = several.map.map.arm.q_ready, np.zeros(3), some_ball(2, 6.0)
    first, other = (f.map for f in several.maps)
    whole = judge(first, ball, q, tolerance=Tolerance(torque=1.25, speed=1.0))
    weak = Tolerance(torque=1.25, speed=1.0, strength=0.8)
    assert whole.share <= several.margin
    short = judge(first, ball, q, tolerance=weak)
    assert short.binding_limit == "brake:j4"
    assert short.share > several.margin
    assert judge(other, ball, q, tolerance=weak).share <= several.margin
    assert several.adapt(ball, q, still).chosen == 1


def test_the_map_that_is_followed_is_kept_while_it_serves(several: Family) -> None:
    """Adapted again to a ball that both can catch, the choice stays as it was."""
    ball, q = some_ball(2, 5.5), several.map.map.arm.q_ready
    for first in (0, 1):
        followed = chosen(Family(several.maps, chosen=first), ball, q, np.zeros(3))
        assert followed.chosen == first
        assert followed.sharpness(ball) == followed.map.sharpness(ball)


def test_a_ball_that_falls_short_changes_the_map_in_flight(several: Family) -> None:
    """Foreseen outside of the followed map's region and inside the other's: astray, and changed."""
    q, still = several.map.map.arm.q_ready, np.zeros(3)
    followed = several.adapt(some_ball(3, 5.0), q, still)
    assert followed.chosen == 0
    assert not followed.astray(some_ball(3, 5.0))
    end, steep = np.array([0.95, 0.04, -0.35]), np.array([-4.1, -0.6, -3.8])
    short = ball_state(end - steep * 0.2 + 0.5 * G * 0.04, steep - G * 0.2, G)
    assert not followed.map.returns(short)
    assert followed.astray(short)
    changed = chosen(followed, short, q, still).adapt(short, q, still)
    assert changed.chosen == 1
    assert not changed.astray(short)


def low_ball(seed: int, after: float) -> BallState:
    """Return a ball that will pass below the paper's map, where the inward one reaches."""
    rng = np.random.default_rng(seed)
    end = np.array([0.95, rng.uniform(-0.1, 0.1), rng.uniform(-0.4, -0.3)])
    steep = np.array([rng.uniform(-4.5, -3.8), rng.uniform(-0.6, 0.6), -3.8])
    return ball_state(end - steep * after + 0.5 * G * after**2, steep - G * after, G)


@settings(max_examples=20)
@given(seed=seeds, after=st.floats(0.3, 0.6), later=st.floats(0.0, 0.15))
def test_the_map_that_waits_for_a_low_ball_is_the_one_whose_verdict_is_open(
    several: Family, seed: int, after: float, later: float
) -> None:
    """However far ahead the catch is: it waits at its own height, and lets no other go down."""
    q, still, ball = several.map.map.arm.q_ready, np.zeros(3), low_ball(seed, after)
    assert several.verdict(ball, q).outcome is Outcome.OPEN
    assert several.maps[1].verdict(ball, q).outcome is Outcome.FEASIBLE
    waiting = several.wait(ball, q, still)
    assert waiting.chosen == 0
    surrogate = several.maps[0].waiting(ball)
    alone = several.maps[0].adapt(surrogate, q, still)
    assert np.array_equal(waiting.reference(surrogate).q_d, alone.reference(surrogate).q_d)
    falls = low_ball(seed, after - later)
    assert not waiting.astray(falls)
    assert waiting.verdict(falls, q, still).outcome is Outcome.OPEN
    assert chosen(waiting, falls, q, still).chosen == 0


def test_a_map_that_has_waited_keeps_a_ball_that_it_can_catch(several: Family) -> None:
    """Also one that leaves it less room for the brake than another map would have."""
    q, still, ball = several.map.map.arm.q_ready, np.zeros(3), some_ball(2, 6.0)
    assert several.adapt(ball, q, still).chosen == 1
    waited = several.wait(low_ball(1, 0.4), q, still)
    assert chosen(waited, ball, q, still).chosen == waited.chosen == 0
    too_fast = some_ball(1, 9.0)
    assert chosen(waited, too_fast, q, still).chosen == 1


@given(before=st.floats(0.05, 1.2), side=st.floats(-0.6, 0.6), led=st.booleans())
def test_what_is_known_to_be_unsettled_gets_no_other_verdict(
    several: Family, before: float, side: float, led: bool
) -> None:
    """No map could settle it; a ball in the air is never called so."""
    f, dr = several.map.map, np.array([-3.0, 0.2, 0.5])
    r_o = f.arm.position(f.start) - before * dr + np.array([0.0, side, 0.0])
    ball = replace(ball_state(r_o, dr, np.zeros(3)), led=led)
    known = several.unsettled(ball, f.arm.q_ready)
    assert led or not known
    assert not known or several.verdict(ball, f.arm.q_ready).outcome is Outcome.UNSETTLED


def test_where_no_map_can_catch_none_is_changed(several: Family) -> None:
    """A ball that flies away is out of every region: the choice stays."""
    away = ball_state(np.array([2.0, 0.0, 0.5]), np.array([5.0, 0.0, 0.0]), G)
    followed = several.adapt(some_ball(3, 5.0), several.map.map.arm.q_ready, np.zeros(3))
    assert not followed.astray(away)


def test_a_ball_that_has_come_back_is_not_waited_for_with_another_map(several: Family) -> None:
    """Costly for the map that waited, still low for the other: the one that waited keeps it."""
    q, still = several.map.map.arm.q_ready, np.zeros(3)
    end, steep = np.array([0.9, 0.12, -0.35]), np.array([-3.5, 0.0, -0.7])
    back = ball_state(end - steep * 0.18 + 0.5 * G * 0.18**2, steep - G * 0.18, G)
    loose = Tolerance(torque=1.25, speed=1.0)
    low, costly = (judge(f.map, back, q, tolerance=loose) for f in several.maps)
    assert costly.outcome is Outcome.UNREACHABLE
    assert low.outcome is Outcome.OPEN
    followed = Family(several.maps, chosen=1)
    assert followed.map.returns(back)
    assert chosen(followed, back, q, still).chosen == 1


def test_maps_that_weigh_the_match_are_chosen_among_their_own_kind(learned: Learned) -> None:
    """A map with terms of first order has no others of that size beside it that have none."""
    soft = learn(
        learned.map.arm,
        design=MapDesign(match_weight=1.0),
        around=Neighbourhood(flights=20, instants=6),
    )
    with pytest.raises(InputError, match="match_weight"):
        Family((Direct(learned.map), Direct(soft.map)))
    assert len(Family((Direct(soft.map), Direct(soft.map))).maps) == 2


def test_a_choice_among_nothing_is_refused() -> None:
    """There must be a map."""
    with pytest.raises(InputError, match="maps"):
        Family(())
