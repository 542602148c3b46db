"""Signals end a command within a second, also where the main thread cannot hear them."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from mitt.cli import main as cli
from mitt.cli.main import main
from mitt.interrupts import Interrupted, finally_do, listening, status_of, words_of

#: How long a process may go on after a signal [s]: a second is promised, on a machine of its own.
SOON = 6.0

#: The main thread is in one call of C that no signal ends.
STUCK = """
import ctypes
from mitt.interrupts import finally_do, listening
libc = ctypes.CDLL(None)
@ctypes.CFUNCTYPE(ctypes.c_int, ctypes.c_void_p, ctypes.c_void_p)
def compare(a, b):
    try:
        import time
        time.sleep(0.2)
    except BaseException:
        pass
    return 1
def last_words():
    open("kept", "w").write("kept")
    return "two throws are kept"
with listening(for_good=True), finally_do(last_words):
    print("ready", flush=True)
    libc.qsort((ctypes.c_int * 1000)(*range(1000)), 1000, 4, compare)
"""


def _signal_myself(number: int) -> None:
    """Send a signal and wait until it is heard."""
    os.kill(os.getpid(), number)
    time.sleep(1.0)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_a_signal_raises_and_names_itself(number: signal.Signals) -> None:
    """The exception carries the number, and handlers are afterwards as before."""
    before = signal.getsignal(number)
    with pytest.raises(Interrupted) as caught, listening():
        _signal_myself(number)
    assert status_of(caught.value) == 128 + number
    assert number.name in words_of(status_of(caught.value))
    assert signal.getsignal(number) is before
    assert status_of(KeyboardInterrupt()) == 130


def test_a_signal_that_was_ignored_stays_ignored() -> None:
    """As for a command that was started with nohup."""
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    try:
        with listening():
            os.kill(os.getpid(), signal.SIGHUP)
            time.sleep(0.1)
    finally:
        signal.signal(signal.SIGHUP, before)


def _stuck(folder: Path, number: int) -> tuple[int, str]:
    """Signal a process that does not hear; return its status and what it says."""
    process = subprocess.Popen(
        [sys.executable, "-c", STUCK],
        cwd=folder,
        text=True,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        env=os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)},
    )
    assert process.stdout is not None
    process.stdout.readline()
    time.sleep(0.3)
    sent = time.monotonic()
    process.send_signal(number)
    _, err = process.communicate(timeout=60)
    assert time.monotonic() - sent < SOON
    return process.returncode, err


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_a_main_thread_that_does_not_hear_is_ended(tmp_path: Path, number: signal.Signals) -> None:
    """Stuck in a library that swallows exceptions: last words are done, one line, the status."""
    status, err = _stuck(tmp_path, number)
    assert status == 128 + number
    assert err == f"mitt: interrupted by {number.name}; two throws are kept\n"
    assert (tmp_path / "kept").exists()


def test_what_could_not_be_kept_is_said(tmp_path: Path) -> None:
    """A disk that is full at the last moment is no reason to be silent."""
    (tmp_path / "kept").mkdir()  # so that it cannot be written as a file
    status, err = _stuck(tmp_path, signal.SIGTERM)
    assert status == 143
    assert err.startswith("mitt: interrupted by SIGTERM; what was finished could not be kept: ")
    assert err.count("\n") == 1


def test_an_interrupt_that_a_library_makes_another_error_of_is_an_interrupt(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """As where an extension module is being loaded: the signal's status and line, no fault."""

    def load(_job: object) -> None:
        try:
            _signal_myself(signal.SIGTERM)
        except KeyboardInterrupt:
            raise ImportError("initialization failed") from None

    monkeypatch.setattr("mitt.cli.catching._prepared", load)
    assert main(["catch"]) == 143
    assert capsys.readouterr().err == "mitt: interrupted by SIGTERM\n"


def test_an_interrupt_stays_one_where_something_is_to_be_kept() -> None:
    """A library made another error of it: who keeps what is finished still hears of a signal."""

    def load() -> None:
        try:
            _signal_myself(signal.SIGTERM)
        except KeyboardInterrupt:
            raise SystemError("returned a result with an exception set") from None

    with listening(), pytest.raises(Interrupted) as caught, finally_do(str):
        load()
    assert status_of(caught.value) == 143
    with listening(), pytest.raises(SystemError, match="by itself"), finally_do(str):
        raise SystemError("by itself")


def test_a_signal_while_signals_are_taken_says_its_line(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """It comes before the command has begun: one line and the status, as at any other time."""

    @contextmanager
    def taken(**_: object) -> Iterator[None]:
        raise Interrupted(signal.SIGTERM)
        yield

    monkeypatch.setattr(cli, "listening", taken)
    assert main(["bench", "--check"]) == 143
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    assert words_of(143) in said


#: A process that starts another, which waits, and says what number it has.
PARENT = """
import multiprocessing, sys, time
from mitt.interrupts import end_with_parent
def child(ready):
    end_with_parent()
    ready.set()
    time.sleep(60.0)
if __name__ == "__main__":
    context = multiprocessing.get_context("spawn")
    ready = context.Event()
    other = context.Process(target=child, args=(ready,))
    other.start()
    ready.wait()
    print(other.pid, flush=True)
    time.sleep(60.0)
"""


def test_a_second_process_does_not_outlive_the_first(tmp_path: Path) -> None:
    """Not even where the first is killed, and can end nothing itself."""
    script = tmp_path / "parent.py"
    script.write_text(PARENT)
    with subprocess.Popen(
        [sys.executable, script], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True
    ) as first:
        assert first.stdout is not None
        second = int(first.stdout.readline())
        assert _runs(second)
        first.kill()
    end = time.monotonic() + SOON
    while _runs(second) and time.monotonic() < end:
        time.sleep(0.01)
    assert not _runs(second)


def _runs(process: int) -> bool:
    """Say whether a process is there and has not ended."""
    try:
        state = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0]
    except FileNotFoundError:
        return False
    return state != "Z"
