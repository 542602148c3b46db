"""The page of a study: one file that opens anywhere, replays of the worst throws beside it.

Sections that all tasks have, and those of one alone: its pictures, and replays of catching.
"""

from collections.abc import Callable, Mapping, Sequence
from typing import Any, Final

import numpy as np

import mitt
from mitt.clock import Progress
from mitt.core import checks
from mitt.core.signals import Array
from mitt.io.arm_file import ThrowSettings
from mitt.io.reading import read_json
from mitt.io.writing import write_text
from mitt.lab.report.page import NONE, Cell, OwnPicture, Section, interval, page, shown_number
from mitt.lab.report.replay_3d import replay_page
from mitt.lab.report.study_figures import (
    effort,
    errors_by_rate,
    miss_map,
    rates_against,
    rates_by_condition,
    reach_maps,
)
from mitt.lab.trials.catch_study import CatchStudy, throw_again
from mitt.lab.trials.score import CATCH
from mitt.lab.trials.scored_task import PAGE, Measure, Row, ScoredTask
from mitt.lab.trials.study import REFERENCE, Chunk, Study, extent
from mitt.lab.trials.study_results import StudyResult, columns_of, read_trials
from mitt.lab.trials.study_run import all_chunks, by_cell

Curve = list[tuple[float, float]]
"""Value of a disturbance and rate, in the order of the values."""

_SECTIONS: Final = (
    Section("summary", "Answer", "What the figures say"),
    Section("picture", "Picture", "In a picture"),
    Section("sweeps", "Against disturbances", "Rate against each disturbance"),
    Section("conditions", "By condition", "Rate by condition"),
    Section("paired", "Pairs", "Direct map against each rival, on the same trials"),
    Section("even", "Break-even", "Where it breaks even"),
    Section("reach", "Reach", "Where and how fast"),
    Section("effort", "Effort", "Torque, work and contact force"),
    Section("worst", "Worst throws", "Worst throws"),
    Section("times", "Computing time", "Computing time of a tick"),
    Section("rows", "All numbers", "All numbers"),
)
#: Two rates whose difference is surely less than this are level.
_LEVEL: Final = 0.05
#: Up to so many rows all numbers are shown at once.
_FEW: Final = 40
#: Columns of a table of throws.
_COLUMNS: Final = columns_of(CATCH.trial, CATCH.extra)
_EFFORT: Final = (
    ("peak_torque_ratio", "peak torque [% of limit]", 100.0),
    ("energy_j", "work of the joints [J]", 1.0),
    ("peak_contact_force_n", "peak contact force [N]", 1.0),
)


def write_study_page(result: StudyResult, *, replays: int, progress: Progress) -> None:
    """Write ``report.html`` and the replays beside it."""
    worst = worst_throws(result, replays, progress)
    progress("page", 0, 1)
    write_text(result.folder.path / PAGE, study_page(result, worst))
    progress("page", 1, 1)


def study_page(result: StudyResult, worst: Sequence[Sequence[Cell]] = ()) -> str:
    """Return the page.

    ``worst`` has the rows of the table of worst throws.
    """
    study, rows = result.study, result.rows
    task = study.kind
    pairs = [row for row in rows if row["against_direct"] is not None]
    sure = [row for row in pairs if row["against_direct"]["p_holm"] < _LEVEL]
    ahead: list[Row] = []
    behind: list[Row] = []
    for row in sure:
        duel = row["against_direct"]
        (ahead if duel["only_direct"] > duel["only_this"] else behind).append(row)
    equal = sum(
        row["against_direct"]["difference_ci95"][0] > -_LEVEL
        and row["against_direct"]["difference_ci95"][1] < _LEVEL
        for row in pairs
    )
    sweeps = sweeps_of(rows)
    head, of_row = table_of_all(task)
    return page(
        "study",
        _SECTIONS,
        title=f"{study.name}: {extent(study, sum(int(row[task.trials]) for row in rows))}",
        command="study",
        study=study,
        task=task,
        rows=rows,
        few=len(rows) <= _FEW,
        unfinished=sum(not row["complete"] for row in rows),
        pairs=len(pairs),
        equal=equal,
        ahead=ahead,
        behind=behind,
        answer=study.answer(rows),
        sweeps=rates_against(task, sweeps).svg if sweeps else None,
        conditions=_by_condition(study, [r for r in rows if r["disturbance"] not in sweeps]),
        pictures=_PICTURES.get(task.name, _no_pictures)(result),
        rivals=_rivals(rows),
        paired=paired_tests(rows),
        even=break_even(task, rows),
        worst=worst,
        times=_times(result),
        head=head,
        numbers=[of_row(row) for row in rows],
    )


def _by_condition(study: Study, rows: Sequence[Row]) -> str | None:
    """Return the drawing of rates by condition; cells of a map have a drawing of their own."""
    mapped = {c.name for c, _ in study.cells(rows)}
    shown = [row for row in rows if row["condition"] not in mapped]
    return rates_by_condition(study.kind, shown).svg if shown else None


def _no_pictures(result: StudyResult) -> list[OwnPicture]:  # noqa: ARG001
    """Return the pictures of a task that has none of its own."""
    return []


def _catch_pictures(result: StudyResult) -> list[OwnPicture]:
    """Return where and how fast balls are caught in the widest condition, and the effort."""
    conditions = result.study.conditions
    wide = [c for c in conditions if c.throws != ThrowSettings()]
    widest = max(wide, key=lambda c: c.throws.spread, default=conditions[0]).name
    trials = {g: _passings(result, g, widest) for g in result.study.generators}
    trials = {g: points for g, points in trials.items() if len(points)}
    out = []
    if trials:
        words = (
            f"Condition \u201c{widest}\u201d. Sideways place, height and speed of the undisturbed "
            "ball where it is nearest to the waiting hand; the colour is the share that was "
            "caught, white where nothing was thrown."
        )
        out.append(OwnPicture("reach", "Where and how fast", words, reach_maps(trials)))
    words = (
        "A dot is the median over the throws of one condition, a bar the median of the dots. Work "
        "is that of all joints, counted positive both ways; force is the largest single contact "
        "force on the ball."
    )
    drawn = effort(result.rows, _EFFORT)
    return [*out, OwnPicture("effort", "Torque, work and contact force", words, drawn)]


def _passings(result: StudyResult, generator: str, condition: str) -> Array:
    """Return y, z, speed and whether caught of each throw of a cell, shape (k, 4)."""
    names = [f"passing_{axis}" for axis in ("y", "z", "vx", "vy", "vz")]
    cell = [("generator", "=", generator), ("condition", "=", condition)]
    table = read_trials(result.folder.trials, _COLUMNS, [*names, "status"], cell)
    y, z, *v = (np.asarray(table[name].to_numpy()) for name in names)
    caught = np.array([status == "caught" for status in table["status"].to_pylist()], float)
    return np.column_stack((y, z, np.linalg.norm(v, axis=0), caught)).reshape(-1, 4)


def _meet_pictures(result: StudyResult) -> list[OwnPicture]:
    """Return errors by the rate of planning."""
    groups = {
        c.name: [r for r in result.rows if r["condition"] == c.name]
        for c in result.study.conditions
    }
    title = "Error at the grasp against the rate of planning"
    words = "Median, and up to the 90th percentile. Generators that do not plan are lines across."
    return [OwnPicture("picture", title, words, errors_by_rate(groups))]


def _bat_pictures(result: StudyResult) -> list[OwnPicture]:
    """Return the map of the landing error, where the study has one."""
    cells = result.study.cells(result.rows)
    if not cells:
        return []
    title = "Median landing error [cm] by target and ball speed"
    words = (
        "Below it, of 100 balls: refused before the arm moved (ref.), and not returned otherwise "
        "(lost), as they missed the paddle or landed more than 25 cm off. Grey: none landed."
    )
    return [OwnPicture("picture", title, words, miss_map(cells))]


#: Pictures by task.
_PICTURES: Final[Mapping[str, Callable[[StudyResult], list[OwnPicture]]]] = {
    "catch": _catch_pictures,
    "meet": _meet_pictures,
    "bat": _bat_pictures,
}


def table_of_all(task: ScoredTask) -> tuple[list[str], Callable[[Row], list[str]]]:
    """Return the head of the table of all numbers, and what makes a row of it."""
    shown = {name: x for name, x in task.medians.items() if x.digits is not None}
    head = [
        "condition",
        "generator",
        "stopped by",
        "refused by",
        task.trials,
        task.success,
        "rate [%]",
        "95 % interval [%]",
        *(x.words for x in task.measures.values()),
        "too hard",
        *task.statuses[1:],
        *(x.words for x in shown.values()),
        "beyond a limit",
    ]

    def cells(row: Row) -> list[str]:
        return [
            str(row["condition"]),
            str(row["generator"]),
            ", ".join(f"{reason} {count}" for reason, count in row["stopped_by"].items()),
            str(row["refused_by"] or ""),
            str(row[task.trials]),
            str(row[task.success]),
            f"{100.0 * row[task.rate]:.1f}",
            interval(row["ci95"]),
            *(_spread(row[name], x) for name, x in task.measures.items()),
            str(row["over_force"]),
            *(str(row[status]) for status in task.statuses[1:]),
            *(shown_number(row["median"][name], x.digits or 0) for name, x in shown.items()),
            str(row[f"violating_{task.trials}"]),
        ]

    return head, cells


def _spread(of: Mapping[str, float] | None, measure: Measure) -> str:
    """Return median and upper percentile as text."""
    digits = measure.digits or 0
    if of is None:
        return NONE
    return (
        f"{shown_number(of['median'], digits)} ({shown_number(of[f'p{measure.percent}'], digits)})"
    )


def _times(result: StudyResult) -> list[list[str]]:
    """Return generators with a tick's median and p99 time [us] in their slowest condition."""
    path = result.folder.path / "timing.json"
    given = read_json(path) if path.exists() else {}
    rows = given.get("rows") if isinstance(given, dict) else None
    cells = []
    for name in dict.fromkeys(str(row["generator"]) for row in result.rows):
        of = [r for r in rows or () if isinstance(r, dict) and r.get("generator") == name]
        if of:
            p50, p99 = (
                [checks.number(f"{path} {key}", row.get(key)) for row in of]
                for key in ("tick_us_p50", "tick_us_p99")
            )
            cells.append([name, shown_number(max(p50), 0), shown_number(max(p99), 0)])
    return cells


def _rivals(rows: Sequence[Row]) -> list[str]:
    """Return the generators beside the reference, in their order."""
    return [x for x in dict.fromkeys(str(row["generator"]) for row in rows) if x != REFERENCE]


def worst_throws(result: StudyResult, count: int, progress: Progress) -> list[tuple[Cell, ...]]:
    """Return a row for each throw with a replay, and write the replays.

    One failure of each condition in which the direct map lost most, then of the others.
    """
    study = result.study
    if count < 1 or not isinstance(study, CatchStudy) or study.version != mitt.__version__:
        return []
    tasks = _candidates(result, count, progress)
    rows: list[tuple[Cell, ...]] = []
    for done, (chunk, row) in enumerate(tasks):
        progress("replays", done, len(tasks))
        recording = result.folder.recording(chunk.player.name, chunk.condition.name, row["index"])
        path = result.folder.path / "replays" / f"{recording.stem}.html"
        outcome, arm = throw_again(chunk, row["index"])
        if outcome.log is None or outcome.trial.status != row["status"]:
            continue
        write_text(path, replay_page(arm, chunk.condition.scene, outcome.log))
        kept = {"href": f"recordings/{recording.name}", "text": "recording"}
        rows.append(
            (
                chunk.condition.name,
                chunk.player.name,
                str(row["index"]),
                str(row["status"]),
                str(row["binding_limit"] or ""),
                {"href": f"replays/{path.name}", "text": "replay"},
                kept if recording.exists() else "",
            )
        )
    progress("replays", len(tasks), len(tasks))
    return rows


def _candidates(
    result: StudyResult, count: int, progress: Progress
) -> list[tuple[Chunk, dict[str, Any]]]:
    """Return failures to show: those of the direct map where it lost most first, one a cell.

    Of a cell it is the first throw in which the arm moved and the ball was lost, or else any lost.
    """
    cells = {
        (g[0].condition.name, g[0].player.name): g
        for g in by_cell(list(all_chunks(result.study, result.folder, progress)))
    }
    out: list[tuple[Chunk, dict[str, Any]]] = []
    for row in sorted(result.rows, key=lambda r: (r["generator"] != REFERENCE, r[CATCH.rate])):
        if len(out) == count:
            break
        lost = [
            ("generator", "=", row["generator"]),
            ("condition", "=", row["condition"]),
            ("status", "!=", CATCH.success),
        ]
        table = read_trials(
            result.folder.trials, _COLUMNS, ("index", "status", "binding_limit"), lost
        )
        failed: list[dict[str, Any]] = table.to_pylist()
        moved = [throw for throw in failed if throw["status"] in ("dropped", "missed")]
        for throw in (moved or failed)[:1]:
            group = cells[row["condition"], row["generator"]]
            out.append((next(x for x in group if x.start <= throw["index"] < x.stop), throw))
    return out


def sweeps_of(rows: Sequence[Row]) -> dict[str, list[Row]]:
    """Return the rows of each swept disturbance."""
    out: dict[str, list[Row]] = {}
    for row in rows:
        if row["value"] is not None:
            out.setdefault(str(row["disturbance"]), []).append(row)
    return {name: found for name, found in out.items() if len({r["value"] for r in found}) > 1}


def paired_tests(rows: Sequence[Row]) -> list[list[str]]:
    """Return the table of paired differences, a row a condition, a column a rival.

    By how much the rival's rate is above the reference's with its 95 % interval [%], trials in
    which only the reference succeeded, those in which only the rival did, and p.
    """
    if not any(row["against_direct"] for row in rows):
        return []
    found = {(row["condition"], row["generator"]): row["against_direct"] for row in rows}

    def difference(pair: Row | None) -> str:
        if pair is None or not pair["pairs"]:
            return ""
        p = max(pair["p_holm"], 1e-4)
        low, high = (100.0 * end for end in pair["difference_ci95"])
        rates = f"{100.0 * pair['difference']:+.0f} ({low:+.0f} to {high:+.0f})"
        return f"{rates}, {pair['only_direct']} : {pair['only_this']}, p {p:.2g}"

    return [
        [name, *(difference(found.get((name, rival))) for rival in _rivals(rows))]
        for name in dict.fromkeys(str(row["condition"]) for row in rows)
    ]


def break_even(task: ScoredTask, rows: Sequence[Row]) -> list[list[str]]:
    """Return where half of the trials fail, and where a rival draws level with the map."""
    out = []
    for name, points in sweeps_of(rows).items():
        unit = str(points[0]["unit"])
        curves: dict[str, Curve] = {}
        for row in points:
            at = float(row["value"]), float(row[task.rate])
            curves.setdefault(str(row["generator"]), []).append(at)
        curves = {generator: sorted(curve) for generator, curve in curves.items()}
        mine = curves.get(REFERENCE)
        for generator, curve in curves.items():
            half = _crossing(curve, [0.5] * len(curve), unit) or "not in this range"
            level = "" if mine is None or generator == REFERENCE else _level(mine, curve, unit)
            out.append([name, generator, half, level])
    return out


def _level(mine: Curve, other: Curve, unit: str) -> str:
    """Return where two curves cross; who is ahead everywhere where they do not."""
    if [x for x, _ in mine] != [x for x, _ in other]:
        return ""
    crossing = _crossing(other, [rate for _, rate in mine], unit)
    if crossing:
        return crossing
    gaps = [b - a for (_, a), (_, b) in zip(mine, other, strict=True)]
    if all(gap == 0.0 for gap in gaps):
        return "level everywhere"
    return "never: direct ahead" if min(gaps) < 0.0 else "never: direct behind"


def _crossing(curve: Curve, bar: Sequence[float], unit: str) -> str:
    """Return where a curve first passes from one side of a bar to the other; empty if nowhere."""
    gaps = [rate - height for (_, rate), height in zip(curve, bar, strict=True)]
    for k in range(len(gaps) - 1):
        if gaps[k] * gaps[k + 1] < 0.0:
            share = gaps[k] / (gaps[k] - gaps[k + 1])
            value = curve[k][0] + share * (curve[k + 1][0] - curve[k][0])
            return f"{value:.3g} {unit}".strip()
    return ""
