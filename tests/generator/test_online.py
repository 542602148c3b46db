"""Laws of the online step: what it keeps, what it improves, what it does with nonsense."""

from copy import deepcopy
from dataclasses import replace

import numpy as np
import pytest
from support import ball_state

from mitt.ball.flight import advance
from mitt.control.brake import plan_brake
from mitt.errors import InputError
from mitt.generator.demand import Tolerance, demand
from mitt.generator.design import MapDesign
from mitt.generator.feasibility import Outcome
from mitt.generator.flights import Flight
from mitt.generator.learn import Learned
from mitt.generator.mapping import DirectMap, unlearned
from mitt.generator.online import Online, OnlineSettings, Refinement
from mitt.generator.prediction import flown, foresee
from mitt.generator.program import cost, limit_rows, sensitivity
from mitt.generator.qp import linearise
from mitt.generator.sqp_step import begin, merit
from mitt.generator.stopping import spare
from mitt.generator.utilization import weigh
from mitt.robot.arm import Arm
from mitt.robot.wam import wam_limits
from mitt.signals import Array, BallState

#: Jump of q_d and dq_d that is let pass [rad, rad/s].
JUMP = 1e-6


@pytest.fixture
def throw(learned: Learned, flights: list[Flight]) -> tuple[DirectMap, BallState]:
    """A ball at t_0 and the map projected onto its initial constraint."""
    ball = ball_state(*flights[3].ball[0])
    return learned.map.adapt(ball, learned.map.arm.q_ready, np.zeros(3)), ball


def along(f: DirectMap, ball: BallState, start: float = 0.0) -> Array:
    """Return q_d, dq_d, ddq_d on the way to a little past the catch, shape (80, 3, n)."""
    times = np.linspace(start, foresee(f, ball).after + 0.012, 80)
    return np.array([f.motion(row)[1][:3] for row in flown(ball, times)])


def test_a_step_leaves_the_reference_where_it_was(
    learned: Learned, throw: tuple[DirectMap, BallState]
) -> None:
    """q_d and dq_d are the same before and after, at the instant at which the step acts."""
    f, ball = throw
    online = Online(learned.map)
    answer = online.refine(f.alpha, ball)
    assert answer.status is Refinement.REFINED
    row = flown(ball, np.array([online.settings.lead]))[0]
    before, after = f.motion(row)[1], f.with_alpha(answer.alpha).motion(row)[1]
    assert after[:2] == pytest.approx(before[:2], abs=JUMP)


def test_steps_lower_the_cost_by_an_independent_reckoning(
    learned: Learned, throw: tuple[DirectMap, BallState]
) -> None:
    """After ten steps eq. (22), reckoned by Pinocchio on a finer grid, is lower."""
    f, ball = throw
    online, alpha = Online(learned.map), f.alpha
    for _ in range(10):
        alpha = online.refine(alpha, ball).alpha
    before = demand(f.arm, along(f, ball)).cost
    after = demand(f.arm, along(f.with_alpha(alpha), ball)).cost
    assert after < before


def test_the_catch_stays_where_it_was(learned: Learned, throw: tuple[DirectMap, BallState]) -> None:
    """Whatever the step, position and velocity match at the catch, eq. (3)."""
    f, ball = throw
    refined = f.with_alpha(Online(learned.map).refine(f.alpha, ball).alpha)
    row = flown(ball, np.array([foresee(f, ball).after]))[0]
    motion = refined.motion(row)[1]
    assert f.arm.position(motion[0]) == pytest.approx(row[0], abs=1e-5)
    assert f.arm.jacobian(motion[0]) @ motion[1] == pytest.approx(row[1], abs=1e-2)


def test_gradient_and_hessian_are_those_of_the_learner(
    learned: Learned, throw: tuple[DirectMap, BallState]
) -> None:
    """The kernel's Gauss-Newton system is the one of program.py (Pinocchio) on the same course."""
    f, ball = throw
    online = Online(learned.map, OnlineSettings(pull=0.0))
    online.refine(f.alpha, ball)
    b = online._buffers
    state = np.array([*ball.r_o, *ball.dr_o, ball.drag])
    begin(online._map, online._plant, online._goal, state, (0.001, 0.35), f.alpha, b)
    c = b.course
    s = sensitivity(f.arm, c.rows + c.phi @ f.alpha, c.phi)
    torque, speed, J = cost(f.arm, s)
    residual = np.concatenate([torque.ravel(), speed.ravel()])
    weight = np.concatenate([np.repeat(c.weight, f.arm.n)] * 2)
    scale = np.abs(b.programme.h).max()
    assert b.programme.h == pytest.approx((J.T * weight) @ J, abs=1e-10 * scale)
    assert b.programme.g == pytest.approx((J.T * weight) @ residual, abs=1e-10 * scale)
    expected = float(np.sum(weight * residual**2))
    assert merit(online._map, online._plant, online._goal, f.alpha, b) >= expected - 1e-12


@pytest.mark.parametrize("name", ["paper", "wam-48v"])
def test_the_rows_of_the_limits_are_those_of_the_learner(
    throw: tuple[DirectMap, BallState], name: str
) -> None:
    """As many, with as much room and the same slopes, the motors' voltage among them."""
    f, ball = throw
    f = replace(f, arm=Arm(f.arm.model, wam_limits(name)))
    online = Online(f, OnlineSettings(pull=0.0, near=0.0, share=1.0))
    b, state = online._buffers, np.array([*ball.r_o, *ball.dr_o, ball.drag])
    begin(online._map, online._plant, online._goal, state, (0.001, 0.35), f.alpha, b)
    c, n = b.course, f.arm.n
    s = sensitivity(f.arm, c.rows + c.phi @ f.alpha, c.phi)
    rows = limit_rows(f.arm, s, share=1.0, near=0.0)
    given = online._plant, c, f.alpha, (1.0, 0.0)
    count, _, _ = linearise(*given, b.programme, b.shares, b.at, b.work)
    A, room = b.programme.A[2 * n : count], b.programme.room[2 * n : count]
    assert len(room) == len(rows.room)
    mine, theirs = np.argsort(room), np.argsort(rows.room)
    assert room[mine] == pytest.approx(rows.room[theirs], abs=1e-9)
    scale = np.abs(rows.rows).max()
    total = rows.rows.sum(axis=0)
    assert A.sum(axis=0) == pytest.approx(total, abs=1e-7 * len(room) * scale)


def test_a_map_that_weighs_the_match_is_not_refined(learned: Learned) -> None:
    """Eq. (22) alone would undo the match; it is refused in one line with the remedy."""
    soft = unlearned(learned.map.arm, MapDesign(match_weight=1.0))
    with pytest.raises(InputError, match="leave --adapt refine out"):
        Online(soft)


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_nonsense_keeps_the_last_good_coefficients(
    learned: Learned, throw: tuple[DirectMap, BallState], value: float
) -> None:
    """A ball that is not finite changes nothing, and the next sound one is refined again."""
    f, ball = throw
    online = Online(learned.map)
    online.refine(f.alpha, ball)
    answer = online.refine(f.alpha, replace(ball, dr_o=np.array([value, 0.0, 0.0])))
    assert answer.status in (Refinement.OUTSIDE, Refinement.FAILED)
    assert np.array_equal(answer.alpha, f.alpha)
    assert online.refine(f.alpha, ball).status is Refinement.REFINED


def test_near_the_catch_nothing_is_changed(
    learned: Learned, throw: tuple[DirectMap, BallState]
) -> None:
    """In the last 40 ms the coefficients stay, for there is nothing left to be gained."""
    f, ball = throw
    online = Online(learned.map)
    r, dr = ball.r_o.copy(), ball.dr_o.copy()
    advance(r, dr, ball.drag, foresee(f, ball).after - 0.03)
    late = replace(ball, r_o=r, dr_o=dr)
    answer = online.refine(f.alpha, late)
    assert answer.status is Refinement.LATE
    assert np.array_equal(answer.alpha, f.alpha)
    assert online.certify(f.alpha, late, tolerance=Tolerance()) is None


def test_the_certificate_says_what_the_demand_says(
    learned: Learned, throw: tuple[DirectMap, BallState]
) -> None:
    """The share of the binding limit is that of the motion reckoned on a finer grid."""
    f, ball = throw
    online, tolerance = Online(learned.map), Tolerance(torque=1.0, speed=1.0)
    alpha = online.refine(f.alpha, ball).alpha
    verdict = online.certify(alpha, ball, tolerance=tolerance)
    assert verdict is not None
    asked = demand(f.arm, along(f.with_alpha(alpha), ball, online.settings.lead))
    largest = max(float(asked.torque.max()), float(asked.speed.max()))
    assert verdict.share == pytest.approx(largest, rel=0.05)
    assert verdict.outcome is Outcome.FEASIBLE
    assert verdict.margin == pytest.approx(1.0 - verdict.share)
    assert deepcopy(online).certify(alpha, ball, tolerance=tolerance) == verdict


def test_less_certainty_means_less_probability(
    learned: Learned, throw: tuple[DirectMap, BallState]
) -> None:
    """A ball known better is caught with greater probability; one known exactly, with all."""
    f, ball = throw
    online, tolerance = Online(learned.map), Tolerance()
    alpha = online.refine(f.alpha, ball).alpha
    odds = []
    for sigma in (1e-6, 0.1, 1.0):
        known = replace(ball, covariance=sigma**2 * np.diag([0.01] * 3 + [1.0] * 3))
        verdict = online.certify(alpha, known, tolerance=tolerance)
        assert verdict is not None
        odds.append(verdict.probability)
    assert odds[0] == pytest.approx(1.0, abs=1e-6)
    assert odds[0] >= odds[1] > odds[2]


def test_the_shares_are_those_of_the_coefficients_that_are_kept(
    learned: Learned, flights: list[Flight]
) -> None:
    """After every step, also one that did not help, they are reckoned anew to the same."""
    kept = 0
    for flight in flights[:6]:
        ball = ball_state(*flight.ball[0])
        f = learned.map.adapt(ball, learned.map.arm.q_ready, np.zeros(3))
        online, alpha = Online(learned.map), f.alpha
        for _ in range(12):
            answer = online.refine(alpha, ball)
            b, again, at = (
                online._buffers,
                np.zeros_like(answer.shares),
                np.zeros_like(answer.shares),
            )
            weigh(online._plant, b.course, answer.alpha, online.settings.share, again, at, b.work)
            assert np.allclose(answer.shares, again, rtol=0.0, atol=1e-12)
            kept, alpha = kept + (answer.status is Refinement.KEPT), answer.alpha
    assert kept > 0


def test_where_the_certificate_sees_room_the_brake_finds_it(
    learned: Learned, throw: tuple[DirectMap, BallState]
) -> None:
    """From the end of the course the planned brake stops the arm inside its range as well."""
    f, ball = throw
    online = Online(learned.map)
    online.refine(f.alpha, ball)
    share, _ = spare(online._plant, f.alpha, online._buffers)
    c = online._buffers.course
    brake = plan_brake(f.arm, 0.0, c.rows[-1] + c.phi[-1] @ f.alpha)
    assert share < 1.0
    assert np.all(brake.q_end < f.arm.q_max)
    assert np.all(brake.q_end > f.arm.q_min)
    middle, half = 0.5 * (f.arm.q_max + f.arm.q_min), 0.5 * (f.arm.q_max - f.arm.q_min)
    assert share == pytest.approx(float((np.abs(brake.q_end - middle) / half).max()), abs=0.25)
