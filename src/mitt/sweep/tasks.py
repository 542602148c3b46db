"""Handing tasks to an engine, a few at a time, and taking what comes back, deaths included."""

from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, wait
from typing import TypeVar

from mitt.sweep.engine import Engine

_Task = TypeVar("_Task")


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
        broken = not _fill(engine, work, waiting, under_way, window)
        ended = wait(under_way, return_when=FIRST_COMPLETED).done if under_way else set()
        for future in ended:
            broken = broken or _died(engine, future)
            yield under_way.pop(future), _outcome(future)
        if broken:
            for future, task in under_way.items():
                yield task, _outcome(future)
            under_way.clear()
            engine.restart()


def _fill(
    engine: Engine,
    work: Callable[[_Task], bytes],
    waiting: deque[_Task],
    under_way: dict[Future[bytes], _Task],
    window: int,
) -> bool:
    """Start tasks up to the window; say whether the engine still takes them."""
    while waiting and len(under_way) < window:
        try:
            under_way[engine.submit(work, waiting[0])] = waiting[0]
        except Exception as error:
            if not engine.died(error):
                raise
            return False
        waiting.popleft()
    return True


def _outcome(future: Future[bytes]) -> bytes | BaseException:
    """Return the result of a task, or its error; waits for it."""
    error = future.exception()
    return future.result() if error is None else error


def _died(engine: Engine, future: Future[bytes]) -> bool:
    """Say whether a task ended because its worker died."""
    error = future.exception()
    return error is not None and engine.died(error)
