"""How hand and ball meet: the closed form keeps its own equations, and those of the map."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import lsq_linear

from mitt.core.arm.arm import Arm
from mitt.core.arm.hands import HandModel
from mitt.core.errors import MittError
from mitt.core.map.mapping import coordinates, unlearned
from mitt.core.map.tangent import to_go
from mitt.core.signals import Array
from mitt.lab.design.candidate import Candidate, mutated
from mitt.lab.design.driven_arm import whole_arm
from mitt.lab.design.geometry import (
    CandidateRows,
    best_of,
    candidates_of,
    drawn,
    improved,
    score_candidates,
    triples_of,
)
from mitt.lab.design.interception import (
    alone,
    bounded_speeds,
    least_relative_velocity,
    line_rates,
    slope_of,
    sloped,
)
from mitt.lab.design.poses import Touch, poses_of
from mitt.lab.design.task import Balls, DesignTask
from mitt.lab.world.scene import read_scene

#: What joint speeds and velocities agree to.
_ROUNDED = 1e-9
#: Three joints that move alone.
EYE = np.eye(3)[None]


@pytest.fixture(scope="module")
def whole() -> Arm:
    return whole_arm("wam", tip=None, limits="wam-48v", hand=HandModel())


@pytest.fixture(scope="module")
def rows(whole: Arm) -> CandidateRows:
    rng = np.random.default_rng(11)
    found = drawn(
        whole,
        Balls(),
        triples_of(whole, None),
        rng,
        count=3000,
        touch=Touch(whole, read_scene("ideal")),
    )
    assert len(found.q) > 200
    return found


def _problem(count: int) -> tuple[Array, Array, Array, Array, Array]:
    rng = np.random.default_rng(2)
    J = rng.standard_normal((count, 3, 3))
    w = np.cross(J[:, 2], rng.standard_normal((count, 3)))  # an axis is across its own column
    w /= np.linalg.norm(w, axis=1)[:, None]
    d = np.cross(w, rng.standard_normal((count, 3)))
    d /= np.linalg.norm(d, axis=1)[:, None]
    return J, w, rng.standard_normal((count, 3)) * 4.0, d, rng.uniform(1.0, 6.0, (count, 3))


def test_the_least_relative_velocity_keeps_the_speeds_and_uses_one_up() -> None:
    J, w, v, d, fastest = _problem(2000)
    m = least_relative_velocity(J, w, v, d, fastest, EYE)
    assert 50 < int(m.sound.sum()) < 2000
    hand = np.einsum("bkc,bk->bc", J, m.x)
    np.testing.assert_allclose((v - hand)[m.sound], (m.s[:, None] * d)[m.sound], atol=1e-6)
    share = np.abs(m.x / fastest)[m.sound].max(axis=1)
    assert share.max() <= 1.0 + _ROUNDED
    slowed = m.s[m.sound] > 1e-9
    np.testing.assert_allclose(share[slowed], 1.0, atol=1e-9)


def test_kappa_and_inward_give_back_the_meeting_they_came_from() -> None:
    J, w, v, d, fastest = _problem(2000)
    m = least_relative_velocity(J, w, v, d, fastest, EYE)
    x = line_rates(J, w, v, m.kappa, m.inward)
    np.testing.assert_allclose(x[m.sound], m.x[m.sound], rtol=1e-6, atol=1e-6)


def test_dependent_columns_are_never_sound() -> None:
    J, w, v, d, fastest = _problem(5)
    J[:, 1] = 2.0 * J[:, 0]
    assert not least_relative_velocity(J, w, v, d, fastest, EYE).sound.any()
    assert not np.isfinite(line_rates(J, w, v, np.ones(5), np.zeros(5))).any()


def test_bounded_speeds_are_the_least_squares_of_a_solver() -> None:
    rng = np.random.default_rng(4)
    J, v = rng.standard_normal((20, 5, 3)), 4.0 * rng.standard_normal((20, 3))
    high = rng.uniform(0.1, 1.5, (20, 5))
    high[:, 4] = 0.0  # a joint that is held
    low = -high
    low[3, 0] = 0.05  # a speed that has to be asked
    dq = bounded_speeds(J, v, low, high)
    assert np.all((dq >= low) & (dq <= high))
    for k in range(20):
        ends = low[k] - 1e-12, high[k] + 1e-12
        best = lsq_linear(J[k].T, v[k], bounds=ends, tol=1e-12).cost
        assert 0.5 * np.sum((v[k] - J[k].T @ dq[k]) ** 2) <= best + 1e-4


def test_joint_speeds_are_those_of_the_map_at_its_catch(whole: Arm, rows: CandidateRows) -> None:
    few = rows.take(np.arange(0, len(rows.q), len(rows.q) // 30))
    candidates = candidates_of(whole, Balls(), few, np.random.default_rng(1))
    for k, c in enumerate(candidates):
        at_catch = replace(c, ready=c.q[list(c.free)])  # where the inverse starts
        f = unlearned(at_catch.arm(whole), c.design)
        v = Balls().velocity()
        inside, virtual = f.virtual(np.array([few.tip[k], v, np.zeros(3)]))
        assert inside
        order = np.argsort(few.free[k])
        np.testing.assert_allclose(virtual[0], c.q_catch, atol=1e-8)
        np.testing.assert_allclose(
            coordinates(f.tangent, virtual[1]), few.x[k][order], rtol=1e-5, atol=1e-6
        )
        every = (few.A[k] @ few.x[k])[list(c.active)]
        np.testing.assert_allclose(virtual[1], every, rtol=1e-5, atol=1e-6)


def test_candidates_stand_where_they_say(whole: Arm, rows: CandidateRows) -> None:
    for c in _candidates(whole, rows):
        arm = c.arm(whole)
        np.testing.assert_allclose(arm.position(c.q_catch), c.aim[0], atol=1e-9)
        assert arm.names == tuple(whole.names[k] for k in c.active)
        assert np.all((c.q_ready > arm.q_min) & (c.q_ready < arm.q_max))


def test_rows_are_drawn_within_speeds_and_above_the_floor(whole: Arm, rows: CandidateRows) -> None:
    speeds = np.einsum("bka,ba->bk", rows.A, rows.x)
    assert np.all(np.abs(speeds) <= 0.9 * whole.dq_max + _ROUNDED)
    assert set(rows.moving.tolist()) == {3, 4}
    assert np.all(rows.tip[:, 2] > -1.0)
    poses = poses_of(whole.model, rows.q)
    hand = np.einsum("bkc,bk->bc", poses.J, speeds)
    relative = np.linalg.norm(Balls().velocity() - hand, axis=1)
    assert np.all(relative <= np.linalg.norm(Balls().velocity()) + _ROUNDED)


def test_balls_all_over_the_box_leave_some_candidates(whole: Arm, rows: CandidateRows) -> None:
    left = score_candidates(whole, Balls(), rows, Touch(whole, read_scene("ideal")))
    assert 0 < len(left.q) < len(rows.q)
    best = best_of(left, count=10, each=4)
    assert len(best.q) <= 10
    assert best.score[0] == left.score.min()
    kinds = [(*free, k) for free, k in zip(best.free.tolist(), best.moving.tolist(), strict=True)]
    assert max(kinds.count(kind) for kind in kinds) <= 4


def test_an_aim_that_is_given_is_on_the_way_of_the_ball(whole: Arm) -> None:
    aim = np.array([[0.75, 0.0, 0.05], [0.04, 0.2, 0.15]])
    balls = Balls(aim=aim)
    triples = triples_of(whole, ("j1", "j2", "j4"))
    found = drawn(
        whole,
        balls,
        triples,
        np.random.default_rng(1),
        count=2000,
        touch=Touch(whole, read_scene("ideal")),
    )
    way = balls.velocity() / balls.speed
    off = found.tip - aim[0]
    assert len(found.q) > 20
    assert np.all(np.linalg.norm(off - (off @ way)[:, None] * way, axis=1) < 0.05)
    assert set(found.free.ravel().tolist()) == {0, 1, 3}


def _candidates(whole: Arm, rows: CandidateRows) -> list[Candidate]:
    return candidates_of(whole, Balls(), rows.take(np.arange(20)), np.random.default_rng(1))


FREE = np.array([[3, 0, 2], [1, 2, 4]])

seeds = st.integers(0, 2**31)


@given(seed=seeds)
def test_a_slope_changes_the_virtual_joints_and_not_what_they_span(seed: int) -> None:
    """Its columns give the same motions of the joints; slopes add up."""
    rng = np.random.default_rng(seed)
    slope, more = rng.standard_normal((2, 2, 2))
    A = alone(FREE, 5)
    A[:, ~np.isin(np.arange(5), FREE)] = 0.0
    tilted = sloped(A, slope)
    assert np.allclose(slope_of(tilted, FREE), slope)
    assert np.allclose(sloped(tilted, more), sloped(A, slope + more))
    for before, after in zip(A, tilted, strict=True):
        answer = np.linalg.lstsq(before, after, rcond=None)
        assert np.allclose(before @ answer[0], after)


def test_candidates_wait_and_catch_in_poses_of_their_own_map(whole: Arm, task: DesignTask) -> None:
    """Drawn, improved or changed: the nominal catch lies where q_i = q_alpha, sloped or not."""
    rng, touch = np.random.default_rng(4), Touch(whole, task.scene)
    rows = drawn(whole, Balls(), triples_of(whole, None), rng, count=4000, touch=touch)
    rows = improved(whole, Balls(), rows, rng, size=0.1, touch=touch)
    candidates = candidates_of(whole, Balls(), rows, rng)[-200:]
    candidates += [mutated(whole, c, rng, size=1.0, moves=True) for c in candidates]
    known, weights = 0, {c.match_weight > 0.0 for c in candidates}
    for c in candidates:
        i, others = c.free[c.catch], [k for k in range(3) if k != c.catch]
        rest = np.delete(c.A[list(c.free)], c.catch, axis=0)
        assert np.array_equal(rest, np.delete(np.eye(3), c.catch, axis=0))
        assert tuple(c.A[i, others]) == c.design.slope
        assert c.A[i, c.catch] == 1.0
        free = [c.active.index(k) for k in c.free]
        assert np.allclose(c.q_ready[free], c.ready)
        try:
            f = unlearned(c.arm(whole), c.design)
            gap = to_go(f.tangent, c.q_catch)
        except MittError:  # kappa, inward or slope beyond what a map may have
            continue
        known += 1
        assert abs(gap) < 1e-9
    assert known > 300
    assert weights == {True, False}
    assert any(any(c.design.slope) for c in candidates)
    assert not all(any(c.design.slope) for c in candidates)
