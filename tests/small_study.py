"""A small study with a map at hand, and an engine that works here and now."""

import shutil
from collections.abc import Callable
from concurrent.futures import Future
from pathlib import Path

from mitt.core.map.learn import Learned
from mitt.io.maps import save_map
from mitt.lab.trials.catch_study import CatchStudy, read_catch_study
from mitt.lab.trials.study import Chunk
from mitt.lab.trials.study_folder import Folder

TEXT = """
name = "small"
seed = 500
throws = 2
chunk = 1
generators = ["direct", "unoptimised"]
vision = "points"

[[conditions]]
name = "clean"

[[conditions]]
name = "blind"
scene.faults = [{ kind = "dropout" }]

[[sweeps]]
name = "kick"
unit = "m/s"
set = "scene.faults.0.magnitude"
values = [1.0]
scene.faults = [{ kind = "kick", magnitude = 0.0 }]
"""
GENERATORS = ("direct", "unoptimised")


def written(folder: Path, text: str) -> Path:
    """Write a study file and return where it is."""
    path = folder / "study.toml"
    path.write_text(text)
    return path


class WorkerDiedError(Exception):
    """What an engine reports when a worker died."""


class Here:
    """An engine that does each task when it is handed over; some tasks kill their worker.

    Attributes:
        workers: How many tasks may be under way.
        done: Numbers of the chunks that were thrown.
    """

    def __init__(self, deadly: Callable[[int, int], bool] | None = None) -> None:
        """Take what says whether the n-th try of a chunk's number is deadly."""
        self.workers = 1
        self.done: list[int] = []
        self._tries: dict[int, int] = {}
        self._deadly = deadly or (lambda _number, _attempt: False)

    def submit(self, work: Callable[..., bytes], *given: object) -> "Future[bytes]":
        """Do the work."""
        future: Future[bytes] = Future()
        number = given[0].number if isinstance(given[0], Chunk) else -1
        attempt = self._tries[number] = self._tries.get(number, 0) + 1
        if self._deadly(number, attempt):
            future.set_exception(WorkerDiedError())
            return future
        try:
            future.set_result(work(*given))
            self.done.append(number)
        except Exception as error:
            future.set_exception(error)
        return future

    def died(self, error: BaseException) -> bool:
        """Say whether a worker died."""
        return isinstance(error, WorkerDiedError)

    def restart(self) -> None:
        """Do nothing."""

    def close(self, *, at_once: bool) -> None:
        """Do nothing."""


def quiet(name: str, done: int, of: int) -> None:
    """Take in progress and say nothing."""


def write_study(folder: Path, text: str, *, generators: tuple[str, ...] = GENERATORS) -> CatchStudy:
    """Write a study file and read it."""
    path = folder / "study.toml"
    path.write_text(text)
    return read_catch_study(path, generators=generators)


def ready(path: Path, study: CatchStudy, learned: Learned) -> Folder:
    """Return a claimed folder with a map in it, so that nothing has to be learned."""
    folder = Folder(path)
    folder.claim(study, resume=True, overwrite=False)
    for condition in study.conditions:
        save_map(folder.map(condition.arm), learned, version="0.1.0")
    return folder


def thrown_again(whole: Path, place: Path) -> tuple[CatchStudy, Folder]:
    """Return the small study and a copy of its folder after it was thrown."""
    study = write_study(place, TEXT)
    return study, Folder(Path(shutil.copytree(whole, place / "out")))
