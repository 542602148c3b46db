"""Fig. 8, the catching trajectory from the side and from above, with and without learning."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from mitt.report.figures.style import (
    ALPHA_0,
    BALL,
    GREY,
    INK,
    LEARNED,
    Plot,
    dots,
    legend_above,
    plot,
)
from mitt.report.skeleton import skeleton
from mitt.robot.arm import Arm
from mitt.signals import Array
from mitt.trials.log import TrialLog

#: A line of the arm each so many ticks, and how long after the catch all is drawn [s].
_ARM_EACH, _AFTER = 50, 0.1
#: How far in front of the hand's farthest point the ball is shown, and the room around all [m].
_AHEAD, _ROOM = 0.9, 0.12


def catching_trajectory(arm: Arm, learned: TrialLog, plain: TrialLog | None) -> Plot:
    """Draw ball and hand each millisecond and the arm each 50 ms: fig. 8."""
    columns = [("Learned map", learned)] + ([] if plain is None else [(ALPHA_0, plain)])
    low, high = _extent(arm, [log for _, log in columns])
    x, y, z = high - low

    def draw(figure: Figure) -> None:
        grid = figure.subplots(
            2, len(columns), sharex=True, sharey="row", squeeze=False, height_ratios=(z, y)
        )
        for (title, log), (side, top) in zip(columns, grid.T, strict=True):
            side.set_title(title)
            for axes, view in ((side, [0, 2]), (top, [0, 1])):
                _draw_view(axes, arm, log, view)
                axes.set(xlim=(low[0], high[0]), ylim=(low[view[1]], high[view[1]]))
            top.set_xlabel("x [m], towards the thrower")
        grid[0, 0].set_ylabel("z [m], from the side")
        grid[1, 0].set_ylabel("y [m], from above")
        legend_above(figure, grid[0, 0], ncols=4, handlelength=1.8)

    return plot("fig8", (11.0, 5.1 * (y + z) / x + 1.2), draw)


def _shown(log: TrialLog) -> NDArray[np.int64]:
    """Return the rows of the truth that are drawn: until shortly after the catch."""
    end = min(log.t_catch + _AFTER, float(log.truth.t[-1]))
    return np.flatnonzero(log.truth.t <= end + 1e-9)


def _extent(arm: Arm, logs: list[TrialLog]) -> tuple[Array, Array]:
    """Return the corners of a box [m] around arm and hand, with the ball's last stretch."""
    cloud = np.zeros((1, 3))
    for log in logs:
        rows = _shown(log)
        arms = [skeleton(arm.model, log.truth.q[k]) for k in rows[::_ARM_EACH]]
        cloud = np.concatenate([cloud, log.truth.position[rows], *arms])
    low, high = cloud.min(axis=0), cloud.max(axis=0)
    near = high[0] + _AHEAD
    for log in logs:
        balls = log.truth.r_o[_shown(log)]
        balls = balls[balls[:, 0] < near]
        if len(balls):
            low, high = np.minimum(low, balls.min(axis=0)), np.maximum(high, balls.max(axis=0))
    return low - _ROOM, high + _ROOM


def _draw_view(axes: Axes, arm: Arm, log: TrialLog, view: list[int]) -> None:
    """Draw one projection onto two of the three axes."""
    trace, rows = log.truth, _shown(log)
    for count, k in enumerate(rows[::_ARM_EACH]):
        line = skeleton(arm.model, trace.q[k])[:, view]
        axes.plot(
            *line.T, "-o", color=INK, alpha=0.22 + 0.68 * count * _ARM_EACH / len(rows), lw=1.2,
            markersize=2.6, markeredgewidth=0, zorder=2, solid_joinstyle="round",
            label="arm, each 50 ms" if count == 1 else None,
        )  # fmt: skip
    dots(axes, trace.r_o[rows][:, view], colour=BALL, size=2.4, label="ball, each 1 ms")
    dots(axes, trace.position[rows][:, view], colour=LEARNED, size=2.4,
         label="catch point, each 1 ms")  # fmt: skip
    if np.isfinite(log.t_catch):
        at = trace.r_o[int(np.argmin(np.abs(trace.t - log.t_catch)))][view]
        axes.plot(*at, "o", mfc="none", mec=BALL, mew=1.4, ms=12, zorder=6, label="catch")
    axes.plot(0.0, 0.0, "s", color=GREY, markersize=6, zorder=5)
    axes.set_aspect("equal")
