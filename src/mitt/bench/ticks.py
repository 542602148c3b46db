"""How long a tick takes, measured around the call from Python, as a robot's loop would see it."""

from collections.abc import Callable
from typing import TypeAlias

import numpy as np

from mitt.link.clock import Stopwatch, steady_ns
from mitt.trials.runner import LOOKS, TrialRunner
from mitt.trials.source import Source

Call: TypeAlias = Callable[[], object]
Rivals: TypeAlias = dict[str, tuple[Call, int]]
"""A tick of each rival, and how often it is to be timed."""


def timed(call: Call, repeats: int) -> Stopwatch:
    """Return the times of a call; the first ones, which warm caches up, are left out."""
    stopwatch = Stopwatch()
    warm(call, repeats)
    time_calls(call, repeats, stopwatch)
    return stopwatch


def warm(call: Call, repeats: int) -> None:
    """Make the calls that warm caches up before so many others."""
    for _ in range(max(repeats // 10, 1)):
        call()


def time_calls(call: Call, repeats: int, stopwatch: Stopwatch) -> None:
    """Let a stopwatch time a call so many times."""
    took = np.empty(repeats, dtype=np.int64)
    for k in range(repeats):
        start = steady_ns()
        call()
        took[k] = steady_ns() - start
    stopwatch.add(took)


def time_throw(runner: TrialRunner, source: Source, index: int, stopwatch: Stopwatch) -> None:
    """Let a stopwatch time all ticks of a throw in which the ball is watched or followed.

    With pixels, each takes two images to torques; without, a position to torques. Thinking, which
    comes after the command, is left out.

    Args:
        runner: Arm, generator and world.
        source: Balls to throw.
        index: Which of them.
        stopwatch: Is told each time.
    """
    world, catcher, took = runner.world, runner.catcher(), []
    world.reset(source.ball(index), source.trial_seed(index))
    if views := world.views_before(LOOKS):
        catcher.learn_background(views)
    while catcher.looking and world.first_contact is None and world.t < 1.0:
        senses = world.sense()
        start = steady_ns()
        command = catcher.step(senses)
        took.append(steady_ns() - start)
        world.apply(command)
        catcher.think()
    stopwatch.add(np.array(took))


def take_turns(
    runners: tuple[TrialRunner, TrialRunner], rivals: Rivals, source: Source
) -> tuple[tuple[Stopwatch, Stopwatch], dict[str, Stopwatch]]:
    """Return the times of the ticks of two runners and of the rivals'.

    After each throw every rival makes its share of calls. A first throw, which warms caches up, is
    not timed.
    """
    ours, others = (Stopwatch(), Stopwatch()), {name: Stopwatch() for name in rivals}
    for runner, stopwatch in zip(runners, ours, strict=True):
        time_throw(runner, source, 0, stopwatch)
        stopwatch.clear()
    for call, repeats in rivals.values():
        warm(call, repeats)
    for index in range(source.count):
        for runner, stopwatch in zip(runners, ours, strict=True):
            time_throw(runner, source, index, stopwatch)
        for name, (call, repeats) in rivals.items():
            time_calls(call, -(-repeats // source.count), others[name])
    return ours, others
