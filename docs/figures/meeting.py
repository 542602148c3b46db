"""A target that changes its mind: the map follows it, a planner plans a new motion each time."""

from dataclasses import replace

import numpy as np
from drawing import save
from matplotlib.figure import Figure

import mitt
from mitt.core.arm.arm import Arm
from mitt.core.ball.filter import BallFilter
from mitt.core.catcher.generators import Generator
from mitt.core.catcher.meeting import Meeting, MeetingSettings
from mitt.core.map.meeting import unlearned_meeting
from mitt.core.signals import Array
from mitt.lab.report.style import BALL, BLUE, GREEN, GREY, INK
from mitt.lab.rivals.meeting import make_meeter
from mitt.lab.trials.station import CARRIED
from mitt.lab.world.targets import HandReach

RAW = mitt.load_arm("ur5e", hand="none")
ARM = Arm(replace(RAW.model, q_ready=np.array([0.2, -1.3, 1.8, -2.1, -1.5, 0.3])), RAW.limits)
PLACE = ARM.position(ARM.q_ready) + np.array([0.05, 0.0, -0.1])
#: A hand that comes to a place, and 0.25 s before the meeting turns to another, 13 cm aside.
REACH = HandReach(
    start=PLACE + np.array([0.0, 0.3, 0.2]),
    way=np.array([[0.0, -0.3, -0.2], [0.05, -0.06, 0.1]]),
    begin=np.array([0.0, 0.85]),
    duration=np.array([1.2, 0.5]),
    tremor=np.zeros((3, 3)),
)
#: Start of the arm, time to the meeting, time that the tool stays with the target [s].
START = 0.4
AFTER = 0.7
WINDOW = 0.3
#: A camera: its period, the age of what it tells [s], and its noise [m].
PERIOD = 1.0 / 60.0
OLD = 0.03
NOISE = 0.002
TIMES = np.arange(0.0, START + AFTER + WINDOW, 1e-3)
FIRST = round(START / 1e-3)
#: Of what is drawn, from 0.3 s before the meeting on.
DRAWN = slice(round((AFTER - 0.3) / 1e-3), None)


def estimates() -> list[mitt.BallState]:
    """Return the target as the filter knows it in each tick, from sightings that come late."""
    rng, known, out, shot = np.random.default_rng(1), BallFilter(CARRIED), [], 0.0
    for t in TIMES:
        if t >= shot + OLD:
            r_o = REACH.at(shot)[0] + NOISE * rng.standard_normal(3)
            covariance = NOISE**2 * np.eye(3)
            known.update(mitt.Sighting(t=shot, found=True, r_o=r_o, covariance=covariance))
            shot += PERIOD
        out.append(known.state(float(t)))
    return out[FIRST:]


def motion(generator: Generator, seen: list[mitt.BallState]) -> tuple[Array, Array]:
    """Return where the tool is [m], shape (k, 3), and the largest acceleration, (k,)."""
    generator = generator.adapt(seen[0], ARM.q_ready, np.zeros(ARM.n))
    found = [generator.reference(ball) for ball in seen]
    tool = np.array([ARM.position(x.q_d) for x in found])
    return tool, np.array([np.abs(x.ddq_d).max() for x in found])


def draw(figure: Figure) -> None:
    """Draw the ways of target and tool, their distance, and the acceleration that it takes."""
    settings = MeetingSettings(shortest=AFTER, longest=AFTER + 1e-6, settle=WINDOW)
    meeting = Meeting(unlearned_meeting(ARM, (0, 1, 2, 3, 4, 5)), settings)
    seen, times = estimates(), TIMES[FIRST:]
    truth = np.array([REACH.at(float(t))[0] for t in times])
    since = 1e3 * (times - START - AFTER)[DRAWN]
    left, middle, right = figure.subplots(1, 3)
    for generator, colour, name in (
        (make_meeter("quintic", meeting, rate=10.0), INK, "quintic, planned anew at 10 Hz"),
        (make_meeter("quintic", meeting, rate=100.0), GREEN, "the same at 100 Hz"),
        (meeting, BLUE, "map"),
    ):
        tool, most = motion(generator, seen)
        apart = 1e3 * np.linalg.norm(tool - truth, axis=1)
        left.plot(*tool[DRAWN, 1:].T, color=colour, linewidth=1.4, label=name)
        middle.plot(since, apart[DRAWN], color=colour, linewidth=1.4)
        right.plot(since, most[DRAWN], color=colour, linewidth=1.4)
    wrong = 1e3 * np.linalg.norm(np.array([ball.r_o for ball in seen]) - truth, axis=1)
    middle.plot(since, wrong[DRAWN], color=GREY, linewidth=1.0, label="error of the estimate")
    left.plot(*truth[DRAWN, 1:].T, color=BALL, linewidth=3.0, zorder=0, label="target")
    for axes in (middle, right):
        axes.axvline(0.0, color=GREY, linewidth=1.0, linestyle="--")
        axes.axvline(1e3 * (REACH.begin[1] - START - AFTER), color=BALL, linewidth=1.0)
        axes.set(xlabel="time after the meeting [ms]")
    left.set(xlabel="y [m]", ylabel="z [m]", aspect="equal")
    middle.set(ylabel="distance of tool and target [mm]", ylim=(0.0, 70.0))
    right.set(ylabel="largest acceleration of a joint [rad/s²]", ylim=(0.0, None))
    named = [x for axes in (left, middle) for x in axes.get_lines() if x.get_label()[0] != "_"]
    figure.legend(handles=named, loc="outside lower center", ncols=5)


save("meeting", (9.6, 3.7), draw)
