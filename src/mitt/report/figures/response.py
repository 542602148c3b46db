"""Figs. 9 to 11: target and hand, joint angles and torques over time."""

from collections.abc import Callable, Sequence

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
    legend_above,
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
    wanted = np.array([arm.position(q) for q in log.desired[log.following, 0]]).reshape(-1, 3)

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
        legend_above(figure, grid[0, 0], handlelength=2.2)
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
    low, high = _ends([truth.r_o[inside, axis], truth.position[inside, axis]])
    room = 0.08 * max(high - low, 0.05)
    axes.set_ylim(low - room, high + room)


def joint_angles(arm: Arm, learned: TrialLog, plain: TrialLog | None) -> Plot:
    """Draw the joint angles, learned dotted and alpha = 0 solid, with their ranges: fig. 10."""

    def draw_joint(axes: Axes, j: int) -> None:
        axes.axhspan(arm.q_min[j], arm.q_max[j], color=BAND, zorder=0, label="range")
        shown = [arm.q_ready[j : j + 1], learned.encoders[:, 0, j]]
        if plain is not None:
            desired, q = plain.desired[plain.following, 0, j], plain.encoders[:, 0, j]
            _solid(axes, plain, (desired, f"{ALPHA_0}, asked for"), (q, f"{ALPHA_0}, arm", 1.6))
            shown += [desired, q]
        _dotted(axes, learned.t, learned.encoders[:, 0, j], "learned, arm")
        low, high = _ends(shown)
        room = 0.1 * max(high - low, 0.2)
        axes.set(ylabel=f"{arm.names[j]} [rad]", ylim=(low - room, high + room))

    return _by_joint("fig10", arm, learned, draw_joint)


def joint_torques(arm: Arm, learned: TrialLog, plain: TrialLog | None) -> Plot:
    """Draw the torques commanded, learned dotted and alpha = 0 solid, with limits: fig. 11."""
    wanted = _asked_torque(arm, learned)
    plainly = None if plain is None else _asked_torque(arm, plain)

    def draw_joint(axes: Axes, j: int) -> None:
        bound = float(arm.tau_max[j])
        axes.axhspan(-bound, bound, color=BAND, zorder=0, label="within the limit")
        shown = [np.zeros(1), learned.tau[:, j], wanted[:, j]]
        if plain is not None and plainly is not None:
            _solid(axes, plain, (plainly[:, j], f"{ALPHA_0}, asked for, eq. (16)"),
                   (plain.tau[:, j], f"{ALPHA_0}, commanded", 1.2))  # fmt: skip
            shown += [plain.tau[:, j], plainly[:, j]]
        _dotted(axes, learned.t, learned.tau[:, j], "learned, commanded")
        most = min(max(map(abs, _ends(shown))) * 1.15, _ABOVE * bound)
        axes.set(ylabel=f"{arm.names[j]} [N m]", ylim=(-most, most))

    return _by_joint("fig11", arm, learned, draw_joint)


def _by_joint(name: str, arm: Arm, log: TrialLog, draw_joint: Callable[[Axes, int], None]) -> Plot:
    """Draw a panel a joint, one above the other, with their common time and one legend."""

    def draw(figure: Figure) -> None:
        rows = figure.subplots(arm.n, 1, sharex=True, squeeze=False)[:, 0]
        for j, axes in enumerate(rows):
            draw_joint(axes, j)
            _marks(axes, log, named=j == 0)
        rows[-1].set_xlabel("time from release [s]")
        rows[-1].set_xlim(0.0, _end(log))
        legend_above(figure, rows[0], handlelength=2.2)

    return plot(name, (11.0, 2.1 * arm.n + 0.6), draw)


def _asked_torque(arm: Arm, log: TrialLog) -> Array:
    """Return the torque of the motion asked for, eq. (16), shape (k, n)."""
    rows = [arm.inverse_dynamics(*motion) for motion in log.desired[log.following]]
    return np.array(rows).reshape(-1, arm.n)


def _solid(
    axes: Axes, log: TrialLog, desired: tuple[Array, str], done: tuple[Array, str, float]
) -> None:
    """Draw the curves of alpha = 0: what it asks for while it follows, and what came of it."""
    axes.plot(log.t[log.following], desired[0], color=ORANGE, lw=1.1, label=desired[1])
    axes.plot(log.t, done[0], color=PLAIN, label=done[1], lw=done[2])


def _dotted(axes: Axes, t: Array, values: Array, label: str) -> None:
    """Draw a curve of the learned map: dotted, as the paper draws it."""
    axes.plot(t, values, linestyle=(0, (1.2, 1.1)), color=LEARNED, lw=2.4, label=label, zorder=4)


def _ends(shown: Sequence[Array]) -> tuple[float, float]:
    """Return the least and the greatest of all values that are finite: a reading may be lost."""
    values = np.concatenate(shown)
    values = values[np.isfinite(values)]
    return (float(values.min()), float(values.max())) if len(values) else (0.0, 0.0)


def _marks(axes: Axes, log: TrialLog, *, named: bool) -> None:
    """Mark the start of the arm and the catch."""
    for t, text in ((log.t_0, "start"), (log.t_catch, "catch")):
        if np.isfinite(t) and axes.get_xlim()[0] <= t <= axes.get_xlim()[1]:
            mark_time(axes, t, text, named=named)


def _end(log: TrialLog) -> float:
    """Return until when to draw [s]."""
    return min(log.t_catch + _AFTER, float(log.t[-1]))
