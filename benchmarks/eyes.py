"""How well and how fast the eyes see: heads that follow the ball beside cameras that stand still.

    python benchmarks/eyes.py [--throws 40] [--seed 8000]

Position error of single looks by distance from the base of the rig, their mean normalised squared
error (3 is honest), and error of filtered position and velocity 50 and 100 ms after the first
sighting. Then the time of two images to a sighting beside the same by OpenCV calls, in one run.
"""

import argparse
from time import perf_counter

import cv2
import numpy as np

from mitt.flight import advance
from mitt.signals import Array, Frame
from mitt.vision.camera import Rig, fixed_rig
from mitt.vision.eyes import Eyes, EyesStatus
from mitt.vision.filter import THROWN_BALL, BallFilter
from mitt.vision.head import active_rig
from mitt.world.imaging import Imager, ImageSensor

Rows = dict[str, list[tuple[float, float]]]


def throw(rng: np.random.Generator) -> tuple[Array, Array]:
    """Return a release towards the arm: position [m] and velocity [m/s], shape (3,) each."""
    r = rng.uniform((3.3, -0.5, -0.2), (4.6, 0.6, 0.6))
    flight = rng.uniform(0.5, 0.6)
    goal = np.array((0.75, rng.uniform(-0.2, 0.2), 0.05))
    return r, (goal - r) / flight + np.array((-0.4, 0.0, 4.905 * flight))


def watch(rig: Rig, rng: np.random.Generator, rows: Rows, kept: list[tuple[Frame, ...]]) -> None:
    """Watch one throw and note the errors."""
    imager, eyes, belief = Imager(rig, ImageSensor(), rng), Eyes(rig), BallFilter(THROWN_BALL)
    r, dr = throw(rng)
    base = np.mean([c.centre for c in rig.cameras], axis=0)
    first = None
    for k in range(480):
        t = 1e-3 * k
        frames = imager.render(t, r, 0.04, dr_o=dr)
        kept.append(frames)
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


def by_opencv(frames: tuple[Frame, ...], matrices: list[Array], kalman: cv2.KalmanFilter) -> None:
    """Do the same by library calls: threshold, components, moments, triangulation, filter."""
    points = []
    for frame in frames:
        _, binary = cv2.threshold(frame.pixels, 60, 255, cv2.THRESH_BINARY)
        _, _, stats, _ = cv2.connectedComponentsWithStats(binary)
        u, v, w, h, _ = (
            stats[1 + int(np.argmax(stats[1:, 4]))] if len(stats) > 1 else (0, 0, 8, 8, 0)
        )
        m = cv2.moments(frame.pixels[v : v + h, u : u + w])
        points.append(np.array((u + m["m10"] / m["m00"], v + m["m01"] / m["m00"])))
    p = cv2.triangulatePoints(matrices[0], matrices[1], points[0], points[1])
    kalman.predict()
    kalman.correct((p[:3] / p[3]).reshape(3, 1))


def speed(rig: Rig, kept: list[tuple[Frame, ...]]) -> tuple[float, float]:
    """Return the median time of a look by ours and by OpenCV [us], turn about."""
    eyes, kalman = Eyes(rig), cv2.KalmanFilter(6, 3, 0, cv2.CV_64F)
    kalman.measurementMatrix = np.eye(3, 6)
    matrices = []
    for c in rig.cameras:
        K = np.array(((c.f_px, 0, c.cu), (0, c.f_px, c.cv), (0, 0, 1)))
        matrices.append(K @ np.linalg.inv(c.T_world_cam)[:3])
    times: list[list[float]] = [[], []]
    for frames in kept:
        start = perf_counter()
        eyes.step(frames)
        middle = perf_counter()
        by_opencv(frames, matrices, kalman)
        times[0].append(middle - start)
        times[1].append(perf_counter() - middle)
    return 1e6 * float(np.median(times[0])), 1e6 * float(np.median(times[1]))


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--throws", type=int, default=40)
    parser.add_argument("--seed", type=int, default=8000)
    job = parser.parse_args()
    for name, rig in (("fixed", fixed_rig()), ("active", active_rig())):
        rows: Rows = {}
        kept: list[tuple[Frame, ...]] = []
        for k in range(job.throws):
            kept = kept if k < 3 else []  # three throws are enough to time
            watch(rig, np.random.default_rng(job.seed + k), rows, kept)
            if k == 2:
                sample = list(kept)
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
        ours, theirs = speed(rig, sample)
        print(f"  two images to a sighting: {ours:.1f} us (with Python), OpenCV {theirs:.1f} us")


if __name__ == "__main__":
    main()
