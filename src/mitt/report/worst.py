"""The worst throws of a study: thrown once more, and kept as 3-D replays beside the page."""

from collections.abc import Callable
from typing import Any, TypedDict

import mitt
from mitt.link.files import write_text
from mitt.report.replay import replay_page
from mitt.sweep.parts import read_columns
from mitt.sweep.run import all_jobs, by_cell, recording_path
from mitt.sweep.summary import StudyResult
from mitt.sweep.work import Job, throw_again

Progress = Callable[[str, int, int], None]


class Link(TypedDict):
    """A cell of a table that leads somewhere."""

    href: str
    text: str


def worst_throws(
    result: StudyResult, count: int, progress: Progress
) -> list[tuple[str | Link, ...]]:
    """Return a row for each throw with a replay, and write the replays.

    One failure of each condition in which the direct map lost most, then of the others.
    """
    if count < 1 or result.study.version != mitt.__version__:
        return []
    tasks = _candidates(result, count, progress)
    rows: list[tuple[str | Link, ...]] = []
    for done, (job, row) in enumerate(tasks):
        progress("replays", done, len(tasks))
        recording = recording_path(result.folder, job, row["index"])
        path = result.folder.path / "replays" / f"{recording.stem}.html"
        outcome, arm = throw_again(job, row["index"])
        if outcome.log is None or outcome.trial.status != row["status"]:
            continue
        write_text(path, replay_page(arm, job.condition.scene, outcome.log))
        kept = Link(href=f"recordings/{recording.name}", text="recording")
        rows.append((
            job.condition.name, job.generator, str(row["index"]), str(row["status"]),
            str(row["binding_limit"] or ""), Link(href=f"replays/{path.name}", text="replay"),
            kept if recording.exists() else "",
        ))  # fmt: skip
    progress("replays", len(tasks), len(tasks))
    return rows


def _candidates(
    result: StudyResult, count: int, progress: Progress
) -> list[tuple[Job, dict[str, Any]]]:
    """Return failures to show: those of the direct map where it lost most first, one a cell."""
    cells = {(g[0].condition.name, g[0].generator): g
             for g in by_cell(list(all_jobs(result.study, result.folder, progress)))}  # fmt: skip
    order = sorted(result.rows, key=lambda r: (r["generator"] != "direct", r["catch_rate"]))
    out: list[tuple[Job, dict[str, Any]]] = []
    for row in order:
        if len(out) == count:
            break
        failed = _first_failure(result, row["generator"], row["condition"])
        if failed is not None:
            group = cells[row["condition"], row["generator"]]
            job = next(j for j in group if j.start <= failed["index"] < j.stop)
            out.append((job, failed))
    return out


def _first_failure(result: StudyResult, generator: str, condition: str) -> dict[str, Any] | None:
    """Return the first throw of a cell that was touched and lost, or else merely lost."""
    lost = [
        ("generator", "=", generator),
        ("condition", "=", condition),
        ("status", "!=", "caught"),
    ]
    table = read_columns(result.folder.trials, ("index", "status", "binding_limit"), lost)
    rows: list[dict[str, Any]] = table.to_pylist()
    moved = [row for row in rows if row["status"] in ("dropped", "missed")]
    return next(iter(moved or rows), None)
