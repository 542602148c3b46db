"""What learning is for: torque and angles that one throw asks, with alpha = 0 and learned."""

import numpy as np
from drawing import ball_at, save
from matplotlib.figure import Figure

import mitt
from mitt.lab.report.style import BAND, BLUE, GREY, INK

ARM = mitt.load_arm("wam", limits="paper")
LEARNED = mitt.learn(ARM).map
TIMES = np.linspace(-0.42, 0.0, 211)
Q_C = np.array([0.1, 0.75, np.pi / 2])
DR_C = np.array([-5.2, 0.3, -1.6])
R_C = ARM.position(Q_C)


def asked(f: mitt.DirectMap) -> tuple[list[float], list[float]]:
    """Return the largest share of a torque limit and the angle of joint 4 [rad] over time."""
    torque, angle = [], []
    for t in TIMES:
        x = f.reference(ball_at(R_C, DR_C, float(t)))
        tau = ARM.inverse_dynamics(x.q_d, x.dq_d, x.ddq_d)
        torque.append(float(np.max(np.abs(tau) / ARM.tau_max)))
        angle.append(float(x.q_d[2]))
    return torque, angle


def draw(figure: Figure) -> None:
    """Draw both for alpha = 0 and for the learned map, adapted to this throw."""
    start = ball_at(R_C, DR_C, float(TIMES[0]))
    plain = LEARNED.with_alpha(np.zeros_like(LEARNED.alpha))
    adapted = LEARNED.adapt(start, ARM.q_ready, np.zeros(3))
    left, right = figure.subplots(1, 2)
    for f, colour, name in ((plain, INK, "alpha = 0"), (adapted, BLUE, "learned and adapted")):
        for axes, values in zip((left, right), asked(f), strict=True):
            axes.plot(1e3 * TIMES, values, color=colour, label=name)
    left.axhline(1.0, color=GREY, linewidth=1.0, linestyle="--")
    right.axhspan(ARM.q_min[2], ARM.q_max[2], color=BAND, zorder=0)
    right.plot(1e3 * TIMES[0], ARM.q_ready[2], "o", color=BLUE)
    right.annotate("range of joint 4", (-280, ARM.q_max[2] - 0.35), color=GREY)
    left.set(ylim=(0.0, 1.1), ylabel="largest torque, share of its limit")
    right.set(ylim=(-4.0, 3.4), ylabel="joint 4 [rad]")
    for axes in (left, right):
        axes.set(xlabel="time before the catch [ms]")
    left.legend(loc="upper left", bbox_to_anchor=(0.0, 0.9))


save("learning", (9.0, 3.4), draw)
