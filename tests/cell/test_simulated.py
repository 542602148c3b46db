"""The simulated robot's own controller, and the ages of the commands that it gets."""

import numpy as np
import pytest

from mitt.core.arm.arm import Arm
from mitt.io.cell import RobotPart
from mitt.robot.cell.robot import ReceivedCommand
from mitt.robot.cell.simulated import Ages, Controller


def test_it_takes_commands_only_once_released(arm: Arm) -> None:
    """Before, and after the brakes were engaged, it holds the arm by itself."""
    c, q, still = Controller(arm, RobotPart()), arm.q_ready, np.zeros(arm.n)
    told = ReceivedCommand(0.0, np.full((4, arm.n), 0.5), 0.3)
    assert not np.array_equal(c.command(0.0, q, still, told).joints, told.joints)
    c.release(0.001, q, still)
    assert np.array_equal(c.command(0.001, q, still, told).joints, told.joints)
    c.engage(0.002, q, still)
    held = c.command(0.5, q, still, told)
    assert held.brakes
    assert np.allclose(held.tau, arm.inverse_dynamics(q, still, still))


def test_the_watchdog_latches(arm: Arm) -> None:
    """After 20 ms without a command it brakes, says so, and a late command changes nothing."""
    c, q, dq = Controller(arm, RobotPart()), arm.q_ready, np.full(arm.n, 2.0)
    told = ReceivedCommand(0.0, np.zeros((4, arm.n)), 0.0)
    c.release(0.0, q, dq)
    c.command(0.0, q, dq, told)
    assert c.command(0.020, q, dq, None).tau.tolist() == [0.0] * arm.n
    braking = c.command(0.0211, q, dq, None)
    assert c.trouble == "protective stop: no command for 20 ms"
    assert np.all(braking.ddq <= 0.0)
    assert not np.array_equal(c.command(0.03, q, dq, told).joints, told.joints)
    c.release(0.04, q, dq)
    assert c.trouble == ""


@pytest.mark.parametrize("takes", ["velocity", "position"])
def test_motions_are_followed_within_the_torque_limits(arm: Arm, takes: str) -> None:
    """Where drives take no torque, a step of the command does not exceed a motor's limit."""
    c, q, still = (
        Controller(arm, RobotPart.model_validate({"takes": takes})),
        arm.q_ready,
        np.zeros(arm.n),
    )
    c.release(0.0, q, still)
    rows = np.array([q + 1.0, still + 50.0, still, still])
    tau = c.command(0.0, q, still, ReceivedCommand(0.0, rows, 0.0)).tau
    assert np.all(np.abs(tau) <= arm.tau_max * (1.0 + 1e-9))
    assert np.any(np.abs(tau) > 0.9 * arm.tau_max)


@pytest.mark.parametrize("scale", [2e-5, 1e-3, 0.3])
def test_percentiles_are_those_of_all_ages_within_a_class(scale: float) -> None:
    drawn = scale * np.random.default_rng(5).lognormal(sigma=0.7, size=5000)
    ages = Ages()
    for age in drawn:
        ages.add(float(age))
    told = ages.percentiles_us()
    assert told is not None
    for name, share in (("p50", 0.5), ("p99", 0.99), ("p99_9", 0.999)):
        exact = 1e6 * np.quantile(drawn, share, method="inverted_cdf")
        assert exact <= told[name] <= 1.0101 * exact
    assert told["max"] == pytest.approx(1e6 * drawn.max(), rel=1e-12)


def test_without_ages_there_is_none_and_odd_ones_are_counted() -> None:
    ages = Ages()
    assert ages.percentiles_us() is None
    for age in (-1e-3, 0.0, 100.0):
        ages.add(age)
    told = ages.percentiles_us()
    assert told is not None
    assert told["max"] == pytest.approx(1e8)
    assert told["p50"] < 1.1
