"""Which limit refuses which ball: verdicts before the arm moves, over mass and speed."""

import numpy as np
from drawing import ball_at, save
from matplotlib.figure import Figure

import mitt
from mitt.core.arm.catch import CaughtBall
from mitt.core.map.demand import Tolerance
from mitt.core.map.map_design import default_design
from mitt.core.verdict.feasibility import Outcome, judge
from mitt.core.verdict.impact import examined
from mitt.lab.report.style import BAND, BLUE, GREEN, GREY, INK, ORANGE, PURPLE, YELLOW
from mitt.lab.world.build import restitution_of
from mitt.lab.world.scene import read_scene

SPEEDS = np.linspace(3.0, 10.0, 15)
MASSES = np.geomspace(0.02, 2.0, 13)
COLOURS = {
    "torque": ORANGE,
    "speed": YELLOW,
    "range": GREY,
    "impact": BLUE,
    "brake": GREEN,
    "grip": INK,
    "force": PURPLE,
}
#: How the ball of the scene ``lab`` springs back from the palm.
RESTITUTION = restitution_of(read_scene("lab"))


def verdicts(limits: str) -> list[tuple[float, float, str, bool]]:
    """Return speed [m/s], mass [kg], the kind of limit that binds, and whether it refuses."""
    arm = mitt.load_arm("wam", limits=limits)
    design = default_design(arm)
    f, out = mitt.learn(arm, design=design).map, []
    r_c = arm.position(np.array([0.05, 0.75, design.q_catch]))
    for speed in SPEEDS:
        ball = ball_at(r_c, speed * np.array([-0.95, 0.03, -0.3]), -0.4)
        plain = judge(f, ball, arm.q_ready, tolerance=Tolerance())
        for mass in MASSES:
            caught = CaughtBall(mass=float(mass), radius=0.04, restitution=RESTITUTION)
            verdict = examined(arm, plain, caught, bandwidth=80.0)
            kind = verdict.binding_limit.split(":")[0]
            out.append((float(speed), float(mass), kind, verdict.outcome is not Outcome.FEASIBLE))
    return out


def draw(figure: Figure) -> None:
    """Draw a panel for each limit set; what is refused is filled."""
    columns, binds = figure.subplots(1, 2, sharey=True), set()
    for axes, limits in zip(columns, ("paper", "wam-48v"), strict=True):
        for speed, mass, kind, refused in verdicts(limits):
            axes.plot(speed, mass, "s", color=COLOURS[kind] if refused else BAND, markersize=10.5)
            binds |= {kind} if refused else set()
        axes.set(yscale="log", xlabel="speed at the catch [m/s]", title=limits)
        axes.grid(visible=False)
    columns[0].set_ylabel("mass of the ball [kg]")
    columns[0].set_yticks(
        [0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0], ["0.02", "0.05", "0.1", "0.2", "0.5", "1", "2"]
    )
    for kind, colour in {"accepted": BAND, **COLOURS}.items():
        if kind in binds | {"accepted"}:
            columns[0].plot([], [], "s", color=colour, label=kind)
    figure.legend(loc="outside lower center", ncols=8)


save("refusals", (9.0, 4.2), draw)
