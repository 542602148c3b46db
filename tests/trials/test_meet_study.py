"""Studies of meetings: what they write, what they say, what they refuse."""

import json
from pathlib import Path
from typing import Any

import pyarrow.parquet as pq
import pytest
from small_study import Here, quiet, written

from mitt.core.errors import InputError, UnknownNameError
from mitt.lab.report.study_page import write_study_page
from mitt.lab.trials.meet_study import read_meet_study
from mitt.lab.trials.study_folder import Folder, task_of_folder
from mitt.lab.trials.study_results import read_result
from mitt.lab.trials.study_run import all_chunks, run_study
from mitt.lab.trials.tasks import read_study

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
    assert run_study(study, folder, engine, progress=quiet).status == 0
    assert task_of_folder(folder.path) == "meet"
    table = pq.read_table(folder.trials).to_pylist()
    assert [row["generator"] for row in table] == ["direct", "line"]
    for row in table:
        assert (row["status"], row["limit_violations"]) == ("met", 0)
        assert row["position_error_mm"] < 5.0
    summary = json.loads(folder.summary.read_text())
    assert [row["met"] for row in summary["rows"]] == [1, 1]
    assert summary["answer"][0].startswith("belt, targets met: the map (1 of 1) is not told apart")
    again = run_study(study, folder, engine, progress=quiet)
    assert again.rows == summary["rows"]
    assert len(engine.done) == len(table)
    write_study_page(read_result(folder), replays=1, progress=quiet)
    page = (folder.path / "report.html").read_text()
    assert summary["answer"][0] in page


def test_planners_have_their_rates_and_encoders_their_belts(tmp_path: Path) -> None:
    """In the study that ships."""
    assert read_study(Path("meet")).kind.name == "meet"
    assert read_study(Path("smoke")).kind.name == "catch"
    chunks = all_chunks(read_meet_study(Path("meet")), Folder(tmp_path), quiet)
    cells = {chunk.place for chunk in chunks}
    assert ("mpc 1000 Hz", "hand") in cells
    assert ("line-compensated", "belt 1 m/s") in cells
    assert ("line", "hand") not in cells


SWEEP = """
[[sweeps]]
name = "latency"
unit = "ms"
set = "scene.sensing.latency"
values = [0, 20]
target = "belt"
speed = 0.3
"""


def test_a_sweep_is_a_condition_a_value_as_in_studies_of_throws(tmp_path: Path) -> None:
    """Under the settings of the study; the key of another task is refused, and so is no place."""
    study = read_study(written(tmp_path, TEXT + SWEEP))
    swept = [c for c in study.conditions if c.value is not None]
    assert [(c.name, c.disturbance, c.value) for c in swept] == [
        ("latency 0 ms", "latency", 0.0),
        ("latency 20 ms", "latency", 20.0),
    ]
    assert [c.scene.sensing.latency for c in swept] == [0, 20]
    assert {c.scene.sensing.frame_rate for c in study.conditions} == {100.0}
    assert {tuple(c.counts.items()) for c in study.conditions} == {(("direct", 1), ("line", 1))}
    for wrong in ('vision = "points"', "scene = 3", 'generators = ["ik"]'):
        with pytest.raises(InputError, match="latency"):
            read_study(written(tmp_path, TEXT + SWEEP + wrong))


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
    names = ("error_mm", "velocity_m_s", "acceleration", "force_n", "in_sync_s")

    def pair(direct: int, this: int, p: float) -> dict[str, Any]:
        measured = {x: {"direct": direct, "this": this, "p_holm": p} for x in names}
        return {"only_direct": direct, "only_this": this, "p_holm": p} | measured

    pairs = [
        ("direct", None),
        ("a", pair(20, 0, 1e-4)),
        ("b", pair(0, 20, 1e-4)),
        ("c", pair(3, 2, 1.0)),
    ]
    rows = [
        {"condition": "belt", "generator": name, "met": 20, "trials": 20, "against_direct": of}
        | {x: {"median": 1.0} for x in names}
        for name, of in pairs
    ]
    said = read_meet_study(Path("meet")).answer(rows)
    assert said[0] == (
        "belt, targets met: the map (20 of 20) is better than a (20 of 20); worse than b (20 of "
        "20); not told apart from c (20 of 20)."
    )
    assert said[1].startswith("belt, error at the grasp [mm]: the map (1) is better than a (1);")
