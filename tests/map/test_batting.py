"""Laws of batting: at the contact the paddle is at the ball and moves and points as it must."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from mitt.core.arm.arm import Arm
from mitt.core.ball.flight import acceleration, advance, advance_spinning
from mitt.core.ball.spin import lift_constant, lift_of
from mitt.core.errors import InputError, ModelError
from mitt.core.map.batting import BattingMap, learn_batting, lift_strike, unlearned_batting
from mitt.core.map.learn import Flight
from mitt.core.map.map_design import MapDesign
from mitt.core.map.striking import (
    Grip,
    Impact,
    PaddleStrike,
    Restitution,
    aim_at_target,
    aiming_of,
    mass_behind,
    rebound,
    shot,
    spin_after,
)
from mitt.core.signals import GRAVITY, Array, BallState
from mitt.io.arm_file import load_arm

#: Of each arm: joints of the file, a pose in which it strikes, free joints, held ones, catch joint.
ARMS = {
    "wam-48v": (("j1", "j2", "j3", "j4"), (0.0, 0.26, 0.0, 1.0), (0, 1, 3), (2,), 3),
    "wam-80v": (("j1", "j2", "j3", "j4"), (0.0, 0.26, 0.0, 1.0), (0, 1, 3), (2,), 3),
    "three joints": (("j1", "j2", "j4"), (0.0, 0.26, 1.0), (0, 1, 2), (), 2),
}
IMPACT = Impact(mass=0.05, restitution=0.75, loss=0.1)
TARGET = np.array([3.0, 0.0, 0.3])
seeds = st.integers(0, 2**31)
aiming_arms = st.sampled_from([name for name, of in ARMS.items() if of[3]])


@cache
def map_of(name: str) -> BattingMap:
    """Return an arm's map with alpha = 0."""
    joints, pose, free, held, i = ARMS[name]
    limits = name if name.startswith("wam") else "wam-48v"
    raw = load_arm("wam", joints=joints, limits=limits)
    arm = Arm(replace(raw.model, q_ready=np.array(pose)), raw.limits)
    return unlearned_batting(
        arm, MapDesign(catch_joint=i, free=free, inward=3.0), held, arm.q_ready
    )


def drawn(name: str, seed: int) -> tuple[BattingMap, Array, np.random.Generator]:
    """Return a map with random coefficients, a ball at its contact, and a source of more."""
    rng, g = np.random.default_rng(seed), map_of(name)
    alpha = 0.3 * rng.standard_normal(g.map.alpha.shape)
    r = g.arm.position(g.arm.q_ready) + rng.uniform(-1.0, 1.0, 3) * (0.03, 0.1, 0.05)
    v = np.array([-rng.uniform(5.0, 7.0), rng.uniform(-0.5, 0.5), rng.uniform(-2.0, -0.5)])
    return replace(g, map=g.map.with_alpha(alpha)), np.array([r, v]), rng


def struck(g: BattingMap, ball: Array, target: Array | None = TARGET) -> PaddleStrike:
    """Return how a ball is met; draws without one are left out."""
    strike = g.strike(ball, target, IMPACT)
    assume(strike is not None and g.aims(strike, target))
    assert strike is not None
    return strike


def earlier(ball: Array, before: float) -> BallState:
    """Return the estimate of a ball so long before its contact."""
    r, v = ball.copy()
    advance(r, v, IMPACT.drag, -before)
    return BallState(t=0.0, r_o=r, dr_o=v, drag=IMPACT.drag)


def row(ball: Array) -> Array:
    """Return r_o, dr_o, ddr_o of a ball, shape (3, 3)."""
    ddr = np.zeros(3)
    acceleration(ball[1], IMPACT.drag, ddr)
    return np.array([*ball, ddr])


@given(name=aiming_arms, seed=seeds)
def test_a_ball_that_leaves_an_ideal_impact_reaches_the_target(name: str, seed: int) -> None:
    """The impact that a strike is aimed for, by the model itself, and the flight with drag."""
    g, ball, _ = drawn(name, seed)
    s = struck(g, ball)
    behind = mass_behind(g.arm, s.q, s.normal)
    r, v = ball[0].copy(), rebound(IMPACT, behind, s.normal, ball[1], s.v_paddle)
    assert np.allclose(g.arm.orientation(s.q)[:, 2], s.normal)
    assert np.allclose(v, s.v_out)
    advance(r, v, IMPACT.drag, s.T)
    assert np.linalg.norm(r - TARGET) < 1e-3


@given(name=aiming_arms, seed=seeds, rate=st.floats(10.0, 250.0))
def test_a_ball_that_spins_reaches_the_target_by_an_impact_aimed_with_its_spin(
    name: str, seed: int, rate: float
) -> None:
    """With the spin that it leaves with, whose lift bends its flight; not if it is aimed without.

    The restitution that is aimed with is that of the speed at which they meet.
    """
    g, ball, rng = drawn(name, seed)
    x, y, z = (rate * rng.standard_normal(3) / np.sqrt(3.0)).tolist()
    K = lift_constant(0.04, IMPACT.mass)
    still = replace(IMPACT, loss=0.4, radius=0.04, lift=K, fall=0.01)
    spins = replace(still, spin=(x, y, z))
    ends = []
    for impact in (spins, still):
        s = g.strike(ball, TARGET, impact)
        assume(s is not None and g.aims(s, TARGET))
        assert s is not None
        behind = mass_behind(g.arm, s.q, s.normal)
        r, v = ball[0].copy(), rebound(spins, behind, s.normal, ball[1], s.v_paddle)
        omega = spin_after(spins, s.normal, ball[1] - s.v_paddle)
        advance_spinning(r, v, IMPACT.drag, lift_of(omega, K, 0.04), s.T)
        ends.append(np.linalg.norm(r - TARGET))
    assert ends[0] < 2e-3
    assert s is not None
    slid = 0.4 * 0.04 * np.linalg.norm(np.cross([x, y, z], s.normal))
    assert ends[1] > 0.2 * slid


@given(name=st.sampled_from(sorted(ARMS)), seed=seeds, before=st.floats(0.2, 0.6))
def test_at_the_contact_the_paddle_is_at_the_ball_and_strikes(
    name: str, seed: int, before: float
) -> None:
    """In position whatever the coefficients are; at the speed that the impact asks for.

    Its joints accelerate as if they had got their speeds within 70 ms.
    """
    g, ball, rng = drawn(name, seed)
    s, n = struck(g, ball), g.arm.n
    q, dq = g.arm.q_ready + 0.2 * rng.standard_normal(n), 0.3 * rng.standard_normal(n)
    f = g.adapt(earlier(ball, before), q, dq, s)
    assume(f is not None)
    assert f is not None
    for alpha in (f, f.with_alpha(rng.standard_normal(f.alpha.shape))):
        _, rows = alpha.motion(row(ball))
        assert np.allclose(g.arm.position(rows[0]), ball[0], atol=1e-9)
    _, rows = f.motion(row(ball))
    assert np.allclose(g.arm.jacobian(rows[0]) @ rows[1], s.v_paddle, atol=1e-8 * _size(f.alpha))
    _, rows = f.motion(np.array([*ball, [0.0, 0.0, -GRAVITY]]))
    assert np.allclose(rows[2], rows[1] / 0.07, atol=1e-6 * _size(f.alpha))
    _, rows = f.motion(
        np.array(
            [earlier(ball, before).r_o, earlier(ball, before).dr_o, earlier(ball, before).ddr_o]
        )
    )
    assert np.allclose(rows[:2], [q, dq], atol=1e-8 * _size(f.alpha))


def test_bounded_accelerations_leave_more_time_for_the_last_push() -> None:
    """At the contact no joint of a Panda uses more than 0.7 of its bound; speeds are as asked."""
    pose, free = (-1.44, 1.48, 2.11, -1.52, 2.43, 2.97, 0.0), (0, 2, 3)
    raw = load_arm("franka-panda", joints=tuple(f"panda_joint{k + 1}" for k in range(7)))
    arm = Arm(replace(raw.model, q_ready=np.array(pose)), raw.limits)
    design = MapDesign(catch_joint=3, free=free, inward=6.0)
    g, longer = unlearned_batting(arm, design, (1, 4, 5), arm.q_ready), 0
    bound, r = arm.limits.acceleration, arm.position(arm.q_ready)
    assert bound is not None
    for speed in np.linspace(3.0, 6.0, 10):
        ball = np.array([r, [-speed, 0.0, -1.5]])
        s = g.strike(ball, TARGET, IMPACT)
        assert s is not None
        f = g.adapt(earlier(ball, 0.4), arm.q_ready, np.zeros(7), s)
        assert f is not None
        _, rows = f.motion(np.array([*ball, [0.0, 0.0, -GRAVITY]]))
        assert np.allclose(rows[1], s.dq, atol=1e-8 * _size(f.alpha))
        assert np.all(np.abs(rows[2]) <= 0.7 * bound + 1e-6 * _size(f.alpha))
        longer += bool(np.any(np.abs(rows[1]) / 0.07 > 0.7 * bound))
    assert longer > 3


def test_a_strike_beyond_the_catch_joints_range_has_no_map() -> None:
    """It is no error: the ball is refused, or met as it was to be met before."""
    g, ball, _ = drawn("wam-48v", 0)
    s, q = g.strike(ball, TARGET, IMPACT), g.arm.q_ready
    assert s is not None
    beyond = s.q.copy()
    beyond[3] = g.arm.q_max[3] + 0.01
    of = earlier(ball, 0.4), q, 0.0 * q
    assert g.adapt(*of, s) is not None
    assert g.adapt(*of, replace(s, q=beyond)) is None


def _size(alpha: Array) -> float:
    """Return how large sums with coefficients are."""
    return 1.0 + float(np.abs(alpha).max())


@given(name=st.sampled_from(sorted(ARMS)), seed=seeds)
@settings(max_examples=20)
def test_a_shield_is_at_rest_and_faces_the_ball(name: str, seed: int) -> None:
    """As well as its joints let it."""
    g, ball, _ = drawn(name, seed)
    s = struck(g, ball, None)
    f = g.adapt(earlier(ball, 0.4), g.arm.q_ready, np.zeros(g.arm.n), s)
    assume(f is not None)
    assert f is not None
    _, rows = f.motion(row(ball))
    assert np.allclose(rows[1], 0.0, atol=1e-8 * _size(f.alpha))
    assert s.astray < np.deg2rad(60.0)
    assert s.v_out @ ball[1] < ball[1] @ ball[1]


@given(seed=seeds)
@settings(max_examples=20)
def test_three_joints_are_as_near_to_the_direction_as_they_can_be(seed: int) -> None:
    """A pose turned a little that still is at the ball, and another time of flight, are not."""
    g, ball, rng = drawn("three joints", seed)
    s = struck(g, ball)
    for T in s.T + np.array([-0.02, 0.02]):
        wish = shot(ball[0], TARGET, T, IMPACT.drag) - (1.0 - IMPACT.loss) * ball[1]
        astray = np.arccos(np.clip(wish @ s.normal / np.linalg.norm(wish), -1.0, 1.0))
        assert astray >= s.astray - 1e-6
    assert rng is not None


@given(e=st.floats(0.5, 0.9), loss=st.floats(0.0, 0.4), seed=seeds)
def test_the_impact_keeps_what_it_says(e: float, loss: float, seed: int) -> None:
    """Share e of the approach, all but ``loss`` along the face, and momentum with the arm."""
    rng, impact = np.random.default_rng(seed), Impact(mass=0.06, restitution=e, loss=loss)
    n = rng.standard_normal(3)
    n /= np.linalg.norm(n)
    v_in, v_paddle, behind = -4.0 * n + rng.standard_normal(3), 0.3 * rng.standard_normal(3), 1.5
    v = rebound(impact, behind, n, v_in, v_paddle)
    pushed = v_paddle @ n + impact.mass / behind * (v_in - v) @ n
    assert np.isclose(v @ n - pushed, -e * (v_in - v_paddle) @ n)
    across = np.eye(3) - np.outer(n, n)
    assert np.allclose(across @ (v - v_paddle), (1.0 - loss) * across @ (v_in - v_paddle))


def test_restitution_is_learned_from_hits() -> None:
    """From one that is 0.05 wrong to within 0.01, from 20 outgoing velocities with noise."""
    known, true, rng = Restitution(mean=0.75), 0.8, np.random.default_rng(3)
    for k in range(20):
        g, ball, _ = drawn("wam-48v", k)
        s = g.strike(ball, TARGET, IMPACT)
        assert s is not None
        behind = mass_behind(g.arm, s.q, s.normal)
        v = rebound(replace(IMPACT, restitution=true), behind, s.normal, ball[1], s.v_paddle)
        known = known.after(s, behind, IMPACT.mass, v + 0.05 * rng.standard_normal(3))
    assert abs(known.mean - true) < 0.01
    assert known.sigma < 0.01
    assert s is not None
    assert known.after(replace(s, v_paddle=2.0 * ball[1]), behind, 0.05, v) == known


def test_grip_and_lift_of_a_spin_are_learned_from_hits() -> None:
    """A rubber that grips a fifth less, and spins faster than they seem, from 20 hits with noise.

    What is said of the errors holds them, and is far less than before.
    """
    rng, true, gain = np.random.default_rng(5), 0.4, 1.15
    known, vague = Grip(loss=0.45, sigma=0.12, sigma_gain=0.15), 20.0
    ball_of = Impact(mass=0.07, radius=0.04, loss=true, lift=0.002)
    for k in range(20):
        _, ball, _ = drawn("wam-48v", k)
        n = -ball[1] / np.linalg.norm(ball[1]) + 0.3 * rng.standard_normal(3)
        n /= np.linalg.norm(n)
        shown, along = 100.0 * rng.standard_normal(3), ball[1] / np.linalg.norm(ball[1])
        x, y, z = (gain * shown + vague * rng.standard_normal() * along).tolist()
        v = rebound(replace(ball_of, spin=(x, y, z)), 2.0, n, ball[1], np.zeros(3))
        s = PaddleStrike(
            q=np.zeros(4), dq=np.zeros(4), ball=ball, normal=n, v_paddle=np.zeros(3),
            v_out=v, T=0.0, astray=0.0,
        )  # fmt: skip
        x, y, z = shown.tolist()
        seen = v + 0.05 * rng.standard_normal(3)
        known = known.after(replace(ball_of, spin=(x, y, z)), s, seen, vague)
    assert known.after(ball_of, s, v + 2.0 * np.cross(n, [0.0, 0.0, 1.0]), vague) == known
    assert known.covariance is not None
    sigma = np.sqrt(known.covariance[0]), np.sqrt(known.covariance[2])
    assert abs(known.loss - true) < 3.0 * sigma[0] < 0.06
    assert abs(known.loss * known.gain - true * gain) < 3.0 * sigma[1] < 0.06


def flights_of(g: BattingMap, count: int) -> list[tuple[Flight, PaddleStrike]]:
    """Return flights and strikes to learn from."""
    out = list[tuple[Flight, PaddleStrike]]()
    for seed in range(10 * count):
        _, ball, _ = drawn("wam-80v", seed)
        s = g.strike(ball, TARGET, IMPACT)
        if s is not None and g.aims(s, TARGET) and g.ease(s, g.arm.q_ready, 0.5) < 1.0:
            states = [earlier(ball, x) for x in np.linspace(0.5, -0.008, 12)]
            path = np.array([[b.r_o, b.dr_o, b.ddr_o] for b in states])
            out.append((Flight(t=np.linspace(0.0, 0.508, 12), ball=path, seen=path[0]), s))
        if len(out) == count:
            break
    return out


def test_learning_lowers_the_cost_and_holds_each_flight_to_its_strike() -> None:
    """The rows of the contact are rows of the same projection."""
    g = map_of("wam-80v")
    flights = flights_of(g, 8)
    learned, result = learn_batting(g, flights)
    costs = [x.cost_torque + x.cost_speed for x in result.steps]
    assert costs[-1] < costs[1]
    lifted = lift_strike(learned, *flights[0])
    assert lifted is not None
    assert len(lifted.phi_0) == 4
    assert len(lifted.gap) == 4 * g.arm.n
    far = replace(flights[0][0], ball=flights[0][0].ball + 1e6)
    with pytest.raises(InputError):
        learn_batting(g, [(far, flights[0][1])])


def test_what_cannot_be_is_refused() -> None:
    """A ball out of reach has no strike; a held joint is not a free one."""
    g, ball, _ = drawn("wam-48v", 0)
    far = ball + np.array([[5.0], [0.0]])
    assert g.strike(far, TARGET, IMPACT) is None
    assert (
        aim_at_target(g.arm, aiming_of(g.arm, (0, 1, 2, 3)), far, TARGET, IMPACT, g.arm.q_ready)
        is None
    )
    with pytest.raises(ModelError):
        replace(g, held=(0,))
    with pytest.raises(InputError):
        Impact(mass=-1.0)
