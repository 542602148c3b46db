"""Recordings of failures: the first ones of each generator in each condition."""

import hashlib
from collections.abc import Callable
from pathlib import Path

from mitt.sweep.engine import Engine
from mitt.sweep.folder import Folder, write_bytes
from mitt.sweep.parts import read_part
from mitt.sweep.tasks import run_tasks
from mitt.sweep.work import Job, record_throw

#: Characters of a condition's name that a file's name had better not have.
_SAFE = str.maketrans({" ": "_", "/": "_", "%": "pc", "=": "_", "+": "_"})


def record_failures(
    cells: list[list[Job]],
    folder: Folder,
    engine: Engine,
    most: int,
    progress: Callable[[str, int, int], None],
) -> None:
    """Record failures that are not recorded yet; one that cannot be is left out.

    Args:
        cells: Chunks of each generator in each condition.
        folder: Folder of the study.
        engine: Where the throws are made once more, which gives the same trials.
        most: Most recordings of a cell.
        progress: Is told how many are done, and of how many.
    """
    wanted = [task for group in cells for task in _failures(group, folder, most)]
    missing = [task for task in wanted if not recording_path(folder, *task).exists()]
    made = run_tasks(engine, record_throw, missing, window=engine.workers + 1)
    for done, (task, outcome) in enumerate(made, start=1):
        if isinstance(outcome, bytes):
            write_bytes(recording_path(folder, *task), outcome)
        progress("recording", done, len(missing))


def recording_path(folder: Folder, job: Job, index: int) -> Path:
    """Return where the recording of a throw is kept."""
    name = job.condition.name
    condition = name.translate(_SAFE)
    if condition != name:  # another name may read the same now
        condition += f"-{hashlib.sha256(name.encode()).hexdigest()[:6]}"
    return folder.recordings / f"{job.generator}-{condition}-{index}.mcap"


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
