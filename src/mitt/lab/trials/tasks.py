"""The tasks by name: what each counts and measures, and its study. A new task has its line here."""

from collections.abc import Callable
from pathlib import Path
from typing import Any, Final, NamedTuple

from mitt.core.errors import UnknownNameError
from mitt.io.reading import read_toml
from mitt.lab.trials.bat_study import BatStudy, read_bat_study
from mitt.lab.trials.batting import BAT
from mitt.lab.trials.catch_study import CatchStudy, read_catch_study
from mitt.lab.trials.meet_study import MeetStudy, read_meet_study
from mitt.lab.trials.meeting import MEET
from mitt.lab.trials.prepared import TaskRun
from mitt.lab.trials.score import CATCH
from mitt.lab.trials.scored_task import ScoredTask
from mitt.lab.trials.study import Study
from mitt.lab.trials.study_file import study_path
from mitt.lab.trials.study_folder import read_manifest, task_of_folder


class KnownTask(NamedTuple):
    """A task that runs, studies and their readers know.

    Attributes:
        scored: What its trials count and measure.
        study: Its studies.
        read: Reads the file of one.
        prepare: Returns a run from the options of its command and the folder to be written, every
            input read and found good; None where the command is written for the task
            (``mitt.cli``).
    """

    scored: ScoredTask
    study: type[Study]
    read: Callable[[Path], Study]
    prepare: Callable[[Any, Path], TaskRun] | None = None


TASKS: Final = {
    x.scored.name: x
    for x in (
        KnownTask(CATCH, CatchStudy, read_catch_study),
        KnownTask(MEET, MeetStudy, read_meet_study),
        KnownTask(BAT, BatStudy, read_bat_study),
    )
}
"""The tasks."""


def read_study(path: Path) -> Study:
    """Read the file of a study, or one that ships, by name; of catching where it names no task.

    Raises:
        FileError: The file cannot be read or is no TOML.
        InputError: A key is unknown or its value cannot be used.
    """
    place = study_path(path)
    return _of(str(read_toml(place).get("task", CATCH.name)), f"{place} key task").read(path)


def study_of_folder(path: Path) -> Study:
    """Return the study that a folder was made by.

    Raises:
        FileError: The folder holds no study.
    """
    return read_manifest(path, _of(task_of_folder(path), str(path)).study)


def _of(task: str, place: str) -> KnownTask:
    """Return a task by its name; ``place`` is what an error calls what names it."""
    if task not in TASKS:
        raise UnknownNameError(place, task, tuple(TASKS))
    return TASKS[task]
