"""Signals that end a command: what is finished is kept, and the process is gone within a second.

SIGINT, SIGTERM and SIGHUP raise :class:`Interrupted` in the main thread. A library in C may hold
that thread for longer, as the compiler of the kernels does, and may swallow the exception. So a
thread of our own is woken by the signal as well: where the exception has not been noticed in time
it calls what was registered with :func:`finally_do` and ends the process.
"""

import io
import multiprocessing
import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from multiprocessing.connection import wait
from types import FrameType
from typing import NoReturn, TextIO

SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
"""Signals that end a command; one that was ignored at the start stays ignored, as with nohup."""

#: How long the main thread may take to notice a signal [s].
_PATIENCE = 0.5
#: Variable by which Python leaves the working folder out of its path.
_SAFE_PATH = "PYTHONSAFEPATH"

_noticed = threading.Event()
_asked = threading.Event()
#: Held by whoever decides which thread ends the process: only one of them does.
_deciding = threading.Lock()
_arrived: list[int] = []
_aside: list[TextIO] = []
_last_words: list[Callable[[], str]] = []


class Interrupted(KeyboardInterrupt):
    """A signal arrived that ends the command; what is finished is kept.

    Attributes:
        number: Number of the signal.
    """

    def __init__(self, number: int = signal.SIGINT) -> None:
        """Keep the number."""
        super().__init__(number)
        self.number = number


def status_of(stop: KeyboardInterrupt) -> int:
    """Return the exit status after an interrupt: 128 and the number of the signal."""
    return 128 + (stop.number if isinstance(stop, Interrupted) else signal.SIGINT)


def words_of(status: int) -> str:
    """Return what is said of an interrupt, by the exit status."""
    return f"interrupted by {signal.Signals(status - 128).name}"


def tell(text: str) -> None:
    """Say one line on stderr, if anybody can hear it."""
    with suppress(OSError):
        print(f"mitt: {text}", file=sys.stderr, flush=True)  # noqa: T201


def end_with_parent() -> None:
    """Let this process end as soon as the one that started it has ended, however that came."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        threading.Thread(target=_follow, args=(parent.sentinel,), daemon=True).start()


@contextmanager
def safe_path() -> Iterator[None]:
    """Let no Python that is started in the block import anything from the working folder.

    One that is started by ``-m`` or ``-c`` looks there first, so that a user's json.py or numpy.py
    would be run in the place of the module. Multiprocessing begins by ``-c``, its tracker of
    resources as well, which is started with the first lock that is made.
    """
    before = os.environ.get(_SAFE_PATH)
    os.environ[_SAFE_PATH] = "1"
    try:
        yield
    finally:
        if before is None:
            os.environ.pop(_SAFE_PATH, None)
        else:
            os.environ[_SAFE_PATH] = before


def _follow(sentinel: int) -> None:
    """Wait for the end of the parent, and end as well."""
    wait([sentinel])
    os._exit(1)


def raise_again() -> None:
    """Raise the interrupt that has arrived, if a library made another exception of it.

    An extension module that is interrupted while it is loaded says that it cannot be loaded.
    """
    if _arrived and not _noticed.is_set():
        notice()
        raise Interrupted(_arrived[0])


def ask_to_end(*, asked: bool = True) -> None:
    """Note that a signal has asked a session to end, or that there is none any more."""
    (_asked.set if asked else _asked.clear)()


def asked_to_end() -> bool:
    """Say whether a signal has asked the session to end: who waits for long looks now and then."""
    return _asked.is_set()


def notice() -> None:
    """Say that the exception has arrived and that the main thread sees to the rest."""
    with _deciding:
        _noticed.set()
    while _aside:
        sys.stderr = _aside.pop()


@contextmanager
def finally_do(last_words: Callable[[], str]) -> Iterator[None]:
    """Within the block, have something done if the main thread cannot be reached by a signal.

    Args:
        last_words: Is called in another thread; keeps what is finished and returns in words how
            much that is.
    """
    _last_words.append(last_words)
    try:
        yield
    except KeyboardInterrupt:  # from here on the main thread can be reached
        notice()
        raise
    except Exception:
        raise_again()
        raise
    finally:
        _last_words.remove(last_words)


@contextmanager
def listening(*, for_good: bool = False) -> Iterator[None]:
    """Let signals end the block by :class:`Interrupted`; does nothing outside the main thread.

    Args:
        for_good: Whether the process ends after the block: signals are ignored from then on
            instead of being treated as before.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    _noticed.clear()
    _arrived.clear()
    before = {n: signal.getsignal(n) for n in SIGNALS if signal.getsignal(n) != signal.SIG_IGN}
    for number in before:
        signal.signal(number, _interrupt)
    reading, writing = os.pipe2(os.O_CLOEXEC)
    os.set_blocking(writing, False)
    woken = signal.set_wakeup_fd(writing, warn_on_full_buffer=False)
    watcher = threading.Thread(target=_watch, args=(reading,), daemon=True)
    watcher.start()
    try:
        yield
    finally:
        notice()
        signal.set_wakeup_fd(woken)
        for number, handler in before.items():
            signal.signal(number, signal.SIG_IGN if for_good else handler)
        os.close(writing)  # the watcher reads the end
        if not for_good:
            watcher.join()


def _interrupt(number: int, frame: FrameType | None) -> NoReturn:  # noqa: ARG001
    """Turn the first signal into an exception; further ones change nothing.

    What libraries say of it on their way out is not shown.
    """
    _aside.append(sys.stderr)
    sys.stderr = io.StringIO()
    for other in SIGNALS:
        signal.signal(other, signal.SIG_IGN)
    _arrived.append(number)
    raise Interrupted(number)


def _watch(reading: int) -> None:
    """Wait for a signal and end the process if the main thread does not notice."""
    with os.fdopen(reading, "rb", buffering=0) as pipe:
        while number := pipe.read(1):
            if number[0] in SIGNALS and not _noticed.wait(_PATIENCE):
                with _deciding:
                    if not _noticed.is_set():
                        _give_up(number[0])


def _give_up(number: int) -> NoReturn:
    """Keep what is finished, say one line and end the process."""
    said = words_of(128 + number)
    for last_words in _last_words:
        try:
            said += f"; {last_words()}"
        except Exception as error:
            said += f"; what was finished could not be kept: {error}"
    with suppress(OSError):
        shown = "\x1b[?25h\r\x1b[K" if os.isatty(2) else ""  # a bar of progress hides the cursor
        os.write(2, f"{shown}mitt: {said}\n".encode())
    os._exit(128 + number)
