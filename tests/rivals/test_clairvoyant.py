"""The oracle: its model is the arm, its plan keeps the limits, and nothing is cheaper."""

import sys
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support import ball_state

from mitt.core.arm.arm import Arm
from mitt.core.arm.hands import HandModel
from mitt.core.errors import InputError
from mitt.core.map.demand import demand
from mitt.core.map.learn import Learned
from mitt.core.signals import Array, BallState
from mitt.core.verdict.feasibility import Outcome
from mitt.io.wam import wam, wam_limits
from mitt.lab.rivals.clairvoyant import Clairvoyant, Symbolic, make_clairvoyant, symbolic
from mitt.lab.world.throws import Throw, fly

pytest.importorskip("casadi")

#: Agreement of expressions and Pinocchio; of the plan's end and the ball [m, m/s].
EXACT = 1e-10
MET = 1e-3
#: Drag of the thrown ball [1/m], and when the plan starts [s].
DRAG = 0.04
START = 0.08


@pytest.fixture(name="model", scope="module")
def _model(arm: Arm) -> Symbolic:
    """The expressions of the WAM."""
    return symbolic(arm)


@pytest.fixture(name="told", scope="module")
def _told(learned: Learned, throw_of: Callable[[int], Throw]) -> Clairvoyant:
    """The clairvoyant, told of a default throw."""
    throw = throw_of(5)

    def flight(t: float) -> tuple[Array, Array]:
        return fly(throw.r, throw.dr, drag=DRAG, duration=t)

    return make_clairvoyant(learned.map).with_flight(flight)


@given(seed=st.integers(0, 2**31))
@settings(max_examples=20)
def test_the_expressions_are_the_arm(model: Symbolic, arm: Arm, seed: int) -> None:
    """Torques, catch point, its velocity and the palm's normal agree with Pinocchio's."""
    q, dq, ddq = np.random.default_rng(seed).normal(size=(3, 3))
    assert np.allclose(
        np.asarray(model.torque(q, dq, ddq)).ravel(), arm.torque(q, dq, ddq), atol=EXACT
    )
    tip = np.asarray(model.tip(q, dq, ddq))
    assert np.allclose(tip[:, 0], arm.position(q), atol=EXACT)
    assert np.allclose(tip[:, 1], arm.jacobian(q) @ dq, atol=EXACT)
    assert np.allclose(np.asarray(model.normal(q)).ravel(), arm.orientation(q)[:, 2], atol=EXACT)


def test_held_joints_and_motors_are_in_the_expressions() -> None:
    """With joint 3 held bent the torques of all four links agree."""
    arm = Arm(wam(HandModel(), held_3=0.4), wam_limits("wam-80v"))
    q, dq, ddq = np.random.default_rng(2).normal(size=(3, 3))
    found = np.asarray(symbolic(arm).torque(q, dq, ddq)).ravel()
    assert np.allclose(found, arm.torque(q, dq, ddq), atol=EXACT)


def test_the_plan_keeps_every_limit(
    told: Clairvoyant, arm: Arm, ball_of: Callable[[int, float], BallState]
) -> None:
    """Evaluated by Pinocchio between its instants too, and it meets the ball at its end."""
    ball = ball_of(5, START)
    verdict = told.verdict(ball, arm.q_ready)
    assert verdict.outcome is Outcome.FEASIBLE
    assert verdict.share <= 1.0
    plan = told.adapt(ball, arm.q_ready, np.zeros(3)).plan
    assert plan is not None
    rows = np.array([plan.at(t) for t in np.linspace(START, plan.t_c, 200).tolist()])
    asked = demand(arm, rows)
    assert asked.torque.max() <= 1.0
    assert asked.speed.max() <= 1.0
    assert asked.excess.max() == 0.0
    end, met = rows[-1], ball_of(5, plan.t_c)
    assert np.linalg.norm(arm.position(end[0]) - met.r_o) < MET
    assert np.linalg.norm(arm.jacobian(end[0]) @ end[1] - met.dr_o) < 10 * MET


def test_the_map_is_no_cheaper(
    told: Clairvoyant,
    arm: Arm,
    learned: Learned,
    ball_of: Callable[[int, float], BallState],
) -> None:
    """From the same start on the same flight the map's way costs at least the optimum."""
    ball = ball_of(5, START)
    plan = told.adapt(ball, arm.q_ready, np.zeros(3)).plan
    assert plan is not None
    rows = np.array([plan.at(t) for t in np.linspace(START, plan.t_c, 100).tolist()])
    f, ways = learned.map.adapt(ball, arm.q_ready, np.zeros(3)), []
    for t in np.linspace(START, 0.9, 400).tolist():
        reference = f.reference(ball_of(5, t))
        ways.append([reference.q_d, reference.dq_d, reference.ddq_d])
        if reference.time_to_catch <= 0.0:
            break
    assert demand(arm, rows).cost < demand(arm, np.array(ways)).cost


def test_what_cannot_be_caught_is_refused(
    told: Clairvoyant, arm: Arm, ball_of: Callable[[int, float], BallState]
) -> None:
    """A flight that stays out of reach has no plan, and the arm is left where it is."""

    def past(t: float) -> tuple[Array, Array]:
        return np.array([3.0 - 6.0 * t, 3.0, 1.0]), np.array([-6.0, 0.0, 0.0])

    other = told.with_flight(past)
    ball = ball_of(5, START)
    assert other.verdict(ball, arm.q_ready).outcome is Outcome.UNREACHABLE
    assert np.array_equal(other.reference(ball).q_d, arm.q_ready)


def test_a_refusal_is_reconsidered_after_a_while_and_not_each_tick(
    learned: Learned, arm: Arm, monkeypatch: pytest.MonkeyPatch
) -> None:
    """From the same rest a later start can do no more; from a motion it is planned at once."""
    tries: list[float] = []

    def none(_: Clairvoyant, t: float, motion: Array) -> None:  # noqa: ARG001
        tries.append(t)

    monkeypatch.setattr(Clairvoyant, "_plan", none)
    told = make_clairvoyant(learned.map).with_flight(lambda _: (np.full(3, 9.0), np.zeros(3)))
    for k in range(50):
        ball = replace(ball_state(np.full(3, 9.0), np.zeros(3), np.zeros(3)), t=0.001 * k)
        assert told.verdict(ball, arm.q_ready).outcome is Outcome.UNREACHABLE
    assert np.allclose(tries, [0.0, 0.02, 0.04])
    told.adapt(ball, arm.q_ready, np.full(arm.n, 0.1))
    assert np.allclose(tries, [0.0, 0.02, 0.04, 0.049])


def test_nothing_of_another_throw_is_kept(told: Clairvoyant) -> None:
    """Told of a new flight, the plan of the last is gone."""
    fresh = told.with_flight(lambda t: (np.array([t, 0.0, 0.0]), np.zeros(3)))
    assert fresh.plan is None
    assert fresh.last is not told.last


def test_without_casadi_it_says_what_to_install(
    monkeypatch: pytest.MonkeyPatch, learned: Learned
) -> None:
    """One line that names the extra."""
    monkeypatch.setitem(sys.modules, "casadi", None)
    with pytest.raises(InputError, match=r"mitt\[rivals\]") as caught:
        make_clairvoyant(learned.map)
    assert "\n" not in str(caught.value)
