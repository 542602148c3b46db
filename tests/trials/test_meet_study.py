"""Studies of meetings: what they write, what they say, what they refuse."""

import json
from pathlib import Path
from typing import Any

import pyarrow.parquet as pq
import pytest
from small_study import Here, quiet, written

from mitt.errors import InputError, UnknownNameError
from mitt.report.task_study_page import write_task_study_page
from mitt.trials.meet_study import MeetStudy, read_meet_study
from mitt.trials.study_folder import Folder, task_of_folder
from mitt.trials.task_run import answer, read_task_result, run_task_study, task_jobs
from mitt.trials.task_study import task_of_file

TEXT = """
task = "meet"
name = "small"
trials = 1
generators = ["direct", "line"]
scene = { sensing = { latency = 0, point_noise = 0.0, frame_rate = 100.0 } }

[[conditions]]
name = "belt"
target = "belt"
speed = 0.3
"""


def test_a_study_writes_its_table_summary_and_page(tmp_path: Path) -> None:
    """A row a trial, a row a cell, and once more nothing is left to do.

    Each takes a part from a belt that is seen exactly, within all limits.
    """
    study = read_meet_study(written(tmp_path, TEXT))
    folder, engine = Folder(tmp_path / "out"), Here()
    folder.claim(study, resume=False, overwrite=False)
    assert run_task_study(study, folder, engine, progress=quiet).status == 0
    assert task_of_folder(folder.path) == "meet"
    table = pq.read_table(folder.trials).to_pylist()
    assert [row["generator"] for row in table] == ["direct", "line"]
    for row in table:
        assert (row["status"], row["limit_violations"]) == ("met", 0)
        assert row["position_error_mm"] < 5.0
    summary = json.loads(folder.summary.read_text())
    assert [row["met"] for row in summary["rows"]] == [1, 1]
    assert summary["answer"][0].startswith("belt, targets met: the map (1 of 1) is not told apart")
    again = run_task_study(study, folder, engine, progress=quiet)
    assert again.rows == summary["rows"]
    assert len(engine.done) == len(table)
    write_task_study_page(*read_task_result(folder, MeetStudy), folder, progress=quiet)
    page = (folder.path / "report.html").read_text()
    assert summary["answer"][0] in page


def test_planners_have_their_rates_and_encoders_their_belts() -> None:
    """In the study that ships."""
    assert task_of_file(Path("meet")) == "meet"
    assert task_of_file(Path("smoke")) is None
    cells = {job.place for job in task_jobs(read_meet_study(Path("meet")))}
    assert ("mpc 1000 Hz", "hand") in cells
    assert ("line-compensated", "belt 1 m/s") in cells
    assert ("line", "hand") not in cells


def test_what_a_file_cannot_say_is_refused(tmp_path: Path) -> None:
    """An unknown generator, a name twice."""
    with pytest.raises(UnknownNameError, match="another"):
        read_meet_study(written(tmp_path, TEXT.replace('"line"', '"another"')))
    twice = (
        TEXT + TEXT[TEXT.index("[[") :],
        TEXT.replace('"line"', '"direct"'),
        "rates = [50.0, 50.0]" + TEXT,
    )
    for text in twice:
        with pytest.raises(InputError, match="twice"):
            read_meet_study(written(tmp_path, text))


def test_the_answer_says_who_is_better_and_of_whom_that_is_not_known() -> None:
    """By the pairs alone."""
    sure, level = {"direct": 20, "this": 0, "p_holm": 1e-4}, {"direct": 3, "this": 2, "p_holm": 1.0}
    behind = {"direct": 0, "this": 20, "p_holm": 1e-4}
    names = ("met", "error_mm", "velocity_m_s", "acceleration", "force_n", "in_sync_s")
    pairs: list[tuple[str, Any]] = [
        ("direct", None),
        *((x, dict.fromkeys(names, of)) for x, of in (("a", sure), ("b", behind), ("c", level))),
    ]
    rows = [
        {"condition": "belt", "generator": name, "met": 20, "trials": 20, "against_direct": of}
        | {x: {"median": 1.0} for x in names[1:]}
        for name, of in pairs
    ]
    said = answer(read_meet_study(Path("meet")), rows)
    assert said[0] == (
        "belt, targets met: the map (20 of 20) is better than a (20 of 20); worse than b (20 of "
        "20); not told apart from c (20 of 20)."
    )
    assert said[1].startswith("belt, error at the grasp [mm]: the map (1) is better than a (1);")
