"""The way of the hand for coefficients drawn at random: it ends at the ball whatever alpha is."""

import numpy as np
from drawing import ball_at, save
from matplotlib.figure import Figure

import mitt
from mitt.core.signals import Array
from mitt.lab.report.style import BALL, BLUE, INK, PALE

ARM = mitt.load_arm("wam", limits="paper")
LEARNED = mitt.learn(ARM).map
TIMES = -np.geomspace(0.3, 1e-3, 50)
Q_C = np.array([0.1, 0.75, np.pi / 2])
DR_C = np.array([-5.2, 0.3, -1.6])
R_C = ARM.position(Q_C)


def motion(f: mitt.DirectMap) -> tuple[Array, Array]:
    """Return where the hand is [m], shape (k, 3), and its distance from the ball [mm], (k,)."""
    balls = [ball_at(R_C, DR_C, float(t)) for t in TIMES]
    hand = np.array([ARM.position(f.reference(ball).q_d) for ball in balls])
    return hand, 1e3 * np.linalg.norm(hand - np.array([ball.r_o for ball in balls]), axis=1)


def draw(figure: Figure) -> None:
    """Draw the hand's ways from the side, and their distances from the ball."""
    left, right = figure.subplots(1, 2)
    rng, shape = np.random.default_rng(0), LEARNED.alpha.shape
    for k in range(41):
        last = k == 40
        alpha = LEARNED.alpha if last else 1.5 * rng.standard_normal(shape)
        how = {"color": BLUE if last else PALE, "linewidth": 2.0 if last else 0.8}
        hand, apart = motion(LEARNED.with_alpha(alpha))
        left.plot(hand[:, 0], hand[:, 2], **how)
        right.loglog(-1e3 * TIMES, apart, **how)
    path = np.array([ball_at(R_C, DR_C, float(t)).r_o for t in TIMES])
    left.plot(path[:, 0], path[:, 2], color=BALL, linewidth=2.0)
    left.plot(*R_C[[0, 2]], "o", color=BALL, markersize=8)
    left.set(xlabel="x [m]", ylabel="z [m]", xlim=(-0.1, 1.6), ylim=(-0.2, 1.0), aspect="equal")
    right.set(xlabel="time to the catch [ms]", ylabel="distance of hand and ball [mm]")
    right.invert_xaxis()
    for axis in (right.xaxis, right.yaxis):
        axis.set_major_formatter("{x:g}")
    for colour, name in ((PALE, "40 random alpha"), (BLUE, "learned alpha"), (BALL, "ball")):
        right.plot([], [], color=colour, label=name)
    right.legend(loc="lower left", labelcolor=INK)


save("any_alpha", (9.0, 3.7), draw)
