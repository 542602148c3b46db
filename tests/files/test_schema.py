"""What a file of ours should have held, in our words: no library is heard."""

from importlib.resources import files
from pathlib import Path

import pytest

from mitt.core.errors import FileError
from mitt.io.cell import read_cell

TEXT = (files("mitt") / "data" / "cells" / "wam-sim.toml").read_text()


@pytest.mark.parametrize(
    ("key", "value", "said"),
    [
        ("rate", '"fast"', "'robot.rate': wanted a number, got 'fast'"),
        ("takes", '"force"', "wanted 'torque', 'velocity' or 'position', got 'force'"),
        ("delay", "-1", "wanted greater than or equal to 0, got -1"),
        ("schema", '"mitt.cell/9"', "wanted 'mitt.cell/1', got 'mitt.cell/9'"),
        ("name", '"../../a"', "wanted a text that matches the pattern '^"),
        ("frame", '""', "wanted a text that has at least 1 character, got ''"),
        ("radius", "[1]", "wanted a number, got a list"),
    ],
)
def test_a_wrong_value_is_told_in_our_words(
    tmp_path: Path, key: str, value: str, said: str
) -> None:
    lines = [
        f"{key} = {value}" if line.startswith(f"{key} = ") else line for line in TEXT.splitlines()
    ]
    (tmp_path / "cell.toml").write_text("\n".join(lines))
    with pytest.raises(FileError) as caught:
        read_cell(tmp_path / "cell.toml")
    assert said in str(caught.value)
    assert "should" not in str(caught.value)


def test_what_is_missing_is_said(tmp_path: Path) -> None:
    (tmp_path / "cell.toml").write_text(TEXT.replace('name = "wam-sim"', ""))
    with pytest.raises(FileError, match="key 'name': wanted a value, got none"):
        read_cell(tmp_path / "cell.toml")
