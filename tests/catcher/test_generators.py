"""The generators behind one call: what the learned map and alpha = 0 have in common, and not."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from support import ball_state

from mitt.core.arm.arm import Arm
from mitt.core.catcher.generators import Direct, Generator, Unoptimised, refining
from mitt.core.map.demand import shares_of
from mitt.core.map.learn import Learned
from mitt.core.map.mapping import DirectMap
from mitt.core.signals import Array, BallState
from mitt.core.verdict.feasibility import Outcome

G = np.array([0.0, 0.0, -9.81])
seeds = st.integers(0, 2**31)


@pytest.fixture(name="direct", scope="module")
def _direct(learned: Learned) -> Direct:
    """The learned map."""
    return Direct(learned.map)


@pytest.fixture(name="alpha_0", scope="module")
def _alpha_0(plain: DirectMap) -> Unoptimised:
    """The map with alpha = 0."""
    return Unoptimised(plain)


def some_ball(seed: int) -> BallState:
    """Return a ball anywhere before the arm, at any speed."""
    rng = np.random.default_rng(seed)
    r_o = np.array([rng.uniform(1.5, 4.0), rng.uniform(-2.0, 2.0), rng.uniform(-1.0, 2.0)])
    return ball_state(r_o, rng.uniform([-9, -1, -3], [3, 1, 4]), G)


@given(seed=seeds)
def test_alpha_0_never_refuses(arm_ready: Array, alpha_0: Unoptimised, seed: int) -> None:
    """Whatever comes, however fast and wherever, the verdict is feasible."""
    assert alpha_0.verdict(some_ball(seed), arm_ready).outcome is Outcome.FEASIBLE


@given(seed=seeds)
def test_alpha_0_starts_nowhere_and_waits_for_nothing(
    arm_ready: Array, alpha_0: Unoptimised, seed: int
) -> None:
    """Adapting and waiting change nothing: alpha stays 0 and the ball is the ball."""
    ball = some_ball(seed)
    assert alpha_0.adapt(ball, arm_ready, np.ones(3)) is alpha_0
    assert alpha_0.waiting(ball) is ball
    assert alpha_0.returns(ball)
    assert np.array_equal(alpha_0.reference(ball).q_d, alpha_0.reference(ball).q_o)


@given(seed=seeds)
def test_direct_starts_where_the_arm_is(direct: Direct, seed: int) -> None:
    """After adaptation the reference at t_0 is the arm's own motion; the old one is untouched."""
    rng = np.random.default_rng(seed)
    ball = ball_state(np.array([3.0, rng.uniform(-0.3, 0.3), 0.5]), np.array([-6.0, 0.0, 1.5]), G)
    q, dq = direct.map.arm.q_ready + rng.uniform(-0.1, 0.1, 3), rng.uniform(-1, 1, 3)
    before = direct.reference(ball).q_d
    started = direct.adapt(ball, q, dq).reference(ball)
    assert np.allclose(started.q_d, q, atol=1e-8)
    assert np.allclose(started.dq_d, dq, atol=1e-7)
    assert np.array_equal(direct.reference(ball).q_d, before)


@given(seed=seeds)
def test_a_reference_is_pure(direct: Direct, alpha_0: Unoptimised, seed: int) -> None:
    """Asked again, after other balls in between, a generator says the same to the bit."""
    ball, other = some_ball(seed), some_ball(seed + 1)
    generators: tuple[Generator, ...] = (direct, alpha_0)
    for generator in generators:
        first = generator.reference(ball)
        generator.reference(other)
        again = generator.reference(ball)
        assert np.array_equal(first.q_d, again.q_d)
        assert np.array_equal(first.dq_d, again.dq_d)
        assert np.array_equal(first.ddq_d, again.ddq_d)
        assert first.time_to_catch == again.time_to_catch


@given(seed=seeds)
def test_whatever_the_ball_the_reference_is_finite(
    direct: Direct, alpha_0: Unoptimised, seed: int
) -> None:
    """NaN, infinity and absurd balls give finite desired motion with a status."""
    rng = np.random.default_rng(seed)
    ball = some_ball(seed)
    r_o = ball.r_o.copy()
    r_o[rng.integers(3)] = rng.choice([np.nan, np.inf, -np.inf, 1e300, 0.0])
    for generator in (direct, alpha_0):
        reference = generator.reference(replace(ball, r_o=r_o))
        rows = (reference.q_d, reference.dq_d, reference.ddq_d, reference.q_o)
        assert all(np.all(np.isfinite(row)) for row in rows)


@pytest.fixture(name="arm_ready", scope="module")
def _arm_ready(plain: DirectMap) -> Array:
    """The ready pose."""
    return plain.arm.q_ready


def test_a_refined_verdict_knows_what_the_direct_one_knows(learned: Learned) -> None:
    """Whatever acceleration is allowed: it is judged, and so is the motion that comes of it."""
    f, refused = learned.map, 0
    ball = ball_state(np.array([3.0, 0.1, 0.5]), np.array([-6.0, 0.0, 1.5]), G)
    for most in (15.0, 40.0, 80.0, 160.0, 1e4):
        limits = replace(f.arm.limits, acceleration=np.full(len(f.arm.limits.dq_max), most))
        g = refining(replace(f, arm=Arm(f.arm.model, limits)))
        said = g.verdict(ball, f.arm.q_ready)
        assert said.approach is not None
        asked = shares_of(g.map.arm, said.approach.motion, g.tolerance)
        assert said.share >= max(asked.values()) - 1e-12
        assert (said.outcome is Outcome.FEASIBLE) == (said.share <= 1.0)
        refused += said.binding_limit.startswith("acceleration:")
        certificate = g.adapt(ball, f.arm.q_ready, np.zeros(3)).certificate
        assert certificate is not None
        assert most > 40.0 or certificate.outcome is Outcome.UNREACHABLE
    assert refused >= 2
