"""Running a study: every throw once, whatever dies on the way."""

import json
import shutil
from importlib.metadata import EntryPoint
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest
from small_study import TEXT, Here, quiet, ready, thrown_again, write_study

from mitt.core.errors import FileError, InputError
from mitt.core.map.learn import Learned
from mitt.io.writing import locked, write_json
from mitt.lab.trials import registry
from mitt.lab.trials.catch_study import CatchStudy
from mitt.lab.trials.score import CATCH
from mitt.lab.trials.study_folder import Folder
from mitt.lab.trials.study_results import columns_of, read_part
from mitt.lab.trials.study_run import FinishedStudy, all_chunks, run_study

#: What a finished study's folder is compared by.
COMPARED = ("summary.json", "trials.parquet")


@pytest.fixture
def whole(thrown_study: Path) -> Folder:
    """The folder of the small study, thrown in one go."""
    return Folder(thrown_study)


def _run(study: CatchStudy, folder: Folder, engine: Here | None = None) -> FinishedStudy:
    """Run a study here."""
    return run_study(study, folder, engine or Here(), progress=quiet)


def _same(first: Folder, second: Folder) -> bool:
    """Say whether two studies came to the same, byte by byte."""
    return all((first.path / n).read_bytes() == (second.path / n).read_bytes() for n in COMPARED)


def test_every_throw_is_there_once_and_in_order(whole: Folder, study: CatchStudy) -> None:
    table = pq.read_table(whole.trials)
    wanted = [(c.name, g, k) for c in study.conditions for g in study.generators for k in range(2)]
    names = ("condition", "generator", "index")
    assert list(zip(*(table[name].to_pylist() for name in names), strict=True)) == wanted
    assert table.schema.metadata[b"digest"].decode() == study.digest
    assert table.schema.metadata[b"seed"] == b"500"


def test_the_summary_says_what_the_contract_says(whole: Folder) -> None:
    summary = json.loads(whole.summary.read_text())
    assert set(summary) == {"schema", "rows"}
    assert summary["schema"] == "mitt.study/1"
    for row in summary["rows"]:
        assert {"generator", "condition", "throws", "caught", "catch_rate", "ci95"} <= set(row)
        assert row["throws"] == 2
        assert row["complete"]
        assert row["ci95"][0] <= row["catch_rate"] <= row["ci95"][1]


def test_failures_are_recorded_and_no_more_than_asked_for(whole: Folder) -> None:
    rows = json.loads(whole.summary.read_text())["rows"]
    losing = sum(row["caught"] < row["throws"] for row in rows)
    assert len(list(whole.recordings.glob("*.mcap"))) == losing
    assert losing >= 2


def test_a_run_that_was_broken_off_is_finished_with_what_is_missing_and_comes_to_the_same(
    tmp_path: Path, whole: Folder, study: CatchStudy
) -> None:
    """A missing part, a part cut short and one of another study are thrown again, the rest not."""
    folder = Folder(tmp_path / "out")
    shutil.copytree(whole.path, folder.path)
    folder.part(1).unlink()
    folder.part(4).write_bytes(folder.part(4).read_bytes()[:-20])
    shutil.copy(folder.part(0), folder.part(6))
    engine = Here()
    assert _run(study, folder, engine).status == 0
    assert sorted(n for n in engine.done if n >= 0) == [1, 4, 6]
    assert _same(folder, whole)


def test_a_worker_that_dies_once_costs_nothing(tmp_path: Path, whole: Folder) -> None:
    study, folder = thrown_again(whole.path, tmp_path)
    folder.part(3).unlink()
    folder.part(7).unlink()
    engine = Here(lambda number, attempt: number == 3 and attempt == 1)
    finished = _run(study, folder, engine)
    assert sorted(n for n in engine.done if n >= 0) == [3, 7]
    assert finished.status == 0
    assert _same(folder, whole)


def test_a_chunk_that_kills_its_worker_twice_is_left_out_and_the_others_go_on(
    tmp_path: Path, whole: Folder
) -> None:
    """The exit status says so, in one line; the summary marks the cell as not complete."""
    study, folder = thrown_again(whole.path, tmp_path)
    for k in (2, 3, 4):
        folder.part(k).unlink()
    finished = _run(study, folder, Here(lambda number, _: number == 3))
    assert finished.status == 1
    assert len(finished.lost) == 1
    assert "throws 0 to 0 lost" in finished.lost[0]
    assert "\n" not in finished.lost[0]
    assert [row["complete"] for row in finished.rows].count(False) == 1
    assert sum(p.exists() for p in map(folder.part, range(12))) == 11


def test_a_part_says_where_it_comes_from(whole: Folder, study: CatchStudy) -> None:
    rows, notes = read_part(whole.part(0), columns_of(CATCH.trial, CATCH.extra))
    assert [row["index"] for row in rows] == [0]
    assert notes["digest"] == study.digest
    assert notes["version"] == study.version
    assert json.loads(notes["condition"])["name"] == "clean"


def test_a_folder_of_another_study_is_refused(tmp_path: Path, whole: Folder) -> None:
    other = write_study(tmp_path, TEXT.replace("seed = 500", "seed = 501"))
    with pytest.raises(InputError, match="another study"):
        whole.check(other, resume=True)


def test_a_folder_of_another_version_is_refused(
    tmp_path: Path, whole: Folder, study: CatchStudy
) -> None:
    folder = Folder(tmp_path / "out")
    shutil.copytree(whole.path, folder.path)
    manifest = json.loads((folder.path / "study.json").read_text())
    write_json(folder.path / "study.json", manifest | {"version": "0.0.1", "digest": "x"})
    with pytest.raises(InputError, match=r"mitt 0\.0\.1"):
        folder.check(study, resume=True)


def test_a_plug_in_that_was_changed_is_another_study(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its source is part of the study, and whoever goes on is told which one is not as it was."""
    source = tmp_path / "their_planner.py"
    source.write_text("from mitt.lab.rivals.planned import make_quintic as make\n")
    monkeypatch.syspath_prepend(tmp_path)
    point = EntryPoint("theirs", "their_planner:make", registry.GROUP)
    monkeypatch.setattr(registry, "entry_points", lambda **_: (point,))
    text = TEXT.replace('"unoptimised"', '"theirs"')
    study = write_study(tmp_path, text, generators=("direct", "theirs"))
    assert study.plugins.keys() == {"theirs"}
    folder = Folder(tmp_path / "out")
    folder.claim(study, resume=False, overwrite=False)
    folder.check(study, resume=True)
    source.write_text(source.read_text() + "# changed\n")
    changed = write_study(tmp_path, text, generators=("direct", "theirs"))
    with pytest.raises(InputError, match=r"generator .theirs. of sources .*; now sources "):
        folder.check(changed, resume=True)


def test_two_runs_do_not_share_a_folder(tmp_path: Path) -> None:
    out = tmp_path / "out"
    with locked(out), pytest.raises(InputError, match="one is running"), locked(out):
        pass
    with locked(out):
        pass


def test_leavings_of_a_killed_run_are_swept_away(tmp_path: Path, study: CatchStudy) -> None:
    folder = Folder(tmp_path / "out")
    folder.claim(study, resume=True, overwrite=False)
    left = folder.path / "parts" / ".part-000001.parquet.a1b2c3d4"
    left.write_text("half")
    folder.claim(study, resume=True, overwrite=False)
    assert not left.exists()


FLIGHT = "flight,t_s,x_m,y_m,z_m\n" + "".join(
    f"a,{0.02 * k:.2f},{3.0 - 0.1 * k:.3f},0.0,{0.5 + 0.06 * k - 0.00196 * k * k:.5f}\n"
    for k in range(30)
)
BY_FLIGHTS = """
name = "flights"
throws = 1
generators = ["direct"]
vision = "points"

[[conditions]]
name = "mine"
flights = "mine.csv"
"""


def test_a_study_is_known_by_what_its_flights_hold_not_by_where_they_lie(
    tmp_path: Path, learned: Learned
) -> None:
    """Study and table moved elsewhere: it goes on, and its folder needs the table no more."""
    first, second = tmp_path / "first", tmp_path / "second"
    for place in (first, second):
        place.mkdir()
        (place / "mine.csv").write_text(FLIGHT)
    study, moved = (write_study(place, BY_FLIGHTS) for place in (first, second))
    assert study.digest == moved.digest
    (second / "mine.csv").write_text(FLIGHT.replace("0.50000", "0.51000"))
    assert write_study(second, BY_FLIGHTS).digest != study.digest
    folder = ready(tmp_path / "out", study, learned)
    jobs = list(all_chunks(study, folder, quiet))
    (first / "mine.csv").unlink()
    folder.check(moved, resume=True)
    for again in (study, moved):
        assert [len(job.material.recordings) for job in all_chunks(again, folder, quiet)] == [1]
    (job,) = all_chunks(moved, folder, quiet)
    assert np.array_equal(jobs[0].material.recordings[0].r, job.material.recordings[0].r)
    kept = next((folder.path / "flights").iterdir())
    kept.write_text(FLIGHT + " ")
    with pytest.raises(FileError, match="the flights that the study was made with"):
        list(all_chunks(study, folder, quiet))
