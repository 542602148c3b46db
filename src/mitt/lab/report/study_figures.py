"""Figures of studies: rates against a disturbance and by condition, and those of single tasks.

Of catching where and how fast balls are caught, and the effort; of meetings errors by the rate of
planning; of batting the miss by target and ball.
"""

from collections.abc import Mapping, Sequence
from math import ceil
from typing import Any

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.colors import LinearSegmentedColormap, LogNorm
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from matplotlib.ticker import FuncFormatter, MaxNLocator, NullFormatter

from mitt.core.signals import Array
from mitt.lab.report.page import shown_number
from mitt.lab.report.style import (
    BAND,
    BLUE,
    GENERATORS,
    GREY,
    INK,
    UNNAMED,
    Plot,
    legend_above,
    plot,
)
from mitt.lab.trials.bat_study import AXES, BatCondition
from mitt.lab.trials.scored_task import Row, ScoredTask

#: Panels in a row, at least, and their width [inch].
_COLUMNS = 3
_WIDE = 3.7
_CAUGHT = LinearSegmentedColormap.from_list("caught", ["#b6401a", "#f3e3c3", BLUE])


def rates_against(task: ScoredTask, sweeps: Mapping[str, Sequence[Row]]) -> Plot:
    """Draw the rate against each swept number, a line a generator, 95 % intervals shaded."""
    rows = ceil(len(sweeps) / _COLUMNS)

    def draw(figure: Figure) -> None:
        panels = figure.subplots(rows, _COLUMNS, squeeze=False, sharey=True).ravel()
        for axes, (name, points) in zip(panels, sweeps.items(), strict=False):
            _draw_sweep(axes, task, name, points)
        for axes in panels[len(sweeps) :]:
            axes.set_visible(False)
        for axes in panels[::_COLUMNS]:
            axes.set_ylabel(f"{task.success} [%]")
        _name_generators(figure, [row for points in sweeps.values() for row in points])

    return plot("rates", (_COLUMNS * _WIDE, rows * 2.75 + 0.3), draw)


def _draw_sweep(axes: Axes, task: ScoredTask, name: str, points: Sequence[Row]) -> None:
    """Draw one panel."""
    values = sorted({float(row["value"]) for row in points})
    for generator in _generators(points):
        mine = [row for row in points if row["generator"] == generator]
        mine.sort(key=lambda row: float(row["value"]))
        x = [row["value"] for row in mine]
        low, high = (np.array([100.0 * row["ci95"][k] for row in mine]) for k in (0, 1))
        colour, marker, line = GENERATORS.get(generator, UNNAMED)
        axes.fill_between(x, low, high, color=colour, alpha=0.13, linewidth=0)
        rates = [100.0 * row[task.rate] for row in mine]
        axes.plot(x, rates, marker + line, color=colour, ms=4.5)
    if values[0] > 0.0 and values[-1] > 6.0 * values[0]:  # near a decade
        axes.set_xscale("log")
        axes.set_xticks(values, [f"{value:g}" for value in values], rotation=0)
        axes.minorticks_off()
    else:
        axes.xaxis.set_major_locator(MaxNLocator(6))
    unit = f" [{points[0]['unit']}]" if points[0]["unit"] else ""
    axes.set(xlabel=f"{name}{unit}", ylim=(-3.0, 103.0))


def rates_by_condition(task: ScoredTask, rows: Sequence[Row]) -> Plot:
    """Draw the rate in each condition, a mark a generator with its 95 % interval."""
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
            axes.plot(100.0 * row[task.rate], y, marker, color=colour, ms=5.0)
        for k in range(1, len(conditions), 2):
            axes.axhspan(k - 0.5, k + 0.5, color="#f5f7f9", zorder=0)
        axes.set_yticks(range(len(conditions)), conditions)
        axes.set(
            xlim=(-2.0, 102.0), ylim=(len(conditions) - 0.5, -0.5), xlabel=f"{task.success} [%]"
        )
        axes.grid(visible=False, axis="y")
        _name_generators(figure, rows)

    height = 1.1 + len(conditions) * max(0.34, 0.13 * len(names))
    return plot("conditions", (_COLUMNS * _WIDE, height), draw)


def reach_maps(trials: Mapping[str, Array]) -> Plot:
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


#: Misses at the two ends of the colours of a map [cm].
_NEAR = 2.0
_FAR = 100.0


def miss_map(cells: Sequence[tuple[BatCondition, Row]]) -> Plot:
    """Draw the median landing error by where the target is, and by the balls' speed.

    A panel an axis; in each cell the error [cm], and below it, of 100 balls, how many were refused
    and how many were not returned otherwise, where there were any.
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
        miss = None if row["landing_cm"] is None else row["landing_cm"]["median"]
        value = 1.0 if miss is None else float(np.clip(scale(miss), 0.0, 1.0))
        colour = BAND if miss is None else shade(value)
        axes.add_patch(Rectangle((x - 0.5, y - 0.5), 1.0, 1.0, facecolor=colour, edgecolor="white"))
        ink = "white" if miss is not None and value > 0.45 else INK
        refused = round(100.0 * row["unreachable"] / row["trials"])
        lost = round(100.0 * (row["trials"] - row["returned"] - row["unreachable"]) / row["trials"])
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
            _draw_errors(axes, [row for row in rows if row["error_mm"] is not None])
        for axes in panels[len(groups) :]:
            axes.set_visible(False)
        panels[0].set_ylabel("error at the grasp [mm]")
        legend_above(figure, panels[0])

    return plot("planning", (max(len(groups), _COLUMNS) * _WIDE, 3.4), draw)


def _draw_errors(axes: Axes, rows: Sequence[Row]) -> None:
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
