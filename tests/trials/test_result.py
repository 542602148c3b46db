"""Throws kept as they end: what a process that dies leaves, and how it is read back."""

import json
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import pytest
from support import thorough

from mitt.cli.main import main
from mitt.clock import Stopwatch
from mitt.core.errors import FileError, InputError
from mitt.core.map.learn import Learned
from mitt.io.maps import save_map
from mitt.io.writing import LOCK, locked
from mitt.lab.report.run_page import Blocks
from mitt.lab.trials.journal import Journal, died, read_kept
from mitt.lab.trials.result import result
from mitt.lab.trials.score import CATCH, Trial
from mitt.lab.trials.scored_task import NAME, PAGE, RESULT

HEAD = {"version": "0", "arm": "wam", "seed": 3}
#: How long a process may go on after a signal [s]: a second is promised, on a machine of its own.
SOON = 6.0


def trial(index: int) -> Trial:
    """Return a caught throw."""
    return Trial(
        index=index,
        status="caught",
        t_catch_s=0.5,
        position_error_mm=2.5,
        velocity_error_m_s=0.1,
        peak_torque_ratio=[0.5, 0.6],
        peak_speed_ratio=[0.1, 0.2],
        limit_violations=0,
        demand_cost=0.3,
        peak_contact_force_n=80.0,
        binding_limit="torque:j2",
        saturated_ticks=0,
        range_excess_rad=0.0,
        rms_torque_ratio=[0.0, 0.0],
        certificate={"outcome": "feasible", "margin": 0.2},
    )


@pytest.fixture(scope="module")
def a_map(tmp_path_factory: pytest.TempPathFactory, learned: Learned) -> Path:
    """A learned map, so that runs need not learn."""
    path = tmp_path_factory.mktemp("map") / "map.json"
    save_map(path, learned, version="0.1.0")
    return path


@contextmanager
def started(a_map: Path, out: Path, *words: str) -> "Iterator[subprocess.Popen[str]]":
    """Start a long run as a process, and see to its end."""
    process = subprocess.Popen(
        [
            sys.executable,
            "-m",
            "mitt",
            "catch",
            "--throws",
            "2000",
            "--vision",
            "points",
            "--map",
            str(a_map),
            "--record",
            "none",
            "--out",
            str(out),
            *words,
        ],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    try:
        yield process
    finally:
        process.kill()
        process.wait()


def until_lines(path: Path, count: int) -> None:
    """Wait until a file has so many lines; the kernels may have to be compiled first."""
    for _ in range(12_000):
        if path.exists() and path.read_bytes().count(b"\n") >= count:
            return
        time.sleep(0.05)
    raise AssertionError(f"{path} stays short")


def test_what_is_kept_comes_back_as_the_result_of_the_same_throws(tmp_path: Path) -> None:
    """Whole lines only: of a line that breaks off nothing is taken, and all before it stays."""
    with Journal(tmp_path, CATCH, dict(HEAD), 5) as journal:
        for k in range(3):
            journal.add(trial(k))
    assert died(tmp_path)
    wanted = result(CATCH, [trial(k) for k in range(3)], Stopwatch(), dict(HEAD), 5)
    assert read_kept(tmp_path).result == wanted
    assert wanted["incomplete"] is True
    whole = (tmp_path / NAME).read_bytes()
    last = whole.rstrip(b"\n").rfind(b"\n") + 1
    for cut in (last, last + 1, len(whole) - 2, len(whole) - 1):
        (tmp_path / NAME).write_bytes(whole[:cut])
        assert [t["index"] for t in read_kept(tmp_path).result["trials"]] == [0, 1]


def test_each_throw_is_on_disk_as_soon_as_it_is_kept(tmp_path: Path) -> None:
    """Nothing waits in a buffer for the next one."""
    with Journal(tmp_path, CATCH, dict(HEAD), 2) as journal:
        for k in range(2):
            journal.add(trial(k))
            assert len((tmp_path / NAME).read_text().splitlines()) == k + 2


def test_numbers_that_are_not_finite_are_null(tmp_path: Path) -> None:
    """NaN and infinity are no JSON: neither in the list of throws nor in the result."""
    odd = replace(trial(0), demand_cost=float("nan"), peak_torque_ratio=[float("inf"), 1.0])
    with Journal(tmp_path, CATCH, dict(HEAD), 1) as journal:
        journal.add(odd)
        journal.last_words()
    for name in (NAME, RESULT):
        assert "NaN" not in (tmp_path / name).read_text()
        assert "Infinity" not in (tmp_path / name).read_text()
    read = json.loads((tmp_path / RESULT).read_text())["trials"][0]
    assert read["demand_cost"] is None
    assert read["peak_torque_ratio"] == [None, 1.0]


@pytest.mark.parametrize("text", ["", "{}\n", "[]\n", '{"schema": "mitt.catch/1"}\n', "\0\n"])
def test_what_is_no_list_of_throws_is_refused(tmp_path: Path, text: str) -> None:
    """Empty, another schema, no JSON: one line that names the file."""
    (tmp_path / NAME).write_text(text)
    with pytest.raises(FileError, match=NAME):
        read_kept(tmp_path)


def test_a_folder_in_which_a_run_is_under_way_is_refused(
    a_map: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The second run ends at once with one line and status 2, and touches nothing."""
    with locked(tmp_path):
        words = ["catch", "--throws", "1", "--map", str(a_map), "--out", str(tmp_path)]
        assert main(words) == 2
        with pytest.raises(InputError, match="where one is running"), locked(tmp_path):
            pass
    err = capsys.readouterr().err
    assert err.count("\n") == 1
    assert "where one is running" in err
    assert [path.name for path in tmp_path.iterdir()] == [LOCK]


@pytest.mark.slow
def test_kill_9_loses_at_most_the_throw_under_way(
    a_map: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Killed at any moment: all throws up to the last are there, and mitt report reads them."""
    monkeypatch.setattr("mitt.lab.report.outputs.blocks_of", lambda *_: Blocks())
    with started(a_map, tmp_path):
        until_lines(tmp_path / NAME, 3)
    lines = (tmp_path / NAME).read_bytes().count(b"\n") - 1
    assert main(["report", str(tmp_path), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["report"] == str(tmp_path / PAGE)
    found = json.loads((tmp_path / RESULT).read_text())
    assert found["incomplete"] is True
    assert [t["index"] for t in found["trials"]] == list(range(lines))


@pytest.mark.thorough
@pytest.mark.slow
@pytest.mark.parametrize(
    ("number", "status"), thorough([(signal.SIGTERM, 143)], [(signal.SIGHUP, 129)])
)
def test_a_signal_ends_a_run_at_once_and_keeps_its_throws(
    a_map: Path, tmp_path: Path, number: signal.Signals, status: int
) -> None:
    """One line that names the signal, the status of the signal, a result that says incomplete."""
    with started(a_map, tmp_path / "out", "--json") as process:
        until_lines(tmp_path / "out" / NAME, 3)
        process.send_signal(number)
        sent = time.monotonic()
        out, err = process.communicate(timeout=60)
        assert time.monotonic() - sent < SOON
    assert process.returncode == status
    lines = [
        line for line in err.splitlines() if "min left" not in line and "compiling" not in line
    ]
    assert len(lines) == 1, err
    assert number.name in lines[0]
    found = json.loads((tmp_path / "out" / RESULT).read_text())
    if out:  # nothing where the other thread had to end a process that did not get to it
        assert found == json.loads(out)
    assert found["incomplete"] is True
    assert found["summary"]["throws"] == len(found["trials"]) >= 2
