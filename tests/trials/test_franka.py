"""A Panda catches within all limits of its data sheet: what `mitt design` found, end to end."""

import numpy as np
import pytest
from franka_design import panda_file

from mitt.core.arm.arm import Arm
from mitt.core.catcher.generators import Direct
from mitt.core.map.neighbourhood import learn
from mitt.core.signals import TICK
from mitt.io.arm_file import load_arm, read_arm_file
from mitt.lab.trials.runner import TrialRunner
from mitt.lab.trials.source import Source, source_of, widened
from mitt.lab.world.scene import read_scene

THROWS = 4
#: Rounding of a rate: a difference of two numbers, over a millisecond.
ROUNDING = 1e-6


@pytest.fixture(scope="module")
def thrown(tmp_path_factory: pytest.TempPathFactory) -> tuple[Arm, TrialRunner, Source]:
    """Return the arm, its runner with a learned map, and what is thrown."""
    path = panda_file(tmp_path_factory.mktemp("panda"))
    arm, file = load_arm(path), read_arm_file(path)
    f = learn(arm).map
    scene = read_scene("lab")
    source = source_of(arm, seed=87000, count=THROWS, drag=scene.ball.drag)
    assert file.throws is not None
    runner = TrialRunner(arm, Direct(f), scene, pixels=False)
    return arm, runner, widened(source, file.throws)


@pytest.mark.parametrize("throw", range(THROWS))
def test_a_panda_catches_within_its_data_sheet(
    thrown: tuple[Arm, TrialRunner, Source], throw: int
) -> None:
    """Speed, acceleration, jerk, torque and torque rate, commanded and true."""
    arm, runner, source = thrown
    trial = runner.throw(source, throw).trial
    assert trial.status == "caught"
    assert trial.limit_violations == 0
    _, dq, ddq, tau = runner.ticks.command[:, :4].transpose(1, 0, 2)
    limits = arm.limits
    assert limits.acceleration is not None
    assert limits.jerk is not None
    assert limits.torque_rate is not None
    assert np.all(np.abs(dq) <= arm.dq_max)
    assert np.all(np.abs(ddq) <= arm.active(limits.acceleration) + ROUNDING)
    assert np.all(np.abs(np.diff(ddq, axis=0)) <= TICK * arm.active(limits.jerk) + ROUNDING)
    assert np.all(np.abs(np.diff(tau, axis=0)) <= TICK * arm.active(limits.torque_rate) + ROUNDING)
    assert np.ptp(dq, axis=0).max() > 0.5 * arm.dq_max.min()
