"""Whatever a maker's client does, in its own process: the arm is told to stop, mitt says why.

The worst that it can do it does in a call, once the arm moves (``hostile/hostile.py``).
"""

import os
import re
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path

import pytest
from support import install, thorough

from mitt.clock import hurried, pinned, uncollected
from mitt.io.cell import read_cell
from mitt.robot.cell.drivers import Connection, connect_robot, local_connection, local_robot
from mitt.robot.cell.hosted import DriverError, HostedRobot
from mitt.robot.cell.live import LiveLoop, Mode
from mitt.robot.cell.prepare import CellMap, PreparedCell, cell_map, prepare
from mitt.robot.cell.session import Person, Session, loop_of

FOLDER = Path(__file__).parent / "hostile"
#: Time in which the arm has to be told to stop, and in which all has to be over [s].
STOPS = 0.05
ENDS = 1.0
#: How often a case is tried again where this machine was late, so that it stopped for that.
TRIES = 5
CALLS = ("read", "points", "write", "trouble", "waits")
FAULTS = {
    "blocks": r"does not answer: \w+ has not returned for \d+ ms",
    "holds": r"does not answer: \w+ has not returned for \d+ ms.*its process was killed",
    "spins": r"computed too long without a pause|does not answer: \w+ has not returned for \d+ ms",
    "stops": r"does not answer: \w+ has not returned for \d+ ms.*its process was killed",
    "crashes": "has crashed: its process was ended by SIGSEGV",
    "dies": "has crashed: its process was ended by SIGKILL",
    "ends": "has ended its process, with status 3",
    "closes": "has given its link up",
    "fails": r"driver 'hostile': RuntimeError: reflex! \[joint_velocity_violation\]",
    "exits": "the vendor's licence has expired",
}


@pytest.fixture(scope="module")
def ready() -> tuple[PreparedCell, CellMap]:
    """A cell for whose loop all is loaded."""
    prepared = prepare(read_cell("wam-sim"))
    f, local = cell_map(prepared), local_robot(prepared, seed=0, count=1)
    loop = loop_of(prepared, f, local_connection(prepared.cell, local))
    assert loop.healthy() == ""
    loop.begin()
    for _ in range(300):
        loop.cycle()
    return prepared, f


@pytest.fixture
def notes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Where the driver notes what it is told; it is as if it were installed."""
    folder = tmp_path / "installed"
    folder.mkdir()
    install(FOLDER, folder, monkeypatch)
    return tmp_path / "notes"


def noted(notes: Path) -> list[tuple[float, str, int]]:
    """Return what the driver noted: when [s], what, and by which process."""
    lines = [line.split() for line in notes.read_text().splitlines()] if notes.exists() else []
    return [(float(t), what, int(process)) for t, what, process in lines]


def at(notes: Path, what: str) -> list[float]:
    """Return when something was noted [s]."""
    return [t for t, said, _ in noted(notes) if said == what]


def runs(process: int) -> bool:
    """Say whether a process is there that can do anything."""
    try:
        status = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0]
    except OSError:
        return False
    return status not in "ZX"


def until(so: object, within: float = 30.0) -> None:
    """Wait until something is so."""
    assert callable(so)
    end = time.monotonic() + within
    while not so():
        assert time.monotonic() < end
        time.sleep(0.001)


def cell_with(prepared: PreparedCell, notes: Path, call: str, fault: str) -> PreparedCell:
    """Return the cell with the hostile driver."""
    options = {"call": call, "fault": fault, "notes": str(notes)}
    robot = prepared.cell.robot.model_copy(update={"driver": "hostile", "options": options})
    cell = prepared.cell.model_copy(update={"robot": robot})
    return prepare(cell)


@contextmanager
def moving(
    ready: tuple[PreparedCell, CellMap], notes: Path, call: str, fault: str
) -> Iterator[tuple[LiveLoop, Connection]]:
    """Give a live loop at the hostile driver, in real time where that is allowed."""
    prepared = cell_with(ready[0], notes, call, fault)
    connection = connect_robot(prepared)
    with closing(connection.robot), uncollected(), hurried(), pinned(-1):
        yield loop_of(prepared, ready[1], connection), connection


def stopped(ready: tuple[PreparedCell, CellMap], notes: Path, call: str, fault: str) -> str:
    """Let the driver do its worst; return why the loop stopped. The arm was told to in time."""
    for _ in range(TRIES):
        notes.unlink(missing_ok=True)
        with moving(ready, notes, call, fault) as (loop, _):
            until(lambda loop=loop: loop.healthy() == "")
            loop.begin()
            while loop.mode is Mode.MOVING:
                loop.cycle()
            now = time.monotonic()  # one that still answers is brought to rest within its limits
            while loop.mode is not Mode.STOPPED:
                loop.cycle()
            (process,) = {x for *_, x in noted(notes)}
            gone = not runs(process)
        if at(notes, "failed"):
            assert time.monotonic() - now < ENDS
            assert not runs(process)
            told = [t for t in at(notes, "braked") if t > at(notes, "failed")[0]]
            assert told or gone
            assert now - at(notes, "failed")[0] < STOPS
            return loop.why
    raise AssertionError(f"stopped {TRIES} times before the driver failed: {loop.why}")


MAIN = [("write", "blocks"), ("read", "holds"), ("read", "fails")]
FURTHER = [(x, y) for x in CALLS for y in FAULTS if (x, y) not in MAIN]


@pytest.mark.parametrize(("call", "fault"), thorough(MAIN, FURTHER))
def test_whatever_a_client_does_the_arm_is_told_to_stop(
    ready: tuple[PreparedCell, CellMap], notes: Path, call: str, fault: str
) -> None:
    """Within 50 ms by its driver, or by a link that is closed; the loop says why, and ends."""
    why = stopped(ready, notes, call, fault)
    assert re.search(FAULTS[fault], why), why


@pytest.mark.parametrize("number", thorough([signal.SIGKILL], [(signal.SIGSTOP,)]))
def test_the_driver_stops_the_arm_of_a_mitt_that_is_gone_or_stopped(
    notes: Path, number: signal.Signals
) -> None:
    """Within 50 ms; the process of a driver whose mitt is gone ends."""
    with subprocess.Popen(
        [sys.executable, FOLDER / "writes.py", str(notes)],
        env=os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)},
    ) as process:
        try:
            until(lambda: at(notes, "released"))
            time.sleep(0.3)
            assert at(notes, "braked") == []
            sent = time.monotonic()
            process.send_signal(number)
            until(lambda: at(notes, "braked"), ENDS)
            assert at(notes, "braked")[0] - sent < STOPS
        finally:
            process.kill()
        until(lambda: not any(runs(x) for *_, x in noted(notes)), ENDS)


def test_a_session_ends_at_a_signal_though_its_driver_hangs(
    ready: tuple[PreparedCell, CellMap], notes: Path
) -> None:
    """Within a second, its driver's process too."""
    prepared = cell_with(ready[0], notes, "release", "holds")
    connection = connect_robot(prepared)
    session = Session(
        loop_of(prepared, ready[1], connection),
        connection.robot,
        Person(yes=True),
        lambda _: None,
        throws=None,
    )
    sent = list[float]()

    def interrupt() -> None:
        until(lambda: at(notes, "released"))
        time.sleep(0.2)
        sent.append(time.monotonic())
        os.kill(os.getpid(), signal.SIGINT)

    threading.Thread(target=interrupt, daemon=True).start()
    with closing(connection.robot):
        assert not session.run()
    until(lambda: sent)
    assert time.monotonic() - sent[0] < ENDS
    assert not any(runs(x) for *_, x in noted(notes))


@pytest.mark.parametrize(
    ("fault", "said"), thorough([("crashes", "SIGSEGV")], [("fails", "RuntimeError: reflex!")])
)
def test_a_driver_that_cannot_be_made_is_one_line(
    ready: tuple[PreparedCell, CellMap], notes: Path, fault: str, said: str
) -> None:
    """Of what it raised, or of how it crashed; nothing is left of it."""
    prepared = cell_with(ready[0], notes, "make", fault)
    with pytest.raises(DriverError, match=f"driver 'hostile'.*{said}") as caught:
        HostedRobot(prepared.cell, prepared.arm)
    assert "\n" not in str(caught.value)
    assert not any(runs(x) for *_, x in noted(notes))
