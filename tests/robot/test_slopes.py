"""Derivatives of the inverse dynamics against Pinocchio and against differences."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mitt.robot.arm import Arm
from mitt.robot.hands import HandModel
from mitt.robot.slopes import slopes_work, torque_slopes
from mitt.robot.wam import wam, wam_limits
from mitt.signals import Array

TOLERANCE = 1e-10


@pytest.fixture(scope="module", params=["wam", "wam-free"])
def any_arm(request: pytest.FixtureRequest, arm: Arm) -> Arm:
    """The WAM with joint 3 held, and with all four joints free."""
    if request.param == "wam":
        return arm
    return Arm(wam(HandModel(), held_3=None), wam_limits("paper"))


def slopes(arm: Arm, motion: Array) -> tuple[Array, Array]:
    """Return torques and their derivatives by the kernel."""
    links = len(arm.model.links)
    tau, slope = np.zeros(links), np.zeros((3, links, arm.n))
    torque_slopes(arm.bodies, motion, tau, slope, slopes_work(links))
    return tau, slope


@given(seed=st.integers(0, 2**31))
def test_torques_and_derivatives_are_pinocchio_s(any_arm: Arm, seed: int) -> None:
    """Torque of all links, d tau/dq, d tau/d dq and M agree with the library's."""
    scale = np.array([[1.5], [8.0], [60.0]])
    motion = np.random.default_rng(seed).uniform(-1.0, 1.0, (3, any_arm.n)) * scale
    tau, slope = slopes(any_arm, motion)
    assert tau == pytest.approx(any_arm.torque(*motion), abs=TOLERANCE)
    for ours, theirs in zip(slope, any_arm.torque_derivatives(*motion), strict=True):
        assert ours == pytest.approx(theirs, abs=TOLERANCE)


def test_derivatives_are_central_differences_of_the_torque(any_arm: Arm) -> None:
    """Each of the three derivatives is the slope of the torque along each joint."""
    motion = np.random.default_rng(4).uniform(-1.0, 1.0, (3, any_arm.n)) * [[1.5], [8.0], [60.0]]
    _, slope = slopes(any_arm, motion)
    h = 1e-6
    for d in range(3):
        for j in range(any_arm.n):
            step = np.zeros_like(motion)
            step[d, j] = h
            change = (any_arm.torque(*(motion + step)) - any_arm.torque(*(motion - step))) / (2 * h)
            assert slope[d, :, j] == pytest.approx(change, abs=1e-6)
