"""Figs. 9 to 11: target and hand, joint angles and torques over time."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from mitt.report.figures.style import (
    ALPHA_0,
    BALL,
    BAND,
    INK,
    LEARNED,
    ORANGE,
    PLAIN,
    Plot,
    mark_time,
    plot,
)
from mitt.robot.arm import Arm
from mitt.signals import Array
from mitt.trials.log import TrialLog

#: How long after the catch is shown [s], and half the width of the close-up [s].
_AFTER, _CLOSE = 0.20, 0.05
#: Torques are shown up to this multiple of their limit.
_ABOVE = 1.6


def target_and_hand(arm: Arm, log: TrialLog) -> Plot:
    """Draw the ball and the catch point over time, whole and around the catch: fig. 9."""
    wanted = np.array([arm.position(q) for q in log.asked[log.following, 0]]).reshape(-1, 3)

    def draw(figure: Figure) -> None:
        grid = figure.subplots(3, 2, sharex="col", width_ratios=(1.5, 1.0))
        for axis, row in enumerate(grid):
            for axes in row:
                _draw_axis(axes, log, wanted, axis)
            row[0].set_ylabel(f"{'xyz'[axis]} [m]")
            row[0].set_xlim(0.0, _end(log))
            _fit(row[0], log, axis, (0.0, _end(log)))
            if np.isfinite(log.t_catch):
                around = (log.t_catch - _CLOSE, log.t_catch + _CLOSE)
                row[1].set_xlim(*around)
                _fit(row[1], log, axis, around)
        grid[0, 0].set_title("Whole flight")
        grid[0, 1].set_title("Around the catch")
        _legend_above(figure, grid[0, 0])
        for axes in grid[2]:
            axes.set_xlabel("time from release [s]")
        for k, axes in enumerate(grid.flat):
            _marks(axes, log, named=k < 2)

    return plot("fig9", (11.0, 6.6), draw)


def _draw_axis(axes: Axes, log: TrialLog, wanted: Array, axis: int) -> None:
    """Draw one coordinate of ball and hand, true, estimated and wanted."""
    truth = log.truth
    axes.plot(truth.t, truth.r_o[:, axis], color="#f2b48c", linewidth=4.0, label="ball, true")
    seen = log.tracked & (log.phase < 2)
    axes.plot(log.t[seen], log.ball[seen, 0, axis], color=BALL, lw=1.2, label="ball, estimated")
    axes.plot(truth.t, truth.position[:, axis], color=LEARNED, label="catch point, true")
    axes.plot(
        log.t[log.following], wanted[:, axis], ":", color=INK, lw=1.8, label="catch point, wanted"
    )


def _fit(axes: Axes, log: TrialLog, axis: int, window: tuple[float, float]) -> None:
    """Set the height to what ball and hand do in a window of time."""
    truth = log.truth
    inside = (truth.t >= window[0]) & (truth.t <= window[1])
    values = np.concatenate([truth.r_o[inside, axis], truth.position[inside, axis]])
    low, high = float(values.min()), float(values.max())
    room = 0.08 * max(high - low, 0.05)
    axes.set_ylim(low - room, high + room)


def joint_angles(arm: Arm, learned: TrialLog, plain: TrialLog | None) -> Plot:
    """Draw the joint angles, learned dotted and alpha = 0 solid, with their ranges: fig. 10."""

    def draw(figure: Figure) -> None:
        rows = figure.subplots(arm.n, 1, sharex=True, squeeze=False)[:, 0]
        for j, axes in enumerate(rows):
            axes.axhspan(arm.q_min[j], arm.q_max[j], color=BAND, zorder=0, label="range")
            shown = [arm.q_ready[j], arm.q_ready[j]]
            if plain is not None:
                f = plain.following
                axes.plot(plain.t[f], plain.asked[f, 0, j], color=ORANGE, lw=1.1,
                          label=f"{ALPHA_0}, asked for")  # fmt: skip
                axes.plot(plain.t, plain.encoders[:, 0, j], color=PLAIN, label=f"{ALPHA_0}, arm")
                shown += [*_ends(plain.asked[f, 0, j]), *_ends(plain.encoders[:, 0, j])]
            _dotted(axes, learned.t, learned.encoders[:, 0, j], "learned, arm")
            shown += _ends(learned.encoders[:, 0, j])
            axes.set(ylabel=f"{arm.names[j]} [rad]")
            _limit_height(axes, shown)
            _marks(axes, learned, named=j == 0)
        _finish_rows(figure, rows, learned)

    return plot("fig10", (11.0, 2.1 * arm.n + 0.6), draw)


def joint_torques(arm: Arm, learned: TrialLog, plain: TrialLog | None) -> Plot:
    """Draw the torques commanded, learned dotted and alpha = 0 solid, with limits: fig. 11."""

    def draw(figure: Figure) -> None:
        rows = figure.subplots(arm.n, 1, sharex=True, squeeze=False)[:, 0]
        wanted = {id(log): _asked_torque(arm, log) for log in (learned, plain) if log is not None}
        for j, axes in enumerate(rows):
            bound = float(arm.tau_max[j])
            axes.axhspan(-bound, bound, color=BAND, zorder=0, label="within the limit")
            shown = [0.0]
            if plain is not None:
                asked = wanted[id(plain)]
                axes.plot(plain.t[plain.following], asked[:, j], color=ORANGE, lw=1.1,
                          label=f"{ALPHA_0}, asked for, eq. (16)")  # fmt: skip
                axes.plot(
                    plain.t, plain.tau[:, j], color=PLAIN, lw=1.2, label=f"{ALPHA_0}, commanded"
                )
                shown += [*_ends(plain.tau[:, j]), *_ends(asked[:, j])]
            _dotted(axes, learned.t, learned.tau[:, j], "learned, commanded")
            shown += [*_ends(learned.tau[:, j]), *_ends(wanted[id(learned)][:, j])]
            most = min(max(abs(x) for x in shown) * 1.15, _ABOVE * bound)
            axes.set(ylabel=f"{arm.names[j]} [N m]", ylim=(-most, most))
            _marks(axes, learned, named=j == 0)
        _finish_rows(figure, rows, learned)

    return plot("fig11", (11.0, 2.1 * arm.n + 0.6), draw)


def _asked_torque(arm: Arm, log: TrialLog) -> Array:
    """Return the torque of the motion asked for, eq. (16), shape (k, n)."""
    rows = [arm.inverse_dynamics(*motion) for motion in log.asked[log.following]]
    return np.array(rows).reshape(-1, arm.n)


def _dotted(axes: Axes, t: Array, values: Array, label: str) -> None:
    """Draw a curve of the learned map: dotted, as the paper draws it."""
    axes.plot(t, values, linestyle=(0, (1.2, 1.1)), color=LEARNED, lw=2.4, label=label, zorder=4)


def _ends(values: Array) -> list[float]:
    """Return the least and the greatest value, nothing where there is none."""
    return [float(values.min()), float(values.max())] if len(values) else []


def _limit_height(axes: Axes, shown: list[float]) -> None:
    """Set the height so that all curves show."""
    low, high = min(shown), max(shown)
    room = 0.1 * max(high - low, 0.2)
    axes.set_ylim(low - room, high + room)


def _finish_rows(figure: Figure, rows: Array, log: TrialLog) -> None:
    """Give stacked axes their common time and one legend above them."""
    rows[-1].set_xlabel("time from release [s]")
    rows[-1].set_xlim(0.0, _end(log))
    _legend_above(figure, rows[0])


def _legend_above(figure: Figure, axes: Axes) -> None:
    """Put one legend for all axes above them."""
    handles, labels = axes.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper left", ncols=len(labels), handlelength=2.2)


def _marks(axes: Axes, log: TrialLog, *, named: bool) -> None:
    """Mark the start of the arm and the catch."""
    for t, text in ((log.t_0, "start"), (log.t_catch, "catch")):
        if np.isfinite(t) and axes.get_xlim()[0] <= t <= axes.get_xlim()[1]:
            mark_time(axes, t, text, top=named)


def _end(log: TrialLog) -> float:
    """Return until when to draw [s]."""
    return min(log.t_catch + _AFTER, float(log.t[-1]))
