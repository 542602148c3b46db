"""Figures of a run, by the paper's numbers.

Fig. 7, cost over the steps of learning; fig. 8, the catching trajectory; figs. 9 to 11, target and
hand, joint angles and torques over time; and all throws: errors at first contact, releases.
"""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from mitt.core.arm.arm import Arm
from mitt.core.errors import ShapeError
from mitt.core.map.learn import Step
from mitt.core.signals import Array
from mitt.lab.report.scene_meshes import skeleton
from mitt.lab.report.style import (
    ALPHA_0,
    BALL,
    BAND,
    BLUE,
    GREY,
    INK,
    LEARNED,
    ORANGE,
    PLAIN,
    STATUS,
    Plot,
    dots,
    legend_above,
    mark_time,
    plot,
)
from mitt.lab.trials.log import TrialLog


def learning_cost(steps: Sequence[Step]) -> Plot:
    """Draw the mean cost of torque and of speed, eq. (22), over the steps: fig. 7."""

    def draw(figure: Figure) -> None:
        left, right = figure.subplots(1, 2)
        for axes, values, colour, title in (
            (left, [s.cost_torque for s in steps], BLUE, "Torque, τᵀKτ τ"),
            (right, [s.cost_speed for s in steps], ORANGE, "Speed, ωᵀKω ω"),
        ):
            _draw_steps(axes, values, colour)
            axes.annotate(
                f"{values[-1]:.3f}",
                (len(values) - 1, values[-1]),
                (0, 8),
                textcoords="offset points",
                ha="center",
                color=INK,
            )
            axes.set(title=title, ylabel="mean cost per instant [1]")
            axes.set_ylim(0.0, 1.18 * max(values))
            axes.set_xlim(-0.5, len(values) - 0.5)

    return plot("fig7", (10.0, 3.2), draw)


def _draw_steps(axes: Axes, values: Sequence[float], colour: str) -> None:
    """Draw a figure over the steps; name the first point, which has not learned anything."""
    k = np.arange(len(values))
    axes.plot(k, values, "-", color=colour, zorder=3)
    axes.plot(k[1:], values[1:], "o", color=colour, markersize=5, zorder=4)
    axes.plot(0, values[0], "o", color=colour, mfc="white", mew=1.6, ms=7, zorder=4)
    axes.annotate(
        ALPHA_0, (0, values[0]), (0, 8), textcoords="offset points", color=GREY, ha="center"
    )
    axes.set(xlabel="learning step")
    axes.xaxis.set_major_locator(MaxNLocator(integer=True))


def feedback_share(log: TrialLog) -> float:
    """Return the share of feedback in the torque while the ball is followed.

    The root mean square of tau less the feedforward over that of tau, each joint's torque
    summed in squares; 0 where nothing was followed. The paper (section 3.6) says that the
    controller's load falls as the generator nears its optimum.
    """
    tau, feedforward = log.tau[log.following], log.feedforward[log.following]
    total = np.linalg.norm(tau)
    return float(np.linalg.norm(tau - feedforward) / total) if total > 0.0 else 0.0


#: A line of the arm each so many ticks.
_ARM_EACH = 50


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
    """Return the rows of the truth that are drawn: until 0.1 s after the catch."""
    end = min(log.t_catch + 0.1, float(log.truth.t[-1]))
    return np.flatnonzero(log.truth.t <= end + 1e-9)


def _extent(arm: Arm, logs: list[TrialLog]) -> tuple[Array, Array]:
    """Return the corners of a box [m] around arm and hand, with the ball's last 0.9 m."""
    cloud = np.zeros((1, 3))
    for log in logs:
        rows = _shown(log)
        arms = [skeleton(arm.model, log.truth.q[k]) for k in rows[::_ARM_EACH]]
        cloud = np.concatenate([cloud, log.truth.position[rows], *arms])
    low, high = cloud.min(axis=0), cloud.max(axis=0)
    near = high[0] + 0.9
    for log in logs:
        balls = log.truth.r_o[_shown(log)]
        balls = balls[balls[:, 0] < near]
        if len(balls):
            low, high = np.minimum(low, balls.min(axis=0)), np.maximum(high, balls.max(axis=0))
    return low - 0.12, high + 0.12


def _draw_view(axes: Axes, arm: Arm, log: TrialLog, view: list[int]) -> None:
    """Draw one projection onto two of the three axes."""
    trace, rows = log.truth, _shown(log)
    for count, k in enumerate(rows[::_ARM_EACH]):
        line = skeleton(arm.model, trace.q[k])[:, view]
        axes.plot(
            *line.T,
            "-o",
            color=INK,
            alpha=0.22 + 0.68 * count * _ARM_EACH / len(rows),
            lw=1.2,
            markersize=2.6,
            markeredgewidth=0,
            zorder=2,
            solid_joinstyle="round",
            label="arm, each 50 ms" if count == 1 else None,
        )
    dots(axes, trace.r_o[rows][:, view], colour=BALL, size=2.4, label="ball, each 1 ms")
    dots(
        axes,
        trace.position[rows][:, view],
        colour=LEARNED,
        size=2.4,
        label="catch point, each 1 ms",
    )
    if np.isfinite(log.t_catch):
        at = trace.r_o[int(np.argmin(np.abs(trace.t - log.t_catch)))][view]
        axes.plot(*at, "o", mfc="none", mec=BALL, mew=1.4, ms=12, zorder=6, label="catch")
    axes.plot(0.0, 0.0, "s", color=GREY, markersize=6, zorder=5)
    axes.set_aspect("equal")


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
                around = (log.t_catch - 0.05, log.t_catch + 0.05)
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
    """Draw one coordinate of ball and hand, true, estimated and commanded."""
    truth = log.truth
    axes.plot(truth.t, truth.r_o[:, axis], color="#f2b48c", linewidth=4.0, label="ball, true")
    seen = log.tracked & (log.phase < 2)
    axes.plot(log.t[seen], log.ball[seen, 0, axis], color=BALL, lw=1.2, label="ball, estimated")
    axes.plot(truth.t, truth.position[:, axis], color=LEARNED, label="catch point, true")
    axes.plot(
        log.t[log.following],
        wanted[:, axis],
        ":",
        color=INK,
        lw=1.8,
        label="catch point, commanded",
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
            _solid(axes, plain, (desired, f"{ALPHA_0}, commanded"), (q, f"{ALPHA_0}, arm", 1.6))
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
            _solid(
                axes,
                plain,
                (plainly[:, j], f"{ALPHA_0}, feedforward, eq. (16)"),
                (plain.tau[:, j], f"{ALPHA_0}, commanded", 1.2),
            )
            shown += [plain.tau[:, j], plainly[:, j]]
        _dotted(axes, learned.t, learned.tau[:, j], "learned, commanded")
        most = min(max(map(abs, _ends(shown))) * 1.15, 1.6 * bound)  # beyond that no more is shown
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
    """Return until when to draw [s]: 0.2 s after the catch."""
    return min(log.t_catch + 0.2, float(log.t[-1]))


#: Points of one kind that are drawn at most, marks of one kind below a histogram, and throws below
#: which each is drawn, without bars.
_MOST = 2000
_MARKS = 300
_FEW = 40
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
            axes.set(xlabel=title)
        legend_above(figure, figure.axes[0])

    return plot("errors", (11.0, 3.4), draw)


def _draw_errors(axes: Axes, trials: Sequence[dict[str, Any]], key: str) -> None:
    """Draw the values of a field, coloured by status, with their median and 95th percentile."""
    groups = {
        s: [(t[key], t["index"]) for t in trials if t["status"] == s and t[key] is not None]
        for s in STATUS
    }
    groups = {status: rows for status, rows in groups.items() if rows}
    every = np.array([x for rows in groups.values() for x, _ in rows])
    if not len(every):
        axes.text(
            0.5, 0.5, "no ball was touched", transform=axes.transAxes, ha="center", color=GREY
        )
        return
    most = 1.05 * max(float(every.max()), 1e-6)
    (_draw_each if len(every) < _FEW else _draw_bars)(axes, groups, most)
    for share, name, height in ((50.0, "median", 1.0), (95.0, "95 % below", 0.92)):
        at = float(np.percentile(every, share))
        axes.axvline(at, color=INK, linewidth=1.0, linestyle=(0, (4, 2)))
        axes.annotate(
            f"{name} {at:.2g}",
            (at, height),
            (3, 0),
            xycoords=("data", "axes fraction"),
            textcoords="offset points",
            va="top",
            fontsize=8.5,
            color=INK,
        )
    axes.set_xlim(0.0, most)


def _draw_each(axes: Axes, groups: Mapping[str, list[tuple[float, int]]], most: float) -> None:
    """Draw a mark a throw, from the first above to the last below."""
    for status, rows in groups.items():
        values, indices = zip(*rows, strict=True)
        colour, mark = STATUS[status]
        axes.hlines(indices, 0.0, values, color=BAND, linewidth=3.0)
        axes.plot(values, indices, mark, color=colour, ms=7, mec="white", mew=0.7, label=status)
    last = max(index for rows in groups.values() for _, index in rows)
    axes.set(ylabel="throw", ylim=(last + 0.7, -0.2 * last - 1.2), xlim=(0.0, most))
    axes.yaxis.set_major_locator(MaxNLocator(nbins=6, integer=True))
    axes.set_yticks([y for y in axes.get_yticks() if 0.0 <= y <= last])


def _draw_bars(axes: Axes, groups: Mapping[str, list[tuple[float, int]]], most: float) -> None:
    """Draw a histogram, stacked by status, with a mark a throw below it."""
    values = [[x for x, _ in rows] for rows in groups.values()]
    colours = [STATUS[status][0] for status in groups]
    axes.hist(
        values,
        np.linspace(0.0, most, 25).tolist(),
        stacked=True,
        color=colours,
        label=list(groups),
        edgecolor="white",
        linewidth=0.6,
    )
    top = axes.get_ylim()[1]
    for of, colour in zip(values, colours, strict=True):
        marks = np.array(of[:_MARKS])
        axes.plot(marks, np.full(len(marks), -0.05 * top), "|", color=colour, ms=7, mew=1.0)
    if max(map(len, values)) > _MARKS:
        axes.annotate(
            f"marks: the first {_MARKS} of each",
            (0.99, 0.86),
            xycoords="axes fraction",
            ha="right",
            va="top",
            fontsize=8.5,
            color=INK,
        )
    axes.set(ylabel="throws", ylim=(-0.1 * top, 1.25 * top))
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
    low, high = cloud.min(axis=0) - 0.15, cloud.max(axis=0) + 0.15
    x, y, z = high - low

    def draw(figure: Figure) -> None:
        side, top = figure.subplots(1, 2)
        for axes, row, name, seen in ((side, 2, "z", "the side"), (top, 1, "y", "above")):
            _draw_releases(axes, trials, points, row)
            axes.plot(0.0, 0.0, "s", color=GREY, ms=7, label="shoulder")
            axes.plot(
                *marks[1:, [0, row]].T,
                "+",
                color=INK,
                ms=11,
                mew=1.6,
                label="catch of the throw shown",
            )
            axes.set_title(f"From {seen}")
            axes.set(ylabel=f"{name} [m]", xlim=(low[0], high[0]), ylim=(low[row], high[row]))
            axes.set(aspect="equal", xlabel="x [m], towards the thrower")
        legend_above(figure, side)

    return plot("releases", (11.0, 5.0 * max(y, z) / x + 1.2), draw)


def _draw_releases(axes: Axes, trials: Sequence[dict[str, Any]], points: Array, row: int) -> None:
    """Draw the releases in one projection, those that failed in front."""
    for order, (status, (colour, mark)) in enumerate(STATUS.items()):
        of = [k for k, trial in enumerate(trials) if trial["status"] == status]
        if of:
            shown = f", the first {_MOST} shown" if len(of) > _MOST else ""
            axes.plot(
                points[of[:_MOST], 0],
                points[of[:_MOST], row],
                mark,
                color=colour,
                ms=5.5,
                mec="white",
                mew=0.5,
                label=f"{status} ({len(of)}{shown})",
                zorder=3 + order,
            )
