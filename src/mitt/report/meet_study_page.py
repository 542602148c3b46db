"""The page of a study of meetings: the answer in words, errors by rate of planning, all figures."""

from collections.abc import Mapping, Sequence
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, NullFormatter

from mitt.clock import Progress
from mitt.files.writing import write_text
from mitt.report.page import NONE, Section, interval, number, page
from mitt.report.style import GENERATORS, UNNAMED, Plot, legend_above, plot
from mitt.trials.meet_study import MEET_SCHEMA, MeetStudy
from mitt.trials.meet_study_run import answer
from mitt.trials.result import PAGE
from mitt.trials.study_folder import Folder

Row = Mapping[str, Any]

_SECTIONS = (
    Section("summary", "Answer", "What the figures say"),
    Section("rates", "Rates", "Error and the rate of planning"),
    Section("cells", "Table", "All generators"),
)
#: Least number of panels.
_COLUMNS = 3
_HEAD = ("generator", "met", "95 % [%]", "error [mm]", "rel. [m/s]", "[rad/s^2]", "[N]",
         "in step [s]", "beyond")  # fmt: skip
#: Digits of each measure in the table.
_DIGITS = {"error_mm": 1, "velocity_m_s": 3, "acceleration": 0, "force_n": 0, "in_sync_s": 3}


def write_meet_study_page(
    study: MeetStudy, rows: Sequence[Row], folder: Folder, *, progress: Progress
) -> None:
    """Write ``report.html``."""
    progress("page", 0, 1)
    write_text(folder.path / PAGE, meet_study_page(study, rows))
    progress("page", 1, 1)


def meet_study_page(study: MeetStudy, rows: Sequence[Row]) -> str:
    """Return the page of a study with the rows of its summary."""
    groups = {c.name: [r for r in rows if r["condition"] == c.name] for c in study.conditions}
    return page(
        "meet-study", _SECTIONS, title=f"{study.name}: {sum(r['trials'] for r in rows):,} trials",
        command="study", study=study, schema=MEET_SCHEMA, answer=answer(rows), rows=len(rows),
        unfinished=sum(not row["complete"] for row in rows), drawn=errors_by_rate(groups).svg,
        head=_HEAD,
        tables=[(name, [_cells(row) for row in cells]) for name, cells in groups.items()],
    )  # fmt: skip


def _cells(row: Row) -> list[str]:
    """Return a row of the table."""
    return [
        str(row["generator"]), f"{row['met']} of {row['trials']}", interval(row["ci95"]),
        *(_spread(row[name], digits) for name, digits in _DIGITS.items()),
        str(row["violating_trials"]),
    ]  # fmt: skip


def _spread(of: Mapping[str, float] | None, digits: int) -> str:
    """Return median and 90th percentile as text."""
    return NONE if of is None else f"{number(of['median'], digits)} ({number(of['p90'], digits)})"


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
            axes.errorbar([r["rate_hz"] for r in mine], median, [[0.0] * len(mine), above],
                          color=colour, marker=marker, linestyle=line, label=name)  # fmt: skip
