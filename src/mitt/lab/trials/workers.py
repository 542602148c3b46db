"""Where tasks are done: processes of this machine, or a Dask cluster by its address.

Both are a ``concurrent.futures.Executor``, so everything else is the same for both.
"""

import logging
import multiprocessing
import os
import signal
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import (
    FIRST_COMPLETED,
    BrokenExecutor,
    Executor,
    Future,
    ProcessPoolExecutor,
    wait,
)
from importlib import import_module
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess
from threading import Event, Thread
from typing import Protocol, TypeVar, final

from mitt.clock import settle
from mitt.core.errors import InputError, MittError, check_package
from mitt.interrupts import end_with_parent, safe_path
from mitt.numerals import whole_of

_Task = TypeVar("_Task")

#: How long a scheduler may take to answer [s].
_ANSWER = "5s"
#: How long a process may take to be gone, and how often that is looked at [s].
_SOON = 5.0
_OFTEN = 0.05


class Engine(Protocol):
    """Runs functions of ours somewhere else."""

    @property
    def workers(self) -> int:
        """How many chunks run at once."""

    def submit(self, work: Callable[..., bytes], *given: object) -> "Future[bytes]":
        """Start some work."""

    def died(self, error: BaseException) -> bool:
        """Say whether an error of a future means that its worker died."""

    def restart(self) -> None:
        """Be ready for work again after a worker died; work under way is lost.

        Raises:
            InputError: Workers die again and again.
        """

    def close(self, *, at_once: bool) -> None:
        """Let all workers go; ``at_once`` drops what they are doing."""


@final
class Processes:
    """Processes of this machine, started when there is something to do.

    Workers that die again and again, without a task done in between, end by an error: at once where
    one cannot import what it is to do, after two that died before they could begin, and after six
    that died at their tasks.
    """

    def __init__(self, workers: int) -> None:
        """Say how many processes there are to be."""
        self.workers = workers
        self._pool: _Pool | None = None
        self._deaths = 0

    def submit(self, work: Callable[..., bytes], *given: object) -> "Future[bytes]":
        """Start some work.

        Raises:
            InputError: The system starts no more processes.
        """
        self._pool = self._pool or _Pool(self.workers, work.__module__)
        # A process that is started here is not to be interrupted either while it is starting.
        usual = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
        try:
            with safe_path():
                future = self._pool.executor.submit(work, *given)
        except OSError as error:
            raise _no_workers(str(error)) from None
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, usual)
        future.add_done_callback(self._ended)
        return future

    def died(self, error: BaseException) -> bool:
        """Say whether an error means that a worker died."""
        return isinstance(error, BrokenExecutor)

    def restart(self) -> None:
        """Let new processes start.

        Raises:
            InputError: It would not help: workers die again and again.
        """
        if self._pool is None:
            return
        why, begun = self._pool.buried()
        self._pool = None
        self._deaths += 1
        if self._deaths >= (6 if begun else 2):
            raise _no_workers(why)

    def close(self, *, at_once: bool) -> None:
        """Let the processes go."""
        if self._pool is not None:
            self._pool.close(at_once=at_once)
        self._pool = None

    def _ended(self, future: "Future[bytes]") -> None:
        """Note that a worker lived to the end of a task."""
        if not future.cancelled() and not self.died(future.exception() or Exception()):
            self._deaths = 0


@final
class _Pool:
    """Processes that share nothing with this one, and a pipe by which they say that they began."""

    def __init__(self, workers: int, module: str) -> None:
        """Prepare them for the work of a module."""
        context = multiprocessing.get_context("spawn")
        self._said, self._told = context.Pipe(duplex=False)
        with safe_path():
            self.executor = ProcessPoolExecutor(
                workers, mp_context=context, initializer=_begin, initargs=(module, self._told)
            )

    def close(self, *, at_once: bool) -> Sequence[BaseProcess]:
        """Let the processes go; return those that there were."""
        started = list((self.executor._processes or {}).values())
        manager: Thread | None = vars(self.executor)["_executor_manager_thread"]
        self.executor.shutdown(wait=not at_once, cancel_futures=True)
        for process in started if at_once else ():
            process.terminate()
        if at_once and manager is not None:
            manager.join(_SOON)  # semaphores that it still has would be told of as leaked
        return started

    def buried(self) -> tuple[str, bool]:
        """Let go what is left after a death; return why one died, and whether it had begun.

        Raises:
            InputError: It could not import what it was to do.
        """
        started = self.close(at_once=True)
        for process in started:
            _join(process)
        begun = set[int]()
        while self._said.poll():
            number, _, why = self._said.recv_bytes().decode().partition(" ")
            if why:
                raise _no_workers(f"one that cannot begin: {why}")
            begun.add(int(number))
        ends = {x.pid: x.exitcode for x in started if x.exitcode}
        own = {pid: code for pid, code in ends.items() if code != -signal.SIGTERM} or ends
        pid, code = next(iter(own.items()), (None, None))
        return _end_of(code), pid in begun


def _join(process: BaseProcess) -> None:
    """Wait until a process has ended and its exit code is known.

    The executor's own thread waits for it as well, and may be the one that hears of its end.
    """
    process.join(_SOON)
    for _ in range(round(_SOON / _OFTEN)):
        if process.exitcode is not None:
            return
        Event().wait(_OFTEN)


def _end_of(code: int | None) -> str:
    """Return in words how a process ended, by its exit code."""
    if code is None:
        return "one that ended without a word"
    if code > 0:
        return f"one that ended with status {code}"
    name = signal.Signals(-code).name
    return f"one killed by {name}" + (", as where memory runs out" if name == "SIGKILL" else "")


def _no_workers(why: str) -> InputError:
    """Return the error of workers that do not live."""
    return InputError(
        "workers", "processes that live", why, do="see to the memory and the limits of the machine"
    )


def _begin(module: str, told: Connection) -> None:
    """Begin a worker, import what its jobs will, and say that it has begun or why it cannot.

    Interrupts are its parent's business, and it does not outlive its parent. The process throws and
    nothing else, so the garbage collector need not look at all that it has imported again and
    again.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    end_with_parent()
    try:
        import_module(module)
        settle()
    except BaseException as error:  # an executor would print it, and start the next
        said = str(error) if isinstance(error, MittError) else f"{type(error).__name__}: {error}"
        told.send_bytes(f"{os.getpid()} {said[:600]}".encode())
        os._exit(1)
    told.send_bytes(str(os.getpid()).encode())


@final
class Cluster:
    """A Dask cluster."""

    def __init__(self, address: str) -> None:
        """Connect to a scheduler.

        Raises:
            InputError: Nothing answers there.
        """
        from distributed import Client  # noqa: PLC0415 (optional)

        logging.getLogger("distributed").setLevel(logging.CRITICAL)
        place = f"tcp://{address.removeprefix('dask://')}"
        try:
            self._client = Client(place, timeout=_ANSWER)
        except (OSError, ValueError) as error:
            wanted = "the address of a Dask scheduler that answers"
            raise InputError(
                "--engine",
                wanted,
                f"{address} ({type(error).__name__})",
                do="start one with dask scheduler",
            ) from None
        self._pool: Executor = self._client.get_executor(pure=False)
        self.workers = max(1, sum(self._client.nthreads().values()))

    def submit(self, work: Callable[..., bytes], *given: object) -> "Future[bytes]":
        """Start some work."""
        return self._pool.submit(work, *given)

    def died(self, error: BaseException) -> bool:
        """Say whether an error means that a worker died."""
        from distributed.scheduler import KilledWorker  # noqa: PLC0415 (optional)

        return isinstance(error, KilledWorker)

    def restart(self) -> None:
        """Do nothing: the cluster sees to its own workers."""

    def close(self, *, at_once: bool) -> None:
        """Leave the cluster; ``at_once`` cancels what it still has of ours."""
        if not at_once:
            self._pool.shutdown(wait=True)
        self._client.close()


def usable_cores() -> int:
    """Return how many cores this process may use; all of the machine where the system says none."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def engine_of(name: str, workers: int | None) -> Engine:
    """Return an engine: ``local``, or ``dask://HOST:PORT``.

    Raises:
        InputError: As of :func:`check_engine`, or no scheduler answers.
    """
    check_engine(name, workers)
    if name == "local":
        return Processes(workers or usable_cores())
    return Cluster(name)


def check_engine(name: str, workers: int | None) -> None:
    """Refuse an engine that cannot be; nothing is started, and nobody is asked.

    Raises:
        InputError: It is neither ``local`` nor an address, its package is not installed, or the
            number of workers cannot be meant.
    """
    if workers is not None and not 1 <= workers <= 1024:
        raise InputError("--workers", "a number in 1..1024", workers)
    if name == "local":
        return
    host, _, said = name.removeprefix("dask://").rpartition(":")
    port = whole_of(said)
    if not (name.startswith("dask://") and host and port is not None and 0 < port < 65536):
        raise InputError("--engine", "local or dask://HOST:PORT", repr(name))
    check_package("--engine", "distributed", "distributed", "cluster")


def run_tasks(
    engine: Engine, work: Callable[[_Task], bytes], tasks: Sequence[_Task], *, window: int
) -> Iterator[tuple[_Task, bytes | BaseException]]:
    """Yield what became of each task, as they end; at most ``window`` are under way.

    A worker that dies takes with it what is under way in a pool of processes, so that few tasks
    are under way at once; all of those are yielded with the error.
    """
    waiting, under_way = deque(tasks), dict[Future[bytes], _Task]()
    while waiting or under_way:
        broken = False
        while waiting and len(under_way) < window and not broken:
            try:
                under_way[engine.submit(work, waiting[0])] = waiting[0]
                waiting.popleft()
            except Exception as error:
                broken = engine.died(error)
                if not broken:
                    raise
        for future in wait(under_way, return_when=FIRST_COMPLETED).done if under_way else set():
            outcome = _outcome(future)
            broken = broken or (isinstance(outcome, BaseException) and engine.died(outcome))
            yield under_way.pop(future), outcome
        if broken:
            for future, task in under_way.items():
                yield task, _outcome(future)
            under_way.clear()
            engine.restart()


def _outcome(future: Future[bytes]) -> bytes | BaseException:
    """Return the result of a task, or its error; waits for it."""
    error = future.exception()
    return future.result() if error is None else error
