"""The page of a study: one file that opens anywhere, replays of the worst throws beside it."""

from collections.abc import Callable, Mapping
from html import escape
from typing import Any

import numpy as np

from mitt.link.files import write_text
from mitt.signals import Array
from mitt.study import page
from mitt.study.figures.sweep import effort, rates_against, rates_by_condition, reach
from mitt.study.sweep.numbers import break_even, duels, every_row, headline, story, sweeps_of
from mitt.study.sweep.parts import read_columns
from mitt.study.sweep.result import StudyResult
from mitt.study.sweep.settings import ThrowSettings
from mitt.study.sweep.study import SCHEMA, Study
from mitt.study.sweep.worst import worst_throws

Progress = Callable[[str, int, int], None]
_EFFORT = (
    ("peak_torque_ratio", "peak torque [% of limit]", 100.0),
    ("energy_j", "work of the joints [J]", 1.0),
    ("peak_contact_force_n", "peak contact force [N]", 1.0),
)
_SHORT = {"summary": "Summary", "sweeps": "Against disturbances", "conditions": "By condition",
          "duels": "Pairs", "even": "Break-even", "reach": "Reach", "effort": "Effort",
          "worst": "Worst throws", "rows": "All numbers"}  # fmt: skip


def write_study_report(result: StudyResult, *, replays: int, progress: Progress) -> None:
    """Write ``report.html`` and the replays beside it."""
    worst = worst_throws(result, replays, progress)
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
    cell = [("generator", "=", generator), ("condition", "=", condition)]
    table = read_columns(result.folder.trials, [*names, "status"], cell)
    y, z, *v = (np.asarray(table[name].to_numpy()) for name in names)
    caught = np.array([status == "caught" for status in table["status"].to_pylist()], float)
    return np.column_stack((y, z, np.linalg.norm(v, axis=0), caught)).reshape(-1, 4)


def _footer(study: Study) -> str:
    """Return where the numbers come from."""
    return (
        f"mitt {escape(study.version)}, result {SCHEMA}. All throws are simulated. Intervals: "
        "Wilson, 95 %. Numbers: summary.json and trials.parquet beside this page. The page loads "
        "nothing from the network."
    )
