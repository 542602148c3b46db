"""Figures of a study: rates against a disturbance, rates by condition, where balls are caught."""

from collections.abc import Mapping, Sequence
from math import ceil
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from mitt.report.style import BLUE, GENERATORS, GREY, INK, UNNAMED, Plot, legend_above, plot
from mitt.signals import Array

Row = Mapping[str, Any]

#: Panels in a row, and their size [inch].
_COLUMNS, _WIDE, _HIGH = 3, 3.7, 2.75
#: Fewest and most bins of a heat map a side, and the fewest throws that colour one.
_BINS, _FEWEST = (5, 14), 1
#: A ratio of ends of an axis beyond which it is drawn logarithmic.
_DECADE = 6.0
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

    return plot("rates", (_COLUMNS * _WIDE, rows * _HIGH + 0.3), draw)


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
    if values[0] > 0.0 and values[-1] > _DECADE * values[0]:
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
    bins = int(np.clip(0.5 * np.sqrt(len(every) / len(trials)), *_BINS))
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
    np.divide(100.0 * caught, thrown, out=share, where=thrown >= _FEWEST)
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
