"""How joints share the motion, and how the catch angle goes with the other joints."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from mitt.design.candidate import mutated
from mitt.design.geometry import candidates_of, drawn, improved, triples_of
from mitt.design.interception import alone, slope_of, sloped
from mitt.design.poses import Touch
from mitt.design.task import Balls, Task
from mitt.errors import MittError
from mitt.generator.mapping import unlearned
from mitt.generator.tangent import to_go
from mitt.robot.arm import Arm

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


def test_candidates_wait_and_catch_in_poses_of_their_own_map(whole: Arm, task: Task) -> None:
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
