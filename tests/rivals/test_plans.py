"""The planners: what each promises of its plan."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mitt.core.map.demand import demand
from mitt.core.signals import Array, BallState
from mitt.lab.rivals.intercept import Chooser, Intercept
from mitt.lab.rivals.mpc import MpcPlanner, MpcSettings, solve
from mitt.lab.rivals.paths import PathMotion, quintic, responses
from mitt.lab.rivals.planned import Budgeted, RuckigPlanner, plan_quintic
from mitt.lab.rivals.pursuit import at_rest

seeds = st.integers(0, 2**31)
#: Boundary conditions met by polynomials, and by solvers.
EXACT = 1e-8
SOLVED = 1e-4
#: When the plans start [s].
START = 0.1


@pytest.fixture(params=range(4))
def catch(
    request: pytest.FixtureRequest, chooser: Chooser, ball_of: Callable[[int, float], BallState]
) -> Intercept:
    """Catches of a few throws."""
    ball = ball_of(int(request.param), START)
    chosen = chooser.choose(ball, at_rest(chooser.arm.q_ready))
    assert chosen is not None
    return chosen


@given(seed=seeds)
def test_the_quintic_meets_its_ends(seed: int) -> None:
    """Positions, speeds and accelerations at both ends are those asked for."""
    rng = np.random.default_rng(seed)
    start, end, span = rng.normal(size=(3, 4)), rng.normal(size=(3, 4)), rng.uniform(0.1, 2.0)
    out = np.empty((3, 4))
    quintic(start, end, span, 0.0, out)
    assert np.allclose(out, start, atol=EXACT)
    quintic(start, end, span, span, out)
    assert np.allclose(out, end, atol=1e-6)


@given(seed=seeds)
def test_the_quintics_derivatives_are_central_differences(seed: int) -> None:
    """Speed and acceleration belong to the position."""
    rng = np.random.default_rng(seed)
    start, end, h = rng.normal(size=(3, 2)), rng.normal(size=(3, 2)), 1e-5
    rows = np.empty((3, 3, 2))
    for k, s in enumerate((-h, 0.0, h)):
        quintic(start, end, 0.5, 0.2 + s, rows[k])
    assert np.allclose((rows[2, 0] - rows[0, 0]) / (2 * h), rows[1, 1], atol=1e-5)
    assert np.allclose((rows[2, 1] - rows[0, 1]) / (2 * h), rows[1, 2], atol=1e-3)


def test_ruckigs_plan_keeps_its_limits_and_ends_at_the_catch(
    chooser: Chooser, catch: Intercept
) -> None:
    """Position and velocity are met at the time of the catch, speed and acceleration bounded."""
    arm, motion = chooser.arm, at_rest(chooser.arm.q_ready)
    planner = RuckigPlanner(arm)
    plan = planner(motion, START, catch)
    assert plan is not None
    most = planner.accelerations(motion, catch.end)
    t = np.linspace(START, catch.t_c, 200)
    rows = np.array([plan.at(x) for x in t.tolist()])
    assert np.allclose(rows[-1, :2], catch.end[:2], atol=5e-3)
    assert np.all(np.abs(rows[:, 1]) <= arm.dq_max)
    assert np.all(np.abs(rows[:, 2]) <= most * (1.0 + EXACT))


def test_ruckigs_refusals_are_no_errors(chooser: Chooser, catch: Intercept) -> None:
    """Too little time, or an end that is no number, give no plan."""
    planner, motion = RuckigPlanner(chooser.arm), at_rest(chooser.arm.q_ready)
    assert planner(motion, catch.t_c - 0.02, catch) is None
    assert planner(np.full((3, 3), np.nan), START, catch) is None


def test_the_quadratic_programme_is_feasible_and_believed_rightly(
    chooser: Chooser, catch: Intercept
) -> None:
    """DAQP's answer satisfies start, end, speeds and ranges; torques where they can be."""
    planner = MpcPlanner(chooser.arm, MpcSettings())
    problem = planner.problem(at_rest(chooser.arm.q_ready), catch.end, (catch.t_c - START) / 10)
    a = solve(problem)
    assert a is not None
    rows = problem.A @ a
    assert np.all(rows >= problem.low - SOLVED)
    assert np.all(rows <= problem.high + SOLVED)


def test_the_predictive_plan_costs_less_than_the_quintic(
    chooser: Chooser, catch: Intercept
) -> None:
    """Between the same ends at the same times the programme's motion is cheaper by eq. (22)."""
    arm, motion = chooser.arm, at_rest(chooser.arm.q_ready)
    plan = MpcPlanner(arm, MpcSettings())(motion, START, catch)
    assert plan is not None
    other = plan_quintic(motion, START, catch)
    t = np.linspace(START, catch.t_c, 40).tolist()
    assert np.allclose(plan.at(catch.t_c), catch.end, atol=SOLVED)
    costs = [demand(arm, np.array([x.at(s) for s in t])).cost for x in (plan, other)]
    assert costs[0] < costs[1]


def test_a_programme_of_no_numbers_has_no_answer(chooser: Chooser, catch: Intercept) -> None:
    """DAQP is not asked about NaN, and nothing is made of it."""
    motion = np.full((3, 3), np.nan)
    assert MpcPlanner(chooser.arm, MpcSettings())(motion, START, catch) is None


@given(seed=seeds)
def test_pieces_are_exact_integrals(seed: int) -> None:
    """Angles and speeds from the responses are those of the motion, and smooth across pieces."""
    rng, M, h = np.random.default_rng(seed), 6, 0.05
    D, P = responses(M, h)
    a: Array = rng.normal(size=(M + 1, 2))
    motion = PathMotion(t=1.0, step=h, q=(P @ a).T, dq=(D @ a).T, ddq=a.T, cost=0.0)
    for k in range(1, M):
        before, after = motion.at(1.0 + k * h - 1e-9), motion.at(1.0 + k * h + 1e-9)
        assert np.allclose(before, after, atol=1e-6)
    assert np.allclose(motion.at(motion.t_c), [(P @ a)[-1], (D @ a)[-1], a[-1]], atol=1e-9)


def test_a_budget_bounds_the_plans_a_second_and_each_acts_a_period_later(
    catch: Intercept, ball_of: Callable[[int, float], BallState]
) -> None:
    """Where the catch changes all the time, plans are made for what was forecast a period ago."""
    asked: list[tuple[float, float]] = []

    def planner(motion: Array, t: float, to: Intercept) -> object:
        asked.append((t, to.t_c))
        return plan_quintic(motion, t, to)

    ball = ball_of(0, START)
    pursuit = Budgeted(planner=planner, period=0.03)  # type: ignore[arg-type]
    pursuit = pursuit.begin(catch, START, at_rest(catch.end[0]))
    last = at_rest(catch.end[0])
    for k in range(1, 150):
        t = START + 1e-3 * k
        moved = replace(catch, t_c=START + 1.0 + 1e-4 * k)
        motion, pursuit = pursuit.step(moved, replace(ball, t=t))
        assert np.max(np.abs(motion[0] - last[0])) < 0.05
        last = motion
    times = np.array([t for t, _ in asked])
    assert len(asked) == 4
    assert np.all(np.diff(times) >= 0.03 - 1e-9)
    for t, t_c in asked[1:]:
        made_for = START + 1e-3 * (t_c - START - 1.0) / 1e-4
        assert t - made_for == pytest.approx(0.03, abs=2e-3)
