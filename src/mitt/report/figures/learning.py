"""Fig. 7, the cost over the steps of learning, and the share of feedback in the torque."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator, PercentFormatter

from mitt.generator.learn import Step
from mitt.report.figures.style import ALPHA_0, BLUE, GREY, INK, ORANGE, Plot, plot
from mitt.trials.log import TrialLog


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
                f"{values[-1]:.3f}", (len(values) - 1, values[-1]), (0, 8),
                textcoords="offset points", ha="center", color=INK,
            )  # fmt: skip
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
    axes.annotate(ALPHA_0, (0, values[0]), (0, 8), textcoords="offset points", color=GREY,
                  ha="center")  # fmt: skip
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


def feedback_by_step(shares: Sequence[float], *, given: bool = False) -> Plot:
    """Draw the share of feedback for alpha after each step of learning, alpha = 0 first.

    Args:
        shares: Shares of feedback.
        given: Whether the second and last is that of a map which was learned before.
    """

    def draw(figure: Figure) -> None:
        axes = figure.subplots()
        _draw_steps(axes, shares, BLUE)
        if given:
            axes.set(xlabel="", xticks=(0, 1), xticklabels=("", "the map given"))
        axes.set(ylabel="feedback in the torque (rms)", ylim=(0.0, 1.2 * max(*shares, 0.05)))
        axes.yaxis.set_major_formatter(PercentFormatter(1.0))

    return plot("feedback", (10.0, 2.8), draw)
