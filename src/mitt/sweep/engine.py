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
from typing import Protocol, TypeVar, final

from mitt.errors import InputError
from mitt.interrupts import end_with_parent
from mitt.link.realtime import settle

_Task = TypeVar("_Task")

#: How long a scheduler may take to answer [s].
_ANSWER = "5s"


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
        """Be ready for work again after a worker died; work under way is lost."""

    def close(self, *, at_once: bool) -> None:
        """Let all workers go; ``at_once`` drops what they are doing."""


@final
class Processes:
    """Processes of this machine."""

    def __init__(self, workers: int) -> None:
        """Start as many processes."""
        self.workers = workers
        self._pool = self._fresh()

    def submit(self, work: Callable[..., bytes], *given: object) -> "Future[bytes]":
        """Start some work."""
        return self._pool.submit(work, *given)

    def died(self, error: BaseException) -> bool:
        """Say whether an error means that a worker died."""
        return isinstance(error, BrokenExecutor)

    def restart(self) -> None:
        """Start new processes."""
        self._pool.shutdown(wait=False, cancel_futures=True)
        self._pool = self._fresh()

    def close(self, *, at_once: bool) -> None:
        """Let the processes go."""
        started = list((self._pool._processes or {}).values()) if at_once else []
        self._pool.shutdown(wait=not at_once, cancel_futures=True)
        for process in started:
            process.terminate()

    def _fresh(self) -> ProcessPoolExecutor:
        """Return a pool of new processes, which share nothing with this one."""
        context = multiprocessing.get_context("spawn")
        return ProcessPoolExecutor(self.workers, mp_context=context, initializer=_begin)


def _begin() -> None:
    """Begin a worker: interrupts are its parent's business, and it does not outlive its parent.

    The process throws and nothing else, so the garbage collector need not look at all that it
    has imported again and again.
    """
    import mitt.sweep.work  # noqa: F401, PLC0415 (what a job will import)

    settle()
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    end_with_parent()


@final
class Cluster:
    """A Dask cluster."""

    def __init__(self, address: str) -> None:
        """Connect to a scheduler.

        Raises:
            InputError: Nothing answers there, or the package is not installed.
        """
        try:
            from distributed import Client  # noqa: PLC0415 (optional)
        except ImportError:
            raise InputError("--engine", "the package distributed for dask://", "a Python without",
                             do="install mitt[cluster]") from None  # fmt: skip
        logging.getLogger("distributed").setLevel(logging.CRITICAL)
        place = f"tcp://{address.removeprefix('dask://')}"
        try:
            self._client = Client(place, timeout=_ANSWER)
        except (OSError, ValueError) as error:
            wanted = "the address of a Dask scheduler that answers"
            raise InputError("--engine", wanted, f"{address} ({type(error).__name__})",
                             do="start one with dask scheduler") from None  # fmt: skip
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


def engine_of(name: str, workers: int | None) -> Engine:
    """Return an engine: ``local``, or ``dask://HOST:PORT``.

    Raises:
        InputError: The name is neither, the number cannot be meant, or no scheduler answers.
    """
    if workers is not None and not 1 <= workers <= 1024:
        raise InputError("--workers", "a number in 1..1024", workers)
    if name == "local":
        return Processes(workers or len(os.sched_getaffinity(0)))
    return Cluster(check_engine(name))


def check_engine(name: str) -> str:
    """Return the name of an engine that may exist.

    Raises:
        InputError: It is neither ``local`` nor an address.
    """
    _, colon, port = name.removeprefix("dask://").rpartition(":")
    if name != "local" and not (name.startswith("dask://") and colon and port.isdigit()):
        raise InputError("--engine", "local or dask://HOST:PORT", repr(name))
    return name


def run_tasks(
    engine: Engine, work: Callable[[_Task], bytes], tasks: Sequence[_Task], *, window: int
) -> Iterator[tuple[_Task, bytes | BaseException]]:
    """Yield what became of each task, as they end.

    A worker that dies takes with it what is under way in a pool of processes, so that few tasks
    are under way at once; all of those are yielded with the error.

    Args:
        engine: Where the work is done.
        work: What is done with each task.
        tasks: The tasks.
        window: Most tasks under way.
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
