"""Laws of the reserve: what the envelope lets an arm do, its drives can stop."""

from dataclasses import replace
from pathlib import Path
from sysconfig import get_paths

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from mitt.control.stop import EASIEST, HARDEST, SHARE, choose_stop
from mitt.control.viability import BLOCKED, PASSED, SafetyFilter
from mitt.robot.arm import Arm
from mitt.robot.hands import HandModel
from mitt.robot.load import load_arm
from mitt.robot.shapes import Surroundings
from mitt.signals import TICK, Array

PANDA = "cmeel.prefix/share/example-robot-data/robots/panda_description/urdf/panda.urdf"
#: What instants between those that are looked at may take more, and feedback has left.
BETWEEN = 1.03

seeds = st.integers(0, 2**31)


@pytest.fixture(scope="module")
def panda() -> Arm:
    """A Panda that stretches out over joints 1, 2 and 4: gravity takes most of joint 2."""
    joints = [f"panda_joint{k}" for k in (1, 2, 4, 6)]
    path = Path(get_paths()["purelib"]) / PANDA
    arm = load_arm(path, tip="panda_hand_tcp", joints=joints, hand=HandModel())
    links = [replace(x, held=3.1416) if x.name == joints[3] else x for x in arm.model.links]
    ready = np.array([0.0, 0.785, -0.3])
    return Arm(replace(arm.model, links=tuple(links), q_ready=ready), arm.limits)


def stop_of(
    arm: Arm, safety_filter: SafetyFilter, motion: Array, first: int = EASIEST
) -> tuple[float, Array]:
    """Return the share of torque and the decelerations of the stop that is found."""
    s = safety_filter.safety
    return float(choose_stop(arm.tables, s.bounds, motion, first, s.stop)), s.stop.rates.copy()


def shares(arm: Arm, motion: Array, rates: Array) -> Array:
    """Return the torque of a stop, as shares of the drives' bounds; Pinocchio.

    At 60 instants, and just before and after each joint comes to rest.
    """
    q, dq = motion[0], motion[1]
    rests = np.abs(dq) / rates
    even = np.linspace(0.0, 0.9999 * float(np.max(rests)), 60)
    t = np.concatenate([even, rests * (1.0 - 1e-9), rests * (1.0 + 1e-9)])[:, None]
    passed = np.minimum(t, np.abs(dq) / rates)
    qs = q + np.sign(dq) * passed * (np.abs(dq) - 0.5 * rates * passed)
    dqs = np.sign(dq) * np.maximum(np.abs(dq) - rates * t, 0.0)
    ddqs = np.where(np.abs(dqs) > 0.0, -np.sign(dq) * rates, 0.0)
    out = []
    for a, b, c in zip(qs, dqs, ddqs, strict=True):
        # M(q) ddq + n(q, dq), the mass matrix by Pinocchio's composite rigid bodies
        bias = arm.torque(a, b, np.zeros(arm.n))
        tau = bias + arm.torque_derivatives(a, b, c)[2] @ c
        out.append(arm.limits.torque_ratio(tau, arm.all_joints(b)).max())
    return np.array(out)


@settings(max_examples=30)
@given(seed=seeds, hard=st.booleans())
@example(seed=10000, hard=True)  # a joint that comes to rest between two of the equal steps
@example(seed=269, hard=True)
def test_a_stop_that_is_found_takes_what_is_said_of_it(arm: Arm, seed: int, hard: bool) -> None:
    """Against another implementation, between the instants that were looked at as well."""
    safety_filter, rng = SafetyFilter(arm, Surroundings()), np.random.default_rng(seed)
    b = safety_filter.bounds
    q = rng.uniform(b["q_min"], b["q_max"])
    room = np.minimum(q - b["q_min"], b["q_max"] - q)
    dq = rng.uniform(-1.0, 1.0, arm.n) * np.minimum(b["dq_max"], np.sqrt(b["deceleration"] * room))
    motion = np.array([q, dq, np.zeros(arm.n)])
    share, rates = stop_of(arm, safety_filter, motion, HARDEST if hard else EASIEST)
    found = shares(arm, motion, rates)
    assert np.all(rates > 0.0)
    assert np.all(rates <= b["deceleration"] * (1.0 + 1e-12))
    ends = q + 0.5 * dq * np.abs(dq) / rates
    assert np.all(ends >= b["q_min"] - 1e-9)
    assert np.all(ends <= b["q_max"] + 1e-9)
    assert found.max() >= share * (1.0 - 1e-2) - 1e-9
    assert found.max() <= BETWEEN * max(share, SHARE) + 0.1 * share


def test_a_panda_is_not_let_into_a_motion_that_it_cannot_stop(panda: Arm) -> None:
    """Stretched out and driven down as fast as may be: it stops in its range, by its torques.

    With the deceleration of the ready pose alone, 21 rad/s^2, the envelope let joint 2 move on at
    full speed where 1.3 rad/s^2 were left, and the arm ran into the end of its range.
    """
    safety_filter, blocked, worst = SafetyFilter(panda, Surroundings()), 0, 0.0
    safety_filter.begin(np.array([0.0, 0.6, -0.3]), np.zeros(3))
    for _ in range(900):
        q = safety_filter.last[0] + TICK * np.array([0.0, 2.0, 0.0])
        blocked += safety_filter.step(np.array([q, [0.0, 2.0, 0.0], np.zeros(3)])) == BLOCKED
        if safety_filter.last[1].any():
            _, rates = stop_of(panda, safety_filter, safety_filter.last)
            worst = max(worst, float(shares(panda, safety_filter.last, rates).max()))
    assert blocked > 20
    assert worst < 1.0
    assert panda.q_max[1] - 0.1 < safety_filter.last[0, 1] < panda.q_max[1]


def test_where_there_is_room_a_wish_passes(panda: Arm) -> None:
    """A slow motion that the drives can stop at any time is not touched."""
    safety_filter = SafetyFilter(panda, Surroundings())
    for k in range(200):
        t = TICK * k
        q = panda.q_ready + 0.05 * (1.0 - np.cos(4.0 * t))
        wanted = np.array([q, np.full(3, 0.2 * np.sin(4.0 * t)), np.full(3, 0.8 * np.cos(4.0 * t))])
        before = wanted.copy()
        assert safety_filter.step(wanted) == PASSED
        assert np.array_equal(wanted, before)


def test_from_a_motion_that_it_should_not_have_the_arm_gets_out(panda: Arm) -> None:
    """Begun where no stop is possible, it brakes as gently as it must and comes to rest."""
    safety_filter = SafetyFilter(panda, Surroundings())
    safety_filter.begin(np.array([0.0, 1.4, -0.3]), np.array([0.0, 2.1, -1.0]))
    speeds = []
    for _ in range(2000):
        safety_filter.step(np.array([safety_filter.last[0], np.full(3, 1.0), np.zeros(3)]) + 0.0)
        speeds.append(float(np.abs(safety_filter.last[1]).max()))
    assert speeds[20] < 2.1
    assert panda.q_max[1] >= safety_filter.last[0, 1]
