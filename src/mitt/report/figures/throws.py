"""All throws at once: errors at first contact, and where the balls were released."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from mitt.errors import ShapeError
from mitt.report.figures.style import GREY, INK, STATUS, Plot, legend_above, plot
from mitt.signals import Array

#: Bars of a histogram, points drawn at most, and marks below it at most.
_BARS, _MOST, _MOST_MARKS = 24, 2000, 300
#: Room around the releases [m].
_ROOM = 0.15

#: Field of a trial, and what it is called on the axis.
_ERRORS = (
    ("position_error_mm", "position error at first contact [mm]"),
    ("velocity_error_m_s", "velocity error at first contact [m/s]"),
)


def contact_errors(trials: Sequence[dict[str, Any]]) -> Plot:
    """Draw how far ball and catch point were apart at first contact, in place and in velocity."""

    def draw(figure: Figure) -> None:
        for axes, (key, title) in zip(figure.subplots(1, 2), _ERRORS, strict=True):
            _draw_errors(axes, trials, key)
            axes.set(xlabel=title, ylabel="throws")
        legend_above(figure, figure.axes[0])

    return plot("errors", (11.0, 3.4), draw)


def _draw_errors(axes: Axes, trials: Sequence[dict[str, Any]], key: str) -> None:
    """Draw one histogram, stacked by status, with a mark a throw below it."""
    groups = {s: [t[key] for t in trials if t["status"] == s and t[key] is not None]
              for s in STATUS}  # fmt: skip
    groups = {status: values for status, values in groups.items() if values}
    every = np.array([x for values in groups.values() for x in values])
    if not len(every):
        axes.text(0.5, 0.5, "no ball was touched", transform=axes.transAxes, ha="center",
                  color=GREY)  # fmt: skip
        return
    edges = np.linspace(0.0, 1.02 * max(float(every.max()), 1e-6), _BARS + 1)
    colours = [STATUS[status][0] for status in groups]
    axes.hist(
        list(groups.values()), edges.tolist(), stacked=True, color=colours, label=list(groups),
        edgecolor="white", linewidth=0.6,
    )  # fmt: skip
    top = axes.get_ylim()[1]
    for values, colour in zip(groups.values(), colours, strict=True):
        marks = np.array(values[:_MOST_MARKS])
        axes.plot(marks, np.full(len(marks), -0.05 * top), "|", color=colour, ms=7, mew=1.0)
    for share, name, height in ((50.0, "median", 1.0), (95.0, "95 % below", 0.93)):
        at = float(np.percentile(every, share))
        axes.axvline(at, color=INK, linewidth=1.0, linestyle=(0, (4, 2)))
        axes.annotate(f"{name} {at:.2g}", (at, height), (3, 0), xycoords=("data", "axes fraction"),
                      textcoords="offset points", va="top", fontsize=8.5, color=INK)  # fmt: skip
    axes.set_ylim(-0.1 * top, 1.25 * top)
    axes.set_xlim(0.0, float(edges[-1]))
    ticks = MaxNLocator(nbins=5, integer=True).tick_values(0.0, top)
    axes.set_yticks([y for y in ticks if 0.0 <= y <= 1.25 * top])


def releases(
    trials: Sequence[dict[str, Any]], points: Array, catch_point: Array | None = None
) -> Plot:
    """Draw where the balls came from, coloured by what became of them.

    Args:
        trials: Trials of the result.
        points: Ball centre at release of each [m], shape (len(trials), 3).
        catch_point: Where the throw of the other figures was caught [m], shape (3,).

    Raises:
        ShapeError: Not one point a trial.
    """
    if points.shape != (len(trials), 3):
        raise ShapeError("points", f"({len(trials)}, 3)", points.shape)

    marks = np.zeros((1, 3)) if catch_point is None else np.array([np.zeros(3), catch_point])
    cloud = np.concatenate([points, marks])
    low, high = cloud.min(axis=0) - _ROOM, cloud.max(axis=0) + _ROOM
    x, y, z = high - low

    def draw(figure: Figure) -> None:
        side, top = figure.subplots(2, 1, sharex=True, height_ratios=(z, y))
        for axes, row, name in ((side, 2, "z [m], from the side"), (top, 1, "y [m], from above")):
            _draw_releases(axes, trials, points, row)
            axes.plot(0.0, 0.0, "s", color=GREY, ms=7, label="shoulder")
            axes.plot(*marks[1:, [0, row]].T, "+", color=INK, ms=11, mew=1.6,
                      label="catch of the throw shown")  # fmt: skip
            axes.set(ylabel=name, xlim=(low[0], high[0]), ylim=(low[row], high[row]))
            axes.set_aspect("equal")
        top.set_xlabel("x [m], towards the thrower")
        legend_above(figure, side)

    return plot("releases", (11.0, 10.0 * (y + z) / x + 1.1), draw)


def _draw_releases(axes: Axes, trials: Sequence[dict[str, Any]], points: Array, row: int) -> None:
    """Draw the releases in one projection, those that failed in front."""
    for order, (status, (colour, mark)) in enumerate(STATUS.items()):
        of = [k for k, trial in enumerate(trials) if trial["status"] == status]
        if of:
            axes.plot(
                points[of[:_MOST], 0], points[of[:_MOST], row], mark, color=colour, ms=5.5,
                mec="white", mew=0.5, label=f"{status} ({len(of)})", zorder=3 + order,
            )  # fmt: skip
