"""The ball as the hand sees it, for three ways to meet it: matching, kappa, inward."""

import numpy as np
from drawing import ball_at, save
from matplotlib.figure import Figure

import mitt
from mitt.lab.report.style import BALL, BLUE, GREEN, GREY, INK

ARM = mitt.load_arm("wam", limits="wam-48v")
TIMES = np.linspace(-0.12, 0.0, 61)
#: Ways to meet the ball: design, colour, name.
WAYS = (
    (mitt.MapDesign(), INK, "kappa = 1, inward = 0 (the paper)"),
    (mitt.MapDesign(kappa=3.0), GREEN, "kappa = 3"),
    (mitt.MapDesign(q_catch=0.6, inward=3.0), BLUE, "inward = 3 (chosen for 48 V)"),
)


def draw(figure: Figure) -> None:
    """Draw the ball's path in the frame of the hand, and the speed that joint 4 needs."""
    left, right = figure.subplots(1, 2)
    for design, colour, name in WAYS:
        f = mitt.learn(ARM, design=design).map
        q_c = np.array([0.0, 0.75, design.q_catch])
        r_c, dr_c = ARM.position(q_c), np.array([-5.0, 0.0, -1.2])
        f = f.adapt(ball_at(r_c, dr_c, -0.4), ARM.q_ready, np.zeros(3))
        seen, speed = [], []
        for t in TIMES:
            ball = ball_at(r_c, dr_c, float(t))
            x = f.reference(ball)
            seen.append(ARM.orientation(x.q_d).T @ (ball.r_o - ARM.position(x.q_d)))
            speed.append(abs(x.dq_d[2]))
        way = 1e3 * np.array(seen)
        left.plot(way[:, 0], way[:, 2], color=colour, label=name)
        left.plot(way[::10, 0], way[::10, 2], ".", color=colour)
        right.plot(1e3 * TIMES, speed, color=colour)
    left.plot([-45, 45], [-40, -40], color=GREY, linewidth=5.0, solid_capstyle="butt")
    left.annotate("palm", (50, -40), color=GREY, va="center")
    left.plot(0, 0, "o", color=BALL, markersize=9, zorder=4)
    left.set(
        xlabel="along the palm [mm]",
        ylabel="along the palm's normal [mm]",
        xlim=(-260, 260),
        ylim=(-70, 300),
    )
    right.axhline(ARM.dq_max[2], color=GREY, linewidth=1.0, linestyle="--")
    right.annotate(
        "dashed: limit of a 48 V motor", (-70, 5.75), (0, 0), color=GREY, textcoords="offset points"
    )
    right.set(xlabel="time before the catch [ms]", ylabel="speed of joint 4 [rad/s]")
    figure.legend(*left.get_legend_handles_labels(), loc="outside lower center", ncols=3)


save("approach", (9.0, 3.9), draw)
