"""How long a tick takes, measured around the call from Python, as a robot's loop would see it."""

from mitt.link.clock import Stopwatch
from mitt.study.source import Source
from mitt.study.trial import Bench


def time_ticks(bench: Bench, source: Source) -> Stopwatch:
    """Return the times of all ticks in which the ball is watched or followed.

    With pixels, each takes two images to torques; without, a position to torques. Thinking, which
    comes after the command, is left out, and so is the first throw, which warms caches up.

    Args:
        bench: Arm, generator and world.
        source: Balls to throw.
    """
    stopwatch, world = Stopwatch(), bench.world
    for index in range(-1, source.count):
        if index == 0:
            stopwatch.clear()
        k, catcher = max(index, 0), bench.catcher()
        world.reset(source.ball(k), source.trial_seed(k))
        while catcher.looking and world.first_contact is None and world.t < 1.0:
            senses = world.sense()
            with stopwatch:
                command = catcher.step(senses)
            world.apply(command)
            catcher.think()
    return stopwatch
