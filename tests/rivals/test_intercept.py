"""The catch of the rivals: the arm meets the ball there, and no other is better."""

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mitt.core.arm.arm import Arm
from mitt.core.arm.hands import HandModel
from mitt.core.arm.kinematics import ZERO
from mitt.core.map.demand import demand
from mitt.core.map.map_design import default_design
from mitt.core.map.mapping import unlearned
from mitt.core.map.prediction import flown, fly_on, state_of
from mitt.core.signals import Array, BallState
from mitt.core.verdict.feasibility import Outcome
from mitt.io.wam import wam, wam_limits
from mitt.lab.rivals.intercept import (
    APPROACH,
    CLOSINGS,
    FOLLOW,
    HORIZON,
    INSTANTS,
    LEFT,
    LOW,
    PRICE,
    SOONEST,
    SPARE,
    STRIDE,
    Chooser,
    Entry,
    Intercept,
    follow_point,
    meet_ball,
    reach_point,
    resolve,
    slowest,
)
from mitt.lab.rivals.mpc import MpcPlanner, MpcSettings
from mitt.lab.rivals.paths import responses, sample_quintic
from mitt.lab.rivals.planned import QuinticPlan
from mitt.lab.rivals.pursuit import at_rest

seeds = st.integers(0, 2**31)
#: Residuals of positions [m] and of central differences.
EXACT = 1e-8
CLOSE = 1e-4


def _angles(seed: int) -> Array:
    """Return joint angles well within the reach, elbow bent forward."""
    rng = np.random.default_rng(seed)
    return np.array([rng.uniform(-1, 1), rng.uniform(0, 1.2), rng.uniform(0.7, 2.3)])


@given(seed=seeds)
def test_the_inverse_reaches_the_point(chooser: Chooser, seed: int) -> None:
    """From the nominal catch the iteration ends where the catch point is at the point asked."""
    f, q = chooser.map, chooser.map.start.copy()
    r = chooser.arm.position(_angles(seed))
    assert reach_point(f.packed, r, q, f.work) < EXACT
    assert np.allclose(chooser.arm.position(q), r, atol=EXACT)


def test_out_of_reach_the_inverse_stretches_towards_the_point(chooser: Chooser) -> None:
    """Beyond the reach the residual is the way that is missing, and the angles stay finite."""
    f, q = chooser.map, chooser.map.start.copy()
    left = reach_point(f.packed, np.array([3.0, 0.0, 0.0]), q, f.work)
    assert np.all(np.isfinite(q))
    assert left > 1.9


def test_damping_leaves_good_poses_alone_and_bounds_bad_ones() -> None:
    """Where J is well conditioned J' x = b holds exactly; where it is singular x stays small."""
    out = np.empty(3)
    good = np.array([[0.8, 0.1, 0.0], [0.0, 0.7, 0.2], [0.1, 0.0, 0.5]])
    resolve(good, (1.0, -2.0, 0.5), out)
    assert np.allclose(good.T @ out, [1.0, -2.0, 0.5], atol=1e-12)
    bad = np.array([[0.8, 0.0, 0.0], [0.0, 0.7, 0.0], [0.0, 0.3, 1e-9]])
    resolve(bad, (0.0, 0.0, 1.0), out)
    assert np.linalg.norm(out) < 1.0


@given(seed=seeds)
def test_a_moving_point_is_followed_in_all_derivatives(chooser: Chooser, seed: int) -> None:
    """Speeds and accelerations of the joints are central differences of their angles."""
    f, rng = chooser.map, np.random.default_rng(seed)
    q = _angles(seed)
    point = np.array([chooser.arm.position(q), rng.normal(size=3), rng.normal(size=3)])
    rows = np.array([q, np.zeros(3), np.zeros(3)])
    follow_point(f.packed, chooser.hand, ZERO, point, rows, f.work)
    h, near = 1e-3, []
    for s in (-h, h):
        at = q.copy()
        reach_point(f.packed, point[0] + s * point[1] + 0.5 * s * s * point[2], at, f.work)
        near.append(at)
    assert np.allclose(rows[1], (near[1] - near[0]) / (2 * h), rtol=1e-3, atol=1e-3)
    assert np.allclose(rows[2], (near[1] - 2 * rows[0] + near[0]) / h**2, rtol=0.01, atol=0.05)


@given(seed=seeds)
def test_a_point_before_the_palm_is_followed(chooser: Chooser, seed: int) -> None:
    """l(q) + h n(q) is at the point, and its motion is the point's, by central differences."""
    f, arm, rng = chooser.map, chooser.arm, np.random.default_rng(seed)
    q, h = _angles(seed), (0.1, -0.5, 3.0)
    at = arm.position(q) + h[0] * arm.orientation(q)[:, 2]
    point = np.array([at, rng.normal(size=3), rng.normal(size=3)])
    rows = np.array([q, np.zeros(3), np.zeros(3)])
    assert follow_point(f.packed, chooser.hand, h, point, rows, f.work) < EXACT

    def place(s: float) -> Array:
        x = rows[0] + s * rows[1] + 0.5 * s * s * rows[2]
        out: Array = (
            arm.position(x) + (h[0] + s * h[1] + 0.5 * s * s * h[2]) * (arm.orientation(x)[:, 2])
        )
        return out

    s = 1e-4
    assert np.allclose((place(s) - place(-s)) / (2 * s), point[1], atol=CLOSE)
    assert np.allclose((place(s) - 2 * place(0.0) + place(-s)) / s**2, point[2], atol=CLOSE * 10)


@pytest.mark.parametrize("seed", range(5))
def test_the_ball_is_met_from_the_front(
    chooser: Chooser, ball_of: Callable[[int, float], BallState], seed: int
) -> None:
    """At the meeting position and velocity agree and the ball accelerates along the normal."""
    ball = ball_of(seed, 0.1)
    catch = chooser.choose(ball, np.array([chooser.arm.q_ready, np.zeros(3), np.zeros(3)]))
    assert catch is not None
    arm, q, dq, ddq = chooser.arm, *catch.end
    at = np.empty((3, 3))
    fly_on(state_of(ball), catch.t_c - ball.t, at)
    assert np.allclose(arm.position(q), at[0], atol=EXACT)
    assert np.allclose(arm.jacobian(q) @ dq, at[1], atol=EXACT)
    s = 1e-5
    slope = arm.jacobian(q + s * dq) - arm.jacobian(q - s * dq)
    tip = arm.jacobian(q) @ ddq + slope @ dq / (2 * s)
    relative, normal = at[2] - tip, arm.orientation(q)[:, 2]
    a = float(relative @ normal)
    low, high = APPROACH
    assert low - CLOSE <= a <= high + CLOSE
    assert np.allclose(relative, a * normal, atol=CLOSE)


def test_no_meeting_out_of_reach(chooser: Chooser, arm: Arm) -> None:
    """A ball that stays 3 m away is not met."""
    f, rows = chooser.map, np.array([arm.q_ready, np.zeros(3), np.zeros(3)])
    ball = np.array([[3.0, 0.0, 0.0], np.zeros(3), np.zeros(3)])
    assert not meet_ball(f.packed, chooser.hand, Entry(0.0, *APPROACH), ball, rows, f.work)


@given(seed=seeds, closing=st.floats(0.0, 5.0))
def test_a_ball_closes_in_along_the_palm_as_fast_as_chosen(
    chooser: Chooser, seed: int, closing: float
) -> None:
    """Relative to the hand its velocity is that along the normal, whatever the pose."""
    f, arm, q = chooser.map, chooser.arm, _angles(seed)
    ball = np.array([arm.position(q), np.random.default_rng(seed).normal(size=3), [0.0, 0.0, -9.8]])
    rows = np.array([q, np.zeros(3), np.zeros(3)])
    assert meet_ball(f.packed, chooser.hand, Entry(closing, *APPROACH), ball, rows, f.work)
    relative = ball[1] - arm.jacobian(rows[0]) @ rows[1]
    assert np.allclose(relative, -closing * arm.orientation(rows[0])[:, 2], atol=EXACT)


@given(seed=seeds)
def test_no_other_closing_speed_has_slower_joints(chooser: Chooser, seed: int) -> None:
    """In shares of the limits: a little more or less is faster."""
    f, arm, q = chooser.map, chooser.arm, _angles(seed)
    ball = np.array([arm.position(q), [-4.0, 0.5, -1.0], [0.0, 0.0, -9.8]])
    rows = np.array([q, np.zeros(3), np.zeros(3)])
    assert meet_ball(f.packed, chooser.hand, Entry(0.0, *APPROACH), ball, rows, f.work)
    u = slowest(f.packed, chooser.hand, rows, f.work)

    def speed(closing: float) -> float:
        met = rows.copy()
        meet_ball(f.packed, chooser.hand, Entry(closing, *APPROACH), ball, met, f.work)
        return float(np.sum((met[1] / arm.dq_max) ** 2))

    assert all(speed(u) <= speed(x) + ROUNDING for x in (0.0, 0.9 * u, 1.1 * u, u + 0.1))


#: Agreement of two ways of reckoning, relative to the size of what is reckoned.
ROUNDING = 1e-9
#: When the plans start [s].
START = 0.1


def _price(chooser: Chooser, way: Array, end: Array) -> tuple[float, str, float]:
    """Return price of a way, shape (S, 3, n), its most asked limit and how much of it is asked."""
    arm, asked = chooser.arm, demand(chooser.arm, way)
    half, middle = 0.5 * (arm.q_max - arm.q_min), 0.5 * (arm.q_max + arm.q_min)
    stop = end[0] + FOLLOW * end[1] + 0.5 * end[1] * np.abs(end[1]) * chooser.hand.inertia
    kinds = {
        "torque": arm.active(asked.torque).max(axis=0),
        "speed": arm.active(asked.speed).max(axis=0),
        "range": (np.abs(np.array([*way[:, 0], stop]) - middle) / half).max(axis=0),
    }
    shares = {
        f"{kind}:{name}": float(x)
        for kind, values in kinds.items()
        for name, x in zip(arm.names, values, strict=True)
    }
    name = max(shares, key=lambda key: shares[key])
    return asked.cost + PRICE * max(shares[name] - SPARE, 0.0) ** 2, name, shares[name]


def _candidates(
    chooser: Chooser, after: Array, balls: Array, motion: Array
) -> dict[tuple[int, float], tuple[float, str, float]]:
    """Return price, limit and utilization of all catches that are tried, by instant and closing."""
    f, arm, priced = chooser.map, chooser.arm, dict[tuple[int, float], tuple[float, str, float]]()
    rows, way = np.array([f.start, 0.0 * f.start, 0.0 * f.start]), np.empty((INSTANTS, 3, arm.n))
    for k in range(len(after)):
        top, begun = 0.0, rows[0].copy()
        for share in CLOSINGS:
            how = Entry(share * top, *APPROACH)
            if not meet_ball(f.packed, chooser.hand, how, balls[k], rows, f.work):
                rows[0] = begun
                break
            begun = rows[0].copy()
            sample_quintic(motion, rows, after[k], way)
            price, name, used = _price(chooser, way, rows)
            within = np.all((rows[0] > arm.q_min) & (rows[0] < arm.q_max))
            within &= np.abs(way[:, 1] / arm.dq_max).max() <= 1.6
            low = LOW * float(balls[k, 0, 2] < chooser.floor)
            if within:
                priced[k, how.closing] = price + LEFT * how.closing**2 + low, name, used
            if share == 0.0:
                top = slowest(f.packed, chooser.hand, rows, f.work)
            if (within and used <= SPARE) or top == 0.0:
                break
    return priced


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("moving", [0.0, 1.0])
def test_the_chosen_catch_is_the_cheapest_of_all(
    chooser: Chooser, ball_of: Callable[[int, float], BallState], seed: int, moving: float
) -> None:
    """Every candidate weighed by the stages' own functions: the same is the best, at its share."""
    arm, after, ball = chooser.arm, np.arange(SOONEST, HORIZON, STRIDE), ball_of(seed, START)
    motion = at_rest(arm.q_ready) + moving * np.random.default_rng(seed).normal(size=(3, arm.n))
    balls = flown(ball, after)
    priced = _candidates(chooser, after, balls, motion)
    k, closing = min(priced, key=lambda key: priced[key][0])
    best = chooser.best(after, balls, motion)
    assert best is not None
    assert best.t_c == after[k]
    assert best.closing == pytest.approx(closing, rel=ROUNDING)
    assert best.binding_limit == priced[k, closing][1]
    assert best.utilization == pytest.approx(priced[k, closing][2], rel=ROUNDING)
    assert best.low == (balls[k, 0, 2] < chooser.floor)


def _real(limits: str) -> Chooser:
    """Return what chooses catches for the WAM with real motors."""
    arm = Arm(wam(HandModel()), wam_limits(limits))
    return Chooser(unlearned(arm, default_design(arm)))


@pytest.mark.parametrize("limits", ["wam-80v", "wam-48v"])
@pytest.mark.parametrize("seed", range(4))
def test_motors_that_cannot_match_a_ball_s_velocity_are_asked_for_what_they_can(
    ball_of: Callable[[int, float], BallState], limits: str, seed: int
) -> None:
    """Weaker motors meet it slower, within limits; the idealised arm as fast as the ball."""
    real, ball = _real(limits), ball_of(seed, START)
    catch = real.choose(ball, at_rest(real.arm.q_ready))
    assert catch is not None
    assert catch.closing > 0.0
    assert catch.utilization <= 1.05
    assert _ideal(ball).closing == 0.0


def _ideal(ball: BallState) -> Intercept:
    """Return the catch of the arm of the paper's limits."""
    chooser = _real("paper")
    catch = chooser.choose(ball, at_rest(chooser.arm.q_ready))
    assert catch is not None
    return catch


def test_a_verdict_rests_on_the_way_to_the_catch(
    chooser: Chooser, ball_of: Callable[[int, float], BallState]
) -> None:
    """So what comes after it, as brake and grip, is looked at as for a map."""
    ball, motion = ball_of(1, START), at_rest(chooser.arm.q_ready)
    catch = chooser.choose(ball, motion)
    assert catch is not None
    verdict = chooser.verdict(catch, ball, motion, sigma=0.001)
    assert verdict.outcome is Outcome.FEASIBLE
    assert verdict.approach is not None
    assert np.allclose(verdict.approach.motion[0], motion)
    assert np.allclose(verdict.approach.motion[-1], catch.end, atol=1e-6)
    assert np.allclose(verdict.approach.dr_o, flown(ball, np.array([catch.t_c - START]))[0, 1])
    span = verdict.approach.step * (len(verdict.approach.motion) - 1)
    assert span == pytest.approx(catch.t_c - START)


@pytest.mark.parametrize("seed", range(4))
def test_the_search_is_refined_about_the_best(
    chooser: Chooser, ball_of: Callable[[int, float], BallState], seed: int
) -> None:
    """The second search is half a step about the best of the first."""
    ball, rest = ball_of(seed, START), at_rest(chooser.arm.q_ready)
    after = np.arange(SOONEST, HORIZON, STRIDE)
    first, found = chooser.best(after, flown(ball, after), rest), chooser.choose(ball, rest)
    assert first is not None
    assert found is not None
    near = np.linspace(first.t_c - STRIDE / 2, first.t_c + STRIDE / 2, 3)
    near = near[near >= SOONEST]
    best = chooser.best(near, flown(ball, near), rest)
    assert best is not None
    assert found.t_c == ball.t + best.t_c
    assert found.utilization == best.utilization
    assert found.binding_limit == best.binding_limit
    assert np.array_equal(found.end, best.end)
    assert np.array_equal(found.r_c, best.r_c)


def _driven(
    arm: Arm, settings: MpcSettings, motion: Array, end: Array, step: float, a: Array
) -> tuple[float, Array, Array, Array]:
    """Return cost, drives' torques over their bounds, angles and speeds of accelerations."""
    n, limits, count = arm.n, arm.limits, settings.parts + 1
    D, P = responses(settings.parts, step)
    rows, ticks = a.reshape(count, n), step * np.arange(count)[:, None]
    q, dq = motion[0] + ticks * motion[1] + P @ rows, motion[1] + D @ rows
    plan = QuinticPlan(t=0.0, start=motion, t_c=step * settings.parts, end=end)
    cost, ratios = 0.0, []
    for k in range(count):
        near = plan.at(k * step)
        by_q, by_dq, mass = arm.torque_derivatives(*near)
        tau = arm.torque(*near)
        speed = limits.drive_speed(arm.all_joints(near[1]))
        bound = limits.torque_bound(limits.drive_torque(tau), speed)
        tau = tau + by_q @ (q[k] - near[0]) + by_dq @ (dq[k] - near[1])
        tau = tau + mass @ (rows[k] - near[2])
        ratios.append(limits.drive_torque(tau) / np.maximum(bound, 0.05 * limits.tau_peak))
        cost += float(np.sum((arm.active(tau) / arm.tau_max) ** 2 + (dq[k] / arm.dq_max) ** 2))
    return cost, np.concatenate(ratios), q, dq


@pytest.fixture(name="asked", params=range(3))
def _asked(
    request: pytest.FixtureRequest, chooser: Chooser, ball_of: Callable[[int, float], BallState]
) -> tuple[Array, Array, float, Array]:
    """A state of the arm, the end of a catch, the step of its parts, and some accelerations."""
    rng, rest = np.random.default_rng(request.param), at_rest(chooser.arm.q_ready)
    catch = chooser.choose(ball_of(int(request.param), START), rest)
    assert catch is not None
    motion = rest + 0.3 * rng.normal(size=rest.shape)
    parts = MpcSettings().parts
    a = rng.normal(size=(parts + 1) * chooser.arm.n)
    return motion, catch.end, (catch.t_c - START) / parts, a


def test_the_programmes_bounds_are_those_of_the_linearised_arm(
    chooser: Chooser, asked: tuple[Array, Array, float, Array]
) -> None:
    """Room to each bound at some accelerations, by Pinocchio's derivatives along the quintic."""
    arm, s, (motion, end, step, a) = chooser.arm, MpcSettings(), asked
    problem = MpcPlanner(arm, s).problem(motion, end, step)
    _, ratio, q, dq = _driven(arm, s, motion, end, step, a)
    must = [motion[2] - a[: arm.n], end[2] - a[-arm.n :], end[0] - q[-1], end[1] - dq[-1]]
    upper = [*must, s.share - ratio, arm.q_max - s.gap - q[1:-1], s.speed - dq[1:-1] / arm.dq_max]
    lower = [-x for x in must]
    lower += [s.share + ratio, q[1:-1] - arm.q_min - s.gap, s.speed + dq[1:-1] / arm.dq_max]
    for room, plain in (
        (problem.high - problem.A @ a, upper),
        (problem.A @ a - problem.low, lower),
    ):
        assert np.allclose(
            room, np.concatenate([x.ravel() for x in plain]), rtol=ROUNDING, atol=ROUNDING
        )


def test_the_programmes_price_is_eq_22(
    chooser: Chooser, asked: tuple[Array, Array, float, Array]
) -> None:
    """What accelerations cost more than none, but for the weight that keeps it convex."""
    arm, s, (motion, end, step, a) = chooser.arm, MpcSettings(), asked
    problem = MpcPlanner(arm, s).problem(motion, end, step)
    price = 0.5 * a @ problem.H @ a + problem.f @ a - 0.5 * s.damping * a @ a
    costs = [_driven(arm, s, motion, end, step, x)[0] for x in (a, np.zeros_like(a))]
    assert price == pytest.approx(costs[0] - costs[1], rel=1e-6)
