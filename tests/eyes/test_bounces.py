"""A ball that bounces where nobody knows of a table: eyes, heads and filter together."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pytest

from mitt.core.ball.filter import THROWN_BALL, BallFilter
from mitt.core.ball.flight import advance
from mitt.core.eyes.camera import Rig, fixed_rig
from mitt.core.eyes.eyes import Eyes, EyesConfig
from mitt.core.eyes.head import SWEEP, active_rig
from mitt.core.signals import TICK
from mitt.lab.world.imaging import Imager, ImageSensor

RADIUS = 0.02
"""Of the ball [m]."""
BOUNCES = [(0.85, 0.58), (0.7, 0.5), (0.9, 0.9)]
"""Restitution, and share of the speed along the table that is kept."""
BOUNCE = 424
FRAMES = 125
BEFORE = 3
"""Frame of the bounce, frames from then until the ball is past its catch, frames before it that
hide the ball."""

LEAST = 5e-4
"""Error that is none, whatever sigma says [m]."""


@dataclass
class Watched:
    """Errors of position, and its 1-sigma, in each frame from the bounce on [m]."""

    errors: list[float]
    sigmas: list[float]


def watch(
    rig: Rig, speed: float, restitution: float, kept: float, *, hidden: int = 0, shown: bool = True
) -> Watched:
    """Watch a throw that bounces as a catcher does, which is told of no table.

    For ``hidden`` frames from a little before the bounce on the images are without a ball, or
    missing if not ``shown``.
    """
    f, imager = BallFilter(THROWN_BALL), Imager(rig, ImageSensor(), np.random.default_rng(9))
    eyes, out = Eyes(rig, EyesConfig(ball_radius=RADIUS)), Watched([], [])
    r, dr = np.array((1.3 + speed * TICK * BOUNCE, 0.1, 0.29)), np.array((-speed, 0.0, 1.0))
    nowhere = np.array((0.0, 0.0, 50.0))
    for k in range(BOUNCE + FRAMES):
        t = TICK * k
        veiled = -BEFORE <= k - BOUNCE < hidden - BEFORE
        eyes.guide(f.state(t), t, alone=True)
        frames = imager.render(t, nowhere if veiled else r, RADIUS, dr_o=dr)
        f.update(eyes.step(frames if shown or not veiled else ()))
        ball = f.state(t)
        imager.turn(eyes.gaze(ball, t + TICK), TICK)
        if k >= BOUNCE:
            out.errors.append(float(np.linalg.norm(ball.r_o - r)))
            out.sigmas.append(float(np.sqrt(np.trace(ball.covariance[:3, :3]))))
        advance(r, dr, 0.04, TICK)
        if k == BOUNCE - 1:
            dr = dr * (kept, kept, -restitution)
    return out


@pytest.mark.parametrize("make", [fixed_rig, active_rig])
@pytest.mark.parametrize(("restitution", "kept"), BOUNCES)
def test_a_ball_that_bounces_is_found_at_once(
    make: Callable[[], Rig], restitution: float, kept: float
) -> None:
    """By its flight the ball goes on through the table, and comes nearer than it does.

    It keeps a share of its speed along the table, so it is soon farther away than expected, and
    lighter in the images; it is the ball all the same. 25 ms later its place is known to 3 mm.
    """
    seen = watch(make(), 4.5, restitution, kept)
    assert max(seen.errors[25:80]) < 3e-3


@pytest.mark.parametrize(("hidden", "shown"), [(25, False), (40, True), (55, False), (70, True)])
def test_heads_find_a_ball_again_that_bounced_unseen(hidden: int, shown: bool) -> None:
    """Within half a sweep and what the filter takes, though it is 0.5 m from where its flight led.

    Whether something hides the ball or no image comes: heads in agreement look for it.
    """
    for restitution, kept in BOUNCES:
        seen = watch(active_rig(), 4.5, restitution, kept, hidden=hidden, shown=shown)
        again = hidden - BEFORE + round(0.5 * SWEEP / TICK) + 20
        assert max(seen.errors[again : again + 10]) < 8e-3, (restitution, kept)


@pytest.mark.parametrize("make", [fixed_rig, active_rig])
def test_what_a_bounce_leaves_of_the_estimate_is_within_its_sigma(make: Callable[[], Rig]) -> None:
    """In all frames but the first: from then on sightings do not fit, or show another velocity."""
    for restitution, kept in BOUNCES:
        seen = watch(make(), 4.5, restitution, kept)
        allowed = 3.0 * np.array(seen.sigmas) + LEAST
        assert np.all(np.array(seen.errors)[1:40] < allowed[1:40]), (restitution, kept)
