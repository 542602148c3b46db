"""What the eyes make of frozen, swapped and covered cameras and of a second ball."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import pytest

from mitt.core.ball.filter import THROWN_BALL, BallFilter
from mitt.core.ball.flight import advance
from mitt.core.eyes.camera import Rig, fixed_rig
from mitt.core.eyes.eyes import Eyes, EyesStatus
from mitt.core.signals import Array, Frame
from mitt.lab.world.imaging import Imager, ImageSensor

Frames = tuple[Frame, ...]
Spoiler = Callable[[int, Frames], Frames]

TICKS = 400
FIRST = 200
LAST = 300
"""Ticks of a throw; those between which something is wrong."""
ODDS = 40
"""Looks within which eyes that contradict each other say so."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Watched:
    """A throw as it was seen: error [m], jump of the estimate over its own sigma, status."""

    errors: Array
    jumps: Array
    status: list[EyesStatus]


def watch(
    spoil: Spoiler,
    *,
    seed: int,
    rig: Rig | None = None,
    second: tuple[float, float, float, float] | None = None,
) -> Watched:
    """Watch a throw through spoiled frames; ``rig`` is what the eyes believe of the cameras."""
    rng, true = np.random.default_rng(seed), fixed_rig()
    imager = Imager(true, ImageSensor(), rng, second=second)
    eyes, f = Eyes(rig or true), BallFilter(THROWN_BALL)
    r = rng.uniform((3.4, -0.4, 0.0), (4.2, 0.4, 0.5))
    dr = (np.array((0.8, 0.0, 0.1)) - r) / 0.5 + np.array((-0.4, 0.0, 2.4))
    errors, jumps, status = np.full(TICKS, np.nan), np.zeros(TICKS), []
    for k in range(TICKS):
        t = 1e-3 * k
        sighting = eyes.step(spoil(k, imager.render(t, r, 0.04, dr_o=dr)))
        before = f.state(t)
        if sighting.found:
            f.update(sighting)
        after = f.state(t)
        if after.tracked:
            errors[k] = np.linalg.norm(after.r_o - r)
        if before.tracked and after.tracked:
            sigma = np.sqrt(np.diag(before.covariance)[:3])
            jumps[k] = np.abs((after.r_o - before.r_o) / sigma).max()
        status.append(eyes.status)
        advance(r, dr, 0.04, 1e-3)
    return Watched(errors=errors, jumps=jumps, status=status)


def dropout(k: int, frames: Frames) -> Frames:
    """Lose all frames of the interval."""
    return () if FIRST <= k < LAST else frames


@pytest.mark.parametrize("seed", range(4))
def test_a_freeze_of_100_ms_is_a_dropout(seed: int) -> None:
    """Images that stay the same under new numbers and stamps cost no more than none at all."""
    kept: list[Frames] = []

    def freeze(k: int, frames: Frames) -> Frames:
        if k == FIRST:
            kept.append(frames)
        if not FIRST <= k < LAST:
            return frames
        return tuple(replace(f, pixels=old.pixels) for f, old in zip(frames, kept[0], strict=True))

    frozen, dark = watch(freeze, seed=seed), watch(dropout, seed=seed)
    assert frozen.errors[LAST - 1] <= 1.1 * dark.errors[LAST - 1] + 2e-3
    assert frozen.errors[-1] <= 1.1 * dark.errors[-1] + 1e-3
    assert frozen.status[FIRST + 5 : LAST] == [EyesStatus.BLIND] * (LAST - FIRST - 5)


@pytest.mark.parametrize("seed", range(3))
def test_swapped_eyes_are_at_odds_and_see_no_ball(seed: int) -> None:
    """Within 40 ms they say so, and never give a position."""

    def swap(_: int, frames: Frames) -> Frames:
        return tuple(replace(f, camera=1 - f.camera) for f in frames)

    seen = watch(swap, seed=seed)
    assert np.isnan(seen.errors).all()
    assert set(seen.status[ODDS:]) == {EyesStatus.AT_ODDS}


def test_a_calibration_that_is_not_theirs_is_at_odds() -> None:
    """One camera tilted by 2 degrees: the lines of sight pass each other, and the eyes say so."""
    rig, angle = fixed_rig(), np.deg2rad(2.0)
    tilt = np.eye(4)
    tilt[1:3, 1:3] = ((np.cos(angle), -np.sin(angle)), (np.sin(angle), np.cos(angle)))
    left = replace(rig.cameras[0], T_world_cam=rig.cameras[0].T_world_cam @ tilt)
    wrong = Rig(cameras=(left, rig.cameras[1]))
    assert EyesStatus.AT_ODDS in watch(lambda _, frames: frames, seed=1, rig=wrong).status


@pytest.mark.parametrize("camera", [0, 1])
@pytest.mark.parametrize("seed", range(3))
def test_one_covered_eye_is_better_than_two_and_hands_over_smoothly(camera: int, seed: int) -> None:
    """Covered for 100 ms: no worse than a dropout of both, no jump beyond 3 sigma."""

    def cover(k: int, frames: Frames) -> Frames:
        if not FIRST <= k < LAST:
            return frames
        blank = np.full_like(frames[camera].pixels, 24)
        return tuple(replace(f, pixels=blank) if f.camera == camera else f for f in frames)

    one, none = watch(cover, seed=seed), watch(dropout, seed=seed)
    assert set(one.status[FIRST:LAST]) <= {EyesStatus.ONE, EyesStatus.BLIND}
    assert one.status[FIRST:LAST].count(EyesStatus.ONE) > 60
    assert one.errors[FIRST:LAST].max() <= none.errors[FIRST:LAST].max() + 1e-3
    assert one.jumps[FIRST : LAST + 10].max() < 3.0


@pytest.mark.parametrize("seed", range(4))
def test_a_second_ball_beside_the_flight_changes_nothing(seed: int) -> None:
    """A bright ball that looks smaller than the thrown one is never taken for it."""
    alone = watch(lambda _, frames: frames, seed=seed)
    beside = watch(lambda _, frames: frames, seed=seed, second=(4.8, 0.2, 0.4, 0.02))
    assert beside.errors[-50:].max() < 3.0 * alone.errors[-50:].max() + 1e-3
