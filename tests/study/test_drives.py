"""Torques of held joints and of motors over a trial."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mitt.robot.arm import Arm
from mitt.robot.hands import HandModel
from mitt.robot.load import load_arm
from mitt.study.drives import rms_ratio, with_held


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
    found = with_held(motors, motion[:, 0], motion[:, 1], motors.active(tau))
    assert np.allclose(found, tau, atol=1e-9 * (1.0 + np.abs(tau).max()))


def test_a_held_joint_loads_the_motors_of_its_neighbour(motors: Arm) -> None:
    """Both motors of the differential count for joint 2, so holding joint 3 is seen."""
    tau = np.array([0.0, 40.0, 20.0, 0.0])
    share = motors.limits.torque_ratio(tau, np.zeros(4))
    alone = motors.limits.torque_ratio(tau * [1, 1, 0, 1], np.zeros(4))
    by_joint = motors.by_joint(share)
    assert by_joint[1] == pytest.approx(max(share[1], share[2]))
    assert by_joint[1] > motors.by_joint(alone)[1]


@given(scale=st.floats(0.1, 3.0))
def test_continuous_torque_is_a_root_mean_square(motors: Arm, scale: float) -> None:
    """Half a trial at the continuous torque's root two, half at rest: exactly full."""
    tau = np.zeros((10, 4))
    tau[:5] = scale * np.sqrt(2.0) * motors.limits.transmission.T @ motors.limits.tau_rms
    assert rms_ratio(motors, tau) == pytest.approx([scale] * 4)


def test_a_set_without_continuous_torque_has_no_share(arm: Arm) -> None:
    """The share is 0 where nothing is stated."""
    assert rms_ratio(arm, np.ones((3, 4))) == [0.0] * 4
