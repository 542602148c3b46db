"""Running a study of meetings, and what its trials come to: rates, errors, pairs.

Workers, folder and parts are those of :mod:`mitt.trials.study_run`. Each generator is held against
the map on the same targets: who met them by McNemar's test, whose error, acceleration or force was
smaller by the sign test over the targets that both met, corrected after Holm over the generators
of a condition.
"""

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, fields
from functools import lru_cache
from threading import get_ident
from types import UnionType
from typing import Any, Final, Union, final, get_args, get_origin

import numpy as np

from mitt.clock import Progress, Stopwatch
from mitt.errors import FileError, MissingPackageError
from mitt.files.writing import write_json
from mitt.interrupts import notice, status_of
from mitt.reading import difference, noted
from mitt.trials.meet_study import MEET_SCHEMA, MeetCondition, Meeter, MeetStudy
from mitt.trials.meeting import STATUSES, MeetRunner, MeetTrial
from mitt.trials.station import Station, station
from mitt.trials.statistics import holm, mcnemar, wilson
from mitt.trials.study_folder import Folder, notes_of, read_manifest
from mitt.trials.study_results import REFERENCE, Row, read_part, write_rows
from mitt.trials.study_run import FinishedStudy, join, throw_all
from mitt.trials.workers import Engine

try:
    import pyarrow as pa
except ImportError as error:
    raise MissingPackageError("mitt study", "pyarrow", "study") from error

_TYPES: Final = {str: pa.string(), int: pa.int64(), float: pa.float64(), bool: pa.bool_(),
                 list[float]: pa.list_(pa.float64())}  # fmt: skip


def _columns() -> Any:  # noqa: ANN401 (pyarrow has no types)
    """Return the columns of the table: names of the cell, and all of a trial that has a type."""
    out = [pa.field("generator", pa.string()), pa.field("condition", pa.string())]
    for field in fields(MeetTrial):
        kinds = get_args(field.type) if get_origin(field.type) in (Union, UnionType) else ()
        kind = next((x for x in kinds if x is not type(None)), field.type)
        if kind in _TYPES:
            out.append(pa.field(field.name, _TYPES[kind]))
    return pa.schema(out)


MEET_COLUMNS: Final = _columns()
"""Columns of the table of trials."""

MEASURES: Final[dict[str, tuple[str, Callable[[Row], float | None]]]] = {
    "error_mm": ("error at the grasp [mm]", lambda row: row["position_error_mm"]),
    "velocity_m_s": ("relative speed [m/s]", lambda row: row["velocity_error_m_s"]),
    "acceleration": ("peak acceleration [rad/s^2]",
                     lambda row: max(row["peak_acceleration"], default=None)),
    "force_n": ("force on the part [N]", lambda row: row["peak_contact_force_n"]),
    "in_sync_s": ("in step [s]", lambda row: row["in_sync_s"]),
}  # fmt: skip
"""What is measured in each trial: words, and where a row of the table has it."""


#: Below this p a difference counts.
_SURE = 0.05


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class MeetJob:
    """A chunk of one generator in one condition; a :class:`mitt.trials.study_run.Chunk`.

    Attributes:
        number: Number of the chunk in the study.
        study: The study.
        meeter: The generator.
        condition: What comes by.
        start: First trial.
        notes: What the metadata of a part say of the study.
    """

    number: int
    study: MeetStudy
    meeter: Meeter
    condition: MeetCondition
    start: int
    notes: tuple[tuple[str, str], ...]

    @property
    def place(self) -> tuple[str, str]:
        """Names of the generator and of the condition."""
        return self.meeter.label, self.condition.name

    @property
    def trials(self) -> range:
        """Its trials."""
        return range(self.start, min(self.start + self.study.chunk, self.study.trials))

    @property
    def map_digest(self) -> str:
        """Nothing: the map follows from the study."""
        return ""

    @property
    def columns(self) -> Any:  # noqa: ANN401 (pyarrow has no types)
        """Columns of its part of the table."""
        return MEET_COLUMNS

    def thrown(self) -> bytes:
        """Run its trials and return its part of the table."""
        watch = Stopwatch()
        with watch:
            at = _station(self.study, self.condition, get_ident())
            generator = at.generator(self.meeter.name, rate=self.meeter.rate or 1.0)
            runner = MeetRunner(at, seed=self.study.seed, speed=self.condition.speed,
                                generator=generator)  # fmt: skip
            rows = [self._row(asdict(runner.trial(k))) for k in self.trials]
        timing = runner.stopwatch.percentiles_us()
        timing |= {"seconds": 1e-6 * watch.percentiles_us()["max"]}
        notes = dict(self.notes) | {"timing": json.dumps(timing), "map": self.map_digest}
        return write_rows(rows, notes, MEET_COLUMNS)

    def _row(self, trial: dict[str, Any]) -> Row:
        """Return a trial by columns."""
        generator, condition = self.place
        known = {name: trial[name] for name in MEET_COLUMNS.names if name in trial}
        return known | {"generator": generator, "condition": condition}


@lru_cache(maxsize=8)
def _station_of(text: str, condition: MeetCondition, thread: int) -> Station:  # noqa: ARG001
    """Return the arm where it meets what comes by; kept for a thread."""
    study = MeetStudy.model_validate_json(text)
    speed = np.inf if condition.tool_speed is None else condition.tool_speed
    with noted() as files:
        at = station(study.arm, study.gripper, condition.target, study.world,
                     limits=study.limits, speed=speed)  # fmt: skip
    if name := difference(study.arm_files, files):
        raise FileError(name, "the file that the study was made with", "another content",
                        do="put it back, or begin the study anew")  # fmt: skip
    return at


def _station(study: MeetStudy, condition: MeetCondition, thread: int) -> Station:
    """Return the station of a condition."""
    return _station_of(study.model_dump_json(), condition, thread)


def meet_jobs(study: MeetStudy) -> Iterator[MeetJob]:
    """Yield all chunks of a study: the first of every cell before the second of any."""
    notes = tuple((notes_of(study) | {"schema": MEET_SCHEMA}).items())
    cells = [(x, c) for c in study.conditions for x in study.meeters(c)]
    starts = range(0, study.trials, study.chunk)
    for number, (start, (meeter, condition)) in enumerate((s, x) for s in starts for x in cells):
        yield MeetJob(number=number, study=study, meeter=meeter, condition=condition, start=start,
                      notes=notes)  # fmt: skip


def run_meet_study(
    study: MeetStudy, folder: Folder, engine: Engine, *, progress: Progress
) -> FinishedStudy:
    """Run the trials that are not there yet, and write table and summary.

    Args:
        study: The study.
        folder: Its folder, claimed and locked.
        engine: Where to run.
        progress: Is told how far it is.
    """
    jobs, done = list(meet_jobs(study)), FinishedStudy()
    try:
        throw_all(jobs, folder, engine, done, progress)
    except KeyboardInterrupt as stop:
        notice()
        done.interrupt = status_of(stop)
    finally:
        engine.close(at_once=done.interrupt is not None)
    join(jobs, folder, dict(jobs[0].notes) | {"configuration": study.model_dump_json()})
    done.rows = meet_summary(study, folder)
    said = {"schema": MEET_SCHEMA, "answer": answer(done.rows), "rows": done.rows}
    write_json(folder.summary, said)
    return done


def read_meet_result(folder: Folder) -> tuple[MeetStudy, list[dict[str, Any]]]:
    """Return the study of a folder and the rows of its summary, from its table.

    Raises:
        FileError: It holds no study of meetings, or one without a table.
    """
    study = read_manifest(folder.path, MeetStudy)
    if not folder.trials.exists():
        raise FileError(str(folder.path), "a study with a table", "one that is not over",
                        do="finish it with mitt study --resume")  # fmt: skip
    return study, meet_summary(study, folder)


def meet_summary(study: MeetStudy, folder: Folder) -> list[dict[str, Any]]:
    """Return a row for each generator in each condition, from the table of trials."""
    cells: dict[tuple[str, str], list[Row]] = {}
    for row in read_part(folder.trials, MEET_COLUMNS)[0]:
        cells.setdefault((row["condition"], row["generator"]), []).append(row)
    out = []
    for c in study.conditions:
        trials = {x: cells.get((c.name, x.label), []) for x in study.meeters(c)}
        pairs = _against({x.label: of for x, of in trials.items()})
        out += [
            {"generator": x.label, "rate_hz": x.rate, "condition": c.name}
            | _cell(of)
            | {"complete": len(of) == study.trials, "against_direct": pairs.get(x.label)}
            for x, of in trials.items()
        ]
    return out


def _cell(trials: Sequence[Row]) -> dict[str, Any]:
    """Return counts and measures of the trials of a cell."""
    counts = {status: sum(t["status"] == status for t in trials) for status in STATUSES}
    return {
        "trials": len(trials),
        **counts,
        "meet_rate": counts["met"] / len(trials) if trials else 0.0,
        "ci95": list(wilson(counts["met"], len(trials))),
        "violating_trials": sum(t["limit_violations"] > 0 for t in trials),
        **{name: _spread([of(t) for t in trials]) for name, (_, of) in MEASURES.items()},
    }


def _spread(values: Sequence[float | None]) -> dict[str, float] | None:
    """Return median and 90th percentile of what is known; None where nothing is."""
    known = [x for x in values if x is not None]
    if not known:
        return None
    median, p90 = np.percentile(known, [50.0, 90.0]).tolist()
    return {"median": median, "p90": p90}


def _against(trials: Mapping[str, Sequence[Row]]) -> dict[str, dict[str, Any]]:
    """Return how the generators of a condition differ from the map on the same targets."""
    if REFERENCE not in trials:
        return {}
    mine = {t["index"]: t for t in trials[REFERENCE]}
    out: dict[str, dict[str, Any]] = {}
    for label, others in trials.items():
        if label != REFERENCE:
            both = [(mine[t["index"]], t) for t in others if t["index"] in mine]
            out[label] = {"met": _counted([(-_met(a), -_met(b)) for a, b in both])}
            met = [(a, b) for a, b in both if _met(a) and _met(b)]
            for name, (_, of) in MEASURES.items():
                sign = -1.0 if name == "in_sync_s" else 1.0
                found = [(x, y) for a, b in met if None not in (x := of(a), y := of(b))]
                out[label][name] = _counted([(sign * x, sign * y) for x, y in found])  # type: ignore[operator]
    for name in ("met", *MEASURES):
        corrected = holm([pair[name]["p"] for pair in out.values()])
        for pair, p in zip(out.values(), corrected, strict=True):
            pair[name]["p_holm"] = p
    return out


def _met(trial: Row) -> bool:
    """Say whether a target was met."""
    return bool(trial["status"] == "met")


def _counted(pairs: Sequence[tuple[float, float]]) -> dict[str, float]:
    """Return how often the map's value is the smaller of a pair, how often the other's, and p."""
    direct = sum(a < b for a, b in pairs)
    this = sum(b < a for a, b in pairs)
    return {"direct": direct, "this": this, "p": mcnemar(direct, this)}


def answer(rows: Sequence[Mapping[str, Any]]) -> list[str]:
    """Return what the figures say, a sentence for each condition and measure."""
    out = []
    words = {"met": "targets met"} | {name: text for name, (text, _) in MEASURES.items()}
    for condition in dict.fromkeys(row["condition"] for row in rows):
        cells = {row["generator"]: row for row in rows if row["condition"] == condition}
        if REFERENCE in cells and any(row["against_direct"] for row in cells.values()):
            out += [f"{condition}, {text}: {_places(cells, name)}." for name, text in words.items()]
    return out


def _places(cells: Mapping[str, Mapping[str, Any]], name: str) -> str:
    """Return in words whom the map is better than in a measure, and who is better than it."""
    groups: dict[str, list[str]] = {"better than": [], "worse than": [], "not told apart from": []}
    for label, row in cells.items():
        if row["against_direct"]:
            of = row["against_direct"][name]
            kind = "better than" if of["direct"] > of["this"] else "worse than"
            kind = kind if of["p_holm"] < _SURE else "not told apart from"
            groups[kind].append(f"{label} ({_figure(row, name)})")
    said = [f"{kind} {', '.join(labels)}" for kind, labels in groups.items() if labels]
    return f"the map ({_figure(cells[REFERENCE], name)}) is {'; '.join(said)}"


def _figure(row: Mapping[str, Any], name: str) -> str:
    """Return the figure of a cell: how many were met, or the median."""
    if name == "met":
        return f"{row['met']} of {row['trials']}"
    return "none" if row[name] is None else f"{row[name]['median']:.3g}"
