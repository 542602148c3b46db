"""How well the eyes see: heads that follow the ball beside fixed cameras.

    python benchmarks/eyes.py [--throws 40] [--seed 8000]

Position error of single looks by distance from the base of the rig, their mean normalised squared
error (3 is honest), and error of filtered position and velocity 50 and 100 ms after the first
sighting. How fast the eyes are beside OpenCV's calls: ``mitt bench``.
"""

import argparse

import numpy as np

from mitt.core.ball.filter import THROWN_BALL, BallFilter
from mitt.core.ball.flight import advance
from mitt.core.eyes.camera import Rig, fixed_rig
from mitt.core.eyes.eyes import Eyes, EyesStatus
from mitt.core.eyes.head import active_rig
from mitt.core.signals import Array
from mitt.lab.world.imaging import Imager, ImageSensor

Rows = dict[str, list[tuple[float, float]]]


def throw(rng: np.random.Generator) -> tuple[Array, Array]:
    """Return a release towards the arm: position [m] and velocity [m/s], shape (3,) each."""
    r = rng.uniform((3.3, -0.5, -0.2), (4.6, 0.6, 0.6))
    flight = rng.uniform(0.5, 0.6)
    goal = np.array((0.75, rng.uniform(-0.2, 0.2), 0.05))
    return r, (goal - r) / flight + np.array((-0.4, 0.0, 4.905 * flight))


def watch(rig: Rig, rng: np.random.Generator, rows: Rows) -> None:
    """Watch one throw and note the errors."""
    imager, eyes, belief = Imager(rig, ImageSensor(), rng), Eyes(rig), BallFilter(THROWN_BALL)
    r, dr = throw(rng)
    base = np.mean([c.centre for c in rig.cameras], axis=0)
    first = None
    for k in range(480):
        t = 1e-3 * k
        frames = imager.render(t, r, 0.04, dr_o=dr)
        s = eyes.step(frames)
        if s.found:
            belief.update(s)
        if s.found and eyes.status is EyesStatus.BOTH:
            first = k if first is None else first
            e = s.r_o - r
            name = f"raw at {np.linalg.norm(r - base):.0f} m"
            nees = float(e @ np.linalg.solve(s.covariance, e))
            rows.setdefault(name, []).append((float(np.linalg.norm(e)), nees))
        ball = belief.state(t)
        if first is not None and ball.tracked:
            pair = float(np.linalg.norm(ball.r_o - r)), float(np.linalg.norm(ball.dr_o - dr))
            for after in (50, 100):
                if k >= first + after:
                    rows.setdefault(f"filtered after {after} ms", []).append(pair)
        imager.turn(eyes.gaze(ball, t + 1e-3), 1e-3)
        advance(r, dr, 0.04, 1e-3)
    rows.setdefault("first sighting [ms]", []).append((float(first or 0), 0.0))


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--throws", type=int, default=40)
    parser.add_argument("--seed", type=int, default=8000)
    job = parser.parse_args()
    for name, rig in (("fixed", fixed_rig()), ("active", active_rig())):
        rows: Rows = {}
        for k in range(job.throws):
            watch(rig, np.random.default_rng(job.seed + k), rows)
        print(name)
        for key in sorted(rows):
            a = np.array(rows[key])
            rms = np.sqrt(np.mean(a[:, 0] ** 2))
            if key.startswith("raw"):
                print(f"  {key}: {1e3 * rms:.2f} mm rms, nees {a[:, 1].mean():.2f}, n {len(a)}")
            elif key.startswith("filtered"):
                v = np.sqrt(np.mean(a[:, 1] ** 2))
                print(f"  {key}: {1e3 * rms:.2f} mm rms, {v:.3f} m/s rms, n {len(a)}")
            else:
                print(f"  {key}: median {np.median(a[:, 0]):.0f}, worst {a[:, 0].max():.0f}")


if __name__ == "__main__":
    main()
