"""Studies of batting: what they write, what their map shows, what they refuse."""

import json
import re
from pathlib import Path

import pyarrow.parquet as pq
import pytest
from small_study import Here, quiet, written

from mitt.core.errors import InputError, UnknownNameError
from mitt.lab.report.study_page import write_study_page
from mitt.lab.trials.bat_study import AXES, read_bat_study
from mitt.lab.trials.study_folder import Folder, task_of_folder
from mitt.lab.trials.study_results import read_result
from mitt.lab.trials.study_run import all_chunks, run_study

TEXT = """
task = "bat"
name = "small"
trials = 1
limits = "wam-48v"
generators = ["direct", "ik"]

[[conditions]]
name = "usual"
"""
MAP = """
[map]
offsets = [-0.5, 0.5]
speeds = [5.0, 6.0, 7.0]
trials = 2
"""


def test_a_study_writes_its_table_summary_and_page(tmp_path: Path) -> None:
    """A row a trial, a row a cell, and once more nothing is left to do."""
    folder, engine = Folder(tmp_path / "out"), Here()
    study = read_bat_study(written(tmp_path, TEXT))
    folder.claim(study, resume=False, overwrite=False)
    done = run_study(study, folder, engine, progress=quiet)
    assert done.status == 0
    assert task_of_folder(folder.path) == "bat"
    table = pq.read_table(folder.trials).to_pylist()
    assert [row["generator"] for row in table] == ["direct", "ik"]
    summary = json.loads(folder.summary.read_text())
    assert [row["trials"] for row in summary["rows"]] == [1, 1]
    assert summary["answer"][0].startswith("usual, balls returned: the map (")
    assert run_study(study, folder, engine, progress=quiet).rows == summary["rows"]
    assert len(engine.done) == len(table)
    write_study_page(read_result(folder), replays=1, progress=quiet)
    assert summary["answer"][0] in (folder.path / "report.html").read_text()


def test_a_map_moves_the_target_along_each_axis_for_each_speed(tmp_path: Path) -> None:
    """The usual target once a speed; what the summary says of each cell is in the picture."""
    study = read_bat_study(written(tmp_path, TEXT + MAP))
    cells = [c for c in study.conditions if c.moved is not None]
    assert len(cells) == 2 * (1 + 2 * len(AXES))
    chunks = all_chunks(study, Folder(tmp_path), quiet)
    assert {chunk.place[0] for chunk in chunks} == {"direct", "ik"}
    measured = {"median": 3.25, "p90": 9.0}
    rows = [
        {
            "generator": "direct",
            "condition": c.name,
            "trials": 2,
            "returned": k % 2,
            "return_rate": k % 2,
            "unreachable": 2 - k % 2,
            "refused_by": "domain",
            "landing_cm": measured if k % 2 else None,
        }
        for k, c in enumerate(cells)
    ]
    assert [c for c, _ in study.cells(rows)] == cells
    said = study.answer_of_map(rows)
    assert said[0].startswith("Map: in 7 of 14 cells")
    assert "by domain" in said[1]


def test_what_a_file_cannot_say_is_refused(tmp_path: Path) -> None:
    """An unknown generator, a name twice, nothing to be done."""
    with pytest.raises(UnknownNameError, match="another"):
        read_bat_study(written(tmp_path, TEXT.replace('"ik"', '"another"')))
    with pytest.raises(InputError, match="twice"):
        read_bat_study(written(tmp_path, TEXT + TEXT[TEXT.index("[[") :]))
    with pytest.raises(InputError, match="a map"):
        read_bat_study(written(tmp_path, TEXT[: TEXT.index("[[")]))


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (TEXT + "speed = [0.0, 5.0]", "conditions.0.speed"),
        (TEXT + "speed = [7.0, 5.0]", "the least speed and then the largest"),
        (TEXT + "speed = [5.0, 20.1]", "conditions.0.speed"),
        (TEXT + "target = [nan, 0.0, 0.3]", "conditions.0.target"),
        (TEXT + "moved = [7, 0.5]", "conditions.0.moved"),
        (TEXT + 'generators = ["another"]', "conditions.0.generators"),
        (TEXT + 'generators = ["ik", "ik"]', "'ik' twice"),
        (TEXT.replace('"ik"', '"direct"'), "'direct' twice"),
        (TEXT + MAP.replace("7.0", "4.0"), "speeds that rise"),
        (TEXT + MAP.replace("6.0", "5.0"), "speeds that rise"),
    ],
)
def test_values_that_cannot_be_are_refused_as_the_file_is_read(
    text: str, said: str, tmp_path: Path
) -> None:
    """In one line that names the file and the key."""
    path = written(tmp_path, text)
    with pytest.raises(InputError, match=re.escape(said)) as refused:
        read_bat_study(path)
    assert str(refused.value).startswith(f"{path} key ")
    assert "\n" not in str(refused.value)
