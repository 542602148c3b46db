"""What a motion asks, held to the formula in plain NumPy and to MuJoCo."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mitt.core.arm.arm import Arm
from mitt.core.map.demand import KINDS, Tolerance, demand, shares_of, uniform
from mitt.core.map.learn import limit_rows, sensitivity
from mitt.core.signals import Array
from mitt.io.load import build_arm
from mitt.io.wam import wam
from mitt.lab.world.plant import add_arm

EXACT = 1e-9

seeds = st.integers(0, 2**31)


def motion_of(arm: Arm, seed: int, count: int = 6) -> Array:
    """Return q, dq, ddq at some instants within the ranges, shape (count, 3, n)."""
    rng = np.random.default_rng(seed)
    q = rng.uniform(arm.q_min, arm.q_max, (count, arm.n))
    dq = rng.uniform(-arm.dq_max, arm.dq_max, (count, arm.n))
    return np.stack([q, dq, rng.uniform(-50, 50, (count, arm.n))], axis=1)


@given(seed=seeds)
def test_the_cost_is_the_formula(arm: Arm, seed: int) -> None:
    """Eq. (22): the mean of (tau/tau_max)^2 + (omega/omega_max)^2 over joints and instants."""
    motion = motion_of(arm, seed)
    total = 0.0
    for q, dq, ddq in motion:
        tau = arm.inverse_dynamics(q, dq, ddq)
        total += sum((tau / arm.tau_max) ** 2) + sum((dq / arm.dq_max) ** 2)
    assert demand(arm, motion).cost == pytest.approx(total / len(motion), rel=EXACT)


@given(seed=seeds, factor=st.floats(0.1, 5.0))
def test_speed_shares_scale_with_speed_and_costs_with_its_square(
    arm: Arm, seed: int, factor: float
) -> None:
    """At twice the speed twice the share is asked, at four times the cost."""
    slow = motion_of(arm, seed)
    fast = slow.copy()
    fast[:, 1] *= factor
    a, b = demand(arm, slow), demand(arm, fast)
    assert np.allclose(b.speed, factor * a.speed, rtol=EXACT)
    assert np.allclose(b.cost_speed, factor**2 * a.cost_speed, rtol=EXACT)


@given(seed=seeds, beyond=st.just(0.0) | st.floats(1e-6, 3.0))
def test_the_excess_is_the_way_beyond_the_range(arm: Arm, seed: int, beyond: float) -> None:
    """Within the ranges it is 0, beyond them the distance, on either side."""
    motion = motion_of(arm, seed)
    assert not np.any(demand(arm, motion).excess)
    motion[0, 0, 1], motion[1, 0, 2] = arm.q_max[1] + beyond, arm.q_min[2] - beyond
    excess = demand(arm, motion).excess
    assert excess[0, 1] == pytest.approx(beyond, abs=EXACT)
    assert excess[1, 2] == pytest.approx(beyond, abs=EXACT)
    assert np.count_nonzero(excess > EXACT) == (2 if beyond else 0)


@given(seed=seeds)
def test_torque_shares_agree_with_mujoco(arm: Arm, mujoco_arm: mujoco.MjModel, seed: int) -> None:
    """The same arm's inverse dynamics in MuJoCo over the peak torques gives the same shares."""
    motion = motion_of(arm, seed)
    data = mujoco.MjData(mujoco_arm)
    asked = arm.active(demand(arm, motion).torque)
    for row, share in zip(motion, asked, strict=True):
        data.qpos[:], data.qvel[:], data.qacc[:] = row
        mujoco.mj_inverse(mujoco_arm, data)
        assert np.allclose(np.abs(data.qfrc_inverse) / arm.tau_max, share, atol=1e-7)


def test_a_joint_at_its_own_limit_asks_all_of_it() -> None:
    """At dq_max the share of speed is 1, in every limit set."""
    for name in ("paper", "wam-48v", "wam-80v"):
        arm = build_arm("wam", limits=name)
        for k in range(arm.n):
            motion = np.array([[arm.q_ready, arm.dq_max * np.eye(arm.n)[k], np.zeros(arm.n)]])
            assert demand(arm, motion).speed.max() == pytest.approx(1.0, rel=EXACT)


@pytest.fixture(scope="module")
def mujoco_arm(arm: Arm) -> mujoco.MjModel:
    """The arm's links and its hand's mass in MuJoCo, joint limits and contacts off."""
    hand = arm.model.hand
    assert hand is not None
    spec = mujoco.MjSpec()
    spec.option.disableflags |= (
        mujoco.mjtDisableBit.mjDSBL_LIMIT | mujoco.mjtDisableBit.mjDSBL_CONTACT
    )
    plate = add_arm(spec, wam(hand))
    body = plate.add_body(name="hand")
    body.explicitinertial = True
    body.mass, body.ipos = hand.mass, [0.0, 0.0, hand.com]
    body.inertia = np.diag(hand.inertia)
    return spec.compile()


WHOLE = Tolerance(torque=1.0, speed=1.0)


@given(seed=seeds)
def test_shares_are_those_of_the_demand(arm: Arm, seed: int) -> None:
    """The largest of the named shares is the largest of the demand; a tolerance divides it."""
    motion = motion_of(arm, seed)
    asked, twice = demand(arm, motion), Tolerance(torque=2.0, speed=4.0)
    for kind, largest, tolerance in (
        ("torque", arm.by_joint(asked.torque).max(), twice.torque),
        ("speed", arm.by_joint(asked.speed).max(), twice.speed),
    ):
        for limits, divisor in ((WHOLE, 1.0), (twice, tolerance)):
            named = shares_of(arm, motion, limits)
            said = max(share for name, share in named.items() if name.startswith(kind))
            assert said == pytest.approx(largest / divisor, rel=EXACT)


@given(seed=seeds, strength=st.floats(0.2, 1.0))
def test_the_share_of_the_brake_is_where_each_joint_comes_to_rest(
    arm: Arm, seed: int, strength: float
) -> None:
    """Carried on for 12 ms, then braked with a share of its torque, stepped through time."""
    motion = motion_of(arm, seed)
    shares = shares_of(arm, motion, Tolerance(torque=1.0, speed=1.0, strength=strength))
    q, dq = motion[-1, 0], motion[-1, 1]
    rate = strength * arm.tau_max / np.diag(arm.mass_matrix(q))
    for j, name in enumerate(arm.names):
        t = np.linspace(0.0, abs(dq[j]) / rate[j], 20001)
        speed = np.sign(dq[j]) * (abs(dq[j]) - rate[j] * t)
        end = q[j] + 0.012 * dq[j] + np.trapezoid(speed, t)
        half, middle = 0.5 * (arm.q_max[j] - arm.q_min[j]), 0.5 * (arm.q_max[j] + arm.q_min[j])
        assert shares[f"brake:{name}"] == pytest.approx(abs(end - middle) / half, rel=1e-6)


def test_the_brake_is_left_out_where_it_is_not_asked_for(arm: Arm) -> None:
    """Without a strength no share is called after the brake."""
    names = shares_of(arm, motion_of(arm, 1), WHOLE)
    assert not any(name.startswith("brake") for name in names)


@pytest.mark.parametrize("limits", ["paper", "wam-80v", "wam-48v"])
@given(seed=seeds)
def test_verdict_and_learning_agree_on_shares_of_the_torque(limits: str, seed: int) -> None:
    """Also beyond a motor's no-load speed, where its bound is 0: one floor keeps shares finite."""
    arm = build_arm("wam", limits=limits)
    motion = motion_of(arm, seed)
    motion[:, 1] *= 1.5
    asked = demand(arm, motion)
    for k, row in enumerate(motion):
        rows = limit_rows(
            arm, sensitivity(arm, row[None], np.zeros((1, 3, 1))), share=1.0, near=0.0
        )
        assert rows.worst >= asked.torque[k].max() * (1.0 - EXACT)
        ratio = arm.limits.torque_ratio(arm.torques(row[None])[0], arm.all_joints(row[1]))
        assert np.allclose(ratio, asked.torque[k], rtol=EXACT)
        if asked.torque[k].max() >= max(asked.speed[k].max(), 2.0):
            assert rows.worst == pytest.approx(asked.torque[k].max(), rel=EXACT)


@given(seed=seeds)
def test_accelerations_have_a_share_where_the_set_bounds_them(arm: Arm, seed: int) -> None:
    """By joint, divided by the tolerance; no share without a bound."""
    most = np.linspace(5.0, 20.0, len(arm.model.links))
    bounded = Arm(arm.model, replace(arm.limits, acceleration=most))
    motion = motion_of(arm, seed)
    named = shares_of(bounded, motion, Tolerance(acceleration=2.0))
    for j, name in enumerate(arm.names):
        expected = np.abs(motion[:, 2, j]).max() / arm.active(most)[j] / 2.0
        assert named[f"acceleration:{name}"] == pytest.approx(expected, rel=EXACT)
    assert not demand(arm, motion).acceleration.any()
    assert not any(x.startswith("acceleration") for x in shares_of(arm, motion, WHOLE))


@given(seed=seeds, share=st.floats(0.5, 2.0))
def test_one_share_counts_for_every_kind(arm: Arm, seed: int, share: float) -> None:
    """Twice the tolerance is half the share, whatever the limit; ranges have none."""
    most, motion = np.linspace(5.0, 20.0, len(arm.model.links)), motion_of(arm, seed)
    bounded = Arm(arm.model, replace(arm.limits, acceleration=most))
    once, twice = (shares_of(bounded, motion, uniform(k * share)) for k in (1.0, 2.0))
    assert {x.split(":")[0] for x in once} == set(KINDS)
    for name, value in once.items():
        factor = 1.0 if name.startswith("range") else 0.5
        assert twice[name] == pytest.approx(factor * value, rel=EXACT)
