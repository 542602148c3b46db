"""Laws of the map: it meets the ball whatever alpha is, and starts where the arm is."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support import ball_state

from mitt.core.arm.arm import Arm
from mitt.core.arm.hands import HandModel
from mitt.core.catcher.generators import Direct
from mitt.core.errors import InputError, MittError, ModelError, ShapeError
from mitt.core.map.learn import Learned
from mitt.core.map.map_design import MapDesign, tangent_of
from mitt.core.map.mapping import DirectMap, unlearned
from mitt.core.map.prediction import NEAR, flown, root_time
from mitt.core.map.tangent import invert_newton, scratch_of, to_go
from mitt.core.signals import PASSED, Array, BallState, MapStatus
from mitt.io.load import build_arm

STEP = 1e-5
EXACT = 1e-9
DIFFERENCE = 2e-6
PANDA = "cmeel.prefix/share/example-robot-data/robots/panda_description/urdf/panda.urdf"

seeds = st.integers(0, 2**31)


def bent(f: DirectMap, rng: np.random.Generator) -> DirectMap:
    """Return the map with random coefficients."""
    return replace(f, alpha=0.1 * rng.standard_normal(f.alpha.shape))


def at_catch(f: DirectMap, rng: np.random.Generator) -> tuple[Array, Array, Array]:
    """Return a random ball state at the very catch: r_o = l(q) with q_i = q_alpha."""
    q = np.array([rng.uniform(-0.4, 0.4), np.pi / 4 + rng.uniform(-0.3, 0.3), f.design.q_catch])
    dr = np.array([-rng.uniform(2, 7), rng.uniform(-1, 1), rng.uniform(-4, 2)])
    return f.arm.position(q), dr, np.array([0.5, 0.0, -9.81])


@given(seed=seeds, kappa=st.sampled_from([1.0, 1.5, 3.0]), q_catch=st.floats(0.9, 2.0))
def test_the_hand_meets_the_ball_whatever_alpha_is(
    arm: Arm, seed: int, kappa: float, q_catch: float
) -> None:
    """Eq. (3): no position error at any alpha and kappa; relative velocity (kappa - 1) J_i dq_i."""
    rng = np.random.default_rng(seed)
    f = bent(unlearned(arm, MapDesign(kappa=kappa, q_catch=q_catch)), rng)
    r_o, dr_o, ddr_o = at_catch(f, rng)
    reference = f.reference(ball_state(r_o, dr_o, ddr_o))
    J = arm.jacobian(reference.q_d)
    assert np.allclose(arm.position(reference.q_d), r_o, atol=EXACT)
    assert np.allclose(f.catch_gap(r_o), 0.0, atol=EXACT)
    relative = dr_o - J @ reference.dq_d
    assert np.allclose(relative, (kappa - 1.0) * J[:, 2] * reference.dq_d[2], atol=1e-7)


@given(seed=seeds, slope=st.tuples(st.floats(-0.3, 0.3), st.floats(-1.0, 0.5)))
def test_a_map_that_weighs_the_match_meets_the_ball_in_position(
    arm: Arm, seed: int, slope: tuple[float, float]
) -> None:
    """Wherever q_alpha is, and whatever alpha is; the relative velocity is linear in alpha."""
    rng = np.random.default_rng(seed)
    design = MapDesign(q_catch=1.6 - 0.8 * slope[1], slope=slope, match_weight=1.0)
    plain = unlearned(arm, design)
    q = np.array([rng.uniform(-0.4, 0.4), 0.8 + rng.uniform(-0.2, 0.2), 0.0])
    q[2] = design.q_catch + q[:2] @ slope
    r_o, dr_o = arm.position(q), np.array([-rng.uniform(2, 7), *rng.uniform(-1, 1, 2)])
    maps = [plain, bent(plain, rng), bent(plain, rng)]
    maps.append(plain.with_alpha(0.5 * (maps[1].alpha + maps[2].alpha)))
    relative = []
    for f in maps:
        answer = f.reference(ball_state(r_o, dr_o, np.zeros(3)))
        assert to_go(f.tangent, answer.q_o) == pytest.approx(0.0, abs=1e-8)
        assert np.allclose(answer.q_d, q, atol=1e-8)
        assert np.allclose(f.catch_gap(r_o), 0.0, atol=1e-8)
        assert np.allclose(f.F(r_o) @ dr_o, answer.dq_d, atol=1e-6)
        relative.append(dr_o - arm.jacobian(answer.q_d) @ answer.dq_d)
    assert np.abs(relative[1] - relative[0]).max() > 1e-3
    assert np.allclose(relative[3], 0.5 * (relative[1] + relative[2]), atol=1e-6)


@given(seed=seeds)
def test_kappa_slows_the_catch_joint_by_itself_and_no_other(arm: Arm, seed: int) -> None:
    """q_i-dot at the catch is 1/kappa of its value at kappa = 1, the other joints unchanged."""
    rng = np.random.default_rng(seed)
    one, three = (unlearned(arm, MapDesign(kappa=k)) for k in (1.0, 3.0))
    state = ball_state(*at_catch(one, rng))
    fast, slow = one.reference(state).dq_d, three.reference(state).dq_d
    assert np.allclose(slow, fast * [1.0, 1.0, 1.0 / 3.0], atol=1e-9)


@given(seed=seeds)
def test_derivatives_of_the_reference_are_differences(plain: DirectMap, seed: int) -> None:
    """dq_d and ddq_d are time derivatives of q_d along any motion of the ball; F agrees."""
    rng = np.random.default_rng(seed)
    f = bent(plain, rng)
    r_o = np.array([rng.uniform(0.9, 3.0), rng.uniform(-0.8, 0.8), rng.uniform(-0.4, 1.2)])
    dr_o = np.array([-rng.uniform(2, 7), rng.uniform(-1, 1), rng.uniform(-3, 3)])
    ddr_o = rng.uniform(-10, 10, 3)

    def at(t: float) -> Array:
        r = f.reference(ball_state(r_o + dr_o * t + 0.5 * ddr_o * t * t, dr_o + ddr_o * t, ddr_o))
        return np.array([r.q_d, r.dq_d, r.ddq_d])

    now, change = at(0.0), (at(STEP) - at(-STEP)) / (2 * STEP)
    size = 1.0 + np.abs(now).max()
    assert np.allclose(now[1:], change[:2], atol=DIFFERENCE * size)
    assert np.allclose(f.F(r_o) @ dr_o, now[1], atol=EXACT * size)


@given(seed=seeds)
def test_closed_form_and_newton_give_the_same_inverse(plain: DirectMap, seed: int) -> None:
    """Wherever the closed form has a value, Newton finds it too, and l_c leads back to the ball."""
    rng = np.random.default_rng(seed)
    direction = np.array([1.0, rng.uniform(-0.5, 0.5), rng.uniform(-0.6, 0.8)])
    r_o = rng.uniform(0.62, 4.0) * direction / np.linalg.norm(direction)
    status, q_o = plain.to_joints(r_o)
    assert status is MapStatus.INSIDE
    assert np.allclose(plain.to_ball(q_o), r_o, atol=EXACT)
    start = np.array([0.0, np.pi / 4, np.pi / 2])
    general = plain.tangent._replace(planar=False)
    assert invert_newton(general, r_o, start, scratch_of(3))
    assert np.allclose(start, q_o, atol=1e-7)


@given(radius=st.floats(0.0, 0.6), yaw=st.floats(-3.0, 3.0), pitch=st.floats(0.1, 3.0))
def test_the_domain_is_where_the_equations_say(
    plain: DirectMap, radius: float, yaw: float, pitch: float
) -> None:
    """Inside |r_o| = |p x t| / |t| there is no inverse, outside there is; never NaN."""
    px, pz, tx, tz = plain.tangent.plane[:4]
    edge = abs(px * tz - pz * tx) / np.hypot(tx, tz)
    assert edge == pytest.approx(0.569, abs=5e-4)
    if abs(radius - edge) < 1e-6:
        return
    r_o = radius * np.array(
        [np.sin(pitch) * np.cos(yaw), np.sin(pitch) * np.sin(yaw), np.cos(pitch)]
    )
    status, q_o = plain.to_joints(r_o)
    assert (status is MapStatus.INSIDE) == (radius > edge)
    assert np.all(np.isfinite(q_o))


@pytest.mark.parametrize(
    "r_o", [np.array([0.0, 0.0, 2.0]), np.array([np.nan, 1, 1]), np.array([np.inf, 0, 0])]
)
def test_where_the_map_has_no_value_it_says_so_with_finite_numbers(
    plain: DirectMap, r_o: Array
) -> None:
    """Over the axis, at NaN and at infinity the status is DOMAIN and nothing is NaN."""
    reference = plain.reference(ball_state(r_o, np.array([-5.0, 0, 0]), np.zeros(3)))
    assert reference.status is MapStatus.DOMAIN
    rows = (reference.q_d, reference.dq_d, reference.ddq_d, reference.q_o, reference.dq_o)
    assert all(np.all(np.isfinite(row)) for row in rows)


@pytest.mark.parametrize("size", [1e10, 1e154, 1e300])
def test_numbers_that_overflow_are_no_reference(learned: Learned, size: float) -> None:
    """A ball at 1e300 m or as fast, as no ball is, gives rest or a motion, never NaN."""
    near, still = np.array([2.0, 0.0, 0.0]), np.zeros(3)
    fast = np.array([-size, 0.0, 1.0])
    for ball in (ball_state(near, fast, still), ball_state(-fast, fast, fast)):
        reference = learned.map.reference(ball)
        rows = (reference.q_d, reference.dq_d, reference.ddq_d, reference.q_o, reference.dq_o)
        assert all(np.all(np.isfinite(row)) for row in rows)
        assert not np.isnan(reference.time_to_catch)


@given(seed=seeds)
def test_an_adapted_map_starts_where_the_arm_is(learned: Learned, seed: int) -> None:
    """Eq. (8): after adaptation q_d and dq_d at t_0 are the arm's, moving or at rest."""
    rng = np.random.default_rng(seed)
    f = learned.map
    r_o = np.array([rng.uniform(1.8, 3.5), rng.uniform(-0.4, 0.4), rng.uniform(0.0, 1.0)])
    ball = ball_state(r_o, np.array([-6.0, 0.1, 1.0]), np.array([1.0, 0.0, -9.0]))
    q, dq = f.arm.q_ready + rng.uniform(-0.1, 0.1, 3), rng.uniform(-1, 1, 3)
    reference = f.adapt(ball, q, dq).reference(ball)
    assert np.allclose(reference.q_d, q, atol=1e-8)
    assert np.allclose(reference.dq_d, dq, atol=1e-7)


def test_adapting_at_the_catch_itself_stays_finite(learned: Learned) -> None:
    """At s = 0 the matrix C loses its rank: least squares answer, no NaN, no explosion."""
    f = learned.map
    r_o = f.arm.position(np.array([0.1, 0.7, np.pi / 2]))
    adapted = f.adapt(ball_state(r_o, np.array([-5.0, 0, 0]), np.zeros(3)), f.arm.q_ready, r_o)
    assert np.all(np.isfinite(adapted.alpha))
    outside = f.adapt(ball_state(0.1 * r_o, r_o, r_o), f.arm.q_ready, r_o)
    assert outside.status is MapStatus.DOMAIN
    assert np.array_equal(outside.alpha, f.alpha)


@pytest.fixture(scope="module")
def panda() -> Arm:
    """Three joints of an arm that no closed form inverts."""
    path = Path(pytest.__file__).parents[1] / PANDA
    joints = ["panda_joint1", "panda_joint2", "panda_joint4"]
    return build_arm(path, tip="panda_hand_tcp", joints=joints)


@given(seed=seeds)
def test_the_law_holds_for_an_arm_from_a_file(panda: Arm, seed: int) -> None:
    """A Panda's axes 1, 2, 4 meet the ball by Newton's inverse as the WAM does in closed form."""
    rng = np.random.default_rng(seed)
    f = bent(unlearned(panda, MapDesign(q_catch=-1.8)), rng)
    q = np.array([rng.uniform(-0.5, 0.5), rng.uniform(-0.2, 0.6), -1.8])
    r_o, dr_o = panda.position(q), rng.uniform(-2, 2, 3)
    reference = f.reference(ball_state(r_o, dr_o, np.zeros(3)))
    assert reference.status is MapStatus.INSIDE
    assert np.allclose(panda.position(reference.q_d), r_o, atol=1e-8)
    assert np.allclose(panda.jacobian(reference.q_d) @ reference.dq_d, dr_o, atol=1e-6)


def test_designs_that_cannot_be_are_refused(arm: Arm, plain: DirectMap) -> None:
    """Unknown joints, angles outside the range and ratios below 1 raise a MittError."""
    for design in (
        MapDesign(catch_joint=3),
        MapDesign(q_catch=4.0),
        MapDesign(kappa=0.5),
        MapDesign(free=(0, 0, 2)),
    ):
        with pytest.raises(ModelError):
            tangent_of(arm, design)
    with pytest.raises(ShapeError):
        plain.to_joints(np.zeros(2))
    with pytest.raises(MittError):
        replace(plain, alpha=np.full_like(plain.alpha, np.nan))


def test_what_needs_a_place_in_the_domain_refuses_any_other(plain: DirectMap) -> None:
    """The gap of the catch as well as F: no number stands for none."""
    rng, outside = np.random.default_rng(5), 0
    for r_o in rng.uniform(-1.5, 1.5, (200, 3)):
        inside = plain.to_joints(r_o)[0] is MapStatus.INSIDE
        for ask in (plain.catch_gap, plain.F):
            if inside:
                assert np.all(np.isfinite(ask(r_o)))
            else:
                outside += 1
                with pytest.raises(InputError, match="in the domain"):
                    ask(r_o)
    assert outside > 0


G = np.array([0.0, 0.0, -9.81])
#: Step of the dense forecast [s], and what its chord is off [s].
FINE = 1e-3
CHORD = 1e-4
#: Share by which the ball's present motion may mislead within NEAR of the catch.
MISLEADS = 0.35

numbers = st.floats(-1e3, 1e3).filter(lambda x: x == 0.0 or abs(x) > 1e-3)


@settings(max_examples=100)
@given(s=numbers, ds=numbers, dds=numbers)
def test_the_root_is_the_next_one(s: float, ds: float, dds: float) -> None:
    """It is a zero, not in the past, and none comes before it; infinite where none comes."""
    t = root_time(s, ds, dds)
    assert t >= 0.0
    ahead = np.linspace(0.0, 2.0, 400) if t == np.inf else np.linspace(0.0, 0.999 * t, 400)
    way = s + ds * ahead + 0.5 * dds * ahead**2
    if s == 0.0:
        assert t == 0.0
        return
    assert np.all(way[:-1] * s > -1e-9 * max(abs(s), 1.0))
    if t < np.inf:
        scale = abs(s) + abs(ds) * t + 0.5 * abs(dds) * t * t
        assert abs(s + ds * t + 0.5 * dds * t * t) <= 1e-9 * scale


@pytest.mark.parametrize(
    ("of", "time"),
    [
        ((1.0, -1.0, 2.0), np.inf),
        ((1.0, 0.0, -2.0), 1.0),
        ((1.0, -0.0, -2.0), 1.0),
        ((-1.0, 0.0, 2.0), 1.0),
        ((1.0, 1.0, 0.0), np.inf),
        ((1.0, -2.0, 0.0), 0.5),
        ((1.0, 0.0, 0.0), np.inf),
        ((0.0, 0.0, 0.0), 0.0),
        ((1.0, 1.0, -4.0), 1.0),
        ((np.nan, 1.0, 1.0), np.inf),
        ((1e200, -1e200, 1e200), np.inf),
    ],
)
def test_roots_that_are_known(of: tuple[float, float, float], time: float) -> None:
    """Rising, falling, turning, at rest, at the catch, and what is no number."""
    assert root_time(*of) == pytest.approx(time)


def coming(f: DirectMap, seed: int, descent: tuple[float, float]) -> tuple[BallState, float]:
    """Return a ball that comes through a random point of the catch, and how long before it."""
    rng = np.random.default_rng(seed)
    q = f.start + np.append(rng.uniform(-0.25, 0.25, 2), 0.0)
    speed, down, turn = rng.uniform(1.5, 7.0), rng.uniform(*descent), rng.uniform(-0.3, 0.3)
    level = np.array([-np.cos(turn), -np.sin(turn)])
    dr = speed * np.array([*np.cos(down) * level, -np.sin(down)])
    t = rng.uniform(0.02, 0.6)
    r = f.arm.position(q) - t * dr + 0.5 * t * t * G
    return BallState(t=0.0, r_o=r, dr_o=dr - t * G, covariance=1e-8 * np.eye(6)), t


def distance(f: DirectMap, r_o: Array) -> float:
    """Return the distance to go at a ball position [rad]; NaN outside the domain."""
    status, q_o = f.to_joints(r_o)
    return (
        float(q_o[f.design.catch_joint] - f.design.q_catch)
        if status is MapStatus.INSIDE
        else np.nan
    )


def dense(f: DirectMap, ball: BallState) -> float:
    """Return the first time at which the flight passes q_alpha [s]; infinite without, 1 s ahead."""
    path = flown(ball, np.arange(0.0, 1.0, FINE))
    s = np.array([distance(f, row[0]) for row in path])
    out = np.flatnonzero(np.isnan(s))
    s = s[: out[0]] if len(out) else s
    passes = np.flatnonzero(s[:-1] * s[1:] <= 0.0)
    if not len(passes):
        return np.inf
    k = int(passes[0])
    return FINE * (k + float(s[k] / (s[k] - s[k + 1])))


@pytest.mark.parametrize("descent", [(0.0, 0.8), (0.8, 1.2), (1.2, 1.5)])
def test_the_time_is_that_of_the_flight(learned: Learned, descent: tuple[float, float]) -> None:
    """Against a dense forecast: far ahead to 0.1 ms, near as well as the present motion tells."""
    f = learned.map
    for seed in range(50):
        ball, _ = coming(f, seed, descent)
        said, true = f.reference(ball).time_to_catch, dense(f, ball)
        if said <= NEAR:
            assert abs(said - true) <= MISLEADS * true + CHORD
        else:
            assert said == pytest.approx(max(true, NEAR), abs=CHORD)


def test_the_time_that_a_closing_takes_is_told_whatever_comes(learned: Learned) -> None:
    """Along feasible flights, steep lobs among them, the time falls below a lead at the lead."""
    f, lead, feasible = learned.map, HandModel().closing_time(0.04), 0
    g = Direct(f)
    for seed in range(30):
        ball, _ = coming(f, seed, (1.2, 1.5) if seed % 2 else (0.0, 1.2))
        if g.verdict(ball, f.arm.q_ready).outcome.value != "feasible":
            continue
        feasible, true = feasible + 1, dense(f, ball)
        times = np.arange(0.0, true, FINE)
        moving = [f.reference(x).time_to_catch for x in along(ball, times)]
        closes = times[np.flatnonzero(np.array(moving) <= lead)[0]]
        assert abs(closes - max(true - lead, 0.0)) <= 0.010
    assert feasible > 10


def along(ball: BallState, times: Array) -> list[BallState]:
    """Return a ball as it is at later times."""
    return [
        BallState(t=float(t), r_o=row[0], dr_o=row[1])
        for t, row in zip(times, flown(ball, times), strict=True)
    ]


@settings(max_examples=50)
@given(seed=seeds)
def test_a_catch_has_just_passed_or_is_over(learned: Learned, seed: int) -> None:
    """Negative, and falling with the time, while it counts as just passed; then no more."""
    f, (ball, t) = learned.map, coming(learned.map, seed, (0.0, 0.8))
    for since in (1e-3, 5e-3, 0.7 * PASSED):  # beyond, the motion misleads by a tenth
        (later,) = along(ball, np.array([t + since]))
        assert f.reference(later).time_to_catch == pytest.approx(-since, abs=3e-4 + 0.1 * since)
    (later,) = along(ball, np.array([t + 2.0 * PASSED]))
    assert f.reference(later).time_to_catch > 0.0


@settings(max_examples=50)
@given(seed=seeds, vx=st.floats(0.5, 8.0))
def test_a_ball_that_flies_away_has_no_catch(learned: Learned, seed: int, vx: float) -> None:
    """From in front of the arm, and away from it: infinite, not a time that has passed."""
    rng = np.random.default_rng(seed)
    r = np.array([rng.uniform(1.1, 3.0), rng.uniform(-0.3, 0.3), rng.uniform(0.0, 0.8)])
    ball = BallState(t=0.0, r_o=r, dr_o=np.array([vx + 2.0, 0.0, rng.uniform(-1.0, 1.0)]))
    assert learned.map.reference(ball).time_to_catch == np.inf
