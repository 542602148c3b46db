"""Torques of held joints and of motors over a trial."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mitt.robot.arm import Arm
from mitt.robot.hands import HandModel
from mitt.robot.load import load_arm
from mitt.trials.drives import fresh_tally, hold, tally


@pytest.fixture(name="motors", scope="module")
def _motors() -> Arm:
    """A WAM with its motors, joint 3 held."""
    return load_arm("wam", limits="wam-48v", hand=HandModel())


@settings(max_examples=30)
@given(seed=st.integers(0, 2**31))
def test_holding_is_what_inverse_dynamics_says(motors: Arm, seed: int) -> None:
    """From the active torques of a motion, those of all links come back."""
    rng = np.random.default_rng(seed)
    motion = rng.uniform(-1.0, 1.0, (4, 3, 3)) * np.array([1.0, 5.0, 60.0])[:, None]
    tau = np.array([motors.torque(*row) for row in motion])
    found, sums = np.empty((4, 4)), fresh_tally(motors)
    q, dq, active = motion[:, 0].copy(), motion[:, 1].copy(), motors.active(tau)
    for t in range(4):
        hold(motors.tables, q, dq, active, t, found[t], sums)
    assert np.allclose(found, tau, atol=1e-9 * (1.0 + np.abs(tau).max()))


def test_a_held_joint_loads_the_motors_of_its_neighbour(motors: Arm) -> None:
    """Both motors of the differential count for joint 2, so holding joint 3 is seen."""
    tau = np.array([0.0, 40.0, 20.0, 0.0])
    share = motors.limits.torque_ratio(tau, np.zeros(4))
    alone = motors.limits.torque_ratio(tau * [1, 1, 0, 1], np.zeros(4))
    by_joint = motors.by_joint(share)
    assert by_joint[1] == pytest.approx(max(share[1], share[2]))
    assert by_joint[1] > motors.by_joint(alone)[1]


def test_without_held_joints_the_torques_are_those_of_the_active_ones(motors: Arm) -> None:
    """An arm all of whose joints move has nobody to hold."""
    links = tuple(replace(link, held=None) for link in motors.model.links)
    arm = Arm(replace(motors.model, links=links, q_ready=np.zeros(4)), motors.limits)
    tau, still, out = np.array([[1.0, 2.0, 3.0, 4.0]]), np.zeros((1, 4)), np.empty(4)
    hold(arm.tables, still, still, tau, 0, out, fresh_tally(arm))
    assert np.array_equal(out, tau[0])


@settings(max_examples=30)
@given(seed=st.integers(0, 2**31))
def test_continuous_torque_is_a_root_mean_square(motors: Arm, seed: int) -> None:
    """The sums are the squares of what each drive gives to hold its links, tick by tick."""
    rng, sums = np.random.default_rng(seed), fresh_tally(motors)
    most = np.array([motors.q_min, motors.q_max, motors.dq_max])
    q, dq = np.tile(motors.q_ready, (11, 1)), np.zeros((11, 3))
    tau = rng.uniform(-20.0, 20.0, (11, 3))
    told, seen = np.zeros((3, 10, 3)), np.zeros(11, dtype=np.int64)
    told[0], told[2] = motors.q_ready, tau[1:]
    assert tally(motors.tables, most, told, q, dq, tau, seen, sums) == 0
    alone, total = fresh_tally(motors), np.zeros(4)
    for t in range(1, 11):
        out = np.empty(4)
        hold(motors.tables, q, dq, tau, t, out, alone)
        total += motors.limits.drive_torque(out) ** 2
    assert sums.square == pytest.approx(total)
