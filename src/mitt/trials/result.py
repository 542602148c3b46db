"""The result of a run, ``mitt.catch/1``, and its throws one by one as they end.

Throws are kept in ``trials.jsonl`` in the run's folder: the first line says what is run, each
further line is a throw. A line is handed to the system as soon as it is whole, so that a process
that dies, however it dies, takes at most the throw under way with it. ``result.json`` is written
from the same throws when the run is over.
"""

import io
import json
import re
from collections.abc import Iterable, Mapping
from contextlib import AbstractContextManager
from dataclasses import asdict, dataclass
from math import isfinite
from pathlib import Path
from typing import Any, final

import numpy as np

from mitt import checks
from mitt.clock import Stopwatch
from mitt.errors import FileError
from mitt.files.writing import Leaves, write_json
from mitt.reading import read_text
from mitt.trials.score import Trial
from mitt.trials.statistics import wilson

SCHEMA = "mitt.catch/1"
STATUSES = ("caught", "dropped", "missed", "unreachable", "stopped", "aborted")
NAME = "trials.jsonl"
RESULT = "result.json"
MAP = "map.json"
PAGE = "report.html"
"""What the throws are called in the folder of a run, the result, the map and the page."""

LEAVES = Leaves(
    command="mitt catch",
    schema=SCHEMA,
    manifests=(NAME, RESULT),
    names=(*map(re.escape, (NAME, RESULT, MAP, PAGE)), r"recordings/throw-\d{5,}\.mcap"),
)
"""All that a run leaves in its folder."""

MAX_BYTES = 200_000_000
"""Largest list of throws that is read, and largest result [bytes]."""


def result(
    trials: list[Trial], stopwatch: Stopwatch, head: dict[str, object], wanted: int | None = None
) -> dict[str, Any]:
    """Return the whole result.

    ``head`` is what it says of the run; with fewer trials than ``wanted`` it is incomplete.
    """
    return {
        "schema": SCHEMA,
        **head,
        **({"incomplete": True} if wanted is not None and len(trials) < wanted else {}),
        "trials": [finite(plain_fields(trial)) for trial in trials],
        "summary": summary(trials, stopwatch),
    }


def plain_fields(trial: Any) -> dict[str, Any]:  # noqa: ANN401 (any dataclass)
    """Return a trial by its fields, without what only a run that learns a clock has."""
    row = asdict(trial)
    if row.get("clock", row) is None:
        del row["clock"]
    return row


def finite(value: Any) -> Any:  # noqa: ANN401 (any JSON value)
    """Return a value as JSON has it: numbers that are not finite are None, at any depth."""
    if isinstance(value, dict):
        return {key: finite(inner) for key, inner in value.items()}
    if isinstance(value, list):
        return [finite(inner) for inner in value]
    return None if isinstance(value, float) and not isfinite(value) else value


def summary(trials: list[Trial], stopwatch: Stopwatch) -> dict[str, Any]:
    """Return counts, catch rate over all throws with its 95 % Wilson interval, and tick times.

    Beside the rate ``force_n``, median and 95th percentile of the largest contact forces of the
    throws that touched the hand, and ``over_force``, how many of them were beyond what hand and arm
    take.
    """
    counts = {status: sum(t.status == status for t in trials) for status in STATUSES}
    low, high = wilson(counts["caught"], len(trials))
    return {
        "throws": len(trials),
        **counts,
        "catch_rate": counts["caught"] / len(trials) if trials else 0.0,
        "ci95": [low, high],
        "force_n": spread_of([t.peak_contact_force_n for t in trials]),
        "over_force": sum(t.over_force is True for t in trials),
        "tick_us": stopwatch.percentiles_us(),
        "deadline_misses": stopwatch.misses(),
    }


def spread_of(values: Iterable[float | None], percent: int = 95) -> dict[str, float] | None:
    """Return ``median`` and a percentile, as ``p95``, of what is known; None where nothing is."""
    known = [x for x in values if x is not None]
    if not known:
        return None
    median, most = np.percentile(known, [50.0, percent])
    return {"median": float(median), f"p{percent}": float(most)}


def force_words(force: Mapping[str, float] | None, over: int) -> str:
    """Return in words how hard balls pressed, for beside a catch rate."""
    if force is None:
        return "no ball touched the hand"
    beyond = f", {over} beyond what hand or arm take" if over else ""
    return f"contact force {spread_words(force)}{beyond}"


def spread_words(force: Mapping[str, float]) -> str:
    """Return median and 95th percentile of forces [N] in words."""
    return f"{force['median']:.0f} N median, 95 % {force['p95']:.0f} N"


@final
class Journal(AbstractContextManager["Journal"]):
    """Keeps the throws of a run as they end.

    Attributes:
        trials: Those that are kept.
    """

    def __init__(
        self,
        folder: Path,
        head: dict[str, Any],
        wanted: int,
        again: Mapping[str, Any] | None = None,
    ) -> None:
        """Begin the list in a folder that is claimed.

        Args:
            folder: The folder.
            head: What the result says of the run.
            wanted: How many throws there are to be.
            again: What makes the run again.

        Raises:
            FileError: It cannot be written.
        """
        self._folder, self._head, self._wanted = folder, head, wanted
        self.trials: list[Trial] = []
        try:
            self._file = (folder / NAME).open("x", encoding="utf-8", buffering=1)
        except OSError as error:
            raise _unwritable(folder, error) from None
        self._write({"schema": SCHEMA, **head, "throws": wanted, "again": dict(again or {})})

    def __exit__(self, *_: object) -> None:
        """Close the list."""
        self._file.close()

    def add(self, trial: Trial) -> None:
        """Keep a throw that has ended.

        Raises:
            FileError: It cannot be written.
        """
        self._write(plain_fields(trial))
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
    """Return how many trials of an interrupted run are kept, and where."""
    return f"{done} of {wanted} trials are kept in {folder / RESULT}"


def _unwritable(folder: Path, error: OSError) -> FileError:
    """Return the error of a list that cannot be written."""
    return FileError(str(folder / NAME), "a file that can be written", error.strerror)


def died(folder: Path) -> bool:
    """Say whether a folder holds the throws of a run that came to no result."""
    return (folder / NAME).exists() and not (folder / RESULT).exists()


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Kept:
    """What the list of a run says.

    Attributes:
        head: What the result says of the run.
        wanted: How many throws there were to be.
        again: What makes the run again; nothing where the list does not say.
        trials: The throws that ended.
    """

    head: dict[str, Any]
    wanted: int
    again: dict[str, Any]
    trials: list[Trial]

    @property
    def result(self) -> dict[str, Any]:
        """The result of a run that died; the times of its ticks died with it and are zero."""
        return result(self.trials, Stopwatch(), self.head, self.wanted)


def read_kept(folder: Path) -> Kept:
    """Return what the list of a run says.

    Raises:
        FileError: There is no list, or it is none of a run.
    """
    path = checks.path("folder", folder) / NAME
    lines = io.StringIO(read_text(path, max_bytes=MAX_BYTES, wanted="the throws of a run"))
    head = _row(lines.readline())
    wanted, again = head.pop("throws", None), head.pop("again", {})
    ours = head.pop("schema", None) == SCHEMA and isinstance(again, dict)
    if not ours or not isinstance(wanted, int):
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
    return Kept(head=head, wanted=wanted, again=again, trials=trials)


def _row(line: str) -> dict[str, Any]:
    """Return what a line says; nothing where it is no JSON object."""
    try:
        row = json.loads(line)
    except (ValueError, RecursionError):
        return {}
    return row if isinstance(row, dict) else {}
