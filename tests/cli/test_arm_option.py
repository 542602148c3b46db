"""``--arm ARM.toml``: arm, map and throws are the file's; options go before it."""

from collections.abc import Sequence
from importlib.resources import files
from pathlib import Path

import pytest
from arm.test_load import urdf

from mitt.cli.catching import prepare_run
from mitt.cli.main import main
from mitt.cli.options import CatchOptions
from mitt.cli.screen import warn
from mitt.core.errors import InputError, MittError
from mitt.io.arm_file import ArmSpec

TEXT = """schema = "mitt.arm/1"
[arm]
name = "wam"
limits = "wam-80v"
ready = [0.1, 0.8, 0.1]
[map]
q_catch = 1.1
inward = 0.5
[throws]
speed = [4.0, 4.5]
spread = 0.5
"""


@pytest.fixture
def path(tmp_path: Path) -> Path:
    """Return an arm file of the WAM."""
    file = tmp_path / "arm.toml"
    file.write_text(TEXT)
    return file


def test_catch_takes_arm_map_and_throws_from_the_file(path: Path, tmp_path: Path) -> None:
    """Ranges of speed and the width of the box are those that the file says."""
    out = tmp_path / "run"
    prepared = prepare_run(CatchOptions(arm=str(path), out=out))
    assert prepared.arm.limits.name == "wam-80v"
    assert prepared.arm.q_ready.tolist() == [0.1, 0.8, 0.1]
    assert (prepared.design.q_catch, prepared.design.inward) == (1.1, 0.5)
    assert prepared.source.ranges is not None
    assert prepared.source.ranges.speed == (4.0, 4.5)
    plain = prepare_run(CatchOptions(out=out)).source.aim
    aim = prepared.source.aim
    assert (aim.q_high - aim.q_low)[0] == pytest.approx(0.5 * (plain.q_high - plain.q_low)[0])
    other = prepare_run(CatchOptions(arm=str(path), out=out, limits="paper", q_catch=1.3))
    assert other.arm.limits.name == "paper"
    assert (other.design.q_catch, other.design.inward) == (1.3, 0.5)


def test_a_study_takes_the_same(path: Path) -> None:
    """Its table of the arm names the file."""
    chosen = ArmSpec(arm=str(path)).read()
    assert chosen.design.q_catch == 1.1
    assert chosen.throws is not None
    assert chosen.throws.spread == 0.5
    with pytest.raises(ValueError, match="franka-fr3"):
        ArmSpec(limits="huge")


def test_an_arm_without_a_hand_catches_nothing(path: Path, tmp_path: Path) -> None:
    """Refused before anything is learned, as is a tip beside the file."""
    urdf(tmp_path / "five.urdf")
    named = 'file = "five.urdf"\ntip = "l5"\njoints = ["j1", "j2", "j4"]'
    text = TEXT.replace('name = "wam"', named).replace('limits = "wam-80v"', "")
    path.write_text(text.replace("[map]", '[hand]\nname = "none"\n[map]'))
    with pytest.raises(InputError, match="an arm with a hand"):
        prepare_run(CatchOptions(arm=str(path), out=tmp_path / "run"))
    path.write_text(TEXT.replace("[map]", '[hand]\nname = "none"\n[map]'))
    with pytest.raises(MittError, match="a hand on an arm by name"):
        prepare_run(CatchOptions(arm=str(path), out=tmp_path / "run"))
    path.write_text(TEXT)
    with pytest.raises(InputError, match="nothing beside an arm file"):
        prepare_run(CatchOptions(arm=str(path), tip="x", out=tmp_path / "run"))


def test_warnings_leave_json_alone(capsys: pytest.CaptureFixture[str]) -> None:
    """On stdout for people, on stderr where stdout is one JSON object."""
    warn(["too heavy"])
    assert "warning: too heavy" in capsys.readouterr().out
    warn(["too heavy"], json=True)
    said = capsys.readouterr()
    assert said.out == ""
    assert "warning: too heavy" in said.err


#: Says that an arm file is a description, its tip and its joints.
NAMED = ("--tip", "l5", "--joints", "j1,j2,j4")
FIVE = 'file = "five.urdf"\ntip = "l5"\njoints = ["j1", "j2", "j4"]\n'


@pytest.mark.parametrize(
    "words",
    [
        ("catch", "--arm", "five.urdf", *NAMED),
        ("catch", "--arm", "five.urdf", *NAMED, "--json"),
        ("catch", "--arm", "five.urdf", *NAMED, "--scene", "high.toml"),
        ("catch", "--arm", "five.toml"),
        ("learn", "--arm", "five.urdf", *NAMED, "--out", "m.json"),
        ("design", "five.urdf", "--tip", "l5", "--out", "d.toml"),
        ("meet", "--arm", "five.urdf", "--tip", "l5", "--joints", "j1,j2,j3,j4,j5"),
        ("study", "study.toml", "--out", "out"),
        ("run", "cell.toml"),
        ("sim", "cell.toml"),
    ],
)
def test_what_is_doubted_of_an_arm_is_said_by_every_command(
    words: Sequence[str],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """Once, on stderr, and before anything else is refused, as a floor above a part of the arm."""
    monkeypatch.chdir(tmp_path)
    urdf(tmp_path / "five.urdf", effort="90000")
    (tmp_path / "high.toml").write_text("floor = 1.0\n")
    (tmp_path / "five.toml").write_text(
        f'schema = "mitt.arm/1"\n[arm]\n{FIVE}[hand]\nname = "basket"\n'
    )
    cell = (files("mitt") / "data" / "cells" / "wam-sim.toml").read_text()
    (tmp_path / "cell.toml").write_text(
        cell.replace('file = "wam" ', FIVE + "#").replace('limits = "paper"', "")
    )
    (tmp_path / "study.toml").write_text(
        'name = "doubted"\nthrows = 1\ngenerators = ["direct"]\n[[conditions]]\nname = "one"\n'
        'arm = { arm = "five.urdf", tip = "l5", joints = "j1,j2,j4" }\n'
    )
    main([*words, "--check"])
    said = capsys.readouterr()
    lines = said.err.splitlines()
    found = [k for k, line in enumerate(lines) if "large torque limits" in line]
    assert len(found) == 1, said.err
    assert lines[found[0]].startswith("mitt: warning: ")
    assert "large torque limits" not in said.out
    refused = [k for k, line in enumerate(lines) if "wanted" in line]
    assert not refused or refused[0] > found[0]
