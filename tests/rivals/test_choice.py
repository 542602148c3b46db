"""The kernels of the rivals, held to the same in plain NumPy with the library's derivatives."""

from collections.abc import Callable

import numpy as np
import pytest

from mitt.generator.demand import demand
from mitt.generator.prediction import flown
from mitt.rivals.intercept import (
    APPROACH,
    FOLLOW,
    HORIZON,
    INSTANTS,
    LOW,
    PRICE,
    REFUSED,
    SOONEST,
    SPARE,
    STRIDE,
    Chooser,
    meetings,
)
from mitt.rivals.mpc import MpcPlanner, MpcSettings
from mitt.rivals.paths import responses, sample
from mitt.rivals.planned import QuinticPlan
from mitt.rivals.pursuit import still
from mitt.robot.arm import Arm
from mitt.signals import Array, BallState

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


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("moving", [0.0, 1.0])
def test_the_chosen_catch_is_the_cheapest_of_all(
    chooser: Chooser, ball_of: Callable[[int, float], BallState], seed: int, moving: float
) -> None:
    """Every candidate weighed by the stages' own functions: the same is the best, at its share."""
    f, arm = chooser.map, chooser.arm
    after, ball = np.arange(SOONEST, HORIZON, STRIDE), ball_of(seed, START)
    motion = still(arm.q_ready) + moving * np.random.default_rng(seed).normal(size=(3, arm.n))
    balls, ends = flown(ball, after), np.zeros((len(after), 3, arm.n))
    ends[0, 0] = f.start
    found = meetings(f.packed, chooser.hand, APPROACH, balls, ends, f.work)
    found &= np.all((ends[:, 0] > arm.q_min) & (ends[:, 0] < arm.q_max), axis=1)
    ways = np.empty((len(after), INSTANTS, 3, arm.n))
    for k in range(len(after)):
        sample(motion, ends[k], after[k], ways[k])
    quick = np.abs(ways[:, :, 1] / arm.dq_max).max(axis=(1, 2))
    allowed = np.flatnonzero(found & (quick <= max(REFUSED, float(quick[found].min()))))
    priced = {int(k): _price(chooser, ways[k], ends[k]) for k in allowed}
    low = {k: LOW * float(balls[k, 0, 2] < chooser.floor) for k in priced}
    k = min(priced, key=lambda key: priced[key][0] + low[key])
    best = chooser.best(after, balls, motion)
    assert best is not None
    assert best.t_c == after[k]
    assert best.binding_limit == priced[k][1]
    assert best.utilization == pytest.approx(priced[k][2], rel=ROUNDING)
    assert best.low == (low[k] > 0.0)


@pytest.mark.parametrize("seed", range(4))
def test_the_search_is_refined_about_the_best(
    chooser: Chooser, ball_of: Callable[[int, float], BallState], seed: int
) -> None:
    """The second search is half a step about the best of the first."""
    ball, rest = ball_of(seed, START), still(chooser.arm.q_ready)
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
    rng, rest = np.random.default_rng(request.param), still(chooser.arm.q_ready)
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
