"""Laws of the steps for one ball: what they keep, what they improve, what they do with nonsense."""

from dataclasses import replace

import numpy as np
import pytest
from support import ball_state

from mitt.core.catcher.generators import Direct, refining
from mitt.core.catcher.refine import refine
from mitt.core.errors import InputError
from mitt.core.map.demand import demand
from mitt.core.map.foresight import foresee
from mitt.core.map.learn import Flight, Learned
from mitt.core.map.map_design import MapDesign
from mitt.core.map.mapping import DirectMap, unlearned
from mitt.core.map.prediction import flown
from mitt.core.signals import Array, BallState
from mitt.core.verdict.feasibility import Outcome

#: Jump of q_d and dq_d that is let pass [rad, rad/s].
JUMP = 1e-6


@pytest.fixture
def ball(flights: list[Flight]) -> BallState:
    """A ball at t_0."""
    return ball_state(*flights[3].ball[0])


def along(f: DirectMap, ball: BallState) -> Array:
    """Return q_d, dq_d, ddq_d on the way to a little past the catch, shape (80, 3, n)."""
    times = np.linspace(0.0, foresee(f, ball).after + 0.012, 80)
    return np.array([f.motion(row)[1][:3] for row in flown(ball, times)])


def started(f: DirectMap, ball: BallState) -> tuple[DirectMap, DirectMap]:
    """Return the map projected onto the start of an arm at rest, and the one refined from there."""
    q, still = f.arm.q_ready, np.zeros(f.arm.n)
    g = f.adapt(ball, q, still)
    return g, refine(g, ball, q, still)


def test_a_refined_map_starts_where_the_arm_is(learned: Learned, ball: BallState) -> None:
    """q_d and dq_d at t_0 are those of the arm, eq. (12)."""
    _, refined = started(learned.map, ball)
    rows = refined.motion(flown(ball, np.zeros(1))[0])[1]
    assert rows[0] == pytest.approx(learned.map.arm.q_ready, abs=JUMP)
    assert rows[1] == pytest.approx(np.zeros(3), abs=JUMP)


def test_refining_lowers_the_cost(learned: Learned, flights: list[Flight]) -> None:
    """On average over flights eq. (22), reckoned on a finer grid, is lower than projected."""
    before, after = [], []
    for flight in flights[:12]:
        ball = ball_state(*flight.ball[0])
        one, other = started(learned.map, ball)
        before.append(demand(one.arm, along(one, ball)).cost)
        after.append(demand(other.arm, along(other, ball)).cost)
    assert np.mean(after) < 0.99 * np.mean(before)


def test_the_catch_stays_where_it_was(learned: Learned, ball: BallState) -> None:
    """Whatever the steps, position and velocity match at the catch, eq. (3)."""
    _, f = started(learned.map, ball)
    row = flown(ball, np.array([foresee(f, ball).after]))[0]
    motion = f.motion(row)[1]
    assert f.arm.position(motion[0]) == pytest.approx(row[0], abs=1e-5)
    assert f.arm.jacobian(motion[0]) @ motion[1] == pytest.approx(row[1], abs=1e-2)


def test_a_refined_map_bears_an_error_of_the_estimate(learned: Learned, ball: BallState) -> None:
    """A ball that was a centimetre elsewhere asks for little more than the one refined for."""
    _, f = started(learned.map, ball)
    asked = demand(f.arm, along(f, ball))
    for way in (*np.eye(3), *-np.eye(3)):
        other = demand(f.arm, along(f, replace(ball, r_o=ball.r_o + 0.01 * way)))
        assert other.torque.max() < asked.torque.max() + 0.3


def test_a_map_that_weighs_the_match_is_not_refined(learned: Learned) -> None:
    """Eq. (22) alone would undo what it has learned."""
    soft = unlearned(learned.map.arm, MapDesign(match_weight=0.1))
    with pytest.raises(InputError, match="refined in flight"):
        Direct(soft, refines=True)


def test_nonsense_is_not_refined(learned: Learned, ball: BallState) -> None:
    """A ball that is not finite or never comes leaves the map as it was."""
    q, still = learned.map.arm.q_ready, np.zeros(3)
    for r_o in (np.full(3, np.nan), np.array([1e9, 0.0, 0.0]), np.array([-9.0, 0.0, 0.0])):
        assert refine(learned.map, replace(ball, r_o=r_o), q, still) is learned.map


def test_the_probability_falls_with_the_uncertainty_of_the_ball(
    learned: Learned, ball: BallState
) -> None:
    """Nearly 1 for a ball that is known, and ever less the less it is."""
    g, q = refining(learned.map), learned.map.arm.q_ready
    odds = []
    for sigma in (1e-4, 3e-2, 1e-1, 1.0):
        verdict = g.verdict(replace(ball, covariance=sigma**2 * np.eye(6)), q)
        assert verdict.outcome is Outcome.FEASIBLE
        odds.append(verdict.probability)
    assert odds[0] > 0.99
    assert odds == sorted(odds, reverse=True)
    assert odds[-1] < 0.05
