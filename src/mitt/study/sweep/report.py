"""The page of a study: one file that opens anywhere, replays of the worst throws beside it."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from html import escape
from typing import Any

import numpy as np
import pyarrow.parquet as pq

import mitt
from mitt.errors import FileError
from mitt.link.files import read_json, write_text
from mitt.signals import Array
from mitt.study import page
from mitt.study.figures.sweep import effort, rates_against, rates_by_condition, reach
from mitt.study.replay import replay_page
from mitt.study.sweep.folder import Folder, read_manifest
from mitt.study.sweep.numbers import break_even, duels, every_row, headline, story, sweeps_of
from mitt.study.sweep.recordings import recording_path
from mitt.study.sweep.run import all_jobs, by_cell
from mitt.study.sweep.settings import ThrowSettings
from mitt.study.sweep.study import SCHEMA, Study
from mitt.study.sweep.work import Job, throw_again

Progress = Callable[[str, int, int], None]
_MAX_BYTES = 200_000_000
_EFFORT = (
    ("peak_torque_ratio", "peak torque [% of limit]", 100.0),
    ("energy_j", "work of the joints [J]", 1.0),
    ("peak_contact_force_n", "peak contact force [N]", 1.0),
)
_SHORT = {"summary": "Summary", "sweeps": "Against disturbances", "conditions": "By condition",
          "duels": "Pairs", "even": "Break-even", "reach": "Reach", "effort": "Effort",
          "worst": "Worst throws", "rows": "All numbers"}  # fmt: skip


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class StudyResult:
    """What the folder of a study holds.

    Attributes:
        study: The study.
        folder: The folder.
        rows: Rows of the summary.
    """

    study: Study
    folder: Folder
    rows: list[dict[str, Any]]


def read_result(folder: Folder) -> StudyResult:
    """Read the folder of a study.

    Raises:
        FileError: It holds no study, or one without a summary.
    """
    study = read_manifest(folder.path)
    if not folder.summary.exists() or not folder.trials.exists():
        raise FileError(str(folder.path), "a study with a summary", "one that is not over",
                        do="finish it with mitt study --resume")  # fmt: skip
    raw = read_json(folder.summary, max_bytes=_MAX_BYTES)
    if not isinstance(raw, dict) or raw.get("schema") != SCHEMA:
        raise FileError(str(folder.summary), f"schema {SCHEMA}", "another")
    return StudyResult(study=study, folder=folder, rows=raw["rows"])


def write_study_report(result: StudyResult, *, replays: int, progress: Progress) -> None:
    """Write ``report.html`` and the replays beside it."""
    worst = _worst(result, replays, progress)
    progress("page", 0, 1)
    write_text(result.folder.path / "report.html", study_page(result, worst))
    progress("page", 1, 1)


def study_page(result: StudyResult, worst: str) -> str:
    """Return the page; ``worst`` is the HTML of the worst throws."""
    study, rows = result.study, result.rows
    sweeps = sweeps_of(rows)
    single = [row for row in rows if row["disturbance"] not in sweeps]
    parts = [
        ("summary", "What came out", story(study, rows)),
        ("sweeps", "Catch rate against each disturbance", _sweeps(sweeps)),
        ("conditions", "Catch rate by condition", _conditions(single)),
        ("duels", "Direct map against each rival, on the same throws", duels(study, rows)),
        ("even", "Where it breaks even", break_even(rows)),
        ("reach", "Where and how fast", _reach(result)),
        ("effort", "Torque, work and contact force", _effort(rows)),
        ("worst", "Worst throws", worst),
        ("rows", "All numbers", every_row(rows)),
    ]
    shown = [(name, title, html) for name, title, html in parts if html]
    links = page.navigation([(name, _SHORT[name]) for name, _, _ in shown])
    title = headline(study, rows)
    top = (
        f'<p class="eyebrow">mitt study</p>\n<h1>{escape(title)}</h1>\n{_settings(study)}\n{links}'
    )
    return page.page(
        f"mitt: {title}",
        header=top,
        sections=[page.section(*part) for part in shown],
        footer=_footer(study),
    )


def _settings(study: Study) -> str:
    """Return the settings in one line."""
    arms = sorted({f"{c.arm.arm}, limits {c.arm.limits or 'default'}" for c in study.conditions})
    eyes = sorted({c.vision for c in study.conditions})
    return (
        f'<p class="settings">arm <b>{escape("; ".join(arms))}</b> &middot; seed '
        f"<b>{study.seed}</b> &middot; vision <b>{escape(', '.join(eyes))}</b> &middot; the same "
        "throws for every generator and condition</p>"
    )


def _sweeps(sweeps: Mapping[str, list[Mapping[str, Any]]]) -> str:
    """Return the figure of the swept disturbances."""
    if not sweeps:
        return ""
    caption = "A line a generator, shaded its 95 % Wilson interval."
    return page.figure("rates", page.plotted(rates_against(sweeps).svg),
                       title="Catch rate against each disturbance", caption=caption)  # fmt: skip


def _conditions(rows: list[dict[str, Any]]) -> str:
    """Return the figure of the single conditions."""
    if not rows:
        return ""
    caption = "A mark a generator, with its 95 % Wilson interval."
    return page.figure("by-condition", page.plotted(rates_by_condition(rows).svg),
                       title="Catch rate by condition", caption=caption)  # fmt: skip


def _effort(rows: list[dict[str, Any]]) -> str:
    """Return the figure of torque, work and force."""
    caption = (
        "A dot is the median over the throws of one condition, a bar the median of the dots. Work "
        "is that of all joints, counted positive both ways; force is the largest single contact "
        "force on the ball."
    )
    return page.figure("efforts", page.plotted(effort(rows, _EFFORT).svg),
                       title="Torque, work and contact force", caption=caption)  # fmt: skip


def _reach(result: StudyResult) -> str:
    """Return the heat maps, of the condition whose throws are spread widest."""
    conditions = result.study.conditions
    wide = [c for c in conditions if c.throws != ThrowSettings()]
    condition = max(wide, key=lambda c: c.throws.spread, default=conditions[0])
    trials = {g: _passings(result, g, condition.name) for g in result.study.generators}
    trials = {g: points for g, points in trials.items() if len(points)}
    if not trials:
        return ""
    caption = (
        f"Condition &ldquo;{escape(condition.name)}&rdquo;. Sideways place, height and speed of "
        "the undisturbed ball where it is nearest to the waiting hand; the colour is the "
        "share that was caught, white where nothing was thrown."
    )
    return page.figure("reach-maps", page.plotted(reach(trials).svg),
                       title="Where and how fast", caption=caption)  # fmt: skip


def _passings(result: StudyResult, generator: str, condition: str) -> Array:
    """Return y, z, speed and whether caught of each throw of a cell, shape (k, 4)."""
    names = [f"passing_{axis}" for axis in ("y", "z", "vx", "vy", "vz")]
    table = pq.read_table(
        result.folder.trials,
        columns=[*names, "status"],
        filters=[("generator", "=", generator), ("condition", "=", condition)],
    )
    y, z, *v = (np.asarray(table[name].to_numpy()) for name in names)
    caught = np.array([status == "caught" for status in table["status"].to_pylist()], float)
    return np.column_stack((y, z, np.linalg.norm(v, axis=0), caught)).reshape(-1, 4)


def _worst(result: StudyResult, count: int, progress: Progress) -> str:
    """Return the table of throws with a replay, and write the replays."""
    if count < 1 or result.study.version != mitt.__version__:
        return ""
    tasks = _candidates(result, count, progress)
    lines = []
    for done, (job, row) in enumerate(tasks):
        progress("replays", done, len(tasks))
        recording = recording_path(result.folder, job, row["index"])
        path = result.folder.path / "replays" / f"{recording.stem}.html"
        outcome, arm = throw_again(job, row["index"])
        if outcome.log is None or outcome.trial.status != row["status"]:
            continue
        write_text(path, replay_page(arm, job.condition.scene, outcome.log))
        lines.append(_line(job, row, path.name, recording.name if recording.exists() else None))
    progress("replays", len(tasks), len(tasks))
    if not lines:
        return ""
    head = ("condition", "generator", "throw", "became", "asked most", "replay", "recording")
    cells = "".join(f"<th>{name}</th>" for name in head)
    return (
        "<p>One failure of each condition in which the direct map lost most, then of the others. "
        "A click opens its 3-D replay; recordings open in Foxglove.</p>"
        f'<div class="wide"><table><thead><tr>{cells}</tr></thead><tbody>'
        f"{''.join(lines)}</tbody></table></div>"
    )


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
    table = pq.read_table(
        result.folder.trials,
        columns=["index", "status", "binding_limit"],
        filters=[("generator", "=", generator), ("condition", "=", condition),
                 ("status", "!=", "caught")],
    )  # fmt: skip
    rows: list[dict[str, Any]] = table.to_pylist()
    moved = [row for row in rows if row["status"] in ("dropped", "missed")]
    return next(iter(moved or rows), None)


def _line(job: Job, row: dict[str, Any], replay: str, recording: str | None) -> str:
    """Return one throw as a row of the table."""
    cells = [job.condition.name, job.generator, str(row["index"]), row["status"],
             row["binding_limit"] or ""]  # fmt: skip
    kept = f'<a href="recordings/{escape(recording)}">recording</a>' if recording else ""
    links = [f'<a href="replays/{escape(replay)}">replay</a>', kept]
    return "<tr>" + "".join(f"<td>{x}</td>" for x in (*map(escape, cells), *links)) + "</tr>"


def _footer(study: Study) -> str:
    """Return where the numbers come from."""
    return (
        f"mitt {escape(study.version)}, result {SCHEMA}. All throws are simulated. Intervals: "
        "Wilson, 95 %. Numbers: summary.json and trials.parquet beside this page. The page loads "
        "nothing from the network."
    )
