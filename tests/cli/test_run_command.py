"""``mitt run`` and ``mitt sim``: checks, refusals, and both as two processes."""

import fcntl
import json
import os
import re
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from local_cell import LocalCell

from mitt.cli.cells import _in_words, _show_session, recording
from mitt.cli.main import main
from mitt.cli.options import RunOptions
from mitt.cli.screen import picture
from mitt.clock import STALL, longest_stall
from mitt.core.errors import FileError, InputError
from mitt.core.signals import Command
from mitt.io.cell import read_cell
from mitt.io.recordings import Recorded
from mitt.robot.cell.live import Mode
from mitt.robot.cell.prepare import cell_map, prepare
from mitt.robot.cell.session import STATES, Person, Session, made_ready


@pytest.mark.usefixtures("watched_shortly")
def test_checking_says_what_the_cell_is(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """And how late ticks come here; it neither joins a network nor moves anything."""
    pytest.importorskip("cyclonedds")
    for command in ("run", "sim"):
        assert main([command, "wam-sim", "--check"]) == 0
        told = capsys.readouterr().err
        assert "the input is good: wam-sim" in told
        assert "ms late at most in two seconds" in told
    here = tmp_path / "cell.toml"
    here.write_text('schema = "mitt.cell/1"\nname = "x"\n[robot]\ndriver = "sim"\n')
    assert main(["run", str(here), "--check"]) == 0
    assert "late" not in capsys.readouterr().err


@pytest.mark.parametrize("words", [["wam-simm"], ["wam-sim", "--throws", "0"], ["tmp/none.toml"]])
def test_bad_input_is_one_line(words: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    """Exit status 2, before anything moves."""
    for command in ("run", "sim"):
        assert main([command, *words]) == 2
        said = capsys.readouterr()
        assert said.out == ""
        assert len(said.err.strip().splitlines()) == 1


def test_a_driver_that_is_not_there_is_found_by_checking(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Its name, and the names that there are."""
    file = tmp_path / "cell.toml"
    file.write_text('schema = "mitt.cell/1"\nname = "x"\n[robot]\ndriver = "mine"\n')
    assert main(["run", str(file), "--check"]) == 2
    assert "one of ros2, sim" in capsys.readouterr().err


def test_without_cyclone_the_extra_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    """Nothing else needs it."""
    for name in [
        name for name in sys.modules if name.startswith(("cyclonedds", "mitt.robot.cell.dds"))
    ]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "cyclonedds", None)
    with pytest.raises(InputError, match=r'pip install "mitt\[ros2\]"'):
        import mitt.robot.cell.dds  # noqa: F401, PLC0415


def session(cell: LocalCell, said: list[str], *, yes: bool, throws: int | None) -> Session:
    """Return a session at a cell in this process."""
    return Session(cell.loop, cell.robot, Person(yes=yes), said.append, throws=throws)


@pytest.mark.thorough
def test_a_session_ends_with_its_throws_and_knows_what_was_caught() -> None:
    """The numbers are those of the contract; verdicts come from the simulated cell alone."""
    cell, said = LocalCell(throws=2), list[str]()
    s = session(cell, said, yes=True, throws=2)
    assert s.run()
    found = s.summary()
    assert (found["schema"], found["throws"], found["caught"]) == ("mitt.run/1", 2, 2)
    assert found["limit_violations"] == 0
    assert 1.0 < found["force_n"]["median"] <= found["force_n"]["p95"] < 1000.0
    assert set(found["command_age_us"]) == {"p50", "p99", "p99_9", "max"}
    assert found["stops"] == []
    assert cell.loop.mode is Mode.STOPPED
    assert cell.robot.braked[-1]
    assert json.loads(json.dumps(found, allow_nan=False)) == found
    assert list(s.shown)[5:] == [2.0, 2.0, 2.0, 0.0]


@pytest.mark.thorough
def test_a_recording_whose_writer_has_died_is_told_at_once(tmp_path: Path) -> None:
    """Not only at the end, and once; the catch goes on."""
    cell, said = LocalCell(throws=1, record=tmp_path / "cell.mcap"), list[str]()
    recorder = cell.recorder
    assert recorder is not None
    s = Session(cell.loop, cell.robot, Person(yes=True), said.append, throws=1, recorder=recorder)
    assert recorder.trouble == ""
    recorder._process.kill()
    recorder._process.wait()
    assert s.run()
    assert s.summary()["caught"] == 1
    told = "the recording is not whole: its writer has ended; the catch goes on"
    assert said.count(told) == 1
    assert said.index(told) <= 1
    with pytest.raises(FileError, match="written to its end"):
        recorder.close()


@pytest.mark.thorough
def test_a_second_run_leaves_the_recording_that_a_first_one_writes(tmp_path: Path) -> None:
    """With --overwrite too: the folder is locked until the file is written to its end."""
    prepared, out = prepare(read_cell("wam-sim")), tmp_path / "out"
    f = cell_map(prepared)
    with recording(prepared, f, RunOptions(cell="wam-sim", out=out)) as first:
        assert first is not None
        before = first.path.stat().st_ino
        again = RunOptions(cell="wam-sim", out=out, overwrite=True)
        with pytest.raises(InputError, match="where one is running"), recording(prepared, f, again):
            pass
        assert first.path.stat().st_ino == before
        first.note("whole")
    assert Recorded(first.path).notes is not None
    with recording(prepared, f, again) as second:
        assert second is not None


def test_nothing_moves_before_somebody_says_so() -> None:
    """Without a keyboard and without --yes the session ends at once."""
    cell, said = LocalCell(throws=1), list[str]()
    assert not session(cell, said, yes=False, throws=1).run()
    assert cell.robot.braked == []
    assert any("--yes" in line for line in said)


def test_a_real_cell_tells_nothing_of_catches(capsys: pytest.CaptureFixture[str]) -> None:
    """Then what became of a ball is unknown, and how hard it pressed."""
    cell, said = LocalCell(throws=1), list[str]()
    cell.robot.news = list  # type: ignore[method-assign]
    s = session(cell, said, yes=True, throws=1)
    assert s.run()
    found = s.summary()
    assert (found["throws"], found["caught"], found["unknown"]) == (1, 0, 1)
    assert found["command_age_us"] is None
    assert found["force_n"] is None
    _show_session(s, json=False)
    assert "contact force not measured" in capsys.readouterr().out.replace("\n", " ")


def test_what_a_simulated_cell_says_is_counted_not_kept() -> None:
    """However many throws there are; what was said before the session counts for nothing."""
    cell, news = LocalCell(throws=1), [json.dumps({"status": "missed", "done": True})]
    inner = cell.robot.news

    def told() -> list[str]:
        nonlocal news
        said, news = [*news, *inner()], []
        return said

    cell.robot.news = told  # type: ignore[method-assign]
    s = session(cell, [], yes=True, throws=None)
    assert s.run()
    assert (s.summary()["throws"], s.summary()["caught"], s.summary()["missed"]) == (1, 1, 0)
    before = asizeof(s)
    news = [json.dumps({"status": "caught", "throw": k}) for k in range(1000)]
    s._hear()
    assert s.summary()["caught"] == 1001
    assert asizeof(s) - before < 2000


def asizeof(s: Session) -> int:
    """Return the size of what a session keeps of the throws, as text."""
    return len(repr(s._told)) + len(repr(s._last))


def test_a_fault_ends_a_session_that_nobody_can_answer() -> None:
    """The reason is said and counted."""
    cell, said = LocalCell(throws=1), list[str]()
    s = session(cell, said, yes=True, throws=1)
    cell.robot.on_write = lambda _: cell.fastest < 1.0
    assert not s.run()
    assert any("protective stop" in line for line in said)
    assert s.summary()["stops"] == [cell.loop.why]


def test_ctrl_c_in_a_catch_is_a_controlled_stop() -> None:
    """The arm comes to rest within its limits, then the session ends and says by what."""
    cell, said = LocalCell(throws=1), list[str]()
    s = session(cell, said, yes=True, throws=1)

    def interrupt(_: Command) -> bool:
        if cell.fastest > 1.5 and not s.signal:
            os.kill(os.getpid(), signal.SIGINT)
        return True

    cell.robot.on_write = interrupt
    assert not s.run()
    assert s.signal == signal.SIGINT
    assert any("interrupted by SIGINT" in line for line in said)
    assert cell.fastest < 0.05
    assert cell.robot.braked[-1]
    assert cell.simulated.violations == 0


def test_the_live_table_shows_each_number() -> None:
    """In words."""
    table = picture([2.0, 999.6, 120.0, 3.0, 4.0, 7.0, 6.0, 7.0, 0.0], STATES, ("throws", "caught"))
    cells = [str(x) for column in table.columns for x in column.cells]
    assert "catching" in cells
    assert "1000 Hz" in cells
    assert "6 of 7" in cells
    assert "odd" not in cells
    table = picture([0.0] * 9, STATES, ("parts", "met", "placed"), "12 [stray] positions")
    cells = [str(x) for column in table.columns for x in column.cells]
    assert {"12 [stray] positions", "parts", "met", "placed"} <= set(cells)


@pytest.mark.usefixtures("watched_shortly")
def test_checking_says_which_controllers_are_wanted(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """For each kind of drive and of message, with the settings that are not their defaults."""
    pytest.importorskip("cyclonedds")
    for takes, topic, says in (
        ("torque", "commands", "forward_command_controller with joints [j1, j2, j4]"),
        ("velocity", "commands", "keeps its last command for ever"),
        ("position", "commands", "joints [j1, j2, j3, j4] in this order, interface_name position"),
        ("velocity", "joint_trajectory", "allow_nonzero_velocity_at_trajectory_end true"),
        ("position", "joint_trajectory", "command_interfaces [position]"),
        ("torque", "joint_trajectory", "refuse efforts"),
    ):
        file = tmp_path / "cell.toml"
        file.write_text(
            f'schema = "mitt.cell/1"\nname = "x"\n[robot]\ntakes = "{takes}"\n'
            f'[robot.options]\ncommand = "/c/{topic}"\nunbraked = true\n'
        )
        assert main(["run", str(file), "--check"]) == 0
        assert says in capsys.readouterr().err
    file.write_text(file.read_text() + 'controller = "j1, j2"\n')
    assert main(["run", str(file), "--check"]) == 2
    assert "robot.options.controller" in capsys.readouterr().err


def test_what_a_simulated_cell_did_is_a_line_of_words() -> None:
    """Without anything thrown, and with; no brackets of a program."""
    ages = {"p50": 1776.94, "p99": 2000.0, "p99_9": 2500.0, "max": 3000.4}
    counts = {
        "caught": 1,
        "dropped": 1,
        "missed": 0,
        "aborted": 0,
        "limit_violations": 0,
        "late_ticks": 3,
        "slipped_ticks": 1,
    }
    head = {"schema": "mitt.sim/1", "version": "0", "cell": "wam-sim", "seed": 5}
    assert _in_words({**head, "throws": 0}) == "wam-sim, seed 5: 0 throws"
    for age, says in ((ages, "commands 1777 us old (median), 3000 at most"), (None, "1 slipped")):
        force = {"median": 44.4, "p95": 61.0}
        said = _in_words({**head, "throws": 2, **counts, "force_n": force, "command_age_us": age})
        assert said.startswith(
            "wam-sim, seed 5: 2 throws, 1 caught, 1 dropped, contact force 44 N"
            " median, 95 % 61 N, 0 ticks beyond"
        )
        assert said.endswith(says)
        assert not set(said) & set("{}[]'_")


@pytest.fixture
def alone(tmp_path_factory: pytest.TempPathFactory) -> Iterator[dict[str, str]]:
    """Let one test at a time run in real time, in a domain of its own; the environment for it."""
    with (tmp_path_factory.getbasetemp().parent / "real-time").open("w") as file:
        fcntl.flock(file, fcntl.LOCK_EX)  # until it is closed
        yield {**os.environ, "ROS_DOMAIN_ID": str(170 + os.getpid() % 60)}


def both(name: str, folder: Path, environment: dict[str, str]) -> tuple[str, str] | None:
    """Throw two balls with ``mitt sim`` at ``mitt run``; what they said, unless the arm stopped."""
    words = [sys.executable, "-m", "mitt"]
    throws = ["--throws", "2", "--json"]
    folder.mkdir()
    with (folder / "sim.json").open("w") as out, (folder / "sim.txt").open("w") as err:
        sim = subprocess.Popen(
            [*words, "sim", name, "--seed", "3", *throws], stdout=out, stderr=err, env=environment
        )
    try:
        with (folder / "run.txt").open("w") as err:
            run = subprocess.run(
                [*words, "run", name, "--yes", *throws],
                stdout=subprocess.PIPE,
                stderr=err,
                text=True,
                timeout=180,
                env=environment,
                check=False,
            )
        if run.returncode != 0:
            return None
        sim.wait(timeout=60)
    except subprocess.TimeoutExpired:
        return None
    finally:
        sim.kill()
        sim.wait()
    return run.stdout, (folder / "sim.json").read_text()


#: Why an arm is stopped on a machine that stalls; any other reason is a fault of ours.
STALLED = re.compile(
    "stopped: (the robot's readings come [0-9]+ ms later|no joint states for"
    "|the robot's stamps jumped|the robot says: protective stop: no command"
    "|this loop was late)"
)


@pytest.mark.slow
def test_two_processes_catch_over_dds(tmp_path: Path, alone: dict[str, str]) -> None:
    """They find each other on the loopback; two balls, none dropped for the network's sake.

    Messages of each kind, and all that drives take, are in tests/cell/test_over_dds.py.
    """
    pytest.importorskip("cyclonedds")
    # A machine that stalls stops the arm, as it should: then both begin anew.
    said = next((x for k in range(3) if (x := both("wam-sim", tmp_path / f"{k}", alone))), None)
    if said is None:
        told = "".join(path.read_text() for path in sorted(tmp_path.glob("*/*.txt")))
        stops = [line for line in told.splitlines() if "stopped: " in line]
        assert len(stops) == 3, told  # no attempt ended for another reason, or by its time
        assert all(STALLED.search(line) for line in stops), told
        worst = max(longest_stall(core) for _ in range(3) for core in (0, -1))
        assert worst > STALL, f"the machine stalls for {1e3 * worst:.1f} ms at most\n{told}"
        pytest.skip(f"this machine stalls for {1e3 * worst:.0f} ms: no real time on it")
    found, theirs = (json.loads(text) for text in said)
    assert found["caught"] + found["dropped"] + found["missed"] + found["stopped"] >= 1
    assert found["caught"] >= 1
    assert theirs["schema"] == "mitt.sim/1"
    assert found["limit_violations"] == theirs["limit_violations"] == 0
    assert theirs["command_age_us"] is not None


def test_a_second_run_at_one_arm_moves_nothing() -> None:
    """It says who is there, and waits; that DDS tells it: tests/cell/test_ros2.py."""
    cell, said = LocalCell(throws=1), list[str]()
    cell.robot.meddled = "another program commands the arm on /x: end it"
    s = session(cell, said, yes=True, throws=1)

    def heard(text: str) -> None:
        said.append(text)
        if cell.robot.meddled in text:
            s.signal = signal.SIGINT

    s._teller = heard
    assert not s.run()
    assert any(cell.robot.meddled in line for line in said)
    assert "the arm moves" not in said
    assert cell.robot.braked == []
    assert cell.loop.counts.ticks == 0


def test_what_takes_time_is_said_before_it_begins(monkeypatch: pytest.MonkeyPatch) -> None:
    """A line before the map is loaded or learned, and one before the rehearsal."""
    said, heard = list[str](), list[int]()
    cell = prepare(read_cell("wam-sim"))
    monkeypatch.setattr("mitt.robot.cell.session.cell_map", lambda _: heard.append(len(said)))
    monkeypatch.setattr("mitt.robot.cell.session.rehearse", lambda *_: heard.append(len(said)))
    made_ready(cell, said.append)
    assert heard == [1, 2]
    assert "map" in said[0]
    assert "rehearsing" in said[1]
