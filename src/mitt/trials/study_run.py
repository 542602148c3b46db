"""Running a study: split into chunks, throw wherever there is a worker, keep, sum up at the end.

A worker gets everything it needs in its job and gives back bytes, so that it need not see the
folder of the study. A chunk is the same whoever throws it and whatever was thrown before.
"""

import hashlib
import json
import threading
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Protocol, TypeVar, final

import numpy as np

from mitt.arm.arm import Arm
from mitt.catcher.generators import Generator
from mitt.clock import Progress, Stopwatch
from mitt.errors import FileError, InputError, MittError
from mitt.files.arm_file import ArmSpec, ThrowSettings
from mitt.files.maps import map_from, save_map
from mitt.files.recordings import write_recording
from mitt.files.writing import write_atomically, write_bytes, write_json
from mitt.interrupts import notice, status_of
from mitt.map.learn import Learned
from mitt.map.neighbourhood import learn
from mitt.reading import read_json
from mitt.trials.log import recording_of
from mitt.trials.registry import make_generator, origin_of
from mitt.trials.runner import LoggedTrial, TrialRunner
from mitt.trials.source import Source, source_of, widened
from mitt.trials.study_file import SCHEMA, Condition, Study
from mitt.trials.study_folder import Folder, notes_of
from mitt.trials.study_results import (
    COLUMNS,
    Row,
    merge,
    read_part,
    row_of,
    summary,
    timing_of,
    write_rows,
)
from mitt.trials.workers import Engine, run_tasks
from mitt.world.disturbances import Undisturbed
from mitt.world.flights import RecordedFlight, builtin_flights, read_flights
from mitt.world.throws import Throw

#: Arms with their maps, and generators, that a worker keeps.
_KEPT = 16


class Chunk(Protocol):
    """Some trials of one generator in one condition, of whatever task; sent to a worker."""

    @property
    def number(self) -> int:
        """Number of the chunk in the study."""
        ...

    @property
    def place(self) -> tuple[str, str]:
        """Names of the generator and of the condition."""
        ...

    @property
    def trials(self) -> range:
        """Its trials."""
        ...

    @property
    def notes(self) -> tuple[tuple[str, str], ...]:
        """What the metadata of a part say of the study."""
        ...

    @property
    def map_digest(self) -> str:
        """SHA-256 of the map."""
        ...

    @property
    def columns(self) -> Any:  # noqa: ANN401 (pyarrow has no types)
        """Columns of its part of the table."""
        ...

    def thrown(self) -> bytes:
        """Run its trials and return its part of the table."""
        ...


_AnyChunk = TypeVar("_AnyChunk", bound=Chunk)


@dataclass(frozen=True, slots=True, kw_only=True)
class Job:
    """A chunk of throws; a :class:`Chunk`.

    Attributes:
        number: Number of the chunk in the study.
        generator: Name of the generator.
        condition: The condition.
        seed: Seed of the study.
        start: First throw.
        stop: Throw after the last.
        map: The learned map as its file says it.
        recordings: Recorded flights to throw; none for default throws.
        notes: What the metadata of a part say of the study.
        origin: Package and digest of the generator, where another package adds it.
    """

    number: int
    generator: str
    condition: Condition
    seed: int
    start: int
    stop: int
    map: str
    recordings: tuple[RecordedFlight, ...]
    notes: tuple[tuple[str, str], ...]
    origin: str = ""

    @property
    def map_digest(self) -> str:
        """SHA-256 of the map."""
        return hashlib.sha256(self.map.encode()).hexdigest()

    @property
    def place(self) -> tuple[str, str]:
        """Names of the generator and of the condition."""
        return self.generator, self.condition.name

    @property
    def trials(self) -> range:
        """Its throws."""
        return range(self.start, self.stop)

    @property
    def columns(self) -> Any:  # noqa: ANN401 (pyarrow has no types)
        """Columns of its part of the table."""
        return COLUMNS

    def thrown(self) -> bytes:
        """Throw its balls and return its part of the table."""
        return _thrown(self)


_ArmOfJob = tuple[ArmSpec, tuple[tuple[str, str], ...], str, int]
"""Settings of an arm, digests of its files, its map, and the thread that throws."""


@lru_cache(maxsize=_KEPT)
def _learned(of: _ArmOfJob) -> tuple[Learned, ThrowSettings | None]:
    """Return arm and map, and where its balls come from; held to what the study was made with.

    They are kept for the thread alone: an arm's scratch is not to be shared.
    """
    settings, files, text, _ = of
    found = settings.read(was=dict(files))
    return map_from(json.loads(text), found.arm, place="map of the study"), found.throws


@lru_cache(maxsize=_KEPT)
def _generator(name: str, origin: str, of: _ArmOfJob) -> Generator:
    """Return a generator, kept as its map is: some learn or build much before they begin."""
    if origin and (here := origin_of(name)) != origin:
        raise InputError(f"generator {name!r}", f"that of the study, {origin}", here)
    return make_generator(name, _learned(of)[0].map)


def runner_of(job: Job) -> tuple[TrialRunner, Source, Learned]:
    """Return a fresh runner for a job, so that no chunk depends on one before it.

    A generator is a value and may be shared; what a throw teaches it stays with that throw.
    """
    files = tuple(job.condition.arm_files.items())
    of = job.condition.arm, files, job.map, threading.get_ident()
    (learned, own), generator = _learned(of), _generator(job.generator, job.origin, of)
    pixels = job.condition.vision == "pixels"
    runner = TrialRunner(learned.map.arm, generator, job.condition.scene, pixels=pixels)
    source = source_of(
        learned.map.arm,
        seed=job.seed,
        count=job.stop,
        recordings=job.recordings,
        drag=job.condition.scene.ball.drag,
    )
    throws = job.condition.throws
    if throws == ThrowSettings():
        throws = own or throws
    return runner, widened(source, throws), learned


class ChunkError(MittError):
    """What a chunk cannot be thrown for; one text, so that it comes back from any worker."""


def throw_chunk(job: Chunk) -> bytes:
    """Run the trials of a chunk and return its part of the table.

    Raises:
        ChunkError: What the job asks for cannot be.
    """
    try:
        return job.thrown()
    except MittError as error:
        raise ChunkError(str(error)) from None


def _thrown(job: Job) -> bytes:
    """Throw the balls of a chunk and return its part of the table."""
    watch = Stopwatch()
    with watch:
        runner, source, learned = runner_of(job)
        rows = [_row(job, runner, source, learned.map.arm, k) for k in range(job.start, job.stop)]
    timing = runner.stopwatch.percentiles_us() | {"seconds": 1e-6 * watch.percentiles_us()["max"]}
    timing["deadline_misses"] = float(runner.stopwatch.misses())
    notes = {
        "condition": job.condition.model_dump_json(),
        "timing": json.dumps(timing),
        "map": job.map_digest,
    }
    return write_rows(rows, dict(job.notes) | notes)


def throw_again(job: Job, index: int) -> tuple[LoggedTrial, Arm]:
    """Throw one ball of a chunk once more, with a log; it gives the same trial."""
    runner, source, learned = runner_of(job)
    return runner.throw(source, index, log=True), learned.map.arm


def record_throw(task: tuple[Job, int]) -> bytes:
    """Return the recording of one throw of a chunk, by its index."""
    job, index = task
    runner, source, learned = runner_of(job)
    outcome = runner.throw(source, index, log=True)
    if outcome.log is None:
        raise RuntimeError("a throw left no log")
    about = runner.about(job.generator, learned.map)
    notes = dict(job.notes) | {"condition": job.condition.model_dump_json(), "seed": job.seed}
    with TemporaryDirectory() as folder:
        path = Path(folder) / "throw.mcap"
        write_recording(path, recording_of(outcome.log, outcome.trial, about, notes))
        return path.read_bytes()


def _row(job: Job, runner: TrialRunner, source: Source, arm: Arm, index: int) -> Row:
    """Throw one ball and return its row."""
    ball, trial = source.ball(index), runner.throw(source, index).trial
    truth = runner.world.trace()
    power = np.abs(truth.tau * truth.dq).sum(axis=1)
    energy_j = float(np.sum(0.5 * (power[1:] + power[:-1]) * np.diff(truth.t)))
    release = np.concatenate((ball.r, ball.dr) if isinstance(ball, Throw) else ball.at(0.0))
    flight = Undisturbed(ball=ball, drag=source.drag, hand=arm.position(arm.q_ready))
    passing = np.concatenate(flight.at(flight.nearest()))
    return row_of(job.generator, job.condition.name, trial, energy_j, release, passing)


@final
@dataclass(slots=True, kw_only=True)
class FinishedStudy:
    """A study that is over, by itself or because it was interrupted.

    Attributes:
        rows: Rows of the summary.
        lost: What became of chunks that could not be thrown, a line each.
        interrupt: Exit status after an interrupt.
        thrown: Throws that are done.
        total: Throws of the whole study.
        refused: Whether a chunk asked for what cannot be: bad input, not a fault of ours.
    """

    rows: list[dict[str, object]] = field(default_factory=list)
    lost: list[str] = field(default_factory=list)
    interrupt: int | None = None
    thrown: int = 0
    total: int = 0
    refused: bool = False

    @property
    def status(self) -> int:
        """Exit status of the command."""
        return self.interrupt or (2 if self.refused else 1 if self.lost else 0)


def run_study(study: Study, folder: Folder, engine: Engine, *, progress: Progress) -> FinishedStudy:
    """Throw what is not there yet, and write table and summary.

    Args:
        study: The study.
        folder: Its folder, claimed and locked.
        engine: Where to throw.
        progress: Is told how far it is.
    """
    jobs, done = list(all_jobs(study, folder, progress)), FinishedStudy()
    try:
        throw_all(jobs, folder, engine, done, progress)
        record_failures(by_cell(jobs), folder, engine, study.record, progress)
    except KeyboardInterrupt as stop:
        notice()
        done.interrupt = status_of(stop)
    finally:
        engine.close(at_once=done.interrupt is not None)
    _sum_up(study, jobs, folder, done)
    return done


def all_jobs(study: Study, folder: Folder, progress: Progress) -> Iterator[Job]:
    """Yield all chunks of a study, in an order that depends on nothing else.

    The first chunk of every cell comes before the second of any, so that a study that is broken
    off has something to say about all of them.
    """
    notes, places = tuple(notes_of(study).items()), []
    for condition in study.conditions:
        text = _map_text(condition, folder, study.version, progress)
        recordings = _recordings(condition, study, folder)
        places += [(condition, text, recordings, each) for each in study.counts.items()]
    starts = range(0, max(study.counts.values(), default=0), study.chunk)
    cells = ((start, *place) for start in starts for place in places if start < place[3][1])
    for number, (start, condition, text, recordings, (generator, count)) in enumerate(cells):
        yield Job(
            number=number,
            generator=generator,
            condition=condition,
            seed=study.seed,
            start=start,
            stop=min(start + study.chunk, count),
            map=text,
            recordings=recordings,
            origin=study.plugins.get(generator, ""),
            notes=notes,
        )


def _map_text(condition: Condition, folder: Folder, version: str, progress: Progress) -> str:
    """Return the map of an arm as its file says it; learned once, and kept in the folder."""
    path = folder.map(condition.arm)
    if not path.exists():
        progress("learning", 0, 1)
        of = condition.arm.read(was=condition.arm_files)
        save_map(path, learn(of.arm, design=of.design), version=version)
        progress("learning", 1, 1)
    read_json(path)  # refuses a file that was altered into no JSON
    return path.read_text(encoding="utf-8")


def _recordings(condition: Condition, study: Study, folder: Folder) -> tuple[RecordedFlight, ...]:
    """Return the recorded flights of a condition, from the copy that the study's folder keeps."""
    if condition.flights is None:
        return ()
    if condition.flights == "builtin":
        return builtin_flights()
    return read_flights(folder.flights(study, condition.flights))


def throw_all(
    jobs: Sequence[Chunk], folder: Folder, engine: Engine, done: FinishedStudy, progress: Progress
) -> None:
    """Throw the chunks that are not there yet."""
    todo = [job for job in jobs if not _is_done(folder, job)]
    done.total = sum(len(job.trials) for job in jobs)
    done.thrown = done.total - sum(len(job.trials) for job in todo)
    progress("throwing", done.thrown, done.total)
    suspects = _throw(todo, folder, engine, done, progress, window=engine.workers + 1)
    for job in suspects:  # once more, one at a time, so that each answers for itself
        if _throw([job], folder, engine, done, progress, window=1):
            done.lost.append(_line(job, "its worker died twice"))


def _throw(
    jobs: list[Chunk],
    folder: Folder,
    engine: Engine,
    done: FinishedStudy,
    progress: Progress,
    *,
    window: int,
) -> list[Chunk]:
    """Throw chunks and keep their parts; return those whose worker died."""
    suspects = []
    for job, outcome in run_tasks(engine, throw_chunk, jobs, window=window):
        if isinstance(outcome, bytes):
            write_bytes(folder.part(job.number), outcome)
            done.thrown += len(job.trials)
            progress("throwing", done.thrown, done.total)
        elif engine.died(outcome):
            suspects.append(job)
        else:
            done.refused |= isinstance(outcome, ChunkError)
            done.lost.append(_line(job, outcome))
    return suspects


def _is_done(folder: Folder, job: Chunk) -> bool:
    """Say whether the part of a chunk is there, whole and its own; one that is not is dropped."""
    path = folder.part(job.number)
    if not path.exists():
        return False
    try:
        rows, notes = read_part(path, job.columns)
    except FileError:
        path.unlink()
        return False
    place = {(r["generator"], r["condition"]) for r in rows}
    indices = [r["index"] for r in rows] == list(job.trials)
    own = notes.get("digest") == dict(job.notes)["digest"] and notes.get("map") == job.map_digest
    return own and indices and place == {job.place}


def _line(job: Chunk, error: object) -> str:
    """Say in one line which chunk was lost, and why."""
    why = f"{type(error).__name__}: {error}" if str(error) else type(error).__name__
    why = str(error) if isinstance(error, ChunkError) else why
    generator, condition = job.place
    place = f"{generator}, {condition!r}, throws {job.trials[0]} to {job.trials[-1]}"
    return " ".join(f"{place} lost: {why}".split())[:300]


def by_cell(jobs: Sequence[_AnyChunk]) -> list[list[_AnyChunk]]:
    """Return the chunks of each generator in each condition."""
    cells: dict[tuple[str, str], list[_AnyChunk]] = {}
    for job in jobs:
        cells.setdefault(job.place, []).append(job)
    return list(cells.values())


def record_failures(
    cells: list[list[Job]], folder: Folder, engine: Engine, most: int, progress: Progress
) -> None:
    """Record up to ``most`` failures of each cell that are not recorded yet.

    Throws are made once more, which gives the same trials; one that cannot be is left out.
    """
    wanted = [task for group in cells for task in _failures(group, folder, most)]
    missing = [task for task in wanted if not _recording(folder, *task).exists()]
    made = run_tasks(engine, record_throw, missing, window=engine.workers + 1)
    for done, (task, outcome) in enumerate(made, start=1):
        if isinstance(outcome, bytes):
            write_bytes(_recording(folder, *task), outcome)
        progress("recording", done, len(missing))


def _recording(folder: Folder, job: Job, index: int) -> Path:
    """Return where the recording of a throw is kept."""
    return folder.recording(job.generator, job.condition.name, index)


def _failures(group: list[Job], folder: Folder, most: int) -> list[tuple[Job, int]]:
    """Return the first throws of a cell that were not caught."""
    out: list[tuple[Job, int]] = []
    for job in group:
        if len(out) >= most:
            break
        if folder.part(job.number).exists():
            rows, _ = read_part(folder.part(job.number))
            out += [(job, row["index"]) for row in rows if row["status"] != "caught"]
    return out[:most]


def _sum_up(study: Study, jobs: list[Job], folder: Folder, done: FinishedStudy) -> None:
    """Write the whole table, the summary and the wall-clock figures."""
    join(jobs, folder, notes_of(study) | {"configuration": study.model_dump_json()})
    done.rows = summary(study, folder)
    write_json(folder.summary, {"schema": SCHEMA, "rows": done.rows})


def join(jobs: Sequence[Chunk], folder: Folder, notes: dict[str, str]) -> None:
    """Write the whole table of the parts that are there, and the wall-clock figures."""
    cells = by_cell(jobs)
    parts = [p for group in cells for job in group if (p := folder.part(job.number)).exists()]
    columns = jobs[0].columns
    write_atomically(folder.trials, lambda temporary: merge(parts, temporary, notes, columns))
    timing = [_timing(group, folder) for group in cells]
    write_json(folder.path / "timing.json", {"schema": "mitt.timing/1", "rows": timing})


def _timing(group: Sequence[Chunk], folder: Folder) -> dict[str, object]:
    """Return what a cell took."""
    parts = [p for job in group if (p := folder.part(job.number)).exists()]
    figures = [timing_of(path) for path in parts]
    medians = sorted(f.get("p50", 0.0) for f in figures) or [0.0]
    return {
        "generator": group[0].place[0],
        "condition": group[0].place[1],
        "seconds": sum(f.get("seconds", 0.0) for f in figures),
        "tick_us_p50": medians[len(medians) // 2],
        "tick_us_p99": max((f.get("p99", 0.0) for f in figures), default=0.0),
    }
