"""`mitt meet` from the command line: a file of motions in, a result and a page out; bad input."""

import json
from pathlib import Path

import numpy as np
import pytest

from mitt.cli.main import main
from mitt.lab.trials.meeting import STATUSES


def motions(path: Path) -> Path:
    """Write a thing that somebody holds out."""
    x = np.clip(np.linspace(0.0, 1.6, 97) / 1.3, 0.0, 1.0)
    way = 0.5 * x**3 * (10.0 - 15.0 * x + 6.0 * x * x)
    rows = [f"a,{k / 60:.4f},{1.0 - s:.4f},{2.0 + 0.2 * s:.4f},1.0" for k, s in enumerate(way)]
    path.write_text("\n".join(["flight,t_s,x_m,y_m,z_m", *rows]))
    return path


@pytest.mark.thorough
def test_motions_of_a_file_are_met(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """One trial a motion, near a person slowly; the result is what is printed; a page beside it."""
    out, file = tmp_path / "out", motions(tmp_path / "motions.csv")
    words = ["--target", str(file), "--tool", "jaw", "--seed", "3", "--out", str(out), "--json"]
    assert main(["meet", *words]) == 0
    result = json.loads(capsys.readouterr().out)
    assert result == json.loads((out / "result.json").read_text())
    said, (trial,) = result["summary"], result["trials"]
    assert result["schema"] == "mitt.meet/1"
    assert result["tool_speed_m_s"] == 0.25
    assert said["trials"] == sum(said[status] for status in STATUSES) == 1
    assert trial["hand_force_n"] is None or trial["hand_force_n"] < 140.0  # ISO/TS 15066, a hand
    page = (out / "report.html").read_text()
    assert "<svg" in page
    assert "src=" not in page


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--target", "blet"], "did you mean 'belt'"),
        (["--target", "no.csv"], "a CSV file"),
        (["--tool-speed", "0"], "0.01..20"),
        (["--trials", "0"], "1..100000"),
    ],
)
def test_bad_input_is_one_line(
    words: list[str], said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """Exit status 2, and what was wanted."""
    assert main(["meet", *words]) == 2
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 1
    assert said in lines[0]
