"""Torques of held joints and of motors over a trial."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mitt.robot.arm import Arm
from mitt.robot.hands import HandModel
from mitt.robot.load import load_arm
from mitt.trials.score import drive_loads, link_torques


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
    found = link_torques(motors, motion[:, 0], motion[:, 1], motors.active(tau))
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
    tau, still = np.array([[1.0, 2.0, 3.0, 4.0]]), np.zeros((1, 4))
    assert np.array_equal(link_torques(arm, still, still, tau), tau)


@settings(max_examples=30)
@given(seed=st.integers(0, 2**31))
def test_the_loads_are_those_of_the_limit_set(motors: Arm, seed: int) -> None:
    """Torque and share of each drive, locked joints included, and which instants are over."""
    rng = np.random.default_rng(seed)
    q, dq = np.tile(motors.q_ready, (10, 1)), rng.uniform(-1.0, 1.0, (10, 3))
    tau, limits = rng.uniform(-90.0, 90.0, (10, 3)), motors.limits
    found, links = drive_loads(motors, q, dq, tau), link_torques(motors, q, dq, tau)
    speeds = np.array([motors.all_joints(row) for row in dq])
    assert np.array_equal(found.torque, limits.drive_torque(links))
    assert np.array_equal(found.share, limits.torque_ratio(links, speeds))
    assert np.array_equal(found.over(1e-9), np.any(found.share > 1.0 + 1e-9, axis=1))
    assert not np.any(found.over(np.full(10, np.inf)))
