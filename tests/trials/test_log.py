"""The log: one row a tick, in step with the truth, zero where nothing was asked."""

import numpy as np

from mitt.catcher.settings import PHASES
from mitt.robot.arm import Arm
from mitt.trials.runner import LoggedTrial

TICK = 0.001


def test_every_column_has_a_row_for_each_tick(direct: LoggedTrial) -> None:
    """All columns are as long as the times, the truth has one row more, at release."""
    assert direct.log is not None
    log, k = direct.log, len(direct.log.t)
    columns = (
        log.phase, log.tracked, log.following, log.encoders, log.ball, log.desired, log.virtual,
        log.command, log.tau, log.feedforward, log.hand,
    )  # fmt: skip
    assert {len(column) for column in columns} == {k}
    assert len(log.truth.t) == k + 1
    assert np.allclose(np.diff(log.t), TICK)
    assert np.allclose(log.truth.t[:-1], log.t)


def test_rows_without_a_reference_are_zero(direct: LoggedTrial) -> None:
    """Before t_0 and after the hand has closed nothing is asked."""
    assert direct.log is not None
    log = direct.log
    assert not np.any(log.desired[~log.following])
    assert not np.any(log.virtual[~log.following])
    assert np.any(log.following)
    assert log.t[log.following][0] == log.t_0


def test_phases_come_in_their_order(direct: LoggedTrial) -> None:
    """Watching, following, braking: the phase never goes back."""
    assert direct.log is not None
    assert np.all(np.diff(direct.log.phase) >= 0)
    assert [p.value for p in PHASES] == ["watch", "follow", "brake", "refused", "stopped"]


def test_the_feedforward_is_the_torque_of_the_command_alone(direct: LoggedTrial, arm: Arm) -> None:
    """Inverse dynamics of the commanded motion, tick by tick."""
    assert direct.log is not None
    log = direct.log
    for k in range(0, len(log.t), 97):
        assert np.allclose(log.feedforward[k], arm.inverse_dynamics(*log.command[k]), atol=1e-9)


def test_exact_encoders_are_the_truth(direct: LoggedTrial) -> None:
    """In the default world the encoders of a tick read the true state before it."""
    assert direct.log is not None
    truth = direct.log.truth
    assert np.array_equal(direct.log.encoders[:, 0], truth.q[:-1])
    assert np.array_equal(direct.log.encoders[:, 1], truth.dq[:-1])
    assert np.array_equal(direct.log.tau, truth.tau[1:])
