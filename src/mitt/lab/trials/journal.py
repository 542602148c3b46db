"""The trials of a run one by one as they end.

Trials are kept in ``trials.jsonl`` in the run's folder: the first line says what is run, each
further line is a trial. A line is handed to the system as soon as it is whole, so that a process
that dies, however it dies, takes at most the trial under way with it. ``result.json`` is written
from the same trials when the run is over.
"""

import io
import json
from collections.abc import Mapping
from contextlib import AbstractContextManager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, final

from mitt.clock import Stopwatch
from mitt.core import checks
from mitt.core.errors import FileError
from mitt.io.reading import read_text
from mitt.io.writing import write_json
from mitt.lab.trials.result import finite, kept_words, plain_fields, result
from mitt.lab.trials.scored_task import NAME, RESULT, ScoredTask
from mitt.lab.trials.tasks import TASKS

MAX_BYTES = 200_000_000
"""Largest list of trials that is read, and largest result [bytes]."""


@final
class Journal(AbstractContextManager["Journal"]):
    """Keeps the trials of a run as they end.

    Attributes:
        trials: Those that are kept.
    """

    def __init__(
        self,
        folder: Path,
        task: ScoredTask,
        head: Mapping[str, Any],
        wanted: int,
        again: Mapping[str, Any] | None = None,
    ) -> None:
        """Begin the list in a folder that is claimed.

        Args:
            folder: The folder.
            task: What the trials are of.
            head: What the result says of the run.
            wanted: How many trials there are to be.
            again: What makes the run again.

        Raises:
            FileError: It cannot be written.
        """
        self._folder, self._task, self._head, self._wanted = folder, task, head, wanted
        self.trials: list[Any] = []
        try:
            self._file = (folder / NAME).open("x", encoding="utf-8", buffering=1)
        except OSError as error:
            raise _unwritable(folder, error) from None
        said = {"schema": task.result_schema, **head, task.in_result: wanted}
        self._write(said | {"again": dict(again or {})})

    def __exit__(self, *_: object) -> None:
        """Close the list."""
        self._file.close()

    def add(self, trial: Any) -> None:  # noqa: ANN401 (one of its task)
        """Keep a trial that has ended.

        Raises:
            FileError: It cannot be written.
        """
        self._write(plain_fields(trial))
        self.trials.append(trial)

    def last_words(self) -> str:
        """Write the result of what is done, and return how much that is."""
        trials = list(self.trials)
        said = result(self._task, trials, Stopwatch(), self._head, self._wanted)
        write_json(self._folder / RESULT, said)
        return kept_words(len(trials), self._wanted, self._folder)

    def _write(self, row: dict[str, Any]) -> None:
        """Write a line."""
        try:
            self._file.write(json.dumps(finite(row), allow_nan=False) + "\n")
        except OSError as error:
            raise _unwritable(self._folder, error) from None


def _unwritable(folder: Path, error: OSError) -> FileError:
    """Return the error of a list that cannot be written."""
    return FileError(str(folder / NAME), "a file that can be written", error.strerror)


def died(folder: Path) -> bool:
    """Say whether a folder holds the trials of a run that came to no result."""
    return (folder / NAME).exists() and not (folder / RESULT).exists()


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Kept:
    """What the list of a run says.

    Attributes:
        task: What the trials are of.
        head: What the result says of the run.
        wanted: How many trials there were to be.
        again: What makes the run again; nothing where the list does not say.
        trials: The trials that ended.
    """

    task: ScoredTask
    head: dict[str, Any]
    wanted: int
    again: dict[str, Any]
    trials: list[Any]

    @property
    def result(self) -> dict[str, Any]:
        """The result of a run that died; the times of its ticks died with it and are zero."""
        return result(self.task, self.trials, Stopwatch(), self.head, self.wanted)


def read_kept(folder: Path) -> Kept:
    """Return what the list of a run says.

    Raises:
        FileError: There is no list, or it is none of a run.
    """
    path = checks.path("folder", folder) / NAME
    lines = io.StringIO(read_text(path, max_bytes=MAX_BYTES, wanted="the trials of a run"))
    head = _row(lines.readline())
    again, schema = head.pop("again", {}), head.pop("schema", "")
    tasks = [x.scored for x in TASKS.values()]
    task = next((x for x in tasks if x.result_schema == schema), None)
    wanted = None if task is None else head.pop(task.in_result, None)
    if task is None or not isinstance(again, dict) or not isinstance(wanted, int):
        known = " or ".join(x.result_schema for x in tasks)
        raise FileError(str(path), f"trials of schema {known}", "others")
    trials = []
    for line in lines:
        if not line.endswith("\n"):
            break  # the process died while it wrote this one
        try:
            trials.append(task.trial(**_row(line)))
        except TypeError:
            place = f"{path} line {len(trials) + 2}"
            raise FileError(place, "a trial of this version", line[:60]) from None
    return Kept(task=task, head=head, wanted=wanted, again=again, trials=trials)


def _row(line: str) -> dict[str, Any]:
    """Return what a line says; nothing where it is no JSON object."""
    try:
        row = json.loads(line)
    except (ValueError, RecursionError):
        return {}
    return row if isinstance(row, dict) else {}
