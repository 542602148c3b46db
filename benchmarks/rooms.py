"""How well two cameras that stand still see a thrown ball in rooms as they are.

    python benchmarks/rooms.py [clutter|shutters] [--throws 20] [--seed 564000]

``clutter``: hot pixels, small lamps and windows beside the ball, with a background that was learned
and without. ``shutters``: exposures and rolling shutters by frame rate, before a dark and a bright
wall. Frames from the third sighting on that show the ball where it is said to be, others, median
error of single looks, and normalised squared error of these and of the filtered position: 3 is
honest.
"""

import argparse
from dataclasses import dataclass, field, replace

import numpy as np

from mitt.core.ball.filter import THROWN_BALL, BallFilter
from mitt.core.ball.flight import advance
from mitt.core.eyes.camera import fixed_rig
from mitt.core.eyes.eyes import Eyes
from mitt.core.signals import TICK, Array
from mitt.lab.world.imaging import Imager, ImageSensor

RADIUS = 0.04
FLIGHT = 0.5
FAR = 36.0
"""Normalised squared error of what is elsewhere than it is said to be."""


@dataclass(slots=True)
class Row:
    """What came of the frames of one kind of room."""

    shown: int = 0
    right: int = 0
    wrong: int = 0
    errors: list[float] = field(default_factory=list)
    nees: list[float] = field(default_factory=list)
    filtered: list[float] = field(default_factory=list)


def throw(rng: np.random.Generator) -> tuple[Array, Array]:
    """Return a release in view of both cameras: position [m] and velocity [m/s], shape (3,)."""
    r = rng.uniform((3.4, -0.4, 0.0), (4.2, 0.4, 0.5))
    goal = np.array((0.8, 0.0, 0.1))
    return r, (goal - r) / FLIGHT + np.array((-0.4, 0.0, 4.905 * FLIGHT))


def watch(sensor: ImageSensor, rate: float, learned: bool, seed: int, row: Row) -> None:
    """Watch one throw; the filter is told what is seen, and tells the eyes where to look."""
    rng, plain = np.random.default_rng(seed), fixed_rig()
    rig = replace(plain, cameras=tuple(replace(c, readout=sensor.readout) for c in plain.cameras))
    imager, eyes, belief = Imager(rig, sensor, rng), Eyes(rig), BallFilter(THROWN_BALL)
    if learned:
        eyes.learn_background(imager.before(10, np.zeros((0, 8))))
    r, dr = throw(rng)
    sightings, ticks = 0, round(1.0 / (rate * TICK))
    for k in range(int(FLIGHT * rate)):
        t = k * ticks * TICK
        eyes.guide(belief.state(t), t, alone=True)
        s = eyes.step(imager.render(t, r, RADIUS, dr_o=dr))
        if s.found:
            sightings += 1
            late = s.t - t
            error = s.r_o - (r + late * dr + np.array((0.0, 0.0, -0.5 * 9.81 * late * late)))
            nees = float(error @ np.linalg.solve(s.covariance, error))
            good = bool(nees < FAR)
            row.wrong += not good
            row.right += good and sightings > 2
            if good:
                row.errors.append(float(np.linalg.norm(error)))
                row.nees.append(nees)
            belief.update(s)
        row.shown += sightings > 2 or (sightings <= 2 and t > 0.1)
        ball = belief.state(t)
        if ball.tracked and t > 0.5 * FLIGHT:
            error = ball.r_o - r
            row.filtered.append(float(error @ np.linalg.solve(ball.covariance[:3, :3], error)))
        for _ in range(ticks):
            advance(r, dr, RADIUS, TICK)


def show(
    name: str, sensor: ImageSensor, rate: float, learned: bool, job: argparse.Namespace
) -> None:
    """Watch all throws in one kind of room, and print what came of them."""
    row = Row()
    for k in range(job.throws):
        watch(sensor, rate, learned, job.seed + k, row)
    median = 1e3 * float(np.median(row.errors)) if row.errors else float("nan")
    nees = [float(np.mean(x)) if x else float("nan") for x in (row.nees, row.filtered)]
    print(
        f"{name:38s} {rate:5.0f} Hz  {'learned' if learned else 'without':8s}"
        f"right {row.right:5d} of {row.shown:5d}  wrong {row.wrong:3d}"
        f"  median {median:5.2f} mm  nees {nees[0]:5.2f}, filtered {nees[1]:5.2f}",
        flush=True,
    )


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("what", nargs="?", choices=("clutter", "shutters"), default="clutter")
    parser.add_argument("--throws", type=int, default=20)
    parser.add_argument("--seed", type=int, default=564000)
    job = parser.parse_args()
    if job.what == "clutter":
        for rate in (1000.0, 120.0, 30.0):
            for count in (16, 40, 200):
                for learned in (True, False):
                    show(f"{count} hot pixels", ImageSensor(hot=count), rate, learned, job)
                    lamps = ImageSensor(lamps=(float(count), 220.0))
                    show(f"{count} lamps", lamps, rate, learned, job)
            for learned in (True, False):
                show("a window", ImageSensor(windows=(1.0, 250.0)), rate, learned, job)
        return
    for rate, exposure, readout in (
        (1000.0, 0.001, 0.0),
        (120.0, 0.001, 0.0),
        (120.0, 0.008, 0.0),
        (120.0, 0.001, 0.008),
        (100.0, 0.01, 0.0),
        (30.0, 0.001, 0.0),
        (30.0, 0.01, 0.0),
        (30.0, 0.001, 0.02),
        (30.0, 0.01, 0.02),
    ):
        name = f"exposure {1e3 * exposure:g}, readout {1e3 * readout:g} ms"
        sensor = ImageSensor(exposure=exposure, readout=readout)
        show(name, sensor, rate, True, job)
        bright = replace(sensor, background=110.0, brightness=90.0, light=(0.05, 100.0))
        show(f"{name}, bright", bright, rate, True, job)


if __name__ == "__main__":
    main()
