"""How fast a belt may be for a tool that takes its time: parts met and in step, over its speed.

    python benchmarks/gripper_delays.py docs/img/delays.svg --parts 10 --seed 9850

A part counts if it is met and the tool was in step with it for 150 ms before it had closed. The
bars are Wilson intervals, 95 %. The figures are printed, too: a row for each delay and speed, and
before them for how long the joints of an arm could follow a part through its work area at all.
"""

import argparse
from collections.abc import Iterator
from dataclasses import replace
from multiprocessing import get_context
from pathlib import Path

import matplotlib
import numpy as np
from matplotlib.figure import Figure

from mitt.core.arm.tools import TOOLS
from mitt.lab.report.style import BLUE, GREEN, ORANGE, RC
from mitt.lab.trials.meeting import MeetRunner
from mitt.lab.trials.station import PARTS_SCENE, station
from mitt.lab.trials.statistics import wilson

#: Time from the command until the tool acts [s], mean speeds of the belt [m/s], and the time for
#: which a tool has to be in step [s].
DELAYS = {0.02: BLUE, 0.2: GREEN, 1.0: ORANGE}
SPEEDS = (0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.8, 1.0, 1.2, 1.5)
IN_STEP = 0.15
#: Arms whose joints are looked at, and the number of places in their work areas.
ARMS = ("ur5e", "franka-panda", "wam")
PLACES = 100


def followed(name: str, speed: float) -> float:
    """Return for how long an arm's joints can be as fast as a part on its belt asks [s].

    Args:
        name: Name of the arm.
        speed: That of the belt [m/s].
    """
    at = station(name, TOOLS["suction"], "belt", PARTS_SCENE)
    step = (at.settings.high[1] - at.settings.low[1]) / PLACES
    longest = stretch = 0
    for k in range(PLACES + 1):
        part = np.array([at.place, [0.0, speed, 0.0], [0.0, 0.0, 0.0]])
        part[0, 1] = at.settings.low[1] + k * step
        rows = at.map.motion_along(part[None], np.zeros(1), 1.0)
        most = at.arm.active(at.arm.limits.dq_max)
        keeps = rows is not None and bool(np.all(np.abs(rows[0, 1]) <= most))
        stretch = stretch + 1 if keeps else 0
        longest = max(longest, stretch)
    return max(longest - 1, 0) * step / speed


def good(job: tuple[float, float, int, int]) -> int:
    """Return how many parts were met and in step, of a delay, a speed, so many parts, a seed."""
    delay, speed, parts, seed = job
    at = station("ur5e", replace(TOOLS["suction"], delay=delay), "belt", PARTS_SCENE)
    runner = MeetRunner(at, seed=seed, speed=speed, generator=at.generator("direct"))
    trials = [runner.trial(k) for k in range(parts)]
    return sum(x.status == "met" and x.in_sync_s >= IN_STEP for x in trials)


def draw(figure: Figure, rows: list[tuple[float, float, int]], parts: int) -> None:
    """Draw a line for each delay."""
    axes = figure.subplots()
    for k, (delay, colour) in enumerate(DELAYS.items()):
        shares = [(v, 100.0 * n / parts, wilson(n, parts)) for d, v, n in rows if d == delay]
        speeds = [v + 0.006 * (k - 1) for v, _, _ in shares]
        most = [share for _, share, _ in shares]
        ends = [
            [y - 100.0 * low for _, y, (low, _) in shares],
            [100.0 * high - y for _, y, (_, high) in shares],
        ]
        axes.errorbar(
            speeds,
            most,
            ends,
            color=colour,
            marker="o",
            markersize=4,
            linewidth=1.4,
            elinewidth=0.8,
            label=f"{1e3 * delay:.0f} ms",
        )
    axes.set(xlabel="mean speed of the belt [m/s]", ylabel="met and in step [%]", ylim=(-3, 103))
    axes.legend(title="the tool acts after")


def tried(jobs: list[tuple[float, float, int, int]], workers: int) -> Iterator[int]:
    """Yield the results of jobs in their order."""
    with get_context("spawn").Pool(workers) as pool:
        yield from pool.imap(good, jobs)


def main() -> None:
    """Try all, print a row for each delay and speed, and draw."""
    parser = argparse.ArgumentParser()
    parser.add_argument("path", type=Path)
    parser.add_argument("--parts", type=int, default=10)
    parser.add_argument("--seed", type=int, default=9850)
    parser.add_argument("--workers", type=int, default=2)
    options = parser.parse_args()
    for name in ARMS:
        print(name, *(f"{v} m/s: {followed(name, v):.2f} s" for v in SPEEDS), sep="  ", flush=True)
    jobs = [(d, v, options.parts, options.seed) for d in DELAYS for v in SPEEDS]
    rows = list[tuple[float, float, int]]()
    for (delay, speed, _, _), count in zip(jobs, tried(jobs, options.workers), strict=True):
        rows.append((delay, speed, count))
        print(f"{delay:5.2f} s {speed:4.1f} m/s {count:3d} of {options.parts}", flush=True)
    with matplotlib.rc_context({**RC, "svg.fonttype": "path", "svg.hashsalt": "delays"}):
        figure = Figure(figsize=(6.4, 3.6), layout="constrained", facecolor="white")
        draw(figure, rows, options.parts)
        figure.savefig(options.path, metadata={"Date": None})


if __name__ == "__main__":
    main()
