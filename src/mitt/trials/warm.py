"""All that a throw needs is compiled in two processes at once, before the first ball flies."""

import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from multiprocessing import get_context
from threading import Event, Thread
from typing import Any

import numpy as np
from numba import typeof

from mitt.catcher.catcher import Catcher
from mitt.catcher.tick import act, perceive, refer, undecided
from mitt.generator.generators import Direct
from mitt.generator.mapping import DirectMap
from mitt.jit import compiled_count, is_cold
from mitt.trials.play import NOTHING
from mitt.trials.runner import LOOKS, TrialRunner
from mitt.world.flights import BallPath
from mitt.world.motion import move
from mitt.world.scene import Scene
from mitt.world.throws import Throw

#: Kernels that a throw needs, those of several types counted for each, and how often the bar of
#: progress looks at them [s].
_KERNELS, _PERIOD = 302, 1.0

Report = Callable[[str, int, int], None]


@contextmanager
def warming(
    f: DirectMap, scene: Scene, ball: Throw | BallPath, *, pixels: bool, progress: Report
) -> Iterator[None]:
    """Compile in a second process what the eyes need, meanwhile here what the arm needs.

    Does nothing where the kernels have been compiled before. What a process could not compile is
    compiled when it is needed.

    Args:
        f: The map, not learned.
        scene: The world.
        ball: Any throw.
        pixels: Whether the catcher sees images.
        progress: Is told how many kernels are compiled.
    """
    if not is_cold():
        yield
        return
    over, job = Event(), (f, scene, ball, pixels)
    other = get_context("spawn").Process(target=_compile_eyes, args=job, daemon=True)
    watch = Thread(target=_watch, args=(over, progress), daemon=True)
    other.start()
    watch.start()
    try:
        yield
        _compile_arm(*job)
        other.join()
    finally:
        other.terminate()
        over.set()
        watch.join()


def _watch(over: Event, progress: Report) -> None:
    """Report how many kernels are compiled until it is over."""
    before = compiled_count()
    while not over.wait(_PERIOD):
        count = min(compiled_count() - before, _KERNELS - 1)
        progress("compiling kernels, once for this version", count, _KERNELS)


def _compile_eyes(f: DirectMap, scene: Scene, ball: Throw | BallPath, pixels: bool) -> None:
    """Compile what draws images and what finds the ball in them."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the first process ends this one
    runner, catcher = _prepared(f, scene, ball, pixels=pixels)
    if views := runner.world.views_before(LOOKS):
        catcher.learn_background(views)
    _, state, result = catcher.ending
    q = np.zeros(f.arm.n)
    _compile(perceive, NOTHING, catcher.backgrounds, 0, 0.0, 0.0, q, q, state, result)


def _compile_arm(f: DirectMap, scene: Scene, ball: Throw | BallPath, pixels: bool) -> None:
    """Compile what moves the arm, in the catcher and in the world."""
    runner, catcher = _prepared(f, scene, ball, pixels=pixels)
    brake, state, result = catcher.ending
    _compile(act, brake, state, result)
    _compile(refer, state, result)
    _compile(undecided, 0, state, result)
    stage = runner.world.stage
    if stage is not None:
        rows, told = stage.tape.reserve(2), result[0]["told"]
        _compile(move, stage.plant, told[3], 0.0, rows)


def _prepared(
    f: DirectMap, scene: Scene, ball: Throw | BallPath, *, pixels: bool
) -> tuple[TrialRunner, Catcher]:
    """Return a runner whose world is ready for a throw, and its catcher."""
    runner = TrialRunner(f.arm, Direct(f), scene, pixels=pixels)
    runner.world.reset(ball, 0)
    return runner, runner.catcher()


def _compile(kernel: Any, *args: object) -> None:  # noqa: ANN401
    """Compile a kernel for the types of its arguments."""
    kernel.compile(tuple(typeof(x) for x in args))
