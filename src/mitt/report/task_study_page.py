"""The page of a study of a task: the answer in words, a picture, all figures.

Of meetings the picture shows errors by rate of planning; of batting the miss by target and ball.
"""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from matplotlib.ticker import FuncFormatter, NullFormatter

from mitt.clock import Progress
from mitt.files.writing import write_text
from mitt.report.page import NONE, Section, interval, page, shown_number
from mitt.report.style import BAND, GENERATORS, INK, UNNAMED, Plot, legend_above, plot
from mitt.trials.bat_study import AXES, BatCondition, BatStudy
from mitt.trials.result import PAGE
from mitt.trials.study_folder import Folder
from mitt.trials.task_run import answer
from mitt.trials.task_study import TaskStudy

Row = Mapping[str, Any]

_SECTIONS = (
    Section("summary", "Answer", "What the figures say"),
    Section("picture", "Picture", "In a picture"),
    Section("cells", "Table", "All generators"),
)
#: What is said below the pictures.
_RATES = "Median, and up to the 90th percentile. Generators that do not plan are lines across."
_MISSES = (
    "Below it, of 100 balls: refused before the arm moved (ref.), and not hit otherwise (lost). "
    "Grey: none was hit."
)
#: Least number of panels.
_COLUMNS = 3
#: Misses at the two ends of the colours of a map [cm].
_NEAR = 2.0
_FAR = 100.0


def write_task_study_page(
    study: TaskStudy, rows: Sequence[Row], folder: Folder, *, progress: Progress
) -> None:
    """Write ``report.html``."""
    progress("page", 0, 1)
    write_text(folder.path / PAGE, task_study_page(study, rows))
    progress("page", 1, 1)


def task_study_page(study: TaskStudy, rows: Sequence[Row]) -> str:
    """Return the page of a study with the rows of its summary."""
    task = study.task_of
    groups = {c.name: [r for r in rows if r["condition"] == c.name] for c in study.conditions}
    cells = study.cells(rows) if isinstance(study, BatStudy) else None
    picture = None
    if cells is None:
        picture = (
            "Error at the grasp against the rate of planning",
            _RATES,
            errors_by_rate(groups),
        )
    elif cells:
        picture = ("Median miss [cm] by target and ball speed", _MISSES, miss_map(cells))
    of_map = {c.name for c, _ in cells or ()}
    head = (
        task.success,
        "95 % [%]",
        *(x.words for x in task.measures.values()),
        "refused",
        "by",
        "beyond",
    )
    tables = [
        (name, ("generator", *head), [_cells(study, "generator", row) for row in of])
        for name, of in groups.items()
        if name not in of_map
    ]
    if cells:
        of = [_cells(study, "condition", row) for _, row in cells]
        tables.append(("Map", ("condition", *head), of))
    return page(
        "task-study",
        _SECTIONS,
        title=f"{study.name}: {sum(r['trials'] for r in rows):,} trials",
        command="study",
        study=study,
        task=task,
        answer=answer(study, rows),
        rows=len(rows),
        unfinished=sum(not row["complete"] for row in rows),
        tables=tables,
        picture=picture,
    )


def _cells(study: TaskStudy, first: str, row: Row) -> list[str]:
    """Return a row of a table, which begins with a generator or a condition."""
    task = study.task_of
    return [
        str(row[first]),
        f"{row[task.success]} of {row['trials']}",
        interval(row["ci95"]),
        *(_spread(row[name], x.digits) for name, x in task.measures.items()),
        str(row["unreachable"]),
        str(row["refused_by"] or NONE),
        str(row["violating_trials"]),
    ]


def _spread(of: Mapping[str, float] | None, digits: int) -> str:
    """Return median and 90th percentile as text."""
    return (
        NONE
        if of is None
        else f"{shown_number(of['median'], digits)} ({shown_number(of['p90'], digits)})"
    )


def miss_map(cells: Sequence[tuple[BatCondition, Row]]) -> Plot:
    """Draw the median miss by where the target is, a panel an axis, and by the balls' speed.

    In each cell the miss [cm], and below it, of 100 balls, how many were refused and how many were
    not hit otherwise, where there were any.
    """

    def draw(figure: Figure) -> None:
        panels = figure.subplots(1, len(AXES), sharey=True)
        for k, axes in enumerate(panels):
            mine = [(c, row) for c, row in cells if c.moved is not None and c.moved[0] in (k, -1)]
            _draw_misses(axes, mine)
            axes.set(title=f"Target {AXES[k]}", xlabel="moved by [m]")
        panels[0].set_ylabel("ball at release [m/s]")

    return plot("map", (11.5, 4.6), draw)


def _draw_misses(axes: Axes, cells: Sequence[tuple[BatCondition, Row]]) -> None:
    """Draw one panel of the map."""
    offsets = sorted({c.moved[1] for c, _ in cells if c.moved is not None})
    speeds = sorted({c.speed for c, _ in cells if c.speed is not None})
    shade, scale = colormaps["viridis_r"], LogNorm(_NEAR, _FAR)
    for c, row in cells:
        if c.moved is None or c.speed is None or not row["trials"]:
            continue
        x, y = offsets.index(c.moved[1]), speeds.index(c.speed)
        miss = None if row["miss_cm"] is None else row["miss_cm"]["median"]
        value = 1.0 if miss is None else float(np.clip(scale(miss), 0.0, 1.0))
        colour = BAND if miss is None else shade(value)
        axes.add_patch(Rectangle((x - 0.5, y - 0.5), 1.0, 1.0, facecolor=colour, edgecolor="white"))
        ink = "white" if miss is not None and value > 0.45 else INK
        refused = round(100.0 * row["unreachable"] / row["trials"])
        lost = round(100.0 * (row["trials"] - row["hit"] - row["unreachable"]) / row["trials"])
        text = shown_number(miss, 1 if miss is not None and miss < 10.0 else 0)
        axes.text(x, y + 0.14, text, ha="center", va="center", color=ink, fontsize=10.5)
        said = ", ".join(f"{n} {what}" for n, what in ((refused, "ref."), (lost, "lost")) if n)
        axes.text(x, y - 0.26, said, ha="center", va="center", color=ink, fontsize=6.5)
    axes.set(xlim=(-0.5, len(offsets) - 0.5), ylim=(-0.5, len(speeds) - 0.5))
    axes.set_xticks(range(len(offsets)), [f"{x:+g}" if x else "0" for x in offsets])
    axes.set_yticks(range(len(speeds)), [f"{a:g} to {b:g}" for a, b in speeds])
    axes.grid(visible=False)


def errors_by_rate(groups: Mapping[str, Sequence[Row]]) -> Plot:
    """Draw the error at the grasp against the rate of planning, a panel a condition."""

    def draw(figure: Figure) -> None:
        panels = figure.subplots(1, max(len(groups), _COLUMNS), squeeze=False).ravel()
        for axes, (name, rows) in zip(panels, groups.items(), strict=False):
            axes.set_title(name)
            axes.set_xlabel("plans a second")
            _draw(axes, [row for row in rows if row["error_mm"] is not None])
        for axes in panels[len(groups) :]:
            axes.set_visible(False)
        panels[0].set_ylabel("error at the grasp [mm]")
        legend_above(figure, panels[0])

    return plot("rates", (max(len(groups), _COLUMNS) * 3.7, 3.4), draw)


def _draw(axes: Axes, rows: Sequence[Row]) -> None:
    """Draw one panel: those that plan by their rates, the others across."""
    rates = sorted({float(row["rate_hz"]) for row in rows if row["rate_hz"] is not None})
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.set_xlim(0.5 * min(rates, default=10.0), 2.0 * max(rates, default=1000.0))
    axes.set_xticks(rates, [f"{rate:g}" for rate in rates], minor=False)
    axes.xaxis.set_minor_formatter(NullFormatter())
    axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axes.yaxis.set_minor_formatter(NullFormatter())
    names = dict.fromkeys(str(row["generator"]).split(" ", maxsplit=1)[0] for row in rows)
    for name in names:
        colour, marker, line = GENERATORS.get(name, UNNAMED)
        mine = [r for r in rows if str(r["generator"]).split(" ", maxsplit=1)[0] == name]
        median = [r["error_mm"]["median"] for r in mine]
        above = [r["error_mm"]["p90"] - r["error_mm"]["median"] for r in mine]
        if mine[0]["rate_hz"] is None:
            axes.axhline(median[0], color=colour, linestyle=line, label=name)
        else:
            axes.errorbar(
                [r["rate_hz"] for r in mine],
                median,
                [[0.0] * len(mine), above],
                color=colour,
                marker=marker,
                linestyle=line,
                label=name,
            )
