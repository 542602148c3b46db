"""The time between two cameras, as the images of a flight say it."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from throws_on_film import level_rig

from mitt.core.ball.flight import advance
from mitt.core.eyes.camera import Rig, fixed_rig, turned
from mitt.core.signals import Array
from mitt.robot.cameras.synchrony import Synchrony, synchrony

RADIUS = 0.04
NOISE = 0.1
DURATION = 0.6
#: What a calibration leaves of the poses [rad, m], one sigma.
POSE = np.array(3 * [3e-4] + 3 * [1e-3])
Motion = Callable[[Array], Array]
Delay = Callable[[Array], Array]


def thrown(rng: np.random.Generator, drag: float) -> Motion:
    """Return a throw towards the arm as a function of time."""
    r = np.array((3.6, rng.uniform(-0.3, 0.3), rng.uniform(-0.2, 0.4)))
    dr = np.array((rng.normal(-5.5, 0.5), rng.normal(0.0, 0.4), rng.uniform(0.5, 2.5)))
    times, path = np.arange(-0.1, DURATION + 0.1, 5e-4), []
    for _ in times:
        path.append(r.copy())
        advance(r, dr, drag, 5e-4)
    places = np.array(path)
    return lambda t: np.column_stack([np.interp(t, times, places[:, k]) for k in range(3)])


def waved(rng: np.random.Generator) -> Motion:
    """Return a ball that a hand waves about."""
    rate, phase = rng.uniform(4.0, 9.0, 3), rng.uniform(0.0, 6.0, 3)
    size = np.array((0.3, 0.4, 0.3))
    return lambda t: np.array((2.0, 0.0, 0.3)) + size * np.sin(np.outer(t, rate) + phase)


def seen(
    rig: Rig, motion: Motion, rate: float, delay: Delay, rng: np.random.Generator
) -> tuple[Array, Rig]:
    """Return what both cameras see of a motion, and the rig as a calibration found it."""
    t = np.arange(int(DURATION * rate)) / rate
    images = [
        np.array([camera.project(p) for p in motion(at)])
        for camera, at in zip(rig.cameras, (t, t + delay(t)), strict=True)
    ]
    uv = np.hstack(images) + NOISE * rng.normal(size=(len(t), 4))
    inside = np.all((uv > 1.0) & (uv < 126.0), axis=1)
    found = [
        replace(c, T_world_cam=turned(c.T_world_cam, POSE * rng.normal(size=6)))
        for c in rig.cameras
    ]
    return np.column_stack((t, uv))[inside], Rig(cameras=tuple(found))


def answer(points: Array, rig: Rig) -> Synchrony:
    """Return what the images say."""
    found = synchrony(points, rig, radius=RADIUS, noise=0.05)
    assert found is not None
    return found


def delays(name: str, period: float) -> Delay:
    """Return how late the right images are, as a function of time."""
    first, last = {
        "first frame lost": (-1.0, 9.0),
        "one lost on the way": (0.3, 9.0),
        "each lost one": (0.12, 0.45),
        "each lost one, soon": (0.3, 0.3 + 6.5 * abs(period)),
    }.get(name, (-1.0, 9.0))
    size = {
        "the left one lost it": -period,
        "stamps 25 ms apart": 0.025,
        "started between frames": 0.5 * period,
        "rates that differ": 0.0,
    }
    drift = 0.05 if name == "rates that differ" else 0.0
    return lambda t: np.asarray(
        np.where((t > first) & (t < last), size.get(name, period), 0.0) + drift * t
    )


SHIFTS = (
    "first frame lost",
    "the left one lost it",
    "one lost on the way",
    "each lost one",
    "each lost one, soon",
    "stamps 25 ms apart",
    "rates that differ",
    "started between frames",
)


@pytest.mark.parametrize("rig", [level_rig(), fixed_rig()], ids=["level", "fixed"])
@pytest.mark.parametrize("name", SHIFTS)
def test_cameras_out_of_step_are_found(name: str, rig: Rig) -> None:
    """Whatever the kind of shift, at 60 and 120 Hz, beside what calibration leaves."""
    for k, rate in enumerate((60.0, 120.0)):
        rng = np.random.default_rng(k)
        delay = delays(name, 1.0 / rate)
        points, found_rig = seen(rig, thrown(rng, 0.08), rate, delay, rng)
        found = answer(points, found_rig)
        assert found.shifted
        largest = np.abs(delay(points[:, 0])).max()
        assert abs(found.offset[found.worst]) == pytest.approx(largest, rel=0.35)


@pytest.mark.parametrize("rate", [60.0, 120.0, 250.0])
def test_cameras_in_step_are_left_alone(rate: float) -> None:
    """Thrown or waved, with any drag: no offset is certain, and its sigma holds."""
    ratios = []
    for k in range(12):
        rng = np.random.default_rng(k)
        motion = waved(rng) if k % 3 == 0 else thrown(rng, rng.uniform(0.02, 0.15))
        rig = level_rig() if k % 2 else fixed_rig()
        points, found_rig = seen(rig, motion, rate, np.zeros_like, rng)
        found = answer(points, found_rig)
        assert not found.shifted
        ratios.append(found.mean / found.mean_sigma)
    assert np.abs(ratios).max() < 4.0
    assert np.std(ratios) < 1.5


def test_the_error_covers_what_the_offset_moves() -> None:
    """The ball that is triangulated from images a frame apart is off by what is said."""
    rng = np.random.default_rng(1)
    rig, period = level_rig(), 1.0 / 120.0
    motion = thrown(rng, 0.08)
    points, found_rig = seen(rig, motion, 120.0, delays("first frame lost", period), rng)
    found = answer(points, found_rig)
    off = period * np.linalg.norm(found.slope, axis=1)
    said = np.array([np.linalg.norm(found.error(t)) for t in points[:, 0]])
    assert np.all(said > 0.7 * off)
    assert np.median(off) > 0.01


@pytest.mark.parametrize("delay", [0.0005, 0.001, 0.002])
def test_an_offset_too_small_to_be_certain_is_within_what_is_said(delay: float) -> None:
    """From some 2 ms on a constant one is found; below, the error that is said covers it."""
    found = []
    for k in range(6):
        rng = np.random.default_rng(k)
        points, rig = seen(
            level_rig() if k % 2 else fixed_rig(),
            thrown(rng, rng.uniform(0.02, 0.15)),
            (60.0, 120.0)[k % 2],
            lambda t: np.full_like(t, delay),
            rng,
        )
        said = answer(points, rig)
        off = delay * np.linalg.norm(said.slope, axis=1)
        error = np.array([np.linalg.norm(said.error(t)) for t in said.t])
        assert np.all(off < 3.0 * error)
        found.append(abs(said.mean - delay) / said.mean_sigma)
    assert max(found) < 4.0


@pytest.mark.parametrize("frames", [1, 2, 3])
def test_a_few_frames_of_another_instant_are_within_what_is_said(frames: int) -> None:
    """Too few to say that the cameras are out of step, across whose epipolar lines the ball flies.

    So is what a track makes of them: for some instants it remembers.
    """
    for k in range(6):
        rng, period = np.random.default_rng(k), 1.0 / (60.0, 120.0)[k % 2]
        first = rng.uniform(0.15, 0.3)

        def delay(t: Array, at: float = first, T: float = period) -> Array:
            return np.where((t > at) & (t < at + frames * T), T, 0.0)

        points, rig = seen(level_rig(), thrown(rng, 0.08), 1.0 / period, delay, rng)
        said = answer(points, rig)
        there = (said.t > first) & (said.t < first + (frames + 3) * period)
        off = period * np.linalg.norm(said.slope[there], axis=1)
        error = np.array([np.linalg.norm(said.error(t)) for t in said.t[there]])
        assert np.all(off < 3.0 * (error + 0.003))
        assert np.median(said.sigma[~there]) < 1e-3


def test_few_instants_say_nothing() -> None:
    """Seven in a row, or many with pauses between them."""
    rng = np.random.default_rng(0)
    points, rig = seen(level_rig(), thrown(rng, 0.08), 120.0, np.zeros_like, rng)
    assert synchrony(points[:7], rig, radius=RADIUS, noise=0.05) is None
    assert synchrony(points[:0], rig, radius=RADIUS, noise=0.05) is None
