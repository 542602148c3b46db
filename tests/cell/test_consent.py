"""Consent holds for the state of the cell for which it was given."""

import os
import pty
import signal
import subprocess
import sys
import time
from collections.abc import Callable

import pytest
from local_cell import LocalCell
from support import thorough

from mitt.robot.cell.live import Mode
from mitt.robot.cell.session import Person, Session

#: How another session leaves a cell, as the second finds it: what the robot says of others, of
#: itself, and the least angle by which its arm moves from one reading to the next [rad].
STATES: dict[str, tuple[str, str]] = {
    "it waits for a person": ("another program commands the arm on /c: end it", ""),
    "it moves": ("another program commands the arm on /c: end it; the arm moves already", ""),
    "it was killed": (
        "another program commands the arm on /c: end it",
        "protective stop: no command for 20 ms",
    ),
    "it was killed a while ago": ("", "protective stop: no command for 20 ms"),
    "it has engaged the brakes": ("", "another program engaged the brakes on /b"),
    "it told the hand": ("another program commands the hand on /h", ""),
    "two of them": ("two publishers of j1 on /joint_states: end one", ""),
}


def session(cell: LocalCell, person: Person, said: list[str]) -> Session:
    """Return a session of one throw that tells what it says, and how far the arm was then."""
    return Session(cell.loop, cell.robot, person, said.append, throws=1)


def meddled(cell: LocalCell, conflict: str, trouble: str, looks: int) -> None:
    """Let a cell be found in a state for some looks, until the other has gone."""
    inner, count = cell.loop.healthy, 0

    def healthy() -> str:
        nonlocal count
        count += 1
        there = count <= looks
        cell.robot.meddled = conflict if there else ""
        cell.robot.said = trouble if there or not cell.robot.braked else ""
        return inner()

    cell.loop.healthy = healthy  # type: ignore[method-assign]


@pytest.mark.parametrize("state", STATES)
@pytest.mark.parametrize("looks", [1, 30])
def test_yes_does_not_take_over_what_another_has_stopped(state: str, looks: int) -> None:
    """Without a keyboard the session ends, with status 1; nothing was released before."""
    cell, said = LocalCell(throws=1), list[str]()
    meddled(cell, *STATES[state], looks)
    assert not session(cell, Person(yes=True), said).run()
    assert cell.robot.braked == []
    assert cell.loop.mode is Mode.WAITING
    conflict, trouble = STATES[state]
    assert said[0].startswith("--yes holds no more: ")
    assert all(x in said[0] for x in (conflict, trouble))
    assert said[-1] == "nobody can say that the arm may move then: see to it, start again"


@pytest.mark.parametrize("state", thorough([*STATES][:4], [*STATES][4:]))
def test_a_person_agrees_to_what_there_is_then(state: str) -> None:
    """Enter counts once the other has gone; what was pressed before that moves nothing."""
    cell, said, person = LocalCell(throws=1), list[str](), Person(yes=True)
    person.keyboard = person._listens = True
    meddled(cell, *STATES[state], 30)
    looks = 0

    def pressed() -> str:
        nonlocal looks
        looks += 1
        found = inner()
        if looks == 10 and STATES[state][0]:
            person._pressed.set()
        if looks == 40:
            assert cell.robot.braked == []
            person._pressed.set()
        return found

    inner, cell.loop.healthy = cell.loop.healthy, pressed  # type: ignore[method-assign]
    assert session(cell, person, said).run()
    assert looks >= 40
    assert cell.simulated.statuses == ["caught"]


@pytest.mark.parametrize("wrong", ["moves", "outside"])
def test_an_arm_that_a_person_moves_is_not_what_was_agreed_to(wrong: str) -> None:
    """Whoever moves it back by hand is at the arm."""
    cell, said = LocalCell(throws=1), list[str]()
    looks: list[str] = []
    inner = cell.loop._watch

    def look() -> str:
        looks.append("")
        if len(looks) < 5:
            inner.disturbed = True
            return "the arm moves already" if wrong == "moves" else "j2 is 0.30 rad outside"
        inner.disturbed = False
        return ""

    inner.look = look  # type: ignore[method-assign]
    assert not session(cell, Person(yes=True), said).run()
    assert cell.robot.braked == []


def test_who_is_not_there_yet_is_waited_for_with_yes() -> None:
    """That says nothing of the arm: programs of a cell are started in any order."""
    cell, said, looks = LocalCell(throws=1), list[str](), 0
    inner = cell.loop.healthy

    def healthy() -> str:
        nonlocal looks
        looks += 1
        cell.robot.kept = "nobody takes commands on /c" if looks < 20 else ""
        return inner()

    cell.loop.healthy = healthy  # type: ignore[method-assign]
    assert session(cell, Person(yes=True), said).run()
    assert cell.simulated.statuses == ["caught"]


def test_a_stop_that_does_not_end_is_not_agreed_to_for_ever(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """As of an emergency stop that is still pressed: brakes, and Enter is asked for anew."""
    monkeypatch.setattr("mitt.robot.cell.session._ENDS_IN", 0.05)
    cell, said, person, looks = LocalCell(throws=1), list[str](), Person(yes=False), 0
    person.keyboard = person._listens = True
    s, inner = session(cell, person, said), cell.loop.healthy

    def healthy() -> str:
        nonlocal looks
        looks += 1
        if looks == 3:
            person._pressed.set()
        if looks > 3:
            time.sleep(0.01)
        cell.robot.said = "emergency stop" if looks < 30 else ""
        s.signal = signal.SIGTERM if looks == 60 else 0
        return inner()

    cell.loop.healthy = healthy  # type: ignore[method-assign]
    assert not s.run()
    assert cell.robot.braked == [False, True]


#: Be a shell with a terminal of its own, and run something in the background.
_SHELL = """
import fcntl, os, subprocess, sys, termios, time
fcntl.ioctl(0, termios.TIOCSCTTY, 0)
run, status = subprocess.Popen([sys.executable, "-c", sys.argv[1]], process_group=0), 0
while not status and os.waitid(os.P_PID, run.pid, os.WEXITED | os.WNOHANG | os.WNOWAIT) is None:
    _, status = os.waitpid(run.pid, os.WUNTRACED | os.WNOHANG)
    time.sleep(0.01)
print("stopped" if os.WIFSTOPPED(status) else run.wait())
run.kill()
"""
_LISTENS = """
import time
from mitt.robot.cell.session import Person
for yes in (True, False):
    person = Person(yes=yes)
    assert person.keyboard
    person.agrees()
time.sleep(1.0)
"""


def test_in_the_background_the_keyboard_is_left_alone() -> None:
    """With a key waiting there too: whoever reads it then is stopped by the kernel."""
    keys, theirs = pty.openpty()
    shell = subprocess.Popen(
        [sys.executable, "-c", _SHELL, _LISTENS],
        stdin=theirs,
        stdout=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    os.write(keys, b"\n")
    out, _ = shell.communicate(timeout=60)
    assert out.strip() == "0"


def soon(what: Callable[[], bool]) -> None:
    """Wait until something is so."""
    end = time.monotonic() + 10.0
    while not what():
        assert time.monotonic() < end
        time.sleep(0.01)


def test_in_the_foreground_enter_is_heard(monkeypatch: pytest.MonkeyPatch) -> None:
    """A line that ends, not each key."""
    keys, theirs = pty.openpty()
    with os.fdopen(theirs) as terminal:
        monkeypatch.setattr("sys.stdin", terminal)
        monkeypatch.setattr("os.tcgetpgrp", lambda _: os.getpgrp())
        person = Person(yes=False)
        assert not person.agrees()
        os.write(keys, b"\n")
        soon(person.agrees)
        assert not person.agrees()
        os.close(keys)
        soon(lambda: not person.keyboard)
