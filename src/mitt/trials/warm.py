"""All that a throw needs is compiled in two processes at once, before the first ball flies."""

import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from multiprocessing import get_context
from threading import Event, Thread
from typing import Any

import numpy as np
from numba import typeof

from mitt.catcher.action import act
from mitt.catcher.catcher import Catcher
from mitt.catcher.perception import perceive
from mitt.catcher.tick import refer, undecided
from mitt.generator.design import MapDesign
from mitt.generator.generators import Direct
from mitt.generator.mapping import DirectMap, unlearned
from mitt.interrupts import end_with_parent
from mitt.jit import cache_folder, compiled_count, is_cold
from mitt.robot.arm import Arm
from mitt.trials.play import NOTHING
from mitt.trials.runner import LOOKS, TrialRunner
from mitt.world.flights import BallPath
from mitt.world.motion import move
from mitt.world.scene import Scene
from mitt.world.throws import Throw

#: Kernels of a default ``mitt catch``, counted on November 23; how often the bar looks at them [s].
_KERNELS, _PERIOD = 331, 1.0
#: What the bar says.
_COMPILING = "compiling, once"

Report = Callable[[str, int, int], None]


@contextmanager
def warming(
    arm: Arm, design: MapDesign, scene: Scene, ball: Throw | BallPath, *, pixels: bool,
    progress: Report,
) -> Iterator[None]:  # fmt: skip
    """Compile in a second process what the eyes need, meanwhile here what the arm needs.

    Does nothing where the kernels have been compiled before, or cannot be kept. What a process
    could not compile is compiled when it is needed.

    Args:
        arm: The arm.
        design: Of the map.
        scene: The world.
        ball: Any throw.
        pixels: Whether the catcher sees images.
        progress: Is told how many kernels are compiled.
    """
    if cache_folder() is None or not is_cold():
        yield
        return
    over, job = Event(), (unlearned(arm, design), scene, ball, pixels)
    other = get_context("spawn").Process(target=_compile_eyes, args=job, daemon=True)
    watch = Thread(target=_watch, args=(over, progress), daemon=True)
    signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})  # for the second process, for good
    try:
        other.start()
    finally:
        signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})
    watch.start()
    try:
        yield
        _compile_arm(*job)
        other.join()
        progress(_COMPILING, _KERNELS, _KERNELS)
    finally:
        other.terminate()
        over.set()
        watch.join()


def _watch(over: Event, progress: Report) -> None:
    """Report how many kernels are compiled until it is over."""
    before = compiled_count()
    while not over.wait(_PERIOD):
        progress(_COMPILING, min(max(compiled_count() - before, 0), _KERNELS - 1), _KERNELS)


def _compile_eyes(f: DirectMap, scene: Scene, ball: Throw | BallPath, pixels: bool) -> None:
    """Compile what draws images and what finds the ball in them."""
    end_with_parent()
    runner, catcher = _prepared(f, scene, ball, pixels=pixels)
    if views := runner.world.views_before(LOOKS):
        catcher.learn_background(views)
    _, state, result = catcher.kernel_arguments
    q = np.zeros(f.arm.n)
    _compile(perceive.inner, NOTHING, catcher.backgrounds, 0, 0.0, 0.0, 0.0, q, q, state, result)


def _compile_arm(f: DirectMap, scene: Scene, ball: Throw | BallPath, pixels: bool) -> None:
    """Compile what moves the arm, in the catcher and in the world."""
    runner, catcher = _prepared(f, scene, ball, pixels=pixels)
    brake, state, result = catcher.kernel_arguments
    _compile(act.inner, brake, state, result)
    _compile(refer.inner, state, result)
    _compile(undecided.inner, 0, state, result)
    stage = runner.world.stage
    if stage is not None:
        rows, tau = stage.trace_buffer.reserve(2), catcher.result.command[3]
        _compile(move.inner, stage.plant, tau, 0.0, rows)


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
