"""The page of a study: what it says, that it stands alone, and the commands' manners."""

import json
import re
from pathlib import Path

import pytest
from small_study import TEXT, Here, quiet, ready, write_study

from mitt.cli.main import main
from mitt.core.errors import FileError
from mitt.core.map.learn import Learned
from mitt.io.writing import write_json
from mitt.lab.report.study_page import break_even, paired_tests, sweeps_of, write_study_page
from mitt.lab.trials.catch_study import CatchStudy
from mitt.lab.trials.score import CATCH
from mitt.lab.trials.study_folder import Folder
from mitt.lab.trials.study_results import read_result
from mitt.lab.trials.study_run import run_study


@pytest.fixture(scope="session")
def folder(tmp_path_factory: pytest.TempPathFactory, learned: Learned) -> Folder:
    """A finished study with its page."""
    place = tmp_path_factory.mktemp("report")
    text = TEXT.replace("values = [1.0]", "values = [0.5, 1.0]").replace("throws = 2", "throws = 1")
    study = write_study(place, text)
    out = ready(place / "out", study, learned)
    run_study(study, out, Here(), progress=quiet)
    write_study_page(read_result(out), replays=1, progress=quiet)
    return out


def test_the_page_has_all_its_sections_and_loads_nothing(folder: Folder) -> None:
    page = (folder.path / "report.html").read_text()
    for name in (
        "summary",
        "sweeps",
        "conditions",
        "paired",
        "even",
        "reach",
        "effort",
        "worst",
        "rows",
    ):
        assert f'<section id="{name}">' in page
    assert not re.search(r'(?:src|href)="(?:https?:)?//', page)
    assert "nan" not in re.sub(r"<style>.*?</style>", "", page, flags=re.DOTALL).lower().split()


def test_the_page_says_how_long_a_tick_takes(folder: Folder) -> None:
    """By generator, from the wall-clock figures of the study."""
    page = (folder.path / "report.html").read_text()
    rows = json.loads((folder.path / "timing.json").read_text())["rows"]
    p99 = max(row["tick_us_p99"] for row in rows if row["generator"] == "unoptimised")
    assert p99 > 0.0
    cell = r"</td>\s*<td class=.n.>"
    assert re.search(rf"<td>unoptimised{cell}\d+{cell}{p99:.0f}</td>", page)


def test_a_replay_of_a_bad_throw_is_one_click_away(folder: Folder) -> None:
    page = (folder.path / "report.html").read_text()
    (link,) = re.findall(r'href="(replays/[^"]+)"', page)
    assert (folder.path / link).stat().st_size > 100_000


def test_the_page_is_the_same_when_it_is_made_again(folder: Folder) -> None:
    before = (folder.path / "report.html").read_bytes()
    write_study_page(read_result(folder), replays=1, progress=quiet)
    assert (folder.path / "report.html").read_bytes() == before


def _row(generator: str, value: float, rate: float) -> dict[str, object]:
    """Return what the tables read of a row."""
    return {
        "generator": generator,
        "condition": f"x {value:g}",
        "disturbance": "x",
        "value": value,
        "unit": "ms",
        "catch_rate": rate,
    }


def test_break_even_is_where_the_line_between_two_values_crosses() -> None:
    rows = [
        _row("direct", 0.0, 1.0),
        _row("direct", 10.0, 0.0),
        _row("ik", 0.0, 0.8),
        _row("ik", 10.0, 0.2),
    ]
    table = break_even(CATCH, rows)
    assert str(table).count("'5 ms'") == 3  # half of each, and level with each other
    level = [
        _row("direct", 0.0, 1.0),
        _row("direct", 10.0, 0.9),
        _row("ik", 0.0, 0.8),
        _row("ik", 10.0, 0.7),
    ]
    assert "never: direct ahead" in str(break_even(CATCH, level))
    assert list(sweeps_of(rows)) == ["x"]


def test_paired_tests_name_the_sure_differences() -> None:
    pair = {
        "pairs": 100,
        "only_direct": 30,
        "only_this": 2,
        "p": 1e-6,
        "p_holm": 2e-6,
        "difference": -0.28,
        "difference_ci95": [-0.38, -0.17],
    }
    rows = [{"condition": "clean", "generator": "unoptimised", "against_direct": pair}]
    assert "-28 (-38 to -17), 30 : 2, p 0.0001" in str(paired_tests(rows))


def test_a_study_that_is_not_over_has_no_page(tmp_path: Path, study: CatchStudy) -> None:
    out = Folder(tmp_path / "out")
    out.claim(study, resume=False, overwrite=False)
    with pytest.raises(FileError, match="--resume"):
        read_result(out)


def test_a_folder_of_mitt_catch_is_told_from_one_of_a_study(tmp_path: Path) -> None:
    write_json(tmp_path / "result.json", {})
    with pytest.raises(FileError, match="mitt catch"):
        read_result(Folder(tmp_path))


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("study none.toml --out DIR", "readable TOML"),
        ("study FILE --out DIR --engine moon", "local or dask"),
        ("study FILE --out DIR --workers 0", "--workers"),
        ("study FILE --out DIR --resume --overwrite", "one of them"),
        ("study FILE --out FILE", "a folder"),
        ("study FILE --out FULL", "--overwrite"),
        ("study FILE --out FULL --resume", "folder of a study"),
        ("report FULL", "study.json"),
        ("report DIR", "study.json"),
        ("report FULL --replays -1", "--replays"),
    ],
)
def test_bad_input_is_one_line_and_exit_2(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], words: str, said: str
) -> None:
    (tmp_path / "study.toml").write_text(TEXT)
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "letter.txt").write_text("mine")
    places = {"FILE": "study.toml", "DIR": "out", "FULL": "full"}
    arguments = [str(tmp_path / places[w]) if w in places else w for w in words.split()]
    assert main(arguments) == 2
    error = capsys.readouterr().err.strip()
    assert said in error
    assert "\n" not in error
    assert (tmp_path / "full" / "letter.txt").read_text() == "mine"


def test_checking_a_study_does_nothing(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "study.toml").write_text(TEXT)
    words = ["study", str(tmp_path / "study.toml"), "--out", str(tmp_path / "out"), "--check"]
    assert main(words) == 0
    assert "12 throws" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()
