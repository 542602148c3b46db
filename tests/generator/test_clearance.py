"""Rows of clearance: slopes by central differences, and posts that the arm keeps off."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from support import ball_state

from mitt.ball.flight import advance
from mitt.control.viability import MARGIN
from mitt.generator.clearance import gap_slope, keep_clear, space_of
from mitt.generator.flights import Flight
from mitt.generator.learn import Learned
from mitt.generator.mapping import DirectMap
from mitt.generator.online import Online
from mitt.generator.prediction import foresee
from mitt.generator.sqp_step import begin
from mitt.generator.tangent import scratch_of
from mitt.generator.utilization import plant_of
from mitt.robot import kinematics
from mitt.robot.arm import Arm
from mitt.robot.description import Capsule
from mitt.robot.shapes import Surroundings, clearance, gap, place_shapes
from mitt.signals import Array, BallState

#: Step of the differences [rad], agreement of slopes [m/rad], distance of the places at which a
#: gap counts as smooth [m].
STEP, SLOPE, SMOOTH = 1e-6, 1e-6, 1e-3
#: Gap below which the controller brakes [m]; the rows keep more at the instants of the course.
KEPT = MARGIN
ZONE = Capsule(start=(0.9, -0.4, 0.2), end=(0.9, -0.2, 0.6), radius=0.12)


@given(seed=st.integers(0, 2**31))
def test_the_slope_of_every_gap_is_its_central_difference(learned: Learned, seed: int) -> None:
    """In any pose, of links, base, zone and floor, wherever the gap has a slope."""
    f = learned.map
    arm, q = f.arm, np.random.default_rng(seed).uniform(f.arm.q_min, f.arm.q_max)
    space, slope, scratch = (
        space_of(arm, Surroundings(zones=(ZONE,))),
        np.zeros((3, 3)),
        scratch_of(3),
    )

    def gap_at(q: Array, a: int, b: int) -> float:
        place_shapes(arm.bodies, q, space.table, space.ends)
        return float(gap(space.table, space.ends, a, b))

    for a, b in space.pairs:
        steps = STEP * np.eye(3)
        here = gap_at(q, a, b)
        ahead, behind = (np.array([gap_at(q + s * x, a, b) for x in steps]) for s in (1, -1))
        place_shapes(arm.bodies, q, space.table, space.ends)
        kinematics.place(f.tangent.chain, q, scratch.motion)
        gap_slope(plant_of(arm), f.tangent, space, a, b, scratch, slope)
        kinked = np.abs(ahead + behind - 2.0 * here).max() > STEP * SMOOTH
        crossed = here + space.table[a, 7] + space.table[b, 7] < SMOOTH
        expected = -(ahead - behind) / (2.0 * STEP) / 0.05
        assert kinked or crossed or slope[0] == pytest.approx(expected, abs=SLOPE / 0.05)
        assert not slope[1:].any()


@pytest.fixture(scope="module")
def ball(flights: list[Flight]) -> BallState:
    """A ball at t_0."""
    return ball_state(*flights[3].ball[0])


def ride(f: DirectMap, ball: BallState, online: Online) -> Array:
    """Return q_d each millisecond up to the catch, refined all the while, shape (k, n)."""
    g, r, dr, way = f.adapt(ball, f.arm.q_ready, np.zeros(f.arm.n)), *_moving(ball), []
    for tick in range(round(foresee(f, ball).after / 1e-3)):
        now = replace(ball, r_o=r.copy(), dr_o=dr.copy(), t=1e-3 * tick)
        way.append(g.motion(np.array([r, dr, ball.ddr_o]))[1][0])
        g = g.with_alpha(online.refine(g.alpha, now).alpha)
        advance(r, dr, ball.drag, 1e-3)
    return np.array(way)


def _moving(ball: BallState) -> tuple[Array, Array]:
    """Return position and velocity, to be carried on in place."""
    return ball.r_o.copy(), ball.dr_o.copy()


def nearest(arm: Arm, way: Array, around: Surroundings) -> float:
    """Return the smallest gap on a way [m]."""
    s = space_of(arm, around)
    return min(float(clearance(arm.bodies, q, s.table, s.pairs, s.ends)) for q in way)


def post(arm: Arm, way: Array, side: int, room: float) -> Surroundings:
    """Return a thin post beside the hand in the middle of a way, beneath it or left or right."""
    space, middle = space_of(arm, Surroundings()), int(0.38 * len(way))
    place_shapes(arm.bodies, way[middle], space.table, space.ends)
    hand = space.ends[-2:].mean(axis=0)
    ahead = arm.jacobian(way[middle]) @ (way[middle + 1] - way[middle])
    up = np.cross(ahead, [0.0, 1.0, 0.0]) / np.linalg.norm(ahead)
    direction = np.array([0.0, float(side), 0.0]) if side else -up
    at = hand + direction * (space.table[-1, 7] + 0.05 + room)
    top = at + np.array([0.0, 0.0, 1e-3])
    return Surroundings(zones=(Capsule(start=tuple(at), end=tuple(top), radius=0.05),))


@pytest.mark.parametrize(("side", "room"), [(1, -0.02), (-1, 0.01), (0, -0.01), (0, 0.01)])
def test_a_post_in_the_way_is_kept_clear_of(
    learned: Learned, ball: BallState, side: int, room: float
) -> None:
    """Refined without knowing of it, the arm comes too close; with its rows it keeps its gap."""
    f = learned.map
    blind = ride(f, ball, Online(f))
    around = post(f.arm, blind, side, room)
    assert nearest(f.arm, blind, around) < KEPT
    assert nearest(f.arm, ride(f, ball, Online(f, around=around)), around) > KEPT


def test_open_space_changes_nothing(learned: Learned, ball: BallState) -> None:
    """A zone far away gives no row: the coefficients are the same bit by bit."""
    f = learned.map
    alpha = f.adapt(ball, f.arm.q_ready, np.zeros(3)).alpha
    far = Capsule(start=(0.0, 3.0, 0.0), end=(0.0, 3.0, 1.0), radius=0.1)
    around = Surroundings(zones=(far,))
    one, other = (Online(f, around=x).refine(alpha, ball).alpha for x in (None, around))
    assert np.array_equal(one, other)


def test_what_need_not_be_looked_at_again_changes_nothing(
    learned: Learned, ball: BallState
) -> None:
    """Looking at every instant of every step gives the same way bit by bit."""
    f = learned.map
    around = post(f.arm, ride(f, ball, Online(f)), 1, 0.05)
    ways = []
    for forgets in (False, True):
        online, g = Online(f, around=around), f.adapt(ball, f.arm.q_ready, np.zeros(3))
        for _ in range(10):
            if forgets:
                online._goal.space.seen[:] = -np.inf
            g = g.with_alpha(online.refine(g.alpha, ball).alpha)
        ways.append(g.alpha)
    assert np.array_equal(ways[0], ways[1])


def test_the_rows_are_the_slope_of_the_squared_excess(learned: Learned, ball: BallState) -> None:
    """In every coefficient: twice excess times row, summed, is the central difference."""
    f = learned.map
    alpha = f.adapt(ball, f.arm.q_ready, np.zeros(3)).alpha
    around = post(f.arm, ride(f, ball, Online(f)), 1, -0.03)
    online = Online(f, around=around)
    online.refine(alpha, ball)
    m, p, goal, b = online._map, online._plant, online._goal, online._buffers
    state = np.array([*ball.r_o, *ball.dr_o, ball.drag])
    begin(m, p, goal, state, (0.001, foresee(f, ball).after - 0.001), alpha, b)
    scratch = scratch_of(3)

    def excess(x: Array, at: int) -> tuple[int, float]:
        out = b.programme
        found: tuple[int, float] = keep_clear(
            p, f.tangent, goal.space, goal.weights[4], b.course, x, out, b.work, scratch, at
        )
        return found

    count, total = excess(alpha, 0)
    rows, room = b.programme.A[:count].copy(), b.programme.room[:count].copy()
    slope = 2.0 * np.maximum(-room, 0.0) @ rows
    units = 1e-6 * np.eye(alpha.size)
    differences = [
        (
            excess(alpha + x.reshape(alpha.shape), -1)[1]
            - excess(alpha - x.reshape(alpha.shape), -1)[1]
        )
        / 2e-6
        for x in units
    ]
    assert total > 0.0
    assert slope == pytest.approx(np.array(differences), abs=1e-6 * np.abs(slope).max())
