"""What a catcher's decisions need is loaded before a loop begins, not in the middle of a throw."""

from dataclasses import replace

import numpy as np

from mitt.core.arm.arm import Arm
from mitt.core.arm.shapes import clearance
from mitt.core.catcher.generators import Generator
from mitt.core.catcher.settings import CatcherSettings
from mitt.core.control.envelope import speeds_of
from mitt.core.control.viability import safety_of
from mitt.core.signals import TICK, Array, BallState
from mitt.core.verdict.feasibility import Approach, is_far
from mitt.core.verdict.holding import force_of
from mitt.core.verdict.impact import examined, gap_at_catch

#: Velocity of a ball that comes [m/s].
_COMES = np.array([-5.0, 0.0, -1.0])


def load_decisions(arm: Arm, generator: Generator, settings: CatcherSettings) -> None:
    """Ask about balls that come to the hand, aside, below or not at all, and one that is led.

    Code is loaded at its first call, or even compiled, which takes up to seconds. A throw that
    needs what no throw before it needed, as the first that asks for too much torque, would wait.
    Which ball asks for too much torque, or is caught beside the region of a map, depends on arm and
    map: what is done for them is done here with a short motion, and with the pose of the start.

    Args:
        arm: The arm.
        generator: What is asked.
        settings: Of the catcher.
    """
    q = arm.q_ready
    for ball in _balls(arm.position(q)):
        generator.sharpness(ball)
        generator.unsettled(ball, q)
        is_far(ball, arm.position(q))
        examined(arm, generator.verdict(ball, q), settings.caught, bandwidth=settings.bandwidth)
        generator.returns(ball)
        generator.waiting(ball)
    f = generator.as_map()
    if f is not None:
        f.to_ball(f.start)
    s = safety_of(arm, settings.around)
    clearance(s.arm.bodies, q, s.shapes, s.pairs, s.ends)
    still = np.array([[q, 0.0 * q, 0.0 * q]] * 3)
    short = Approach(motion=still, step=2.0 * TICK, dr_o=_COMES)
    gap_at_catch(arm, short, speeds_of(arm), settings.bandwidth)
    force_of(arm, q, _COMES, settings.caught)


def _balls(hand: Array) -> list[BallState]:
    """Return a ball of each kind, for a hand that waits somewhere [m], shape (3,)."""
    comes = BallState(t=0.0, r_o=hand - 0.4 * _COMES, dr_o=_COMES)
    miss = [
        replace(comes, r_o=comes.r_o + np.array(by)) for by in ((0.0, 0.9, 0.0), (0.0, 0.0, -0.5))
    ]
    away = replace(comes, dr_o=-comes.dr_o)
    return [comes, *miss, away, replace(comes, led=True)]
