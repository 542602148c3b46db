"""All throws at once: errors at first contact, and where the balls were released."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from mitt.errors import ShapeError
from mitt.signals import Array
from mitt.study.figures.style import GREY, INK, STATUS, Plot, plot

#: Bars of a histogram, points drawn at most, and marks below it at most.
_BARS, _MOST, _MOST_MARKS = 24, 2000, 300

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
        handles, labels = figure.axes[0].get_legend_handles_labels()
        if handles:
            figure.legend(handles, labels, loc="outside upper left", ncols=len(labels))

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
    _, _, bars = axes.hist(
        list(groups.values()), edges, stacked=True, color=colours, label=list(groups),
        edgecolor="white", linewidth=0.6,
    )  # fmt: skip
    del bars
    top = axes.get_ylim()[1]
    for (status, values), colour in zip(groups.items(), colours, strict=True):
        marks = np.array(values[:_MOST_MARKS])
        axes.plot(marks, np.full(len(marks), -0.05 * top), "|", color=colour, ms=7, mew=1.0)
        del status
    for share, name in ((50.0, "median"), (95.0, "95 %")):
        at = float(np.percentile(every, share))
        axes.axvline(at, color=INK, linewidth=1.0, linestyle=(0, (4, 2)))
        axes.annotate(f"{name} {at:.2g}", (at, 1.0), (3, 0), xycoords=("data", "axes fraction"),
                      textcoords="offset points", va="top", fontsize=8.5, color=INK)  # fmt: skip
    axes.set_ylim(-0.1 * top, 1.12 * top)
    axes.set_xlim(0.0, float(edges[-1]))
    axes.yaxis.get_major_locator().set_params(integer=True)
    axes.set_yticks([y for y in axes.get_yticks() if 0 <= y <= 1.12 * top])


def releases(trials: Sequence[dict[str, Any]], points: Array, catch_point: Array) -> Plot:
    """Draw where the balls came from, coloured by what became of them.

    Args:
        trials: Trials of the result.
        points: Ball centre at release of each [m], shape (len(trials), 3).
        catch_point: Nominal catch point [m], shape (3,).

    Raises:
        ShapeError: Not one point a trial.
    """
    if points.shape != (len(trials), 3):
        raise ShapeError("points", f"({len(trials)}, 3)", points.shape)

    def draw(figure: Figure) -> None:
        side, top = figure.subplots(2, 1, sharex=True)
        for axes, row, name in ((side, 2, "z [m], from the side"), (top, 1, "y [m], from above")):
            for status, (colour, mark) in STATUS.items():
                of = [k for k, trial in enumerate(trials) if trial["status"] == status][:_MOST]
                if of:
                    axes.plot(
                        points[of, 0], points[of, row], mark, color=colour, ms=5.5, mec="white",
                        mew=0.5, label=f"{status} ({len(of)})", zorder=4 if status != "caught" else 3,
                    )  # fmt: skip
            axes.plot(0.0, 0.0, "s", color=GREY, ms=7, label="shoulder")
            axes.plot(catch_point[0], catch_point[row], "+", color=INK, ms=11, mew=1.6,
                      label="nominal catch point")  # fmt: skip
            axes.set_ylabel(name)
            axes.set_aspect("equal", adjustable="datalim")
        top.set_xlabel("x [m], towards the thrower")
        handles, labels = side.get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside upper left", ncols=len(labels))

    return plot("releases", (11.0, 4.6), draw)
