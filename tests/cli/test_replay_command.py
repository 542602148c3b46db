"""``mitt replay`` as a user calls it."""

import json
from pathlib import Path

import pytest
from recorded_trials import CASES, recorded

from mitt.cli.main import main


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    """Two recorded throws: one that is caught, one that is stopped."""
    folder = tmp_path_factory.mktemp("files")
    cases = [case for case in CASES if case.name in ("points", "encoder silent")]
    return [path for case in cases for _, path in recorded(case, folder, throws=1, seed=6)]


@pytest.mark.thorough
def test_json_is_as_the_contract_says(
    files: list[Path], capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    """Schema, file, ticks, identical, first difference; with --out a page for each."""
    out = tmp_path / "out"
    assert main(["replay", *map(str, files), "--json", "--out", str(out)]) == 0
    said = json.loads(capsys.readouterr().out)
    assert said["schema"] == "mitt.replay/1"
    rows = said["recordings"]
    assert [row["file"] for row in rows] == [str(path) for path in files]
    assert all(row["identical"] and row["first_difference"] is None for row in rows)
    assert all(row["ticks"] > 100 and row["whole"] for row in rows)
    assert "encoder silent of j4" in rows[1]["cause"]
    pages = sorted(out.glob("*.html"))
    assert len(pages) == 2
    text = pages[1].read_text(encoding="utf-8")
    assert "encoder silent of j4" in text
    assert text.count("<svg") == 4
    assert "://" not in text


def test_another_generator_says_where_it_differs(
    files: list[Path], capsys: pytest.CaptureFixture[str]
) -> None:
    """The first tick that differs is one in which the arm moves."""
    assert main(["replay", str(files[0]), "--generator", "quintic", "--json"]) == 0
    (row,) = json.loads(capsys.readouterr().out)["recordings"]
    assert not row["identical"]
    assert 0 < row["first_difference"] < row["ticks"]
    assert row["different_ticks"] > 10


def test_a_table_says_whether_all_are_identical(
    files: list[Path], capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["replay", *map(str, files)]) == 0
    assert "2 of 2 identical to the bit" in capsys.readouterr().out


def test_a_cut_file_is_replayed_to_its_last_chunk(
    files: list[Path], capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    """What is there is identical; that it is cut is said."""
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(files[0].read_bytes()[:-150_000])
    assert main(["replay", str(cut), "--json"]) == 0
    said = capsys.readouterr()
    (row,) = json.loads(said.out)["recordings"]
    assert row["identical"]
    assert not row["whole"]
    assert "cut after" in said.err


@pytest.mark.parametrize(
    "words",
    [
        ["no.mcap"],
        [],
        ["pyproject.toml"],
        ["REC", "--map", "no.json"],
        ["REC", "--settings", "no.toml"],
        ["REC", "--generator", "dance"],
    ],
)
def test_bad_input_is_one_line(
    files: list[Path], words: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    """Exit status 2, nothing on stdout."""
    assert main(["replay", *(str(files[0]) if word == "REC" else word for word in words)]) == 2
    said = capsys.readouterr()
    assert said.out == ""
    assert len(said.err.strip().splitlines()) == 1


def test_check_reads_and_does_nothing(
    files: list[Path], capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["replay", str(files[0]), "--check"]) == 0
    assert "1 recordings" in capsys.readouterr().err
