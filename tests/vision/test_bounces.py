"""A ball that bounces where nobody knows of a table: eyes, heads and filter together."""

from collections.abc import Callable

import numpy as np
import pytest

from mitt.ball.filter import THROWN_BALL, BallFilter
from mitt.ball.flight import advance
from mitt.signals import TICK
from mitt.vision.camera import Rig, fixed_rig
from mitt.vision.eyes import Eyes, EyesConfig
from mitt.vision.head import active_rig
from mitt.world.imaging import Imager, ImageSensor

RADIUS, TABLE = 0.02, -0.16
"""Of the ball, and height of its centre as it bounces [m]."""
FRAMES = 80
"""Frames that are watched after the bounce: then the ball is where it is caught."""


@pytest.mark.parametrize("make", [fixed_rig, active_rig])
@pytest.mark.parametrize("speed", [4.0, 4.5])
@pytest.mark.parametrize(("restitution", "kept"), [(0.85, 0.58), (0.6, 0.8)])
def test_a_ball_that_bounces_is_found_at_once(
    make: Callable[[], Rig], speed: float, restitution: float, kept: float
) -> None:
    """By its flight the ball goes on through the table, and comes nearer than it does.

    It keeps a share of its speed along the table, so it is soon farther away than expected, and
    lighter in the images; it is the ball all the same. 25 ms later its place is known to 3 mm.
    """
    rig, f = make(), BallFilter(THROWN_BALL)
    imager = Imager(rig, ImageSensor(), np.random.default_rng(9))
    eyes = Eyes(rig, EyesConfig(ball_radius=RADIUS))
    r, dr = np.array((1.0 + 0.5 * speed, 0.1, TABLE + 0.45)), np.array((-speed, 0.0, 1.0))
    errors, bounced = list[float](), False
    for k in range(1000):
        t = TICK * k
        eyes.guide(f.state(t), t, gap=TICK, alone=True)
        f.update(eyes.step(imager.render(t, r, RADIUS, dr_o=dr)))
        ball = f.state(t)
        imager.turn(eyes.gaze(ball, t + TICK), TICK)
        if bounced:
            errors.append(float(np.linalg.norm(ball.r_o - r)))
        if len(errors) == FRAMES:
            break
        advance(r, dr, 0.04, TICK)
        if r[2] < TABLE and not bounced:
            bounced, dr = True, dr * (kept, kept, -restitution)
    assert len(errors) == FRAMES
    assert max(errors[25:]) < 3e-3
