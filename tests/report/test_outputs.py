"""What a run leaves in its folder: the result as the contract says, and no strangers touched."""

import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import pytest

from mitt.cli.catching import prepare_run
from mitt.cli.options import CatchOptions
from mitt.clock import Stopwatch
from mitt.core.errors import InputError, MittError
from mitt.core.map.learn import Learned
from mitt.io.maps import read_map, save_map
from mitt.lab.report.outputs import write_page
from mitt.lab.report.run_page import Blocks
from mitt.lab.trials.journal import read_kept
from mitt.lab.trials.result import result
from mitt.lab.trials.runs import Prepared, ThrownBalls
from mitt.lab.trials.score import CATCH, MAP, STATUSES, Trial
from mitt.lab.trials.scored_task import NAME, PAGE, RESULT
from mitt.lab.trials.statistics import wilson
from mitt.lab.trials.task_run import FinishedRun, keeping, run_trials, write_result

HEAD: dict[str, object] = {"version": "0", "arm": "wam"}


def quiet(_name: str, _done: int, _of: int) -> None:
    """Report nothing."""


@pytest.fixture(scope="module")
def prepared(tmp_path_factory: pytest.TempPathFactory, learned: Learned) -> Prepared:
    """A run of two throws."""
    place = tmp_path_factory.mktemp("thrown")
    save_map(place / "map.json", learned, version="0.1.0")
    job = CatchOptions(throws=2, seed=5, map=place / "map.json", vision="points", out=place / "out")
    return prepare_run(job)


@pytest.fixture
def here(prepared: Prepared, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Prepared:
    """That run in a folder of the test's own; its report is not drawn."""
    monkeypatch.setattr("mitt.lab.report.outputs.blocks_of", lambda *_: Blocks())
    return replace(prepared, out=tmp_path / "out")


def whole(run: Prepared) -> FinishedRun:
    """Run it and write all that it leaves."""
    finished = run_trials(run, progress=quiet)
    write_page(finished, write_result(finished), progress=quiet)
    return finished


def trial(index: int, status: str) -> Trial:
    """Return a trial with a status."""
    return Trial(
        index=index,
        status=status,
        t_catch_s=None,
        position_error_mm=None,
        velocity_error_m_s=None,
        peak_torque_ratio=[0.0],
        peak_speed_ratio=[0.0],
        limit_violations=0,
        demand_cost=0.0,
        peak_contact_force_n=None,
        binding_limit=None,
        saturated_ticks=0,
        range_excess_rad=0.0,
    )


def summary(statuses: Sequence[str]) -> dict[str, object]:
    """Return the summary of trials with some statuses."""
    trials = [trial(k, status) for k, status in enumerate(statuses)]
    out: dict[str, object] = result(CATCH, trials, Stopwatch(), HEAD)["summary"]
    return out


def test_a_run_leaves_result_map_report_and_the_first_recording(here: Prepared) -> None:
    """Exactly those names, and both files read back as what was run."""
    finished, out = whole(here), here.out
    assert {path.name for path in out.iterdir()} == {NAME, RESULT, MAP, PAGE, "recordings"}
    assert json.loads((out / "result.json").read_text()) == finished.result
    again = read_map(out / "map.json", here.arm)
    assert isinstance(finished.runner, ThrownBalls)
    assert (again.map.alpha == finished.runner.learned.map.alpha).all()
    recorded = {path.name for path in (out / "recordings").iterdir()}
    failures = {f"throw-{t.index:05d}.mcap" for t in finished.trials if t.status != "caught"}
    assert recorded == {"throw-00000.mcap"} | failures


@pytest.mark.parametrize(("record", "count"), [("none", 0), ("all", 2)])
def test_recordings_are_as_many_as_asked(here: Prepared, record: str, count: int) -> None:
    """None at all, or each throw."""
    settings = replace(here.settings, record=record)  # type: ignore[arg-type]  # a name
    whole(replace(here, settings=settings))
    assert len(list(here.out.glob("recordings/*.mcap"))) == count


def test_strangers_are_refused_and_with_overwrite_left_alone(here: Prepared) -> None:
    """A folder with files is not used; with --overwrite only what a run wrote is replaced."""
    finished, out = whole(here), here.out
    (out / "recordings" / "old.mcap").write_text("old")
    (out / "notes.txt").write_text("mine")
    with pytest.raises(InputError, match="--overwrite"), keeping(here, finished.runner):
        pass
    settings = replace(here.settings, overwrite=True, record="none")
    with keeping(replace(here, settings=settings), finished.runner) as keep:
        keep(finished.trials[0])
    assert (out / "notes.txt").read_text() == "mine"
    assert [path.name for path in (out / "recordings").iterdir()] == ["old.mcap"]
    assert read_kept(out).result["trials"] == finished.result["trials"][:1]


def test_a_run_without_trials_leaves_a_valid_result(here: Prepared) -> None:
    """Interrupted before its first throw: an empty result, and no page about nothing."""

    def stop(name: str, _done: int, _of: int) -> None:
        if name == "throwing":
            raise KeyboardInterrupt

    finished = run_trials(here, progress=stop)
    write_result(finished)
    assert not finished.whole
    assert json.loads((here.out / "result.json").read_text())["trials"] == []


def test_a_place_that_cannot_be_written_is_an_error_of_ours(here: Prepared) -> None:
    """A path below a file: one line, no OSError."""
    here.out.write_text("")
    with pytest.raises(MittError) as caught:
        run_trials(replace(here, out=here.out / "below"), progress=quiet)
    assert "\n" not in str(caught.value)


def test_the_catch_rate_counts_every_throw() -> None:
    """Caught / throws whatever became of the others, and the Wilson interval over all of them."""
    some = summary(["caught", "stopped", "dropped", "aborted", "missed", "unreachable"])
    assert some["catch_rate"] == 1 / 6
    assert [some[s] for s in ("throws", *STATUSES)] == [6, 1, 1, 1, 1, 1, 1]
    assert some["ci95"] == list(wilson(1, 6))
    stopped = summary(["caught"] * 8 + ["stopped"] * 12)
    assert stopped["catch_rate"] == 8 / 20
    none = summary([])
    assert (none["catch_rate"], none["ci95"]) == (0.0, [0.0, 1.0])
