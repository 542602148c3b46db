"""The page of a study: one file that opens anywhere, replays of the worst throws beside it.

Figures: rates against a disturbance, rates by condition, where balls are caught, and the effort.
"""

from collections.abc import Mapping, Sequence
from math import ceil
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

import mitt
from mitt import checks
from mitt.clock import Progress
from mitt.files.arm_file import ThrowSettings
from mitt.files.writing import write_text
from mitt.reading import read_json
from mitt.report.page import Cell, Section, interval, page, shown_number
from mitt.report.replay_3d import replay_page
from mitt.report.style import BLUE, GENERATORS, GREY, INK, UNNAMED, Plot, legend_above, plot
from mitt.signals import Array
from mitt.trials.result import STATUSES
from mitt.trials.study_file import REFERENCE, SCHEMA, Condition, Study, extent
from mitt.trials.study_results import StudyResult, read_columns
from mitt.trials.study_run import Job, all_jobs, by_cell, throw_again

Row = Mapping[str, Any]

#: Panels in a row, and their width [inch].
_COLUMNS = 3
_WIDE = 3.7
_CAUGHT = LinearSegmentedColormap.from_list("caught", ["#b6401a", "#f3e3c3", BLUE])


def rates_against(sweeps: Mapping[str, Sequence[Row]]) -> Plot:
    """Draw the catch rate against each swept number, a line a generator, 95 % intervals shaded."""
    rows = ceil(len(sweeps) / _COLUMNS)

    def draw(figure: Figure) -> None:
        panels = figure.subplots(rows, _COLUMNS, squeeze=False, sharey=True).ravel()
        for axes, (name, points) in zip(panels, sweeps.items(), strict=False):
            _draw_sweep(axes, name, points)
        for axes in panels[len(sweeps) :]:
            axes.set_visible(False)
        for axes in panels[::_COLUMNS]:
            axes.set_ylabel("caught [%]")
        _name_generators(figure, [row for points in sweeps.values() for row in points])

    return plot("rates", (_COLUMNS * _WIDE, rows * 2.75 + 0.3), draw)


def _draw_sweep(axes: Axes, name: str, points: Sequence[Row]) -> None:
    """Draw one panel."""
    values = sorted({float(row["value"]) for row in points})
    for generator in _generators(points):
        mine = [row for row in points if row["generator"] == generator]
        mine.sort(key=lambda row: float(row["value"]))
        x = [row["value"] for row in mine]
        low, high = (np.array([100.0 * row["ci95"][k] for row in mine]) for k in (0, 1))
        colour, marker, line = GENERATORS.get(generator, UNNAMED)
        axes.fill_between(x, low, high, color=colour, alpha=0.13, linewidth=0)
        rates = [100.0 * row["catch_rate"] for row in mine]
        axes.plot(x, rates, marker + line, color=colour, ms=4.5)
    if values[0] > 0.0 and values[-1] > 6.0 * values[0]:  # near a decade
        axes.set_xscale("log")
        axes.set_xticks(values, [f"{value:g}" for value in values], rotation=0)
        axes.minorticks_off()
    else:
        axes.xaxis.set_major_locator(MaxNLocator(6))
    unit = f" [{points[0]['unit']}]" if points[0]["unit"] else ""
    axes.set(xlabel=f"{name}{unit}", ylim=(-3.0, 103.0))


def rates_by_condition(rows: Sequence[Row]) -> Plot:
    """Draw the catch rate in each condition, a mark a generator with its 95 % interval."""
    conditions = list(dict.fromkeys(str(row["condition"]) for row in rows))
    names = _generators(rows)
    step = 0.76 / max(len(names), 1)

    def draw(figure: Figure) -> None:
        axes = figure.subplots()
        for row in rows:
            k = names.index(row["generator"])
            y = conditions.index(row["condition"]) + (k - 0.5 * (len(names) - 1)) * step
            colour, marker, _ = GENERATORS.get(row["generator"], UNNAMED)
            axes.plot([100.0 * x for x in row["ci95"]], [y, y], color=colour, linewidth=1.4)
            axes.plot(100.0 * row["catch_rate"], y, marker, color=colour, ms=5.0)
        for k in range(1, len(conditions), 2):
            axes.axhspan(k - 0.5, k + 0.5, color="#f5f7f9", zorder=0)
        axes.set_yticks(range(len(conditions)), conditions)
        axes.set(xlim=(-2.0, 102.0), ylim=(len(conditions) - 0.5, -0.5), xlabel="caught [%]")
        axes.grid(visible=False, axis="y")
        _name_generators(figure, rows)

    height = 1.1 + len(conditions) * max(0.34, 0.13 * len(names))
    return plot("conditions", (_COLUMNS * _WIDE, height), draw)


def reach(trials: Mapping[str, Array]) -> Plot:
    """Draw where and how fast balls came that were caught, two maps a generator.

    Args:
        trials: Of each generator, rows of y [m], z [m], speed [m/s], whether caught, shape (k, 4).
    """
    every = np.concatenate(list(trials.values()))
    ends = np.percentile(every[:, :3], [1.0, 99.0], axis=0)
    bins = int(np.clip(0.5 * np.sqrt(len(every) / len(trials)), 5, 14))  # a side
    edges = [np.linspace(float(a), float(b), bins + 1) for a, b in ends.T]
    rows = len(trials)

    def draw(figure: Figure) -> None:
        panels = figure.subplots(2, rows, squeeze=False, sharey="row")
        shown = None
        for column, (generator, points) in enumerate(trials.items()):
            upper, lower = panels[:, column]
            shown = _draw_map(upper, points, edges, (0, 1))
            _draw_map(lower, points, edges, (2, 1))
            colour = GENERATORS.get(generator, UNNAMED)[0]
            upper.set_title(generator, color=colour, fontsize=min(10.5, 62.0 / rows))
            upper.set_xlabel("sideways [m]")
            lower.set_xlabel("speed [m/s]")
        for axes in panels[:, 0]:
            axes.set_ylabel("height [m]")
        if shown is not None:
            figure.colorbar(shown, ax=panels, label="caught [%]", shrink=0.7, aspect=30)

    return plot("reach", (_COLUMNS * _WIDE, 4.6), draw)


def _draw_map(axes: Axes, points: Array, edges: Sequence[Array], of: tuple[int, int]) -> Any:  # noqa: ANN401 (matplotlib)
    """Draw the share of balls caught in each cell of a plane; cells without throws stay white."""
    columns = points[:, of[0]], points[:, of[1]]
    bins = [edges[of[0]], edges[of[1]]]
    thrown = np.histogram2d(*columns, bins=bins)[0]
    caught = np.histogram2d(*columns, bins=bins, weights=points[:, 3])[0]
    share = np.full(thrown.shape, np.nan)
    np.divide(100.0 * caught, thrown, out=share, where=thrown > 0)
    axes.grid(visible=False)
    return axes.pcolormesh(*bins, np.ma.masked_invalid(share.T), cmap=_CAUGHT, vmin=0.0, vmax=100.0)


def effort(rows: Sequence[Row], columns: Sequence[tuple[str, str, float]]) -> Plot:
    """Draw medians over the conditions, a dot a condition, a line at their median.

    Args:
        rows: Rows of the summary.
        columns: Name of a median, what it is called, and its factor.
    """
    names = _generators(rows)

    def draw(figure: Figure) -> None:
        for axes, (key, title, factor) in zip(
            figure.subplots(1, len(columns), squeeze=False)[0], columns, strict=True
        ):
            for k, name in enumerate(names):
                found = [row["median"][key] for row in rows if row["generator"] == name]
                values = factor * np.array([x for x in found if x is not None])
                if not len(values):
                    continue
                colour = GENERATORS.get(name, UNNAMED)[0]
                spread = k + 0.30 * np.linspace(-1.0, 1.0, len(values))
                axes.plot(spread, values, ".", color=colour, alpha=0.55)
                axes.plot([k - 0.36, k + 0.36], [np.median(values)] * 2, color=colour, lw=2.2)
            axes.set_xticks(range(len(names)), names, rotation=55, ha="right")
            axes.set_title(title, color=INK)
            axes.set_ylim(0.0, 1.05 * axes.get_ylim()[1])
            axes.grid(visible=False, axis="x")

    return plot("effort", (_COLUMNS * _WIDE, 3.4), draw)


def _generators(rows: Sequence[Row]) -> list[str]:
    """Return the generators of some rows, in their order."""
    return list(dict.fromkeys(str(row["generator"]) for row in rows))


def _name_generators(figure: Figure, rows: Sequence[Row]) -> None:
    """Put the key of the generators above all panels."""
    for name in _generators(rows):
        colour, marker, line = GENERATORS.get(name, UNNAMED)
        figure.axes[0].plot([], [], marker + line, color=colour, label=name, ms=4.5)
    legend_above(figure, figure.axes[0], labelcolor=GREY)


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
        rows.append(
            (
                job.condition.name,
                job.generator,
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
) -> list[tuple[Job, dict[str, Any]]]:
    """Return failures to show: those of the direct map where it lost most first, one a cell.

    Of a cell it is the first throw in which the arm moved and the ball was lost, or else any lost.
    """
    cells = {
        (g[0].condition.name, g[0].generator): g
        for g in by_cell(list(all_jobs(result.study, result.folder, progress)))
    }
    out: list[tuple[Job, dict[str, Any]]] = []
    for row in sorted(result.rows, key=lambda r: (r["generator"] != "direct", r["catch_rate"])):
        if len(out) == count:
            break
        lost = [
            ("generator", "=", row["generator"]),
            ("condition", "=", row["condition"]),
            ("status", "!=", "caught"),
        ]
        table = read_columns(result.folder.trials, ("index", "status", "binding_limit"), lost)
        failed: list[dict[str, Any]] = table.to_pylist()
        moved = [throw for throw in failed if throw["status"] in ("dropped", "missed")]
        for throw in (moved or failed)[:1]:
            group = cells[row["condition"], row["generator"]]
            out.append((next(j for j in group if j.start <= throw["index"] < j.stop), throw))
    return out


Curve = list[tuple[float, float]]
"""Value of a disturbance and catch rate, in the order of the values."""

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
#: Two rates whose difference is surely less than this are level.
_LEVEL = 0.05
_HEAD = (
    "condition",
    "generator",
    "stopped by",
    "throws",
    "caught",
    "rate [%]",
    "95 % interval [%]",
    "force [N]",
    "force, 95 % [N]",
    "too hard",
    *STATUSES[1:],
    "position [mm]",
    "velocity [m/s]",
    "work [J]",
    "beyond a limit",
)


def write_study_report(result: StudyResult, *, replays: int, progress: Progress) -> None:
    """Write ``report.html`` and the replays beside it."""
    worst = worst_throws(result, replays, progress)
    progress("page", 0, 1)
    write_text(result.folder.path / "report.html", study_page(result, worst))
    progress("page", 1, 1)


def study_page(result: StudyResult, worst: Sequence[Sequence[Cell]]) -> str:
    """Return the page.

    ``worst`` has the rows of the table of worst throws.
    """
    study, rows = result.study, result.rows
    pairs = [row for row in rows if row["against_direct"] is not None]
    sure = [row for row in pairs if row["against_direct"]["p_holm"] < 0.05]
    ahead: list[Mapping[str, Any]] = []
    behind: list[Mapping[str, Any]] = []
    for row in sure:
        duel = row["against_direct"]
        (ahead if duel["only_direct"] > duel["only_this"] else behind).append(row)
    equal = sum(
        row["against_direct"]["difference_ci95"][0] > -_LEVEL
        and row["against_direct"]["difference_ci95"][1] < _LEVEL
        for row in pairs
    )
    wide = [c for c in study.conditions if c.throws != ThrowSettings()]
    widest = max(wide, key=lambda c: c.throws.spread, default=study.conditions[0])
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
        equal=equal,
        ahead=ahead,
        behind=behind,
        drawn=_drawn(result, widest),
        rivals=[name for name in study.generators if name != REFERENCE],
        paired=paired_tests(study, rows),
        even=break_even(rows),
        widest=widest.name,
        worst=worst,
        times=_times(result),
        head=_HEAD,
        numbers=[_cells(row) for row in rows],
    )


def _drawn(result: StudyResult, widest: Condition) -> dict[str, str]:
    """Return all drawings for which there are data; the heat maps are those of a condition."""
    sweeps = sweeps_of(result.rows)
    single = [row for row in result.rows if row["disturbance"] not in sweeps]
    trials = {g: _passings(result, g, widest.name) for g in result.study.generators}
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


def _cells(row: Row) -> list[str]:
    """Return a row of the summary as cells of the table of all numbers."""
    median, force = row["median"], row["force_n"] or {"median": None, "p95": None}
    return [
        str(row["condition"]),
        str(row["generator"]),
        ", ".join(f"{reason} {count}" for reason, count in row["stopped_by"].items()),
        str(row["throws"]),
        str(row["caught"]),
        f"{100.0 * row['catch_rate']:.1f}",
        interval(row["ci95"]),
        shown_number(force["median"], 0),
        shown_number(force["p95"], 0),
        str(row["over_force"]),
        *(str(row[status]) for status in STATUSES[1:]),
        shown_number(median["position_error_mm"], 1),
        shown_number(median["velocity_error_m_s"], 2),
        shown_number(median["energy_j"], 0),
        str(row["violating_throws"]),
    ]


def _times(result: StudyResult) -> list[list[str]]:
    """Return generators with a tick's median and p99 time [us] in their slowest condition."""
    path = result.folder.path / "timing.json"
    given = read_json(path) if path.exists() else {}
    rows = given.get("rows") if isinstance(given, dict) else None
    cells = []
    for name in result.study.generators:
        of = [r for r in rows or () if isinstance(r, dict) and r.get("generator") == name]
        if of:
            p50, p99 = (
                [checks.number(f"{path} {key}", row.get(key)) for row in of]
                for key in ("tick_us_p50", "tick_us_p99")
            )
            cells.append([name, shown_number(max(p50), 0), shown_number(max(p99), 0)])
    return cells


def sweeps_of(rows: Sequence[Row]) -> dict[str, list[Row]]:
    """Return the rows of each swept disturbance."""
    out: dict[str, list[Row]] = {}
    for row in rows:
        if row["value"] is not None:
            out.setdefault(str(row["disturbance"]), []).append(row)
    return {name: found for name, found in out.items() if len({r["value"] for r in found}) > 1}


def paired_tests(study: Study, rows: Sequence[Row]) -> list[list[str]]:
    """Return the table of paired differences, a row a condition, a column a rival.

    By how much the rival's rate is above the reference's with its 95 % interval [%], throws that
    only the reference caught, those that only the rival caught, and p.
    """
    rivals = [name for name in study.generators if name != REFERENCE]
    if not rivals or REFERENCE not in study.generators:
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
        [c.name, *(difference(found.get((c.name, rival))) for rival in rivals)]
        for c in study.conditions
    ]


def break_even(rows: Sequence[Row]) -> list[list[str]]:
    """Return where half of the balls are lost, and where a rival draws level with the map."""
    out = []
    for name, points in sweeps_of(rows).items():
        unit = str(points[0]["unit"])
        curves: dict[str, Curve] = {}
        for row in points:
            at = float(row["value"]), float(row["catch_rate"])
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
