"""Outputs of all commands: what is the user's stays, also with --overwrite, also on failure."""

import json
import re
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from recorded_trials import CASES, recorded
from small_study import Here
from support import thorough
from throws_on_film import calibrated

from mitt.cli.catching import prepare_run
from mitt.cli.main import main
from mitt.cli.options import COMMANDS, CatchOptions
from mitt.core.map.learn import Learned
from mitt.io.maps import save_map
from mitt.io.rig import write_rig
from mitt.io.writing import file_name
from mitt.lab.report import outputs
from mitt.lab.report.run_page import Blocks
from mitt.lab.trials.batting import BatRunner
from mitt.lab.trials.journal import read_kept
from mitt.lab.trials.meeting import MeetRunner
from mitt.lab.trials.scored_task import NAME, PAGE, RESULT
from mitt.lab.trials.tasks import TASKS

#: The user's own files: names that mean something to one of the commands, and others.
MINE = (
    "notes.txt",
    "maps/notes.txt",
    "flights/mine.csv",
    "recordings/.git/config",
    "parts/x.csv",
    "recordings/session-1.txt",
    "replays/mine.html",
    "report.html.bak",
    ".report.html.swp",
    "arm.toml.old",
    "study.toml",
    "throws.csv",
    "a.csv",
    "image.png",
    ".hidden.json.12",
)
STUDY = """
name = "two"
throws = 1
generators = ["direct"]
vision = "points"
[[conditions]]
name = "clean"
[[conditions]]
name = "blind"
scene.faults = [{ kind = "dropout" }]
"""
THROWS = "x,y,z,vx,vy,vz\n3.5,0.1,0.4,-5.5,0.0,2.0\n"
#: How a recording of ours begins.
MCAP = b"\x89MCAP0\r\n\x01" + bytes(12) + b"ros2" + bytes(4) + b"mitt"
Quick = Callable[..., int]


def put(folder: Path) -> dict[str, bytes]:
    """Put the user's files into a folder; return them."""
    for name in MINE:
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(f"mine: {name}")
    (folder / "study.toml").write_text(STUDY)
    (folder / "throws.csv").write_text(THROWS)
    return {name: (folder / name).read_bytes() for name in MINE}


def all_there(folder: Path, mine: dict[str, bytes]) -> bool:
    """Say whether the user's files are what they were."""
    return all((folder / name).read_bytes() == content for name, content in mine.items())


@pytest.fixture(scope="module")
def a_map(tmp_path_factory: pytest.TempPathFactory, learned: Learned) -> Path:
    """A learned map, so that nothing has to be learned."""
    path = tmp_path_factory.mktemp("map") / "map.json"
    save_map(path, learned)
    return path


@pytest.fixture
def quick(monkeypatch: pytest.MonkeyPatch, learned: Learned, a_map: Path) -> Quick:
    """What runs a command; nothing is learned, and no page of throws is drawn."""
    page = "<!doctype html>\n<title>mitt: it</title>"
    monkeypatch.setitem(outputs.BLOCKS, "catch", lambda *_: Blocks())
    for name in ("replay_page", "still"):
        monkeypatch.setattr(f"mitt.lab.report.bat_blocks.{name}", lambda *_: "")
    monkeypatch.setattr(
        "mitt.lab.report.recording_page.write_replay_page",
        lambda path, *_, **__: path.write_text(page),
    )
    monkeypatch.setattr("mitt.lab.trials.catch_study.learn", lambda *_, **__: learned)
    monkeypatch.setattr("mitt.cli.measuring.engine_of", lambda *_: Here())

    def run(*words: object) -> int:
        maps = ("--map", a_map, "--vision", "points", "--throws", "1", "--record", "none")
        of = (*words, *(maps if words[0] == "catch" and "--map" not in words else ()))
        return main([str(word) for word in of])

    return run


def test_each_command_that_writes_a_folder_or_a_file_is_looked_at_here() -> None:
    """A new command with --out has to be added to this file; those of tasks are one command."""
    with_out = {name for name, kind in COMMANDS.items() if hasattr(kind, "out")}
    assert with_out - set(TASKS) == {
        "learn",
        "design",
        "run",
        "measure",
        "study",
        "track",
        "see",
        "calibrate",
        "replay",
    }


@pytest.mark.parametrize("words", thorough([("bat", "--throws", 1)], [(("meet", "--trials", 1),)]))
def test_what_is_not_of_a_meeting_or_a_hit_is_left(
    tmp_path: Path, quick: Quick, words: tuple[object, ...]
) -> None:
    """In a folder of the user's: refused at first, and with all of it there in the end."""
    mine = put(tmp_path)
    assert quick(*words, "--out", tmp_path) == 2
    assert quick(*words, "--out", tmp_path, "--overwrite") == 0
    assert all_there(tmp_path, mine)
    assert (tmp_path / RESULT).exists()


def test_catch_leaves_what_is_not_its_own(tmp_path: Path, quick: Quick) -> None:
    """In a folder of the user's, again, with inputs in it, and where the run fails."""
    mine = put(tmp_path)
    words = ("catch", "--out", tmp_path, "--throws-file", tmp_path / "throws.csv")
    assert quick(*words) == 2
    for again in (words, (*words, "--map", tmp_path / "map.json", "--vision", "points")):
        assert quick(*again, "--overwrite") == 0
        assert all_there(tmp_path, mine)
        assert json.loads((tmp_path / RESULT).read_text())["summary"]["throws"] == 1
    kept = (tmp_path / RESULT).read_bytes()
    assert quick(*words[:3], "--throws-file", tmp_path / "notes.txt", "--overwrite") == 2
    assert (tmp_path / RESULT).read_bytes() == kept
    assert all_there(tmp_path, mine)


def test_measure_refuses_a_file_that_is_there(
    tmp_path: Path, quick: Quick, capsys: pytest.CaptureFixture[str]
) -> None:
    """Before the arm moves, in one line."""
    mine = tmp_path / "mine.toml"
    mine.write_text("mine")
    assert quick("measure", "wam-sim", "--out", mine, "--yes") == 2
    assert capsys.readouterr().err.count("\n") == 1
    assert mine.read_text() == "mine"


@pytest.mark.parametrize("name", ["report.html", "map.json", NAME, RESULT])
def test_catch_refuses_a_folder_in_which_its_names_are_taken(
    tmp_path: Path, quick: Quick, capsys: pytest.CaptureFixture[str], name: str
) -> None:
    """By a file that no run left there: one line, nothing is touched."""
    mine = put(tmp_path)
    (tmp_path / name).write_text("mine")
    assert quick("catch", "--out", tmp_path, "--overwrite") == 2
    err = capsys.readouterr().err
    assert name in err
    assert err.count("\n") == 1
    assert (tmp_path / name).read_text() == "mine"
    assert all_there(tmp_path, mine)


@pytest.mark.thorough
def test_study_and_report_leave_what_is_not_their_own(tmp_path: Path, quick: Quick) -> None:
    """The study's own folder as output, three times; then its page."""
    mine = put(tmp_path)
    for _ in range(2):
        assert quick("study", tmp_path / "study.toml", "--out", tmp_path, "--overwrite") == 0
        assert (tmp_path / "summary.json").exists()
        assert all_there(tmp_path, mine)
    (tmp_path / PAGE).write_text("mine")
    assert quick("report", tmp_path, "--replays", "0") == 2
    assert (tmp_path / PAGE).read_text() == "mine"
    (tmp_path / PAGE).unlink()
    for _ in range(2):
        assert quick("report", tmp_path, "--replays", "0") == 0
        assert all_there(tmp_path, mine)
    (tmp_path / "recordings" / "mine-3.mcap").write_text("mine")
    assert quick("study", tmp_path / "study.toml", "--out", tmp_path, "--overwrite") == 2
    assert (tmp_path / "recordings" / "mine-3.mcap").read_text() == "mine"
    assert (tmp_path / "summary.json").exists()


def test_a_study_whose_flights_lie_in_its_output_keeps_them(tmp_path: Path, quick: Quick) -> None:
    """By their own name, and as the copy that an earlier study made."""
    flights = "flight,t_s,x_m,y_m,z_m\n" + "".join(
        f"a,{0.02 * k:.2f},{3.0 - 0.1 * k:.3f},0.0,{0.5 + 0.06 * k - 0.00196 * k * k:.5f}\n"
        for k in range(30)
    )
    put(tmp_path)
    (tmp_path / "flights" / "mine.csv").write_text(flights)
    study = tmp_path / "study.toml"
    study.write_text(
        'name = "x"\nthrows = 1\ngenerators = ["direct"]\nvision = "points"\n'
        '[[conditions]]\nname = "mine"\nflights = "flights/mine.csv"\n'
    )
    assert quick("study", study, "--out", tmp_path, "--overwrite") == 0
    assert (tmp_path / "flights" / "mine.csv").read_text() == flights
    (copy,) = (tmp_path / "flights").glob("?" * 16 + ".csv")
    study.write_text(study.read_text().replace("flights/mine.csv", f"flights/{copy.name}"))
    assert quick("study", study, "--out", tmp_path, "--overwrite") == 0
    assert copy.read_text() == flights


def test_replay_replaces_its_own_pages_alone(tmp_path: Path, quick: Quick) -> None:
    """Beside its recording; a page that somebody else wrote is in the way."""
    ((_, path),) = recorded(replace(CASES[0], name="x"), tmp_path, throws=1, seed=5)
    mine, content = put(tmp_path), path.read_bytes()
    for _ in range(2):
        assert quick("replay", path, "--out", tmp_path, "--overwrite") == 0
        assert all_there(tmp_path, mine)
    assert path.read_bytes() == content
    (tmp_path / "replay.html").write_text("<html>mine</html>")
    assert quick("replay", path, "--out", tmp_path, "--overwrite") == 2
    assert (tmp_path / "replay.html").read_text() == "<html>mine</html>"


def test_run_replaces_its_own_recording_alone(
    tmp_path: Path, quick: Quick, capsys: pytest.CaptureFixture[str]
) -> None:
    """A file that only has its name is in the way, before the robot is asked for."""
    mine = put(tmp_path)
    (tmp_path / "wam-sim.mcap").write_bytes(b"\x89MCAP0\r\nmine")
    assert quick("run", "wam-sim", "--yes", "--out", tmp_path) == 2
    assert "--overwrite" in capsys.readouterr().err
    assert quick("run", "wam-sim", "--yes", "--out", tmp_path, "--overwrite") == 2
    assert "wam-sim.mcap" in capsys.readouterr().err
    assert (tmp_path / "wam-sim.mcap").read_bytes() == b"\x89MCAP0\r\nmine"
    assert all_there(tmp_path, mine)


def _cameras(folder: Path) -> tuple[Path, Path]:
    """Return the file of a rig, and a folder of images."""
    write_rig(folder / "rig.toml", calibrated(), version="0")
    (folder / "left.mkv").write_bytes(b"mine")
    (folder / "right.mkv").write_bytes(b"mine")
    return folder / "rig.toml", folder


def test_files_that_nobody_named_are_not_replaced(
    tmp_path: Path, quick: Quick, capsys: pytest.CaptureFixture[str]
) -> None:
    """A video, a picture, a page beside --out: only one that says that mitt wrote it."""
    rig, _ = _cameras(tmp_path)
    (tmp_path / "arm.html").write_text("mine")
    (tmp_path / "boards.png").write_bytes(b"mine")
    films = (tmp_path / "left.mkv", tmp_path / "right.mkv")
    see = ("see", *films, "--rig", rig, "--overwrite", "--out")
    commands = (
        (*see, tmp_path / "left.csv"),
        ("calibrate", "--left", tmp_path, "--overwrite", "--out", tmp_path / "boards.toml"),
        ("design", "wam", "--overwrite", "--out", tmp_path / "arm.toml"),
    )
    before = {path: path.read_bytes() for path in tmp_path.iterdir()}
    for words in commands:
        assert quick(*words) == 2
        err = capsys.readouterr().err
        assert re.search("a file of mitt|read or written too", err)
        assert err.count("\n") == 1
    assert {path: path.read_bytes() for path in tmp_path.iterdir()} == before


@pytest.mark.parametrize("command", ["track", "learn", "see", "calibrate"])
def test_an_output_is_never_an_input(
    tmp_path: Path, quick: Quick, capsys: pytest.CaptureFixture[str], command: str
) -> None:
    """Named as input and as output, by whatever path: refused, and as it was."""
    rig, _ = _cameras(tmp_path)
    points, away = tmp_path / "points.csv", tmp_path / "away"
    points.write_text("mine")
    away.symlink_to(tmp_path)
    words: dict[str, tuple[object, ...]] = {
        "track": ("track", points, "--out", away / "points.csv"),
        "learn": ("learn", "--arm", points, "--out", away / "points.csv"),
        "see": ("see", points, rig, "--rig", rig, "--out", away / "points.csv", "--no-video"),
        "calibrate": ("calibrate", "--rig", rig, "--hand", points, "--out", away / "rig.toml"),
    }
    before = {path: path.read_bytes() for path in (points, rig)}
    assert quick(*words[command], "--overwrite") == 2
    assert capsys.readouterr().err.count("\n") == 1
    assert {path: path.read_bytes() for path in (points, rig)} == before


def test_a_plain_command_works_twice(
    tmp_path: Path, quick: Quick, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each run without --out gets a new folder; --check takes none, whatever is there."""
    monkeypatch.chdir(tmp_path)
    for _ in range(2):
        assert quick("catch") == 0
    assert quick("catch", "--check") == 0
    assert quick("catch", "--overwrite") == 0
    made = sorted(path.name for path in (tmp_path / "runs").iterdir())
    assert made == ["0-direct", "0-direct-2"]


@pytest.mark.usefixtures("watched_shortly")
def test_check_refuses_no_folder_and_writes_nothing(
    tmp_path: Path, quick: Quick, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Every command whose output is there already says that its input is good."""
    monkeypatch.chdir(tmp_path)
    rig, _ = _cameras(tmp_path)
    put(tmp_path)
    t = 0.01 * np.arange(20)
    rows = np.column_stack((t, 3.0 - 5.0 * t, 0.0 * t, 0.5 + 3.0 * t - 4.905 * t * t))
    points = "\n".join(["t_s,x_m,y_m,z_m", *(",".join(map(repr, x.tolist())) for x in rows)])
    (tmp_path / "points.csv").write_text(points)
    (tmp_path / "arm.toml").write_text("mine")
    films = (tmp_path / "left.mkv", tmp_path / "right.mkv")
    before = {x: x.read_bytes() for x in tmp_path.rglob("*") if x.is_file()}
    for words in (
        ("catch", "--out", "."),
        ("study", "study.toml", "--out", "."),
        ("run", "wam-sim", "--out", "."),
        ("track", "points.csv", "--out", "a.csv"),
        ("learn", "--out", "arm.toml"),
        ("see", *films, "--rig", rig, "--out", "a.csv", "--no-video"),
        ("design", "wam", "--out", "arm.toml"),
    ):
        assert quick(*words, "--check") == 0, words
    assert {x: x.read_bytes() for x in tmp_path.rglob("*") if x.is_file()} == before


def test_a_generator_of_any_name_stays_below_runs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What another package calls its generator is no path."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("mitt.cli.catching.check_generator", lambda _: None)
    for name in ("../../up", "/etc/up", "a/b"):
        out = prepare_run(CatchOptions(generator=name, throws=1)).out
        assert out.parent == Path("runs")
        assert out.name == file_name(f"0-{name}")


def test_a_run_that_was_broken_off_gets_its_page(
    tmp_path: Path, quick: Quick, capsys: pytest.CaptureFixture[str]
) -> None:
    """With its result or without; its own files stay; a file that it read must be what it was."""
    out, throws = tmp_path / "out", tmp_path / "throws.csv"
    throws.write_text(THROWS)
    assert quick("catch", "--out", out, "--throws-file", throws) == 0
    whole = (out / RESULT).read_bytes()
    assert quick("report", out) == 2
    assert PAGE in capsys.readouterr().err
    for died in (False, True):
        (out / PAGE).unlink()
        if died:
            (out / RESULT).unlink()
        kept = (out / NAME).read_bytes()
        assert quick("report", out, "--check") == 0
        assert not (out / PAGE).exists()
        assert quick("report", out) == 0
        assert (out / PAGE).exists()
        assert (out / NAME).read_bytes() == kept
        assert died or (out / RESULT).read_bytes() == whole
    (out / PAGE).unlink()
    throws.write_text(THROWS.replace("-5.5", "-5.4"))
    capsys.readouterr()
    assert quick("report", out) == 2
    assert "throws.csv" in capsys.readouterr().err
    shutil.move(throws, tmp_path / "moved.csv")
    assert quick("report", out) == 2
    for head in (
        {},
        {"words": 3},
        {"words": ["--throws=x"], "read": {}},
        {"words": ["--no"], "read": 1},
    ):
        first, _, rest = kept.partition(b"\n")
        (out / NAME).write_bytes(
            json.dumps(json.loads(first) | {"again": head}).encode() + b"\n" + rest
        )
        capsys.readouterr()
        assert quick("report", out) == 2
        assert capsys.readouterr().err.count("\n") == 1


@pytest.mark.parametrize("task", thorough(["bat"], ["meet"]))
def test_meet_and_bat_clear_what_the_run_before_left(
    task: str,
    tmp_path: Path,
    quick: Quick,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """Its recordings, not others; of a run that was killed the page says what had ended."""
    count = ("--trials", 2) if task == "meet" else ("--throws", 2, "--vision", "points")
    words = (task, *count, "--out", tmp_path, "--overwrite")
    kind: Any = {"meet": MeetRunner, "bat": BatRunner}[task]
    inner = kind.trial
    with monkeypatch.context() as patch:

        def killed(self: Any, index: int) -> object:  # noqa: ANN401 (either runner)
            """End as a process does that is killed in its second trial."""
            if index == 1:
                raise SystemExit(9)
            return inner(self, index)

        patch.setattr(kind, "trial", killed)
        with pytest.raises(SystemExit):
            quick(*words)
    assert not (tmp_path / RESULT).exists()
    kept = read_kept(tmp_path)
    assert (kept.task.name, kept.wanted, len(kept.trials)) == (task, 2, 1)
    assert quick("report", tmp_path) == 0
    assert "1 of them" in capsys.readouterr().out
    said = json.loads((tmp_path / RESULT).read_text())
    assert (said["schema"], said["incomplete"], len(said["trials"])) == (f"mitt.{task}/1", True, 1)
    assert "<svg" in (tmp_path / PAGE).read_text()
    own, other = (tmp_path / "recordings" / f"{name}.mcap" for name in ("trial-00007", "mine"))
    own.parent.mkdir()
    own.write_bytes(MCAP)
    other.write_bytes(b"mine")
    assert quick(*words[:-1]) == 2
    assert own.exists()
    assert quick(*words) == 0
    assert not own.exists()
    assert other.read_bytes() == b"mine"
    whole = json.loads((tmp_path / RESULT).read_text())
    assert whole["trials"][:1] == said["trials"]
    assert (len(whole["trials"]), "incomplete" in whole) == (2, False)
    own.write_bytes(b"mine, too")
    assert quick(*words) == 2
    assert own.read_bytes() == b"mine, too"
