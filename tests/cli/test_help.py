"""``--help``: one screen and an example for every command; ``--help-all``: all of it."""

import re
import shlex
import shutil
from dataclasses import fields
from pathlib import Path

import cv2
import numpy as np
import pytest
from small_study import TEXT
from throws_on_film import calibrated

from mitt.cli.line import options_of, parse
from mitt.cli.main import main
from mitt.cli.options import COMMANDS
from mitt.files.maps import save_map
from mitt.files.rig import write_rig
from mitt.map.learn import Learned
from mitt.trials.runs import simulate

ROOT = Path(__file__).parents[2]
#: A screen.
LINES, COLUMNS = 40, 80


def said(capsys: pytest.CaptureFixture[str], *words: str) -> str:
    """Return what a command prints before it ends well."""
    status = main(words)
    captured = capsys.readouterr()
    assert (status, captured.err) == (0, "")
    return captured.out


@pytest.mark.parametrize("name", [*COMMANDS, ""])
def test_help_is_one_screen_with_an_example(capsys: pytest.CaptureFixture[str], name: str) -> None:
    """Usage first, then what it is for and an example, then every option."""
    text = said(capsys, *name.split(), "--help")
    lines = text.splitlines()
    assert len(lines) <= LINES
    assert max(map(len, lines)) < COLUMNS
    assert lines[0].startswith(f"usage: mitt {name}".rstrip())
    assert f"  mitt {name or 'catch'}" in lines[lines.index("examples:") + 1]
    assert said(capsys, *name.split(), "-h") == text


@pytest.mark.parametrize("name", COMMANDS)
def test_help_names_every_option_and_help_all_says_all_of_it(
    capsys: pytest.CaptureFixture[str], name: str
) -> None:
    """The class of the options, the short help and the long one know the same options."""
    short, long = said(capsys, name, "--help"), said(capsys, name, "--help-all")
    options = {x.name for x in options_of(COMMANDS[name]) if not x.place}
    assert len(options_of(COMMANDS[name])) == len(fields(COMMANDS[name]))
    for text in (short, long):
        assert set(re.findall(r"^  (--[a-z-]+)", text, re.MULTILINE)) == options
    flat = re.sub(r"\s+", "", long)
    for option in options_of(COMMANDS[name]):
        assert option.text
        assert re.sub(r"\s+", "", option.text.rstrip(".")) in flat, option.called
    lines = [line for line in short.splitlines() if line.startswith("  -")]
    assert all(len(line.split(maxsplit=2)) > 1 for line in lines)


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory, learned: Learned) -> Path:
    """A folder with the files that the examples name."""
    folder = tmp_path_factory.mktemp("examples")
    shutil.copy(ROOT / "examples" / "own_arm.urdf", folder / "ARM.urdf")
    arm = (ROOT / "examples" / "tutorials" / "arm" / "arm.toml").read_text()
    (folder / "ARM.toml").write_text(arm.replace("../../own_arm.urdf", "ARM.urdf"))
    save_map(folder / "MAP.json", learned, version="0")
    rows = [f"{0.002 * k:.3f},{3.0 - 0.01 * k:.3f},0.1,{0.3 + 0.005 * k:.3f}" for k in range(40)]
    (folder / "POINTS.csv").write_text("\n".join(["t_s,x_m,y_m,z_m", *rows]))
    rows = [f"a,{0.01 * k:.2f},0.6,{0.002 * k:.4f},0.3" for k in range(300)]
    (folder / "MOTIONS.csv").write_text("\n".join(["flight,t_s,x_m,y_m,z_m", *rows]))
    write_rig(folder / "RIG.toml", calibrated(), version="0")
    (folder / "STUDY.toml").write_text(TEXT)
    head = "x_m,y_m,z_m,u_left_px,v_left_px,u_right_px,v_right_px"
    (folder / "HAND.csv").write_text("\n".join([head, *["0.7,0.1,0.3,60,60,64,60"] * 12]))
    for name in ("LEFT", "RIGHT"):
        (folder / name).mkdir()
        (folder / f"{name}.mkv").write_bytes(b"")
        cv2.imwrite(str(folder / name / "0.png"), np.zeros((128, 128), np.uint8))
    simulate(learned, throws=1, pixels=False, record=folder)
    (folder / "throw-00000.mcap").rename(folder / "REC.mcap")
    return folder


@pytest.mark.usefixtures("watched_shortly")
@pytest.mark.parametrize("line", [x for kind in COMMANDS.values() for x in kind.examples])
def test_every_example_parses_and_passes_its_check(
    files: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, line: str
) -> None:
    """As it stands in the help; nothing is written."""
    words = shlex.split(line)[1:]
    name, _ = parse(words)
    if name == "report":  # of a study that has been thrown: tests/trials
        return
    here = tmp_path / "here"
    shutil.copytree(files, here)
    if "--out" in words:
        (here / words[words.index("--out") + 1]).unlink(missing_ok=True)
    monkeypatch.chdir(here)
    before = sorted(here.iterdir())
    assert main([*words, "--check"]) == 0
    assert sorted(here.iterdir()) == before
