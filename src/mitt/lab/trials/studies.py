"""The studies that there are, by task: of a file, and of a folder."""

from collections.abc import Callable
from pathlib import Path
from typing import Final, NamedTuple

from mitt.core.errors import UnknownNameError
from mitt.io.reading import read_toml
from mitt.lab.trials.bat_study import BatStudy, read_bat_study
from mitt.lab.trials.catch_study import CatchStudy, read_catch_study
from mitt.lab.trials.meet_study import MeetStudy, read_meet_study
from mitt.lab.trials.score import CATCH
from mitt.lab.trials.study import Study
from mitt.lab.trials.study_file import study_path
from mitt.lab.trials.study_folder import read_manifest, task_of_folder


class StudyKind(NamedTuple):
    """Studies of a task.

    Attributes:
        kind: What their folder says.
        read: Reads their file.
    """

    kind: type[Study]
    read: Callable[[Path], Study]


STUDIES: Final = {
    x.kind.kind.name: x
    for x in (
        StudyKind(CatchStudy, read_catch_study),
        StudyKind(MeetStudy, read_meet_study),
        StudyKind(BatStudy, read_bat_study),
    )
}
"""Studies by the name of their task."""


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
    return read_manifest(path, _of(task_of_folder(path), str(path)).kind)


def _of(task: str, place: str) -> StudyKind:
    """Return the studies of a task; ``place`` is what an error calls what names it."""
    if task not in STUDIES:
        raise UnknownNameError(place, task, tuple(STUDIES))
    return STUDIES[task]
