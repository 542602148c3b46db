"""Running a study: split into chunks, run wherever there is a worker, keep, sum up at the end.

A worker gets everything it needs in its chunk and gives back bytes, so that it need not see the
folder of the study. A chunk is the same whoever runs it and whatever was run before.
"""

import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, final

from mitt.clock import Progress, Stopwatch
from mitt.core.errors import FileError, MittError
from mitt.interrupts import notice, status_of
from mitt.io.recordings import write_recording
from mitt.io.writing import write_atomically, write_bytes, write_json
from mitt.lab.trials.study import Chunk, Study
from mitt.lab.trials.study_folder import Folder, notes_of
from mitt.lab.trials.study_results import (
    columns_of,
    merge,
    read_part,
    row_of,
    study_summary,
    timing_of,
    write_rows,
)
from mitt.lab.trials.workers import Engine, run_tasks


class ChunkError(MittError):
    """What a chunk cannot be run for; one text, so that it comes back from any worker."""


def columns_of_chunk(chunk: Chunk) -> Any:  # noqa: ANN401 (pyarrow has no types)
    """Return the columns of a chunk's part of the table."""
    return columns_of(chunk.study.kind.trial, chunk.study.kind.extra)


def run_chunk(chunk: Chunk) -> bytes:
    """Run the trials of a chunk and return its part of the table.

    Raises:
        ChunkError: What the chunk asks for cannot be.
    """
    try:
        return _part(chunk)
    except MittError as error:
        raise ChunkError(str(error)) from None


def _part(chunk: Chunk) -> bytes:
    """Run the trials of a chunk and return its part of the table."""
    watch, columns = Stopwatch(), columns_of_chunk(chunk)
    with watch:
        trials, ticks = chunk.study.played(chunk)
    timing = ticks.percentiles_us() | {"seconds": 1e-6 * watch.percentiles_us()["max"]}
    timing["deadline_misses"] = float(ticks.misses())
    notes = {
        "condition": chunk.condition.model_dump_json(),
        "timing": json.dumps(timing),
        "map": chunk.material.digest,
    }
    rows = [row_of(chunk.place, trial, columns) for trial in trials]
    return write_rows(rows, dict(chunk.notes) | notes, columns)


def record_trial(task: tuple[Chunk, int]) -> bytes:
    """Return the recording of one trial of a chunk, by its index."""
    chunk, index = task
    recording = chunk.study.recorded(chunk, index)
    with TemporaryDirectory() as folder:
        path = Path(folder) / "trial.mcap"
        write_recording(path, recording)
        return path.read_bytes()


@final
@dataclass(slots=True, kw_only=True)
class FinishedStudy:
    """A study that is over, by itself or because it was interrupted.

    Attributes:
        rows: Rows of the summary.
        lost: What became of chunks that could not be run, a line each.
        interrupt: Exit status after an interrupt.
        trials: Trials that are done.
        total: Trials of the whole study.
        refused: Whether a chunk asked for what cannot be: bad input, not a fault of ours.
    """

    rows: list[dict[str, object]] = field(default_factory=list)
    lost: list[str] = field(default_factory=list)
    interrupt: int | None = None
    trials: int = 0
    total: int = 0
    refused: bool = False

    @property
    def status(self) -> int:
        """Exit status of the command."""
        return self.interrupt or (2 if self.refused else 1 if self.lost else 0)


def run_study(study: Study, folder: Folder, engine: Engine, *, progress: Progress) -> FinishedStudy:
    """Run the trials that are not there yet, and write table and summary.

    Args:
        study: The study.
        folder: Its folder, claimed and locked.
        engine: Where to run.
        progress: Is told how far it is.
    """
    chunks, done = list(all_chunks(study, folder, progress)), FinishedStudy()
    try:
        _run_all(chunks, folder, engine, done, progress)
        _record_failures(by_cell(chunks), folder, engine, study.record, progress)
    except KeyboardInterrupt as stop:
        notice()
        done.interrupt = status_of(stop)
    finally:
        engine.close(at_once=done.interrupt is not None)
    _join(chunks, folder, notes_of(study) | {"configuration": study.model_dump_json()})
    done.rows = study_summary(study, folder)
    said = study.answer(done.rows)
    answer = {"answer": said} if said else {}
    write_json(folder.summary, {"schema": study.kind.schema, **answer, "rows": done.rows})
    return done


def all_chunks(study: Study, folder: Folder, progress: Progress) -> Iterator[Chunk]:
    """Yield all chunks of a study, in an order that depends on nothing else.

    The first chunk of every cell comes before the second of any, so that a study that is broken
    off has something to say about all of them.
    """
    notes, cells = tuple(notes_of(study).items()), []
    for condition in study.conditions:
        material = study.material(condition, folder, progress)
        alone = study.model_copy(update={"conditions": (condition,)})
        cells += [
            (alone, player, condition, material, condition.counts[player.name])
            for player in study.players(condition)
        ]
    most = max((count for *_, count in cells), default=0)
    starts = range(0, most, study.chunk)
    places = ((start, *cell) for start in starts for cell in cells if start < cell[-1])
    for number, (start, alone, player, condition, material, count) in enumerate(places):
        yield Chunk(
            number=number,
            study=alone,
            player=player,
            condition=condition,
            start=start,
            stop=min(start + study.chunk, count),
            material=material,
            notes=notes,
        )


def _run_all(
    chunks: Sequence[Chunk], folder: Folder, engine: Engine, done: FinishedStudy, progress: Progress
) -> None:
    """Run the chunks that are not there yet."""
    todo = [chunk for chunk in chunks if not _is_done(folder, chunk)]
    done.total = sum(len(chunk.trials) for chunk in chunks)
    done.trials = done.total - sum(len(chunk.trials) for chunk in todo)
    progress("trials", done.trials, done.total)
    suspects = _try(todo, folder, engine, done, progress, window=engine.workers + 1)
    for chunk in suspects:  # once more, one at a time, so that each answers for itself
        if _try([chunk], folder, engine, done, progress, window=1):
            done.lost.append(_line(chunk, "its worker died twice"))


def _try(
    chunks: list[Chunk],
    folder: Folder,
    engine: Engine,
    done: FinishedStudy,
    progress: Progress,
    *,
    window: int,
) -> list[Chunk]:
    """Run chunks and keep their parts; return those whose worker died."""
    suspects = []
    for chunk, outcome in run_tasks(engine, run_chunk, chunks, window=window):
        if isinstance(outcome, bytes):
            write_bytes(folder.part(chunk.number), outcome)
            done.trials += len(chunk.trials)
            progress("trials", done.trials, done.total)
        elif engine.died(outcome):
            suspects.append(chunk)
        else:
            done.refused |= isinstance(outcome, ChunkError)
            done.lost.append(_line(chunk, outcome))
    return suspects


def _is_done(folder: Folder, chunk: Chunk) -> bool:
    """Say whether the part of a chunk is there, whole and its own; one that is not is dropped."""
    path = folder.part(chunk.number)
    if not path.exists():
        return False
    try:
        rows, notes = read_part(path, columns_of_chunk(chunk))
    except FileError:
        path.unlink()
        return False
    place = {(r["generator"], r["condition"]) for r in rows}
    indices = [r["index"] for r in rows] == list(chunk.trials)
    own = (
        notes.get("digest") == dict(chunk.notes)["digest"]
        and notes.get("map") == chunk.material.digest
    )
    return own and indices and place == {chunk.place}


def _line(chunk: Chunk, error: object) -> str:
    """Say in one line which chunk was lost, and why."""
    why = f"{type(error).__name__}: {error}" if str(error) else type(error).__name__
    why = str(error) if isinstance(error, ChunkError) else why
    generator, condition = chunk.place
    trials = f"{chunk.study.kind.trials} {chunk.start} to {chunk.stop - 1}"
    place = f"{generator}, {condition!r}, {trials}"
    return " ".join(f"{place} lost: {why}".split())[:300]


def by_cell(chunks: Sequence[Chunk]) -> list[list[Chunk]]:
    """Return the chunks of each generator in each condition."""
    cells: dict[tuple[str, str], list[Chunk]] = {}
    for chunk in chunks:
        cells.setdefault(chunk.place, []).append(chunk)
    return list(cells.values())


def _record_failures(
    cells: list[list[Chunk]], folder: Folder, engine: Engine, most: int, progress: Progress
) -> None:
    """Record up to ``most`` failures of each cell that are not recorded yet.

    Trials are run once more, which gives the same; one that cannot be recorded is left out.
    """
    wanted = [task for group in cells for task in _failures(group, folder, most)]
    missing = [task for task in wanted if not _recording(folder, *task).exists()]
    made = run_tasks(engine, record_trial, missing, window=engine.workers + 1)
    for done, (task, outcome) in enumerate(made, start=1):
        if isinstance(outcome, bytes):
            write_bytes(_recording(folder, *task), outcome)
        progress("recording", done, len(missing))


def _recording(folder: Folder, chunk: Chunk, index: int) -> Path:
    """Return where the recording of a trial is kept."""
    return folder.recording(*chunk.place, index)


def _failures(group: list[Chunk], folder: Folder, most: int) -> list[tuple[Chunk, int]]:
    """Return the first trials of a cell that did not succeed."""
    out: list[tuple[Chunk, int]] = []
    for chunk in group:
        if len(out) >= most:
            break
        if folder.part(chunk.number).exists():
            rows, _ = read_part(folder.part(chunk.number), columns_of_chunk(chunk))
            success = chunk.study.kind.success
            out += [(chunk, row["index"]) for row in rows if row["status"] != success]
    return out[:most]


def _join(chunks: Sequence[Chunk], folder: Folder, notes: dict[str, str]) -> None:
    """Write the whole table of the parts that are there, and the wall-clock figures."""
    cells = by_cell(chunks)
    parts = [p for group in cells for chunk in group if (p := folder.part(chunk.number)).exists()]
    columns = columns_of_chunk(chunks[0])
    write_atomically(folder.trials, lambda temporary: merge(parts, temporary, notes, columns))
    timing = [_timing(group, folder) for group in cells]
    write_json(folder.path / "timing.json", {"schema": "mitt.timing/1", "rows": timing})


def _timing(group: Sequence[Chunk], folder: Folder) -> dict[str, object]:
    """Return what a cell took."""
    parts = [p for chunk in group if (p := folder.part(chunk.number)).exists()]
    figures = [timing_of(path) for path in parts]
    medians = sorted(f.get("p50", 0.0) for f in figures) or [0.0]
    return {
        "generator": group[0].place[0],
        "condition": group[0].place[1],
        "seconds": sum(f.get("seconds", 0.0) for f in figures),
        "tick_us_p50": medians[len(medians) // 2],
        "tick_us_p99": max((f.get("p99", 0.0) for f in figures), default=0.0),
    }
