"""The throws of a run, written one by one as they end: ``trials.jsonl`` in the run's folder.

The first line says what is run, each further line is a throw. A line is handed to the system as
soon as it is whole, so that a process that dies, however it dies, takes at most the throw under way
with it. ``result.json`` is written from the same throws when the run is over.
"""

import io
import json
from contextlib import AbstractContextManager
from dataclasses import asdict
from pathlib import Path
from typing import Any, final

from mitt.errors import FileError
from mitt.files.files import write_json
from mitt.link.clock import Stopwatch
from mitt.reading import read_text
from mitt.trials.result import SCHEMA, finite, result
from mitt.trials.score import Trial

NAME, RESULT = "trials.jsonl", "result.json"
"""What the throws are called in the folder of a run, and the result."""

#: Largest list of throws that is read [bytes].
_MAX_BYTES = 200_000_000


@final
class Journal(AbstractContextManager["Journal"]):
    """Keeps the throws of a run as they end.

    Attributes:
        trials: Those that are kept.
    """

    def __init__(self, folder: Path, head: dict[str, Any], wanted: int) -> None:
        """Begin the list in a folder that is claimed.

        Raises:
            FileError: It cannot be written.
        """
        self._folder, self._head, self._wanted = folder, head, wanted
        self.trials: list[Trial] = []
        try:
            self._file = (folder / NAME).open("x", encoding="utf-8", buffering=1)
        except OSError as error:
            raise _unwritable(folder, error) from None
        self._write({"schema": SCHEMA, **head, "throws": wanted})

    def __exit__(self, *_: object) -> None:
        """Close the list."""
        self._file.close()

    def add(self, trial: Trial) -> None:
        """Keep a throw that has ended.

        Raises:
            FileError: It cannot be written.
        """
        self._write(asdict(trial))
        self.trials.append(trial)

    def last_words(self) -> str:
        """Write the result of what is done, and return how much that is."""
        trials = list(self.trials)
        write_json(self._folder / RESULT, result(trials, Stopwatch(), self._head, self._wanted))
        return kept_words(len(trials), self._wanted, self._folder)

    def _write(self, row: dict[str, Any]) -> None:
        """Write a line."""
        try:
            self._file.write(json.dumps(finite(row), allow_nan=False) + "\n")
        except OSError as error:
            raise _unwritable(self._folder, error) from None


def kept_words(done: int, wanted: int, folder: Path) -> str:
    """Return how many throws of an interrupted run are kept, and where."""
    return f"{done} of {wanted} throws are kept in {folder / RESULT}"


def _unwritable(folder: Path, error: OSError) -> FileError:
    """Return the error of a list that cannot be written."""
    return FileError(str(folder / NAME), "a file that can be written", error.strerror)


def died(folder: Path) -> bool:
    """Say whether a folder holds the throws of a run that came to no result."""
    return (folder / NAME).exists() and not (folder / RESULT).exists()


def recovered(folder: Path) -> dict[str, Any]:
    """Return the result of a run that died, from its list of throws.

    The times of its ticks died with it: those of the result are zero.

    Raises:
        FileError: There is no list, or it is none of a run.
    """
    path = folder / NAME
    lines = io.StringIO(read_text(path, max_bytes=_MAX_BYTES, wanted="the throws of a run"))
    head = _row(lines.readline())
    wanted = head.pop("throws", None)
    if head.pop("schema", None) != SCHEMA or not isinstance(wanted, int):
        raise FileError(str(path), f"throws of schema {SCHEMA}", "others")
    trials = []
    for line in lines:
        if not line.endswith("\n"):
            break  # the process died while it wrote this one
        try:
            trials.append(Trial(**_row(line)))
        except TypeError:
            place = f"{path} line {len(trials) + 2}"
            raise FileError(place, "a throw of this version", line[:60]) from None
    return result(trials, Stopwatch(), head, wanted)


def _row(line: str) -> dict[str, Any]:
    """Return what a line says; nothing where it is no JSON object."""
    try:
        row = json.loads(line)
    except (ValueError, RecursionError):
        return {}
    return row if isinstance(row, dict) else {}
