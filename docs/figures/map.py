"""The map from the side: a ball, its virtual joints, the arm; and the joints over time."""

import numpy as np
from drawing import ball_at, draw_arm, save
from matplotlib.figure import Figure

import mitt
from mitt.core.signals import Array
from mitt.lab.report.style import BALL, BLUE, GREY, INK, PALE

ARM = mitt.load_arm("wam", limits="paper")
LEARNED = mitt.learn(ARM).map
#: The catch: pose [rad], velocity of the ball [m/s]; when the arm starts [s]; instants drawn [s].
Q_C = np.array([0.0, 0.75, np.pi / 2])
DR_C = np.array([-5.2, 0.0, -1.6])
START = -0.42
SHOWN = (-0.30, -0.15, 0.0)
R_C = ARM.position(Q_C)
F = LEARNED.adapt(ball_at(R_C, DR_C, START), ARM.q_ready, np.zeros(3))


def tangent_foot(q_o: Array) -> Array:
    """Return the pose whose catch joint is at q_alpha, from which the tangent leaves [rad]."""
    foot = q_o.copy()
    foot[F.design.catch_joint] = F.design.q_catch
    return foot


def draw(figure: Figure) -> None:
    """Draw three instants from the side, then q_o and q_d of the two joints that move."""
    instants = figure.add_gridspec(2, 3, height_ratios=(1.15, 1.0))
    path = np.array([ball_at(R_C, DR_C, t).r_o for t in np.linspace(START, 0.0, 60)])
    for column, t in enumerate(SHOWN):
        axes = figure.add_subplot(instants[0, column])
        ball = ball_at(R_C, DR_C, t)
        reference = F.reference(ball)
        foot = tangent_foot(reference.q_o)
        axes.plot(path[:, 0], path[:, 2], color=BALL, linewidth=0.8, alpha=0.5, zorder=0)
        draw_arm(axes, ARM, foot, color=PALE, linewidth=6.0, zorder=1)
        start = ARM.position(foot)
        axes.plot([start[0], ball.r_o[0]], [start[2], ball.r_o[2]], "--", color=BALL, zorder=2)
        draw_arm(axes, ARM, reference.q_d, color=BLUE, zorder=3)
        axes.plot(ball.r_o[0], ball.r_o[2], "o", color=BALL, markersize=9, zorder=4)
        axes.set(xlim=(-0.25, 2.6), ylim=(-0.75, 0.95), aspect="equal", xlabel="x [m]")
        if not column:
            axes.text(0.72, -0.62, "virtual arm", color=GREY)
            axes.text(0.02, 0.68, "arm", color=BLUE)
        axes.set_title(f"{-1e3 * t:.0f} ms before the catch" if t else "at the catch")
        if column == 0:
            axes.set_ylabel("z [m]")
    axes = figure.add_subplot(instants[1, :])
    times = np.linspace(START, 0.0, 200)
    rows = [F.reference(ball_at(R_C, DR_C, t)) for t in times]
    for joint, colour, name in ((1, INK, "joint 2"), (2, BLUE, "joint 4")):
        axes.plot(1e3 * times, [x.q_o[joint] for x in rows], "--", color=colour, linewidth=1.2)
        axes.plot(1e3 * times, [x.q_d[joint] for x in rows], color=colour, label=name)
    axes.plot([], [], "--", color=GREY, label="dashed: virtual joints q_o")
    axes.set(xlabel="time before the catch [ms]", ylabel="angle [rad]", ylim=(-4.0, 2.2))
    axes.legend(ncols=3, loc="lower right")


save("map", (9.0, 5.2), draw)
