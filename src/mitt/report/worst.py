"""The worst throws of a study: thrown once more, and kept as 3-D replays beside the page."""

from typing import Any

import mitt
from mitt.files.writing import write_text
from mitt.report.page import Cell
from mitt.report.replay import replay_page
from mitt.trials.runs import Progress
from mitt.trials.study_results import StudyResult, read_columns
from mitt.trials.study_run import Job, all_jobs, by_cell, throw_again


def worst_throws(result: StudyResult, count: int, progress: Progress) -> list[tuple[Cell, ...]]:
    """Return a row for each throw with a replay, and write the replays.

    One failure of each condition in which the direct map lost most, then of the others.
    """
    if count < 1 or result.study.version != mitt.__version__:
        return []
    tasks = _candidates(result, count, progress)
    rows: list[tuple[Cell, ...]] = []
    for done, (job, row) in enumerate(tasks):
        progress("replays", done, len(tasks))
        recording = result.folder.recording(job.generator, job.condition.name, row["index"])
        path = result.folder.path / "replays" / f"{recording.stem}.html"
        outcome, arm = throw_again(job, row["index"])
        if outcome.log is None or outcome.trial.status != row["status"]:
            continue
        write_text(path, replay_page(arm, job.condition.scene, outcome.log))
        kept = {"href": f"recordings/{recording.name}", "text": "recording"}
        rows.append((
            job.condition.name, job.generator, str(row["index"]), str(row["status"]),
            str(row["binding_limit"] or ""), {"href": f"replays/{path.name}", "text": "replay"},
            kept if recording.exists() else "",
        ))  # fmt: skip
    progress("replays", len(tasks), len(tasks))
    return rows


def _candidates(
    result: StudyResult, count: int, progress: Progress
) -> list[tuple[Job, dict[str, Any]]]:
    """Return failures to show: those of the direct map where it lost most first, one a cell.

    Of a cell it is the first throw in which the arm moved and the ball was lost, or else any lost.
    """
    cells = {(g[0].condition.name, g[0].generator): g
             for g in by_cell(list(all_jobs(result.study, result.folder, progress)))}  # fmt: skip
    out: list[tuple[Job, dict[str, Any]]] = []
    for row in sorted(result.rows, key=lambda r: (r["generator"] != "direct", r["catch_rate"])):
        if len(out) == count:
            break
        lost = [("generator", "=", row["generator"]), ("condition", "=", row["condition"]),
                ("status", "!=", "caught")]  # fmt: skip
        table = read_columns(result.folder.trials, ("index", "status", "binding_limit"), lost)
        failed: list[dict[str, Any]] = table.to_pylist()
        moved = [throw for throw in failed if throw["status"] in ("dropped", "missed")]
        for throw in (moved or failed)[:1]:
            group = cells[row["condition"], row["generator"]]
            out.append((next(j for j in group if j.start <= throw["index"] < j.stop), throw))
    return out
