"""The tutorial "your robot": page and files, the driver at its simulated arm, its mistakes."""

import re
import runpy
import sys
from pathlib import Path

import numpy as np
import pytest
from documents import is_part
from support import install, thorough

from mitt.cli.main import main
from mitt.core.errors import InputError
from mitt.io.cell import read_cell
from mitt.robot.cell.prepare import prepare
from mitt.robot.cell.robot import Robot, driver_named

ROOT = Path(__file__).parents[2]
FOLDER = ROOT / "examples" / "tutorials" / "robot"
PAGE = (ROOT / "docs/tutorials/own-robot.md").read_text(encoding="utf-8")
CELL = str(FOLDER / "cell.toml")


@pytest.fixture(autouse=True)
def installed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The driver as if it were installed."""
    folder = tmp_path / "installed"
    folder.mkdir()
    install(FOLDER, folder, monkeypatch)


def said_by(
    name: str, words: list[str], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> str:
    """Return what a script of the tutorial prints."""
    monkeypatch.setattr(sys, "argv", [name, *words])
    runpy.run_path(str(FOLDER / name), run_name="__main__")
    return capsys.readouterr().out


def lists(said: str) -> list[list[float]]:
    """Return the numbers between square brackets, some of them after a unit."""
    found = re.findall(r"\[(-?\d[^\]]*)\]", said)
    return [[float(x) for x in text.split(",")] for text in found]


def test_the_page_is_its_files() -> None:
    """Its blocks are parts of the driver, the package, and the two cells."""
    found = re.findall(r"^```(?:python|toml)\n(.*?)^```", PAGE, re.DOTALL | re.MULTILINE)
    names = ("acme_driver.py", "pyproject.toml", "cell.toml", "first-moves.toml")
    for text, name in zip(found, names, strict=True):
        assert is_part(text, FOLDER / name), name


@pytest.mark.parametrize("name", ["cell.toml", "first-moves.toml"])
def test_the_cells_pass_their_check(name: str) -> None:
    """``mitt run --check`` finds the driver by its name, and nothing wrong."""
    assert main(["run", str(FOLDER / name), "--check"]) == 0


def test_the_driver_is_one_and_refuses_what_it_cannot_do() -> None:
    """Another address, other joints, other drives: one line each."""
    prepared = prepare(read_cell(CELL))
    make, cell, arm = driver_named("acme"), prepared.cell, prepared.arm
    assert isinstance(make(cell, arm), Robot)
    changes: tuple[dict[str, object], ...] = (
        {"options": {}},
        {"joints": ["yaw", "lift", "wrist"]},
        {"takes": "position"},
    )
    for change in changes:
        robot = cell.robot.model_copy(update=change)
        with pytest.raises(InputError, match=r"robot\.(options|joints)"):
            make(cell.model_copy(update={"robot": robot}), arm)


@pytest.mark.thorough
def test_the_driver_reads_the_arm_as_it_is(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Angles in the arm's order and sense, and the catch point that goes with them."""
    said = said_by("watch_joints.py", [CELL, "0.3"], monkeypatch, capsys)
    arm = prepare(read_cell(CELL)).arm
    first = said.splitlines()[0]
    angles = [float(x) for x in re.findall(r"j\d ([+-][\d.]+)", first)]
    (place,) = lists(first)
    assert np.abs(np.array(angles) - np.degrees(arm.q_ready)).max() < 0.3
    assert np.abs(np.array(place) - arm.position(arm.q_ready)).max() < 0.01


def test_the_driver_catches_at_its_simulated_arm(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Both balls."""
    said = said_by("try_driver.py", [], monkeypatch, capsys)
    assert "before it moves: nothing is wrong\nloop: catching" in said
    assert "balls: caught, caught" in said


@pytest.mark.slow
@pytest.mark.parametrize("mistake", thorough(["order"], ["sense", "radians", "torque"]))
def test_a_mistake_is_told_as_the_page_says(
    mistake: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The table has the words of the loop; the one that is not found leaves the arm elsewhere."""
    row = re.search(rf"^\| `{mistake}` \|[^|]*\| (.*) \|$", PAGE, re.MULTILINE)
    assert row
    said = said_by("try_driver.py", [mistake], monkeypatch, capsys)
    assert "balls: none thrown" in said
    if row.group(1) == "nothing":
        assert mistake == "sense"
        assert "loop: catching \n" in said
        true, ready = lists(said)
        assert true == pytest.approx([ready[0], -ready[1], ready[2]], abs=0.1)
        assert ready[1] == pytest.approx(0.25 * np.pi, abs=0.01)
    else:
        assert f"loop: stopped {row.group(1).strip('`')}" in said
