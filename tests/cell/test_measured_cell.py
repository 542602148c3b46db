"""``mitt measure``: delay, servo and load of a robot are found from a motion, and written down."""

import tomllib
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from local_cell import LocalCell, Readings
from support import thorough

from mitt.cli.main import main
from mitt.core.errors import FileError
from mitt.core.signals import TICK
from mitt.io.cell import Cell, arm_of, bare_arm, cell_of, cell_text, read_cell, without_load
from mitt.io.measured_cell import measured_text, write_measured
from mitt.robot.cell.identification import Figure, Identified, identify
from mitt.robot.cell.live import Mode
from mitt.robot.cell.prepare import period_of, prepare
from mitt.robot.cell.robot import ReceivedCommand
from mitt.robot.cell.simulated import Controller

#: Noise of the encoders [rad], of stamps [s], and share of readings and commands that are lost.
NOISE = 2e-5
JITTER = 5e-5
LOST = 0.02
#: How far figures may be off. The simulation's steps make 0.5 ms of a delay; friction, and links
#: up to 5 % heavier or lighter than the model knows, are in servo and load.
DELAY = 1.5e-3
SERVO = 0.2
LOAD = 0.3


def altered(cell: Cell, robot: Mapping[str, Any], **arm: Any) -> Cell:  # noqa: ANN401 (any key)
    """Return a cell with another robot, and another arm."""
    parts = {
        "robot": cell.robot.model_copy(update=robot),
        "arm": cell.arm.model_copy(update=arm),
    }
    return cell.model_copy(update=parts)


def measured(believed: Cell, true: Cell, seed: int) -> Identified:
    """Return what a motion shows of a cell that is other than believed; links, noise drawn."""
    rng = np.random.default_rng(seed)
    cell = LocalCell(
        throws=1, seed=seed, prepared=prepare(believed), plant=prepare(true), measured=True
    )
    lost = False

    def read(got: Readings) -> Readings:
        nonlocal lost
        out = []
        for x in got:
            lost = not lost and rng.random() < LOST
            if not lost:
                noise = NOISE * rng.standard_normal(len(x.q))
                out.append(replace(x, t=x.t + JITTER * rng.uniform(-1.0, 1.0), q=x.q + noise))
        return out

    assert cell.loop.healthy() == ""
    cell.robot.on_read = read
    cell.robot.on_write = lambda _: rng.random() > LOST
    cell.loop.begin()
    cell.until(lambda: cell.loop.mode is Mode.CATCHING, ticks=20_000)
    assert cell.loop.measured is not None
    log = cell.noted.log(*cell.loop.measured)
    return identify(
        arm_of(without_load(believed)), believed.robot.takes, log, period=period_of(believed)
    )


@pytest.mark.parametrize(
    ("name", "takes", "rate", "seed"),
    thorough(
        [("wam-sim", "torque", 1000.0, 1)],
        [
            ("ur5e-sim", "velocity", 500.0, 2),
            ("ur5e-sim", "position", 500.0, 3),
            ("ur5e-sim", "torque", 500.0, 4),
            ("franka-panda-sim", "torque", 1000.0, 5),
        ],
    ),
)
def test_a_robot_is_found_to_be_what_it_is(name: str, takes: str, rate: float, seed: int) -> None:
    """Drawn; its links, friction, encoders and stamps are not as the equations have them."""
    rng = np.random.default_rng(seed)
    cell = altered(read_cell(name), {"takes": takes, "rate": rate})
    delay = period_of(cell) + round(rng.uniform(2.0, 7.0)) * TICK
    servo, load = rng.uniform(4.0, 12.0), rng.uniform(0.5, 1.5)
    carries = {"load": load, "load_at": (0.0, 0.02, 0.05)} if takes == "torque" else {}
    found = measured(cell, altered(cell, {"delay": delay, "servo": servo}, **carries), seed)
    assert abs(found.delay.value - delay) < DELAY
    assert found.delay.sigma < DELAY
    if found.servo is not None:
        assert abs(found.servo.value / servo - 1.0) < SERVO
    if found.load is not None:
        assert abs(found.load.value - load) < LOAD
        assert abs(found.load_at[1].value - 0.02) < 0.05
    assert (found.servo is None) == (takes == "torque")
    assert (found.load is None) == (takes != "torque")


def test_a_simulated_cell_is_as_late_as_its_file_says() -> None:
    """A command acts once it is as old as the link makes it, and not before."""
    arm, part = arm_of(read_cell("wam-sim")), read_cell("wam-sim").robot
    c, still = Controller(arm, part, late=3.0 * TICK), np.zeros(arm.n)
    c.release(0.0, arm.q_ready, still)
    rows = np.full((4, arm.n), 0.5)
    acts = []
    for k in range(6):
        told = ReceivedCommand(k * TICK, rows, 0.0) if k == 1 else None
        c.command(k * TICK, arm.q_ready, still, told)
        acts.append(c.commanded)
    assert acts == [False] * 4 + [True] * 2


def test_a_robot_knows_nothing_of_the_load_that_its_cell_adds() -> None:
    """What a driver takes off for the weight that the robot itself holds is without it."""
    cell = altered(read_cell("ur5e-sim"), {}, load=1.2, load_at=(0.01, 0.02, 0.05))
    arm, bare = arm_of(cell), arm_of(without_load(cell))
    motion = np.random.default_rng(3).uniform(-1.0, 1.0, (3, arm.n))
    known = bare_arm(cell, arm)
    assert np.allclose(known.inverse_dynamics(*motion), bare.inverse_dynamics(*motion), atol=1e-9)
    assert not np.allclose(arm.inverse_dynamics(*motion), bare.inverse_dynamics(*motion), atol=1.0)
    assert bare_arm(without_load(cell), bare) is bare


FILE = """# mine
schema = "mitt.cell/1"
name = "mine"  # ours

[robot]  # [delay] delay = 3
rate = 1000.0
delay = 0.003   # measured by hand
[robot.options]
delay = "no key of robot"

[source]
sigma = 0.001
"""


def test_a_file_keeps_all_but_what_was_measured(tmp_path: Path) -> None:
    """Comments and keys stay; what is written is a cell with these figures, and one of mitt."""
    figures = Identified(
        delay=Figure(0.00512, 1e-4), load=Figure(0.8, 0.01), load_at=(Figure(0.01, 0.0),) * 3
    )
    text = measured_text(FILE, figures.values, place="mine")
    assert "delay = 0.0051   # measured by hand" in text.splitlines()
    said, before = tomllib.loads(text), tomllib.loads(FILE)
    assert said.pop("arm") == {"load": 0.8, "load_at": [0.01] * 3}
    assert said["robot"].pop("delay") == 0.0051
    before["robot"].pop("delay")
    assert said == before
    path = tmp_path / "new.toml"
    write_measured(path, text, about="mine")
    write_measured(path, path.read_text(), about="mine again")
    assert path.read_text().count("mitt measure") == 1
    assert cell_of(tomllib.loads(path.read_text()), place="x").robot.delay == 0.0051


@pytest.mark.parametrize("robot", ["robot.delay = 0.003", "robot = { delay = 0.003 }"])
def test_a_file_that_is_not_followed_is_refused(robot: str) -> None:
    """Never written wrongly: what a TOML reader makes of it is what was meant, or it is refused."""
    with pytest.raises(FileError, match="by hand"):
        measured_text(f"{robot}\n", Identified(delay=Figure(0.004, 0.0)).values, place="x")


@pytest.mark.thorough
def test_a_measured_cell_is_one_of_mitt_and_the_old_one_stays(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text = cell_text("wam-sim")[1]
    path, new = tmp_path / "mine.toml", tmp_path / "new.toml"
    path.write_text(text.replace('driver = "ros2"', 'driver = "sim"').split("[robot.options]")[0])
    before = path.read_text()
    assert main(["measure", str(path), "--yes", "--json", "--out", str(new)]) == 0
    assert '"schema": "mitt.measure/1"' in capsys.readouterr().out
    assert path.read_text() == before
    assert abs(read_cell(new).robot.delay - read_cell(path).robot.delay) < 0.6e-3
    assert main(["measure", str(path), "--yes", "--out", str(path)]) == 2
