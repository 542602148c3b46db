"""How candidates meet balls all over the box, by geometry: laws of what lines and terms allow."""

from dataclasses import replace

import numpy as np
import pytest

from mitt.core.arm.arm import Arm
from mitt.core.arm.hands import HandModel
from mitt.core.map.mapping import unlearned
from mitt.core.signals import Array, MapStatus
from mitt.lab.design import geometry
from mitt.lab.design.driven_arm import whole_arm
from mitt.lab.design.geometry import CandidateRows, candidates_of, drawn, triples_of
from mitt.lab.design.interception import ASKED_SHARE, virtual_jacobian
from mitt.lab.design.poses import Touch, poses_of
from mitt.lab.design.task import Balls
from mitt.lab.world.scene import read_scene

#: What velocities agree to [m/s].
_ROUNDED = 1e-9


@pytest.fixture(scope="module")
def whole() -> Arm:
    return whole_arm("wam", tip=None, limits="wam-48v", hand=HandModel())


@pytest.fixture(scope="module")
def rows(whole: Arm) -> CandidateRows:
    touch, rng = Touch(whole, read_scene("ideal")), np.random.default_rng(12)
    found = drawn(whole, Balls(), triples_of(whole, None), rng, count=3000, touch=touch)
    assert len(found.q) > 200
    return found


def _v() -> Array:
    return np.array([Balls().velocity(*x) for x in ((0.0, 0.0, 0.0), (1.0, 0.0, -1.0))])


def _weighed(rows: CandidateRows, weight: float) -> CandidateRows:
    return rows._replace(weight=np.full(len(rows.q), weight))


def test_a_line_lets_the_ball_in_along_itself(whole: Arm, rows: CandidateRows) -> None:
    poses, v = poses_of(whole.model, rows.q), _v()
    J, w = virtual_jacobian(poses, rows.A)
    T = rows.kappa[:, None] * J[:, 2] + rows.inward[:, None] * np.cross(w, J[:, 2])
    met = geometry._meeting(whole, _weighed(rows, 0.0), poses, v)
    ds = np.einsum("kbn,bn->kb", met.dq, _catch_row(rows, whole.n))
    ds -= np.einsum("kba,ba->kb", _others(rows, met.dq), _slope(rows))
    np.testing.assert_allclose(met.relative, ds[:, :, None] * (T - J[:, 2]), atol=1e-6)


def test_first_order_terms_meet_balls_no_harder_and_within_speeds(
    whole: Arm, rows: CandidateRows
) -> None:
    poses, v = poses_of(whole.model, rows.q), _v()
    plain = geometry._meeting(whole, _weighed(rows, 0.0), poses, v)
    better = geometry._meeting(whole, _weighed(rows, 1.0), poses, v)
    slow = plain.line <= ASKED_SHARE
    assert slow.sum() > 50
    before, after = (np.sum(x.relative**2, axis=(0, 2))[slow] for x in (plain, better))
    assert np.all(after <= before + _ROUNDED)
    assert np.mean(after < before - 0.1) > 0.5
    share = np.abs(better.dq / whole.dq_max).max(axis=(0, 2))
    assert np.all(share[slow] <= ASKED_SHARE + _ROUNDED)


def test_scores_fall_where_the_match_is_weighed(whole: Arm, rows: CandidateRows) -> None:
    touch = Touch(whole, read_scene("ideal"))
    plain, better = (
        geometry.score_candidates(whole, Balls(), _weighed(rows, x), touch).score
        for x in (0.0, 1.0)
    )
    assert len(better) > len(plain) > 0
    assert np.median(better) < np.median(plain)


def test_the_domain_is_that_of_the_map(whole: Arm, rows: CandidateRows) -> None:
    few = rows.take(np.arange(0, len(rows.q), len(rows.q) // 40))
    share = geometry.share_inside(whole, Balls(), few)
    assert 0.1 < share.mean() < 0.9
    ways = [geometry._before(Balls().velocity(x, 0.0, y)) for x, y in geometry._EARLY_BALLS]
    for k, c in enumerate(candidates_of(whole, Balls(), few, np.random.default_rng(1))):
        at_catch = replace(c, ready=c.q[list(c.free)])  # where the inverse starts
        f = unlearned(at_catch.arm(whole), c.design)
        inside = [f.to_joints(few.tip[k] + x)[0] is MapStatus.INSIDE for x in ways]
        assert share[k] == pytest.approx(np.mean(inside))


def _catch_row(rows: CandidateRows, n: int) -> Array:
    return np.eye(n)[rows.free[:, 2]]


def _others(rows: CandidateRows, dq: Array) -> Array:
    return np.take_along_axis(dq, np.broadcast_to(rows.free[None, :, :2], (*dq.shape[:2], 2)), 2)


def _slope(rows: CandidateRows) -> Array:
    return rows.A[np.arange(len(rows.q)), rows.free[:, 2], :2]
