"""A throw is judged by one rule, whether ``mitt catch``, a simulated cell or ``mitt.gym`` asks."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from local_cell import LocalCell
from support import BASKET_ARM

from mitt.core.arm.arm import Arm
from mitt.core.catcher.catcher import Catcher
from mitt.core.catcher.generators import Direct
from mitt.core.map.mapping import DirectMap
from mitt.core.signals import Array
from mitt.io.cell import cell_of
from mitt.lab.trials.runner import TrialRunner
from mitt.lab.trials.score import continuous_shares, drive_loads, overheated, ticks_beyond
from mitt.robot.cell.drivers import LocalPort
from mitt.robot.cell.live import Mode
from mitt.robot.cell.prepare import PreparedCell, cell_map, feed_of, prepare, scene_of_cell
from mitt.robot.cell.robot import ReceivedCommand
from mitt.robot.cell.simulated import SimulatedCell


@pytest.fixture(scope="module")
def basket(tmp_path_factory: pytest.TempPathFactory) -> PreparedCell:
    """A simulated cell whose arm carries a basket."""
    file = tmp_path_factory.mktemp("basket") / "arm.toml"
    file.write_text(BASKET_ARM)
    raw = {
        "schema": "mitt.cell/1",
        "name": "basket",
        "arm": {"file": file.name},
        "robot": {"driver": "sim", "delay": 0.0033},
    }
    return prepare(cell_of(raw, place="cell", folder=file.parent))


def test_a_cell_with_a_basket_knows_a_caught_ball(basket: PreparedCell) -> None:
    """It lies in the net, far from the catch point and touched by one cord or none."""
    cell = LocalCell(throws=2, seed=83000, prepared=basket)
    cell.begin()
    cell.until(lambda: cell.simulated.done and cell.loop.mode is Mode.CATCHING)
    assert cell.simulated.statuses == ["caught", "caught"]


def judged(arm: Arm) -> Arm:
    """Return an arm with limits that any catch exceeds: of rates, of continuous torque."""
    size, drives = len(arm.model.links), len(arm.limits.tau_rms)
    tight = replace(
        arm.limits,
        acceleration=np.full(size, 20.0),
        jerk=np.full(size, 5e4),
        torque_rate=np.full(size, 2e3),
        tau_rms=np.full(drives, 0.03),
    )
    return Arm(arm.model, tight)


@pytest.mark.parametrize("hand", ["basket", "fingers"])
@pytest.mark.parametrize("tight", [False, True])
def test_an_environment_judges_as_mitt_catch_does(
    hand: str, request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch, *, tight: bool
) -> None:
    """A residual of nothing is the catcher itself: the same status, the same ticks beyond."""
    pytest.importorskip("gymnasium")
    from mitt.gym import CatchEnv  # noqa: PLC0415

    if hand == "basket":
        prepared = request.getfixturevalue("basket")
        f = cell_map(prepared)
        assert isinstance(f, DirectMap)
    else:
        f = request.getfixturevalue("learned").map
    thrown = list[tuple[Any, int]]()
    release = TrialRunner.release

    def noted(self: TrialRunner, ball: Any, *, seed: int) -> Catcher:  # noqa: ANN401
        thrown.append((ball, seed))
        return release(self, ball, seed=seed)

    monkeypatch.setattr(TrialRunner, "release", noted)
    env = CatchEnv(action="residual", map=f, arm=f.arm, ticks=20)
    runner = TrialRunner(f.arm, Direct(f), env.scene, pixels=False)
    if tight:
        env.arm = runner.arm = judged(f.arm)
    env.reset(seed=1)
    over, info = False, dict[str, Any]()
    while not over:
        *_, terminated, truncated, info = env.step(np.zeros(f.arm.n, np.float32))
        over = terminated or truncated
    ball, seed = thrown[0]
    trial = runner.run(0, ball, seed=seed).trial
    assert (info["status"], info["limit_violations"]) == (trial.status, trial.limit_violations)
    assert trial.status == "caught"
    assert (trial.limit_violations > 100) == tight


def commander(arm: Arm, rng: np.random.Generator) -> Callable[[LocalPort], ReceivedCommand | None]:
    """Return what commands something at random, a little motion, now and then beyond a limit."""

    def command(_: LocalPort) -> ReceivedCommand | None:
        if rng.random() < 0.1:
            return None
        rows = rng.normal(size=(4, arm.n)) * np.array([[0.01], [0.3], [20.0], [3.0]])
        rows[0] += arm.q_ready
        return ReceivedCommand(float("nan"), rows, 0.0)

    return command


@pytest.mark.parametrize("seed", range(3))
def test_a_cell_counts_the_ticks_that_a_trial_counts(
    seed: int, basket: PreparedCell, monkeypatch: pytest.MonkeyPatch
) -> None:
    """However its ticks fall into the batches in which it counts; continuous torque a throw."""
    arm = judged(basket.arm)
    scene = scene_of_cell(basket.cell, None)
    port = LocalPort(1e-3)
    monkeypatch.setattr(LocalPort, "command", commander(arm, np.random.default_rng(seed)))
    cell = SimulatedCell(
        replace(basket, arm=arm),
        scene,
        feed_of(basket, scene, seed=seed, count=1),
        port,
        clock=lambda: 0.0,
    )
    port.braked = False
    told, driven = list[Array](), list[bool]()
    for _ in range(250):
        cell.tick()
        cell.act()
        told.append(cell._controller.told)
        driven.append(cell._controller.commanded)
    cell._check()
    truth = cell._world.trace()
    drives = drive_loads(arm, truth.q[:-1], truth.dq[:-1], truth.tau[1:])
    wanted = ticks_beyond(arm, truth, drives, np.array(told), driven=np.array(driven))
    assert cell.violations == int(np.sum(wanted)) > 50
    shares = continuous_shares(arm, np.sum(drives.torque**2, axis=0), len(told))
    before = cell.violations
    monkeypatch.setattr(type(cell._world), "diverged", True)
    cell._judge()
    assert cell.violations - before == overheated(shares) > 0
    assert cell.statuses == ["aborted"]
