"""A catcher whose images do not show the ball any more: it says so, and does not stop for that."""

from dataclasses import replace

import numpy as np
import pytest

from mitt.core.arm.arm import Arm
from mitt.core.catcher.generators import Direct
from mitt.core.control.health import State
from mitt.core.map.learn import Learned
from mitt.lab.trials.runner import TrialRunner
from mitt.lab.trials.source import aim_of
from mitt.lab.world.scene import Scene
from mitt.lab.world.throws import default_throw


@pytest.mark.parametrize("gone", [True, False])
def test_a_ball_that_frames_do_not_show_may_have_bounced(
    arm: Arm, learned: Learned, gone: bool
) -> None:
    """After 30 ms sigma holds a bounce, which it does not where there are no frames at all.

    What the ball would do if it flew on is known as well as ever, so the arm follows that.
    """
    runner = TrialRunner(arm, Direct(learned.map), Scene())
    throw = default_throw(np.random.default_rng(5), aim_of(arm))
    catcher = runner.release(throw, seed=3)
    world, sigmas = runner.world, list[float]()
    for k in range(360):
        senses = world.sense(look=catcher.looking)
        if k >= 330:
            empty = zip(runner.views[k % len(runner.views)], senses.frames, strict=True)
            frames = tuple(replace(x, t=y.t, number=y.number) for x, y in empty) if gone else ()
            senses = replace(senses, frames=frames)
        world.apply(catcher.step(senses))
        catcher.think()
        tick = catcher.tick
        assert tick is not None
        assert tick.state is not State.ABORT
        sigmas.append(tick.sigma)
    speed = np.linalg.norm(catcher.result.ball[1])
    assert sigmas[329] < 1e-3
    assert (0.1 * speed * 0.03 < sigmas[-1] < speed * 0.03) == gone
    assert (sigmas[-1] < 5e-3) != gone
