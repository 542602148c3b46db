"""The command line from outside: exit status, one line on stderr, JSON alone on stdout."""

import json
import os
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import pytest

import mitt
from mitt.cli.main import main
from mitt.core.map.learn import Learned
from mitt.io.maps import save_map
from mitt.lab.report.run_page import Blocks
from mitt.lab.trials.batting import BatRunner
from mitt.lab.trials.meeting import MeetRunner
from mitt.lab.trials.runner import TrialRunner

TOP = {
    "schema",
    "version",
    "arm",
    "limits",
    "generator",
    "vision",
    "seed",
    "scene",
    "trials",
    "summary",
}
TRIAL = {
    "index",
    "status",
    "t_catch_s",
    "position_error_mm",
    "velocity_error_m_s",
    "peak_torque_ratio",
    "peak_speed_ratio",
    "limit_violations",
    "demand_cost",
    "peak_contact_force_n",
    "binding_limit",
}
#: What a trial says beyond the contract of docs/notation.md.
BEYOND = {
    "saturated_ticks",
    "range_excess_rad",
    "effort_s",
    "jerk_rad_s3",
    "rms_torque_ratio",
    "certificate",
    "certificate_last",
    "stopped_by",
    "over_force",
}
SUMMARY = {
    "throws",
    "caught",
    "dropped",
    "missed",
    "unreachable",
    "stopped",
    "aborted",
    "catch_rate",
    "ci95",
    "tick_us",
    "deadline_misses",
    "force_n",
    "over_force",
}
#: Of a file: longer than a name may be.
LONG = "a" * 300
STATUSES = {"caught", "dropped", "missed", "unreachable", "stopped", "aborted"}

THROWS = "x,y,z,vx,vy,vz\n"
FLIGHTS = "flight,t_s,x_m,y_m,z_m\n"
GOOD_THROW = "3.5,0.1,0.2,-6,0,1.5\n"

Call = Callable[..., tuple[int, str, str]]


@pytest.fixture
def call(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> Iterator[Call]:
    """Run a command in this process; return exit status, stdout and stderr."""
    monkeypatch.setattr("mitt.lab.report.outputs.blocks_of", lambda *_: Blocks())
    before = signal.getsignal(signal.SIGTERM)

    def run(*words: str | Path) -> tuple[int, str, str]:
        status = main([str(word) for word in words])
        out, err = capsys.readouterr()
        return status, out, err

    yield run
    signal.signal(signal.SIGTERM, before)


@pytest.fixture(scope="module")
def a_map(tmp_path_factory: pytest.TempPathFactory, learned: Learned) -> Path:
    """A learned map, so that runs need not learn."""
    path = tmp_path_factory.mktemp("map") / "map.json"
    save_map(path, learned, version="0.1.0")
    return path


def process(words: Sequence[str | Path], cwd: Path) -> subprocess.CompletedProcess[str]:
    """Run Python with some words as a process of its own."""
    return subprocess.run(
        [sys.executable, *map(str, words)],
        cwd=cwd,
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )


def one_line(err: str) -> str:
    """Return what was said, which must be one line that is no traceback."""
    lines = [line for line in err.splitlines() if line.strip()]
    assert len(lines) == 1, err
    assert lines[0].startswith("mitt: ")
    assert "Traceback" not in err
    return lines[0]


def check_contract(result: dict[str, Any], throws: int, *, incomplete: bool = False) -> None:
    """Hold a result to the contract ``mitt.catch/1``, key by key and type by type."""
    assert set(result) == TOP | ({"incomplete"} if incomplete else set())
    assert result["schema"] == "mitt.catch/1"
    assert len(result["trials"]) == result["summary"]["throws"] == throws
    summary = result["summary"]
    assert set(summary) == SUMMARY
    assert set(summary["tick_us"]) == {"p50", "p99", "p99_9", "max"}
    assert sum(summary[status] for status in STATUSES) == throws
    low, high = summary["ci95"]
    assert 0.0 <= low <= summary["catch_rate"] <= high <= 1.0
    assert isinstance(summary["deadline_misses"], int)
    for index, trial in enumerate(result["trials"]):
        assert set(trial) - BEYOND == TRIAL
        assert trial["index"] == index
        assert trial["status"] in STATUSES
        assert isinstance(trial["limit_violations"], int)
        assert isinstance(trial["demand_cost"], float)
        assert len(trial["peak_torque_ratio"]) == len(trial["peak_speed_ratio"]) == 3
        for key in ("t_catch_s", "position_error_mm", "velocity_error_m_s", "peak_contact_force_n"):
            assert trial[key] is None or isinstance(trial[key], float)
        assert trial["binding_limit"] is None or isinstance(trial["binding_limit"], str)


def test_catch_prints_and_writes_the_contract(call: Call, a_map: Path, tmp_path: Path) -> None:
    """--json is the file, and holds the contract; alike in any process: tests/test_bare.py."""
    status, out, _ = call(
        "catch",
        "--throws",
        "2",
        "--seed",
        "3",
        "--vision",
        "points",
        "--map",
        a_map,
        "--json",
        "--out",
        tmp_path / "a",
    )
    first = json.loads(out)
    assert status == 0
    check_contract(first, 2)
    assert json.loads((tmp_path / "a" / "result.json").read_text()) == first


def test_an_unreachable_throw_is_a_result_not_a_failure(
    call: Call, a_map: Path, tmp_path: Path
) -> None:
    """Exit status 0, the status and the limit that forbids it, null where nothing was touched."""
    path = tmp_path / "far.csv"
    path.write_text(THROWS + "3.5,4,0.2,-6,0,1.5\n")
    status, out, _ = call(
        "catch",
        "--throws-file",
        path,
        "--map",
        a_map,
        "--vision",
        "points",
        "--json",
        "--out",
        tmp_path / "o",
    )
    assert status == 0
    result = json.loads(out)
    check_contract(result, 1)
    trial = result["trials"][0]
    assert (trial["status"], trial["binding_limit"]) == ("unreachable", "domain")
    assert trial["position_error_mm"] is None


def test_without_json_a_table_is_shown(call: Call, a_map: Path, tmp_path: Path) -> None:
    """People read a table with each throw and the rate with its interval."""
    status, out, _ = call(
        "catch",
        "--throws",
        "1",
        "--vision",
        "points",
        "--map",
        a_map,
        "--record",
        "none",
        "--out",
        tmp_path / "o",
    )
    assert status == 0
    assert "caught 1 of 1: 100.0 %" in out
    assert str(tmp_path / "o" / "report.html") in out.replace("\n", "")


def test_learn_writes_a_map_that_catch_takes(call: Call, tmp_path: Path) -> None:
    """Learning with --json lists the cost at each step; its map passes catch --check."""
    path = tmp_path / "map.json"
    status, out, _ = call("learn", "--flights", "12", "--out", path, "--json")
    learned = json.loads(out)
    assert status == 0
    assert learned["schema"] == "mitt.learn/1"
    assert len(learned["cost_torque"]) == len(learned["cost_speed"]) > 2
    assert call("catch", "--map", path, "--check", "--out", tmp_path / "o")[0] == 0
    status, _, err = call("learn", "--flights", "12", "--out", path)
    assert status == 2
    assert "--overwrite" in one_line(err)


def test_check_writes_nothing(
    call: Call, a_map: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """--check says on stderr that the input is good; stdout and the folder stay empty."""
    folder = tmp_path / "here"
    folder.mkdir()
    monkeypatch.chdir(folder)
    for words in (("catch", "--map", a_map), ("catch",), ("learn", "--out", "new.json")):
        status, out, err = call(*words, "--check")
        assert (status, out) == (0, "")
        assert "good" in one_line(err)
    assert not list(folder.iterdir())


def test_the_version_is_said(call: Call) -> None:
    """One line on stdout."""
    assert call("--version") == (0, f"{mitt.__version__}\n", "")


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["fly"], "fly"),
        (["catch", "--fast"], "--fast"),
        (["catch", "--throws", "many"], "--throws"),
        (["catch", "--throws", "2.5"], "--throws"),
        (["catch", "--throws"], "--throws"),
        (["catch", "--throws", "0"], "--throws"),
        (["catch", "--throws", "-3"], "--throws"),
        (["catch", "--throws", "1000000000"], "--throws"),
        (["catch", "--throws", "-1"], "--throws"),
        (["catch", "--seed", "-1"], "--seed"),
        (["catch", "--seed", str(2**63)], "--seed"),
        (["catch", "--seed", "99999999999999999999999"], "--seed"),
        (["catch", "--generator", "magic"], "magic"),
        (["catch", "--limits", "strong"], "strong"),
        (["catch", "--vision", "x-ray"], "x-ray"),
        (["catch", "--record", "some"], "some"),
        (["catch", "--arm", "kuka"], "kuka"),
        (["catch", "--arm", "kuka.urdf"], "kuka.urdf"),
        (["catch", "--arm", "none.urdf", "--tip", "t", "--joints", "a,b,c"], "none.urdf"),
        (["catch", "--tip", "t"], "tip"),
        (["catch", "--catch-joint", "7"], "--catch-joint"),
        (["catch", "--q-catch", "9"], "--q-catch"),
        (["catch", "--q-catch", "nan"], "--q-catch"),
        (["catch", "--kappa", "0"], "kappa"),
        (["catch", "--kappa", "nan"], "kappa"),
        (["catch", "--order", "1"], "--order"),
        (["catch", "--order", "1000"], "--order"),
        (["catch", "--map", "no.json"], "no.json"),
        (["catch", "--scene", "no.toml"], "no.toml"),
        (["catch", "--throws-file", "no.csv"], "no.csv"),
        (["catch", "--flights", "no.csv"], "no.csv"),
        (["catch", "--throws-file", "a", "--flights", "b"], "one of them"),
        (["learn"], "--out"),
        (["learn", "--out", "m.json", "--flights", "0"], "--flights"),
        (["learn", "--out", "m.json", "--seed", "-1"], "--seed"),
    ],
)
def test_bad_options_end_with_status_2_and_one_line(
    call: Call, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, words: list[str], said: str
) -> None:
    """The line names what was wrong; nothing reaches stdout, nothing is written."""
    monkeypatch.chdir(tmp_path)
    status, out, err = call(*words, *(["--check"] if len(words) > 1 else []))
    assert (status, out) == (2, ""), err
    assert said in one_line(err)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    "words",
    [
        ("learn", "--out", LONG),
        ("catch", "--out", LONG),
        ("report", LONG),
        ("view", LONG),
        ("replay", LONG),
        ("track", "no.csv", "--out", LONG),
        ("study", "smoke", "--out", LONG),
    ],
)
def test_a_name_that_no_file_can_have_is_bad_input(
    call: Call, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, words: tuple[str, ...]
) -> None:
    """Whichever command is given it: the system's own word is no fault of ours."""
    monkeypatch.chdir(tmp_path)
    status, out, err = call(*words)
    assert (status, out) == (2, ""), err
    assert "fault of mitt" not in one_line(err)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("option", "text", "said"),
    [
        ("--throws-file", "", "columns x,y,z,vx,vy,vz"),
        ("--throws-file", THROWS, "at least one throw"),
        ("--throws-file", THROWS + "nan,0,0,-6,0,1\n", "line 2 column x"),
        ("--throws-file", THROWS + GOOD_THROW + "3,0,0,-6,0,inf\n", "line 3 column vz"),
        ("--throws-file", "x_m,y_m,z_m,vx,vy,vz\n" + GOOD_THROW, "x_m"),
        ("--throws-file", "x,y,z,vx_m_s,vy,vz\n" + GOOD_THROW, "vx_m_s"),
        ("--throws-file", THROWS + "3,0,0,-6,0\n", "line 2"),
        ("--throws-file", THROWS + "3,0,0,-6,0,fast\n", "line 2 column vz"),
        ("--throws-file", THROWS + "1e9,0,0,-6,0,1\n", "column x"),
        ("--throws-file", "\0\0", "NUL"),
        ("--flights", "", "flight,t_s"),
        ("--flights", FLIGHTS, "at least one flight"),
        ("--flights", "flight,t,x,y,z\n1,0,0,0,0\n", "flight,t,x,y,z"),
        ("--flights", FLIGHTS + "1,0,0,0,0\n1,0,1,0,0\n", "line 3 column t_s"),
        ("--flights", FLIGHTS + "1,0,0,0,0\n", "at least 10 samples"),
        ("--flights", FLIGHTS + "1,0,nan,0,0\n", "at least 10 samples, got 0"),
        ("--flights", FLIGHTS + "1,0,inf,0,0\n", "line 2 column x_m"),
        ("--scene", "[ball]\nmass = -0.07\n", "ball.mass"),
        ("--scene", "[ball]\nmass = nan\n", "ball.mass"),
        ("--scene", "[ball]\nmass = '70 g'\n", "ball.mass"),
        ("--scene", "[ball]\nweight = 0.07\n", "weight"),
        ("--scene", "gravity = 9.81\n", "gravity"),
        ("--scene", "[ball\n", "TOML"),
        ("--scene", "[ball]\nmass = 1\n[ball]\nmass = 1\n", "TOML"),
        ("--scene", "floor = true\n", "floor"),
        ("--map", "", "JSON"),
        ("--map", "{}", "key"),
        ("--map", '{"schema": "mitt.map/1"', "JSON"),
        ("--map", "[" * 200_000, "JSON"),
    ],
)
def test_bad_files_end_with_status_2_and_one_line(
    call: Call, tmp_path: Path, option: str, text: str, said: str
) -> None:
    """Empty, NaN, wrong units in the header, unknown keys, cut short: file and place are named."""
    path = tmp_path / "given"
    path.write_text(text)
    status, out, err = call("catch", option, path, "--out", tmp_path / "out")
    assert (status, out) == (2, ""), err
    line = one_line(err)
    assert said in line
    assert str(path) in line
    assert not (tmp_path / "out").exists()


def test_maps_cut_altered_or_of_other_limits_are_refused(
    call: Call, a_map: Path, tmp_path: Path
) -> None:
    """Each with its own reason: incomplete JSON, the checksum, the limit set."""
    text = a_map.read_text()
    path = tmp_path / "map.json"
    path.write_text(text[: len(text) // 2])
    status, _, err = call("catch", "--map", path, "--check")
    assert status == 2
    assert "complete JSON" in one_line(err)
    content = json.loads(text)
    content["alpha"][0][0] += 1.0
    path.write_text(json.dumps(content))
    status, _, err = call("catch", "--map", path, "--check")
    assert status == 2
    assert "checksum" in one_line(err)
    status, _, err = call("catch", "--map", a_map, "--limits", "wam-48v", "--check")
    assert status == 2
    assert "wam-48v" in one_line(err)


def test_a_folder_in_use_is_refused_until_overwrite_is_said(
    call: Call, a_map: Path, tmp_path: Path
) -> None:
    """Refused before anything runs; with --overwrite it is used, and strangers stay."""
    out = tmp_path / "out"
    out.mkdir()
    (out / "mine.txt").write_text("mine")
    words = [
        "catch",
        "--throws",
        "1",
        "--vision",
        "points",
        "--map",
        a_map,
        "--record",
        "none",
        "--out",
        out,
    ]
    status, _, err = call(*words)
    assert status == 2
    assert "--overwrite" in one_line(err)
    assert [path.name for path in out.iterdir()] == ["mine.txt"]
    assert call(*words, "--overwrite")[0] == 0
    assert (out / "mine.txt").read_text() == "mine"
    assert (out / "result.json").exists()


@pytest.mark.parametrize("place", ["file", "file/below", "/proc/mitt", "/dev/null"])
def test_a_folder_that_cannot_be_written_is_bad_input(
    call: Call, a_map: Path, tmp_path: Path, place: str
) -> None:
    """A file in its place, a path below a file, a system's own folder: status 2, one line."""
    (tmp_path / "file").write_text("")
    status, out, err = call(
        "catch", "--throws", "1", "--vision", "points", "--map", a_map, "--out", tmp_path / place
    )
    assert (status, out) == (2, ""), err
    one_line(err)


@pytest.mark.parametrize("place", ["file/below.json", "/proc/mitt.json"])
def test_a_map_that_cannot_be_written_is_bad_input(call: Call, tmp_path: Path, place: str) -> None:
    """The same for mitt learn."""
    (tmp_path / "file").write_text("")
    status, out, err = call("learn", "--flights", "8", "--out", tmp_path / place)
    assert (status, out) == (2, ""), err
    one_line(err)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("runner", "method", "words"),
    [
        (TrialRunner, "throw", ["catch", "--throws", "6", "--vision", "points"]),
        (BatRunner, "trial", ["bat", "--throws", "6", "--vision", "points"]),
        pytest.param(MeetRunner, "trial", ["meet", "--trials", "6"], marks=pytest.mark.thorough),
    ],
    ids=["catch", "bat", "meet"],
)
def test_a_signal_keeps_what_is_finished(
    call: Call,
    runner: type,
    method: str,
    words: list[str],
    a_map: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """One of six done: it is printed and written, the last line says where, and the status."""
    inner = getattr(runner, method)

    def signalled(*given: object, **how: object) -> object:
        if given[-1] == 1:
            os.kill(os.getpid(), signal.SIGINT)
        return inner(*given, **how)

    monkeypatch.setattr(runner, method, signalled)
    monkeypatch.chdir(tmp_path)
    own = ["--map", a_map] if words[0] == "catch" else []
    status, out, err = call(*words, *own, "--record", "none", "--json", "--out", "out")
    assert status == 130, err
    result = json.loads((tmp_path / "out" / "result.json").read_text())
    assert result["schema"] == f"mitt.{words[0]}/1"
    assert [trial["index"] for trial in result["trials"]] == [0]
    if words[0] == "catch":
        check_contract(result, 1, incomplete=True)
    assert json.loads(out) == result
    kept = Path("out", "result.json")
    assert err.splitlines()[-1] == (
        f"mitt: interrupted by SIGINT; 1 of 6 trials are kept in {kept}"
    )
    assert not (tmp_path / "out" / "report.html").exists()
    assert "Traceback" not in err


def test_a_fault_of_ours_is_one_line_with_status_1(
    call: Call, monkeypatch: pytest.MonkeyPatch
) -> None:
    """An unforeseen exception: no traceback, its type and text, and how to see more."""

    def break_down(_job: object) -> None:
        raise ZeroDivisionError("two\nlines")

    monkeypatch.delenv("MITT_TRACEBACK", raising=False)
    monkeypatch.setattr("mitt.cli.catching._prepared", break_down)
    status, out, err = call("catch")
    assert (status, out) == (1, "")
    line = one_line(err)
    assert "ZeroDivisionError: two lines" in line
    assert "MITT_TRACEBACK" in line


@pytest.mark.parametrize("words", [("--help",), ("catch", "--help"), ("learn", "--help")])
def test_help_is_light(words: tuple[str, ...], tmp_path: Path) -> None:
    """Help names its options on stdout with status 0, without loading NumPy or a simulator."""
    code = (
        "import sys; from mitt.cli.main import main\n"
        f"try: status = main({list(words)!r})\n"
        "except SystemExit as leave: status = leave.code\n"
        "print([x for x in ('numpy', 'mujoco', 'numba', 'pinocchio', 'matplotlib', 'viser')"
        " if x in sys.modules], status)"
    )
    done = process(["-c", code], tmp_path)
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines()[-1] in ("[] 0", "[] None")
    assert "usage: mitt" in done.stdout
    assert done.stderr == ""


@pytest.mark.parametrize("given", [None, "3"])
def test_linear_algebra_has_one_thread_unless_a_user_says_else(
    given: str | None, tmp_path: Path
) -> None:
    """Said before NumPy is loaded, so that processes that are started inherit it."""
    code = (
        "import os, sys; from mitt.cli.main import main\n"
        "sys.argv = ['mitt', '--version']\n"
        f"given = {given!r}\n"
        "os.environ.pop('OPENBLAS_NUM_THREADS', None)\n"
        "if given: os.environ['OPENBLAS_NUM_THREADS'] = given\n"
        "early = 'numpy' not in sys.modules\n"
        "try: main()\n"
        "except SystemExit: pass\n"
        "print(early, os.environ['OPENBLAS_NUM_THREADS'])"
    )
    done = process(["-c", code], tmp_path)
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines()[-1] == f"True {given or 1}"


def test_a_closed_pipe_is_no_fault(a_map: Path, tmp_path: Path) -> None:
    """``mitt catch --json | head -c 0``: no traceback, not status 1."""
    script = f"{sys.executable} -m mitt --help | head -c 1 >/dev/null; exit ${{PIPESTATUS[0]}}"
    done = subprocess.run(
        ["bash", "-c", script],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    assert done.returncode in (0, 141)
    assert "Traceback" not in done.stderr
    assert a_map.exists()


@pytest.mark.parametrize(
    ("words", "status", "said"),
    [
        ("--version | head -0", (0, 141), ""),
        ("--help | head -1", (0, 141), "usage"),
        ("--version >/dev/full", (2,), "No space left"),
        ("--help >/dev/full", (2,), "No space left"),
        ("--version 2>&-", (0,), mitt.__version__),
        ("catch --throws 0 2>&-", (2,), ""),
        ("catch --throws 0 2>/dev/full", (2,), ""),
        ("--version >&-", (0,), ""),
    ],
)
def test_streams_that_are_closed_or_full_are_answered_as_other_commands_do(
    tmp_path: Path, words: str, status: tuple[int, ...], said: str
) -> None:
    """The right status, at most one line, never a traceback or a complaint of the interpreter."""
    script = f"{sys.executable} -m mitt {words}; exit ${{PIPESTATUS[0]}}"
    done = subprocess.run(
        ["bash", "-c", script],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    assert done.returncode in status, done.stderr
    told = done.stdout + done.stderr
    assert said in told
    assert "Traceback" not in told
    assert "Exception ignored" not in told
    assert len(done.stderr.splitlines()) <= 1
