"""Learning: less cost, limits kept, the metric positive, the gradient right."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from support import parabola

from mitt.core.arm.arm import Arm
from mitt.core.errors import InputError, ShapeError
from mitt.core.map.demand import demand
from mitt.core.map.learn import (
    Flight,
    Learned,
    cost,
    learn_from,
    lift_flight,
    limit_rows,
    sensitivity,
    solve_step,
)
from mitt.core.map.map_design import MapDesign
from mitt.core.map.mapping import DirectMap, answer_to_gap, coordinates, initial_matrix, project
from mitt.core.map.tangent import to_go
from mitt.core.signals import Array
from mitt.io.wam import wam_limits

STEP = 1e-6
#: The catch lies between two instants of a flight; its velocities are carried there [m/s].
EXTRAPOLATED = 3e-2


def adapted_motion(f: DirectMap, flight: Flight) -> Array:
    """Return q_d, dq_d, ddq_d along a flight with alpha projected onto its start."""
    x = lift_flight(f, flight)
    assert x is not None
    C = initial_matrix(x.phi_0, f.arm.n)
    alpha = f.alpha.ravel() + answer_to_gap(C, f.H_inverse) @ (x.gap - C @ f.alpha.ravel())
    return x.motion(alpha.reshape(f.alpha.shape))


def test_learning_lowers_the_cost_and_keeps_the_limits(
    learned: Learned, flights: Sequence[Flight]
) -> None:
    """The cost of eq. (22) falls below that of alpha = 0, and every flight is within limits."""
    first, last = learned.steps[0], learned.steps[-1]
    assert learned.status == "converged"
    assert last.cost_torque + last.cost_speed < 0.6 * (first.cost_torque + first.cost_speed)
    asked = [demand(learned.map.arm, adapted_motion(learned.map, x)) for x in flights]
    assert max(x.torque.max() for x in asked) <= 1.0
    assert max(x.speed.max() for x in asked) <= 1.0
    assert max(x.excess.max() for x in asked) == 0.0


def met_at(f: DirectMap, flight: Flight) -> Array:
    """Return the relative velocity at the catch, by the adapted map itself [m/s], shape (3,)."""
    x = lift_flight(f, flight)
    assert x is not None
    alpha = project(f.alpha, f.H_inverse, x.phi_0, x.gap)
    g, ball = f.with_alpha(alpha), flight.ball[-1].copy()
    for _ in range(4):
        _, rows = g.motion(ball)
        dt = -to_go(g.tangent, rows[3]) / float(coordinates(g.tangent, rows[4])[g.tangent.catch])
        ball[0] += dt * ball[1] + 0.5 * dt * dt * ball[2]
        ball[1] += dt * ball[2]
    _, rows = g.motion(ball)
    assert np.allclose(g.arm.position(rows[0]), ball[0], atol=1e-6)
    relative: Array = ball[1] - g.arm.jacobian(rows[0]) @ rows[1]
    if f.design.match_weight > 0.0:
        assert np.allclose(relative, x.relative_velocity(alpha), atol=EXTRAPOLATED)
    return relative


def test_the_more_a_match_weighs_the_softer_the_catch(
    learned: Learned, flights: Sequence[Flight]
) -> None:
    """A map whose line asks for a hard catch is made soft by terms of first order, at some cost."""
    few, speeds, costs = flights[:24], [], []
    for weight in (0.0, 0.03, 3.0):
        design = MapDesign(kappa=1.4, match_weight=weight)
        found = learn_from(learned.map.arm, design, few)
        speeds.append(np.mean([np.linalg.norm(met_at(found.map, x)) for x in few]))
        costs.append(found.steps[-1].cost_torque + found.steps[-1].cost_speed)
    assert speeds[0] > 1.5
    assert speeds[0] > 1.5 * speeds[1] > 3.0 * speeds[2]
    assert costs[0] < costs[2]


def test_new_throws_of_the_same_kind_cost_little_more(learned: Learned, arm: Arm) -> None:
    """On flights it has not seen the adapted map costs within 15 % of what it cost in learning."""
    rng = np.random.default_rng(99)
    asked = [demand(arm, adapted_motion(learned.map, parabola(arm, rng))) for _ in range(30)]
    last = learned.steps[-1]
    mean = float(np.mean([x.cost for x in asked]))
    assert mean < 1.15 * (last.cost_torque + last.cost_speed)


def test_the_metric_is_positive_definite(learned: Learned) -> None:
    """H is symmetric with positive eigenvalues, so the projection is defined."""
    H = learned.map.H
    assert np.allclose(H, H.T)
    assert np.linalg.eigvalsh(H)[0] > 0.0


def test_sensitivities_are_differences(learned: Learned, flights: Sequence[Flight]) -> None:
    """Residual and limit rows answer to alpha as central differences say (d tau / d alpha)."""
    f = learned.map
    x = lift_flight(f, flights[0])
    assert x is not None
    rng = np.random.default_rng(3)
    way = rng.standard_normal(f.alpha.shape)

    def residual(step: float) -> Array:
        s = sensitivity(f.arm, x.motion(f.alpha + step * way), x.phi)
        c = cost(f.arm, s)
        return np.concatenate([c.torque.ravel(), c.speed.ravel()])

    s = sensitivity(f.arm, x.motion(f.alpha), x.phi)
    slope = (residual(STEP) - residual(-STEP)) / (2 * STEP)
    assert np.allclose(cost(f.arm, s).J @ way.ravel(), slope, atol=1e-6 * np.abs(slope).max())
    most = np.full(len(f.arm.model.links), 40.0)
    for name in ("paper", "wam-48v"):
        arm = Arm(f.arm.model, replace(wam_limits(name), acceleration=most))
        # With ``near`` at 0 every limit has its row: rows of the two sides can be compared.
        rows = limit_rows(arm, s, share=1.0, near=0.0)
        ahead, back = (
            limit_rows(
                arm, sensitivity(arm, x.motion(f.alpha + h * way), x.phi), share=1.0, near=0.0
            ).room
            for h in (STEP, -STEP)
        )
        slope = -(ahead - back) / (2 * STEP)
        assert np.allclose(rows.rows @ way.ravel(), slope, atol=1e-5 * np.abs(slope).max())


def test_the_rows_of_the_limits_say_what_the_demand_says(
    learned: Learned, flights: Sequence[Flight]
) -> None:
    """The largest share of a row is the largest of torque, voltage and speed that is asked for."""
    f = learned.map
    x = lift_flight(f, flights[0])
    assert x is not None
    for name in ("paper", "wam-80v", "wam-48v"):
        arm = Arm(f.arm.model, wam_limits(name))
        asked = demand(arm, x.motion(f.alpha))
        rows = limit_rows(arm, sensitivity(arm, x.motion(f.alpha), x.phi), share=1.0, near=0.0)
        most = max(float(asked.torque.max()), float(asked.speed.max()))
        assert rows.worst == pytest.approx(most, rel=1e-9)
        assert 1.0 - rows.room.min() == pytest.approx(most, rel=1e-9)


def test_the_soft_programme_finds_its_minimum() -> None:
    """Free rows leave the Newton step; a heavy weight holds the bound; NaN gives no step."""
    H, gradient = np.diag([2.0, 1.0]), np.array([-2.0, -1.0])
    rows = np.array([[1.0, 0.0], [0.0, -1.0]])
    free = solve_step(H, gradient, (rows, np.array([5.0, 5.0])), weight=1.0)
    bound = solve_step(H, gradient, (rows, np.array([0.25, 5.0])), weight=1e6)
    assert free is not None
    assert bound is not None
    assert np.allclose(free, [1.0, 1.0])
    assert np.allclose(bound, [0.25, 1.0], atol=1e-5)
    assert solve_step(H, np.array([np.nan, 0.0]), (rows, np.ones(2)), weight=1.0) is None


def test_no_point_near_the_answer_is_better(learned: Learned) -> None:
    """The answer to a random soft programme is a minimum: every neighbour's value is higher."""
    rng = np.random.default_rng(8)
    size, H = len(learned.map.H), learned.map.H / np.trace(learned.map.H)
    gradient, rows = rng.standard_normal(size), rng.standard_normal((60, size))
    room = rng.uniform(-0.2, 1.0, 60)

    def value(x: Array) -> float:
        over = np.maximum(rows @ x - room, 0.0)
        return float(0.5 * x @ H @ x + gradient @ x + 2.0 * over @ over)

    x = solve_step(H, gradient, (rows, room), weight=2.0)
    assert x is not None
    for _ in range(200):
        assert value(x + 1e-3 * rng.standard_normal(size)) >= value(x) - 1e-12


def test_flights_that_leave_the_domain_are_left_out(arm: Arm, flights: Sequence[Flight]) -> None:
    """A flight through the shoulder is counted, not learned; none at all is an input error."""
    through = Flight(
        t=flights[0].t, ball=flights[0].ball * [[[0.2], [1.0], [1.0]]], seen=flights[0].seen
    )
    assert learn_from(arm, MapDesign(), [*flights[:5], through]).left_out == 1
    with pytest.raises(InputError):
        learn_from(arm, MapDesign(), [through])


def test_a_map_is_called_converged_only_where_the_limits_hold(
    arm: Arm, flights: Sequence[Flight]
) -> None:
    """A tenth of the torque: the cost settles far beyond the limits, and the status says so."""
    weak = Arm(arm.model, replace(arm.limits, tau_peak=0.1 * arm.limits.tau_peak))
    found = learn_from(weak, MapDesign(), flights)
    assert found.steps[-1].worst > 1.0
    assert found.status == "limits"


def test_a_map_of_few_of_its_flights_says_so(arm: Arm, flights: Sequence[Flight]) -> None:
    """One flight that passes, and many too near to the shoulder."""
    away = [Flight(t=x.t, ball=0.02 * x.ball, seen=0.02 * x.seen) for x in flights[:6]]
    found = learn_from(arm, MapDesign(), [flights[0], *away])
    assert (found.flights, found.left_out) == (1, 6)
    assert found.status == "domain"


EXACT = 1e-9
#: Agreement of a derivative with a difference over 2 ms, share of the largest.
DIFFERENCE = 2e-3

seeds = st.integers(0, 2**31)


def test_arrays_that_do_not_fit_together_are_refused() -> None:
    """Ball and times of different length, or a belief of another shape, raise a ShapeError."""
    t, ball, seen = np.zeros(4), np.zeros((4, 3, 3)), np.zeros((3, 3))
    Flight(t=t, ball=ball, seen=seen)
    with pytest.raises(ShapeError, match="ball"):
        Flight(t=t[:3], ball=ball, seen=seen)
    with pytest.raises(ShapeError, match="seen"):
        Flight(t=t, ball=ball, seen=seen[:2])


@given(seed=seeds)
def test_a_lifted_motion_is_that_of_the_map(plain: DirectMap, seed: int) -> None:
    """q_d along the flight equals the map's own reference at each instant, for any alpha."""
    rng = np.random.default_rng(seed)
    flight = parabola(plain.arm, rng, instants=7)
    lifted = lift_flight(plain, flight)
    assert lifted is not None
    alpha = 0.1 * rng.standard_normal(plain.alpha.shape)
    bent = DirectMap(
        arm=plain.arm,
        design=plain.design,
        basis=plain.basis,
        alpha=alpha,
        H=plain.H,
        region=plain.region,
    )
    motion = lifted.motion(alpha)
    for row, ball in zip(motion, flight.ball, strict=True):
        assert np.allclose(row, bent.motion(ball)[1][:3], atol=EXACT * (1 + np.abs(row).max()))


@given(seed=seeds, share=st.floats(-2.0, 2.0))
def test_a_lifted_motion_is_linear_in_alpha(plain: DirectMap, seed: int, share: float) -> None:
    """q_d and its derivatives of a mixture of coefficients are the mixture of the motions."""
    rng = np.random.default_rng(seed)
    lifted = lift_flight(plain, parabola(plain.arm, rng, instants=5))
    assert lifted is not None
    a, b = rng.standard_normal((2, *plain.alpha.shape))
    mixed = lifted.motion(share * a + (1.0 - share) * b)
    parts = share * lifted.motion(a) + (1.0 - share) * lifted.motion(b)
    assert np.allclose(mixed, parts, rtol=1e-9, atol=1e-6)


@given(seed=seeds)
def test_the_rows_of_a_lifted_flight_are_derivatives(plain: DirectMap, seed: int) -> None:
    """Rates of the virtual joints and of the monomials are differences of the rows before."""
    flight = parabola(plain.arm, np.random.default_rng(seed), instants=411)
    lifted = lift_flight(plain, flight)
    assert lifted is not None
    for rows in (lifted.virtual, lifted.phi):
        for k in (0, 1):
            slope = np.gradient(rows[:, k], flight.t, axis=0)[1:-1]
            size = 1.0 + np.abs(rows[:, k + 1]).max()
            assert np.allclose(slope, rows[1:-1, k + 1], atol=DIFFERENCE * size)


def test_the_gap_is_what_an_arm_at_rest_must_make_up_for(plain: DirectMap) -> None:
    """D of eq. (12) is q_ready - q_o and -dq_o of what was believed at t_0."""
    flight = parabola(plain.arm, np.random.default_rng(2))
    moved = Flight(t=flight.t, ball=flight.ball, seen=flight.seen + 0.01)
    lifted = lift_flight(plain, moved)
    assert lifted is not None
    inside, virtual = plain.virtual(moved.seen)
    assert inside
    expected = np.concatenate([plain.arm.q_ready - virtual[0], -virtual[1]])
    assert np.allclose(lifted.gap, expected, atol=EXACT)


def test_a_flight_that_leaves_the_domain_is_none(plain: DirectMap) -> None:
    """One instant inside the unreachable ball about the shoulder is enough."""
    flight = parabola(plain.arm, np.random.default_rng(3))
    ball = flight.ball.copy()
    ball[-1, 0] *= 0.3
    assert lift_flight(plain, Flight(t=flight.t, ball=ball, seen=flight.seen)) is None
    assert lift_flight(plain, Flight(t=flight.t, ball=flight.ball, seen=0.1 * ball[0])) is None
