"""Running a study of a task, and what its trials come to: rates, errors, pairs.

Workers, folder and parts are those of :mod:`mitt.trials.study_run`. Each generator is held against
the map on the same targets: who succeeded by McNemar's test, whose error, acceleration or force was
smaller by the sign test over the trials in which both did, each measure corrected after Holm over
the whole table.
"""

import json
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, fields
from functools import cache
from types import UnionType
from typing import Any, Final, TypeVar, Union, final, get_args, get_origin

from mitt.clock import Progress, Stopwatch
from mitt.errors import FileError, MissingPackageError
from mitt.files.writing import write_json
from mitt.interrupts import notice, status_of
from mitt.trials.result import spread_of
from mitt.trials.statistics import holm, mcnemar, wilson
from mitt.trials.study_file import REFERENCE
from mitt.trials.study_folder import Folder, notes_of, read_manifest
from mitt.trials.study_results import read_part, write_rows
from mitt.trials.study_run import FinishedStudy, join, throw_all
from mitt.trials.task_study import Player, Row, Task, TaskStudy
from mitt.trials.workers import Engine

try:
    import pyarrow as pa
except ImportError as error:
    raise MissingPackageError("mitt study", "pyarrow", "study") from error

#: Below this p a difference counts.
_SURE = 0.05
#: Types of columns, by those of fields.
_TYPES: Final = {
    str: pa.string(),
    int: pa.int64(),
    float: pa.float64(),
    bool: pa.bool_(),
    list[float]: pa.list_(pa.float64()),
}


@cache
def columns_of(trial: type) -> Any:  # noqa: ANN401 (pyarrow has no types)
    """Return the columns of a table of trials: names of the cell, and all that has a type.

    Args:
        trial: The class of the trials, a dataclass.
    """
    out = [pa.field("generator", pa.string()), pa.field("condition", pa.string())]
    for field in fields(trial):
        kinds = get_args(field.type) if get_origin(field.type) in (Union, UnionType) else ()
        kind = next((x for x in kinds if x is not type(None)), field.type)
        if kind in _TYPES:
            out.append(pa.field(field.name, _TYPES[kind]))
    return pa.schema(out)


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class TaskJob:
    """A chunk of one generator in one condition; a :class:`mitt.trials.study_run.Chunk`.

    Attributes:
        number: Number of the chunk in the study.
        study: The study.
        player: The generator.
        condition: What comes by.
        start: First trial.
        notes: What the metadata of a part say of the study.
    """

    number: int
    study: TaskStudy
    player: Player
    condition: Any
    start: int
    notes: tuple[tuple[str, str], ...]

    @property
    def place(self) -> tuple[str, str]:
        """Names of the generator and of the condition."""
        return self.player.label, self.condition.name

    @property
    def trials(self) -> range:
        """Its trials."""
        count = self.study.count(self.condition)
        return range(self.start, min(self.start + self.study.chunk, count))

    @property
    def map_digest(self) -> str:
        """Nothing: the map follows from the study."""
        return ""

    @property
    def columns(self) -> Any:  # noqa: ANN401 (pyarrow has no types)
        """Columns of its part of the table."""
        return columns_of(self.study.task_of.trial)

    def thrown(self) -> bytes:
        """Run its trials and return its part of the table."""
        watch = Stopwatch()
        with watch:
            trials, ticks = self.study.played(self.player, self.condition, self.trials)
        timing = ticks.percentiles_us() | {"seconds": 1e-6 * watch.percentiles_us()["max"]}
        notes = dict(self.notes) | {"timing": json.dumps(timing), "map": self.map_digest}
        return write_rows([self._row(asdict(x)) for x in trials], notes, self.columns)

    def _row(self, trial: dict[str, Any]) -> dict[str, Any]:
        """Return a trial by columns."""
        generator, condition = self.place
        known = {name: trial[name] for name in self.columns.names if name in trial}
        return known | {"generator": generator, "condition": condition}


def task_jobs(study: TaskStudy) -> list[TaskJob]:
    """Return all chunks of a study: the first of every cell before the second of any."""
    notes = tuple((notes_of(study) | {"schema": study.task_of.schema}).items())
    cells = [(x, c) for c in study.conditions for x in study.players(c)]
    most = max(study.count(c) for c in study.conditions)
    places = [
        (start, x, c)
        for start in range(0, most, study.chunk)
        for x, c in cells
        if start < study.count(c)
    ]
    return [
        TaskJob(number=k, study=study, player=x, condition=c, start=start, notes=notes)
        for k, (start, x, c) in enumerate(places)
    ]


def run_task_study(
    study: TaskStudy, folder: Folder, engine: Engine, *, progress: Progress
) -> FinishedStudy:
    """Run the trials that are not there yet, and write table and summary.

    Args:
        study: The study.
        folder: Its folder, claimed and locked.
        engine: Where to run.
        progress: Is told how far it is.
    """
    jobs, done = task_jobs(study), FinishedStudy()
    try:
        throw_all(jobs, folder, engine, done, progress)
    except KeyboardInterrupt as stop:
        notice()
        done.interrupt = status_of(stop)
    finally:
        engine.close(at_once=done.interrupt is not None)
    join(jobs, folder, dict(jobs[0].notes) | {"configuration": study.model_dump_json()})
    done.rows = task_summary(study, folder)
    said = {"schema": study.task_of.schema, "answer": answer(study, done.rows), "rows": done.rows}
    write_json(folder.summary, said)
    return done


_Kind = TypeVar("_Kind", bound=TaskStudy)


def read_task_result(folder: Folder, kind: type[_Kind]) -> tuple[_Kind, list[dict[str, Any]]]:
    """Return the study of a folder and the rows of its summary, from its table.

    Raises:
        FileError: It holds no such study, or one without a table.
    """
    study = read_manifest(folder.path, kind)
    if not folder.trials.exists():
        raise FileError(
            str(folder.path),
            "a study with a table",
            "one that is not over",
            do="finish it with mitt study --resume",
        )
    return study, task_summary(study, folder)


def task_summary(study: TaskStudy, folder: Folder) -> list[dict[str, Any]]:
    """Return a row for each generator in each condition, from the table of trials."""
    cells: dict[tuple[str, str], list[Row]] = {}
    task = study.task_of
    for row in read_part(folder.trials, columns_of(task.trial))[0]:
        cells.setdefault((row["condition"], row["generator"]), []).append(row)
    out: list[dict[str, Any]] = []
    for c in study.conditions:
        trials = {x: cells.get((c.name, x.label), []) for x in study.players(c)}
        pairs = _against(task, {x.label: of for x, of in trials.items()})
        out += [
            {"generator": x.label, "rate_hz": x.rate, "condition": c.name}
            | _cell(task, of)
            | {"complete": len(of) == study.count(c), "against_direct": pairs.get(x.label)}
            for x, of in trials.items()
        ]
    for name in (task.success, *task.measures):
        tested = [row["against_direct"][name] for row in out if row["against_direct"]]
        for pair, p in zip(tested, holm([pair["p"] for pair in tested]), strict=True):
            pair["p_holm"] = p
    return out


def _cell(task: Task, trials: Sequence[Row]) -> dict[str, Any]:
    """Return counts and measures of the trials of a cell."""
    counts = {status: sum(t["status"] == status for t in trials) for status in task.statuses}
    good = counts[task.success]
    refused = Counter(t["binding_limit"] for t in trials if t["status"] == "unreachable")
    return {
        "trials": len(trials),
        **counts,
        task.rate: good / len(trials) if trials else 0.0,
        "ci95": list(wilson(good, len(trials))),
        "refused_by": refused.most_common(1)[0][0] if refused else None,
        "violating_trials": sum(t["limit_violations"] > 0 for t in trials),
        **{name: spread_of([x.of(t) for t in trials], 90) for name, x in task.measures.items()},
    }


def _against(task: Task, trials: Mapping[str, Sequence[Row]]) -> dict[str, dict[str, Any]]:
    """Return how the generators of a condition differ from the map on the same targets."""
    if REFERENCE not in trials:
        return {}
    mine = {t["index"]: t for t in trials[REFERENCE]}

    def good(trial: Row) -> bool:
        return bool(trial["status"] == task.success)

    out: dict[str, dict[str, Any]] = {}
    for label, others in trials.items():
        if label != REFERENCE:
            both = [(mine[t["index"]], t) for t in others if t["index"] in mine]
            out[label] = {task.success: _counted([(-good(a), -good(b)) for a, b in both])}
            done = [(a, b) for a, b in both if good(a) and good(b)]
            for name, x in task.measures.items():
                sign = -1.0 if x.more else 1.0
                found = [(i, j) for a, b in done if None not in (i := x.of(a), j := x.of(b))]
                out[label][name] = _counted([(sign * i, sign * j) for i, j in found])  # type: ignore[operator]
    return out


def _counted(pairs: Sequence[tuple[float, float]]) -> dict[str, float]:
    """Return how often the map's value is the smaller of a pair, how often the other's, and p."""
    direct = sum(a < b for a, b in pairs)
    this = sum(b < a for a, b in pairs)
    return {"direct": direct, "this": this, "p": mcnemar(direct, this)}


def answer(study: TaskStudy, rows: Sequence[Row]) -> list[str]:
    """Return what the figures say, a sentence for each condition and measure."""
    out, task = list[str](), study.task_of
    words = {task.success: task.counted} | {name: x.words for name, x in task.measures.items()}
    for condition in dict.fromkeys(row["condition"] for row in rows):
        cells = {row["generator"]: row for row in rows if row["condition"] == condition}
        if REFERENCE in cells and any(row["against_direct"] for row in cells.values()):
            out += [
                f"{condition}, {text}: {_places(task, cells, name)}."
                for name, text in words.items()
            ]
    return out + study.answer_more(rows)


def _places(task: Task, cells: Mapping[str, Row], name: str) -> str:
    """Return in words whom the map is better than in a measure, and who is better than it."""
    groups: dict[str, list[str]] = {"better than": [], "worse than": [], "not told apart from": []}
    for label, row in cells.items():
        if row["against_direct"]:
            of = row["against_direct"][name]
            kind = "better than" if of["direct"] > of["this"] else "worse than"
            kind = kind if of["p_holm"] < _SURE else "not told apart from"
            groups[kind].append(f"{label} ({_figure(task, row, name)})")
    said = [f"{kind} {', '.join(labels)}" for kind, labels in groups.items() if labels]
    return f"the map ({_figure(task, cells[REFERENCE], name)}) is {'; '.join(said)}"


def _figure(task: Task, row: Row, name: str) -> str:
    """Return the figure of a cell: how many succeeded, or the median."""
    if name == task.success:
        return f"{row[name]} of {row['trials']}"
    return "none" if row[name] is None else f"{row[name]['median']:.3g}"
