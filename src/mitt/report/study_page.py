"""The page of a study: one file that opens anywhere, replays of the worst throws beside it."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from mitt.link.files import write_text
from mitt.report.differences import break_even, decided, paired_tests, sweeps_of
from mitt.report.figures.sweep import effort, rates_against, rates_by_condition, reach
from mitt.report.page import Section, interval, number, page
from mitt.report.worst import Link, worst_throws
from mitt.signals import Array
from mitt.sweep.parts import read_columns
from mitt.sweep.study import SCHEMA, Condition, ThrowSettings, extent
from mitt.sweep.summary import REFERENCE, StudyResult
from mitt.trials.result import STATUSES

Progress = Callable[[str, int, int], None]
_EFFORT = (
    ("peak_torque_ratio", "peak torque [% of limit]", 100.0),
    ("energy_j", "work of the joints [J]", 1.0),
    ("peak_contact_force_n", "peak contact force [N]", 1.0),
)
_SECTIONS = (
    Section("summary", "Summary", "What came out"),
    Section("sweeps", "Against disturbances", "Catch rate against each disturbance"),
    Section("conditions", "By condition", "Catch rate by condition"),
    Section("paired", "Pairs", "Direct map against each rival, on the same throws"),
    Section("even", "Break-even", "Where it breaks even"),
    Section("reach", "Reach", "Where and how fast"),
    Section("effort", "Effort", "Torque, work and contact force"),
    Section("worst", "Worst throws", "Worst throws"),
    Section("rows", "All numbers", "All numbers"),
)
_HEAD = ("condition", "generator", "stopped by", "throws", "caught", "rate [%]",
         "95 % interval [%]", *STATUSES[1:], "position [mm]", "velocity [m/s]", "force [N]",
         "work [J]", "beyond a limit")  # fmt: skip


def write_study_report(result: StudyResult, *, replays: int, progress: Progress) -> None:
    """Write ``report.html`` and the replays beside it."""
    worst = worst_throws(result, replays, progress)
    progress("page", 0, 1)
    write_text(result.folder.path / "report.html", study_page(result, worst))
    progress("page", 1, 1)


def study_page(result: StudyResult, worst: Sequence[Sequence[str | Link]]) -> str:
    """Return the page.

    Args:
        result: The study.
        worst: Rows of the table of worst throws.
    """
    study, rows = result.study, result.rows
    pairs = [row for row in rows if row["against_direct"] is not None]
    ahead, behind = decided(pairs)
    condition = _widest(study.conditions)
    throws = extent(study, sum(int(row["throws"]) for row in rows))
    arms = {f"{c.arm.arm}, limits {c.arm.limits or 'default'}" for c in study.conditions}
    return page(
        "study",
        _SECTIONS,
        title=f"{study.name}: {throws}",
        command="study",
        study=study,
        schema=SCHEMA,
        arms="; ".join(sorted(arms)),
        vision=", ".join(sorted({c.vision for c in study.conditions})),
        rows=rows,
        unfinished=sum(not row["complete"] for row in rows),
        pairs=len(pairs),
        ahead=ahead,
        behind=behind,
        drawn=_drawn(result, condition),
        rivals=[name for name in study.generators if name != REFERENCE],
        paired=paired_tests(study, rows),
        even=break_even(rows),
        widest=condition.name,
        worst=worst,
        head=_HEAD,
        numbers=[_cells(row) for row in rows],
    )


def _widest(conditions: Sequence[Condition]) -> Condition:
    """Return the condition whose throws are spread widest."""
    wide = [c for c in conditions if c.throws != ThrowSettings()]
    return max(wide, key=lambda c: c.throws.spread, default=conditions[0])


def _drawn(result: StudyResult, condition: Condition) -> dict[str, str]:
    """Return all drawings for which there are data; the heat maps are those of a condition."""
    sweeps = sweeps_of(result.rows)
    single = [row for row in result.rows if row["disturbance"] not in sweeps]
    trials = {g: _passings(result, g, condition.name) for g in result.study.generators}
    trials = {g: points for g, points in trials.items() if len(points)}
    plots = [
        *([rates_against(sweeps)] if sweeps else []),
        *([rates_by_condition(single)] if single else []),
        *([reach(trials)] if trials else []),
        effort(result.rows, _EFFORT),
    ]
    return {plot.name: plot.svg for plot in plots}


def _passings(result: StudyResult, generator: str, condition: str) -> Array:
    """Return y, z, speed and whether caught of each throw of a cell, shape (k, 4)."""
    names = [f"passing_{axis}" for axis in ("y", "z", "vx", "vy", "vz")]
    cell = [("generator", "=", generator), ("condition", "=", condition)]
    table = read_columns(result.folder.trials, [*names, "status"], cell)
    y, z, *v = (np.asarray(table[name].to_numpy()) for name in names)
    caught = np.array([status == "caught" for status in table["status"].to_pylist()], float)
    return np.column_stack((y, z, np.linalg.norm(v, axis=0), caught)).reshape(-1, 4)


def _cells(row: dict[str, Any]) -> list[str]:
    """Return a row of the summary as cells of the table of all numbers."""
    median = row["median"]
    return [
        str(row["condition"]), str(row["generator"]),
        ", ".join(f"{reason} {count}" for reason, count in row["stopped_by"].items()),
        str(row["throws"]), str(row["caught"]),
        f"{100.0 * row['catch_rate']:.1f}", interval(row["ci95"]),
        *(str(row[status]) for status in STATUSES[1:]),
        number(median["position_error_mm"], 1), number(median["velocity_error_m_s"], 2),
        number(median["peak_contact_force_n"], 0), number(median["energy_j"], 0),
        str(row["violating_throws"]),
    ]  # fmt: skip
