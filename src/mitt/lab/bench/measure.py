"""All figures of speed in one run, beside other libraries, and the noise of the machine.

A time is ``{"p50", "p99", "p99_9"}``. Everything is timed around the call from Python, as a robot's
loop would see it; numbers of different runs are compared by their ratios within each. A machine has
fast and slow minutes: the ticks of this package and of others take turns, a throw of each and then
a share of each other's calls, so that their ratios are those of the same minutes.
"""

import os
import platform
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np

import mitt
from mitt.clock import Progress, Stopwatch, processor_time, settle
from mitt.core.arm.arm import Arm
from mitt.core.arm.hands import HandModel
from mitt.core.catcher.generators import Direct
from mitt.core.catcher.refine import refine
from mitt.core.errors import InputError
from mitt.core.eyes.camera import fixed_rig
from mitt.core.map.mapping import DirectMap
from mitt.core.map.neighbourhood import learn
from mitt.core.signals import Frame
from mitt.io.load import build_arm
from mitt.lab.bench import libraries as by
from mitt.lab.bench.problem import (
    SETUPS,
    Answer,
    LearningProblem,
    ipopt_run,
    ipopt_solver,
    learning_problem,
    solve_problem,
)
from mitt.lab.trials.runner import TrialRunner
from mitt.lab.trials.source import Source, source_of
from mitt.lab.world.scene import Scene
from mitt.lab.world.throws import Throw

SCHEMA = "mitt.speed/1"

#: Seed of the throws that are timed, and when the ball that a map is refined for is seen [s].
SEED = 20_300
_T_0 = 0.082

Time = dict[str, float]
Result = dict[str, object]
Say = Callable[[str], None]
Rivals = dict[str, tuple[by.Tick, int]]
"""A tick of each rival, and how often it is to be timed."""


@dataclass(frozen=True, slots=True, kw_only=True)
class BenchSettings:
    """How much to measure.

    Attributes:
        throws: Throws of the ticks and of the throughput.
        repeats: Calls of a rival and of the probe.
        solves: How often the learning problem is solved.
        flights: Flights of the learning problem, 30 samples each.
        ipopt: Whether IPOPT learns it too, and plans a catch.
    """

    throws: int = 20
    repeats: int = 2000
    solves: int = 11
    flights: int = 50
    ipopt: bool = True


QUICK = BenchSettings(throws=2, repeats=200, solves=3, flights=10, ipopt=False)


def measure_all(settings: BenchSettings, *, progress: Progress, say: Say) -> Result:
    """Measure everything.

    Args:
        settings: How much.
        progress: Is told what is being done.
        say: Is told in one line what is left out, and why.
    """
    arm = build_arm("wam", hand=HandModel())
    progress("learning", 0, 1)
    f = learn(arm).map
    progress("learning", 1, 1)
    source = source_of(f.arm, seed=SEED, count=settings.throws, drag=Scene().ball.drag)
    progress("ticks", 0, 3)
    with_images, with_points = (
        TrialRunner(arm, Direct(f), Scene(), pixels=pixels) for pixels in (True, False)
    )
    rivals = rivals_of(f, source, watched_images(with_images, source), settings, say)
    settle()
    before = noise(settings.repeats)
    (tick, tick_without_images), others = take_turns((with_images, with_points), rivals, source)
    progress("ticks", 1, 3)
    adapt = figures(time_adapting(f, source, settings.repeats))
    progress("ticks", 2, 3)
    throws = throughput(with_images, source)
    progress("ticks", 3, 3)
    learned, after = learning(arm, settings, progress, say), noise(settings.repeats)
    return {
        "schema": SCHEMA,
        "version": mitt.__version__,
        "machine": f"{platform.machine()}, {os.cpu_count()} cores",
        "tick_us": tick,
        "tick_without_images_us": tick_without_images,
        "adapt_us": adapt,
        **learned,
        "throws_per_s_core": throws,
        "rivals_us": others,
        "noise_us": {name: max(before[name], after[name]) for name in before},
    }


def figures(stopwatch: Stopwatch, *, per: float = 1.0) -> Time:
    """Return median, p99 and p99.9 [us / per]."""
    found = stopwatch.percentiles_us()
    return {name: found[name] / per for name in ("p50", "p99", "p99_9")}


def timed(call: by.Tick, repeats: int) -> Stopwatch:
    """Return the times of a call; the first ones, which warm caches up, are left out."""
    stopwatch = Stopwatch()
    time_calls(call, max(repeats // 10, 1), Stopwatch())
    time_calls(call, repeats, stopwatch)
    return stopwatch


def time_calls(call: by.Tick, repeats: int, stopwatch: Stopwatch) -> None:
    """Let a stopwatch time a call so many times."""
    for _ in range(repeats):
        with stopwatch:
            call()


def time_throw(runner: TrialRunner, source: Source, index: int) -> None:
    """Let the runner's stopwatch time all ticks in which the ball is watched or followed.

    With pixels, each takes two images to torques; without, a position to torques. Thinking, which
    comes after the command, is left out.
    """
    catcher, world = runner.release(source.ball(index), seed=source.trial_seed(index)), runner.world
    while catcher.looking and world.first_contact is None and world.t < 1.0:
        runner.step(catcher)


def take_turns(
    runners: tuple[TrialRunner, ...], rivals: Rivals, source: Source
) -> tuple[list[Time], dict[str, Time]]:
    """Return the times of the ticks of our runners and of the rivals'.

    After each throw every rival makes its share of calls. A first throw, which warms caches up, is
    not timed.
    """
    for runner in runners:
        time_throw(runner, source, 0)
        runner.stopwatch.clear()
    for call, repeats in rivals.values():
        time_calls(call, max(repeats // 10, 1), Stopwatch())
    others = {name: Stopwatch() for name in rivals}
    for index in range(source.count):
        for runner in runners:
            time_throw(runner, source, index)
        for name, (call, repeats) in rivals.items():
            time_calls(call, -(-repeats // source.count), others[name])
    return (
        [figures(runner.stopwatch) for runner in runners],
        {name: figures(stopwatch) for name, stopwatch in others.items()},
    )


def noise(repeats: int) -> Time:
    """Return how long a fixed piece of work takes: what the machine itself adds shows in p99.9."""
    return figures(timed(lambda: sum(range(2000)), repeats))


def watched_images(runner: TrialRunner, source: Source) -> list[tuple[Frame, ...]]:
    """Return the images of the first throw while its ball is watched."""
    catcher, kept = runner.release(source.ball(0), seed=source.trial_seed(0)), []
    while runner.world.t < 0.3:
        senses = runner.step(catcher)
        if len(senses.frames) == len(fixed_rig().cameras):
            kept.append(senses.frames)
    return kept


def rivals_of(
    f: DirectMap, source: Source, kept: list[tuple[Frame, ...]], settings: BenchSettings, say: Say
) -> Rivals:
    """Return a tick of each rival whose library is installed, and how often it is to be timed."""
    ball = by.ball_at(throw_of(source, 0), _T_0)
    makers: dict[str, Callable[[], by.Tick]] = {
        "ruckig": lambda: by.by_ruckig(f.arm, by.catches(f, ball, np.random.default_rng(SEED))),
        "mink": lambda: by.by_mink(f.arm, by.places(ball)),
        "pink": lambda: by.by_pink(f.arm, by.places(ball)),
        "opencv": lambda: by.by_opencv(kept),
        "mpc": lambda: by.by_mpc(f, ball),
    }
    rivals: Rivals = {}
    for name, make in makers.items():
        try:
            tick = make()
        except ImportError as error:
            say(f"{name} is left out: wanted {error.name}, not installed; install mitt[bench]")
            continue
        rivals[name] = tick, settings.repeats if name != "mpc" else settings.repeats // 10
    return rivals


def throw_of(source: Source, index: int) -> Throw:
    """Return a throw of a source that throws."""
    ball = source.ball(index)
    if not isinstance(ball, Throw):
        raise InputError("bench", "default throws", type(ball).__name__)
    return ball


def time_adapting(f: DirectMap, source: Source, repeats: int) -> Stopwatch:
    """Return the times of refining a map for a ball, from its projection on, along flights."""
    stopwatch = Stopwatch()
    start = f.arm.q_ready, np.zeros(f.arm.n)
    for index in range(-1, source.count):
        if index == 0:
            stopwatch.clear()
        throw = throw_of(source, max(index, 0))
        for tick in range(min(30, max(repeats // source.count, 1))):
            ball = by.ball_at(throw, _T_0 + 1e-3 * tick)
            g = f.adapt(ball, *start)
            with stopwatch:
                refine(g, ball, *start)
    return stopwatch


def throughput(runner: TrialRunner, source: Source) -> float:
    """Return whole throws per second of processor time: pixels, finger contact.

    One throw before the clock starts compiles and warms up what is not yet.
    """
    runner.throw(source, 0)
    start = processor_time()
    for index in range(source.count):
        runner.throw(source, index)
    return source.count / (processor_time() - start)


def learning(arm: Arm, settings: BenchSettings, progress: Progress, say: Say) -> Result:
    """Return how long learning takes, and one problem of learning by our way and by IPOPT's best.

    ``learn_ms`` is :func:`mitt.learn` as a user calls it: flights, soft limits of torque, speed and
    range, all steps. The problem that both solvers are given has fixed flights and hard torque rows
    alone; its time is ``learn_solver_ms``.
    """
    progress("solvers", 0, 1)
    whole = timed(partial(learn, arm), min(settings.solves, 5))
    problem = learning_problem(arm, flights=settings.flights, seed=SEED)
    ours = timed(partial(solve_problem, problem), settings.solves)
    took, answer = _by_ipopt(problem, say) if settings.ipopt else (None, None)
    gap = None if answer is None else solve_problem(problem).cost / answer.cost - 1.0
    progress("solvers", 1, 1)
    return {
        "learn_ms": figures(whole, per=1e3),
        "learn_solver_ms": figures(ours, per=1e3),
        "learn_ipopt_ms": took,
        "learn_cost_gap": gap,
    }


def _by_ipopt(problem: LearningProblem, say: Say) -> tuple[Time | None, Answer | None]:
    """Return time [ms] and answer of the fastest set-up that converges; None without one."""
    found: list[tuple[Time, Answer]] = []
    for setup in SETUPS:
        try:
            solver = ipopt_solver(problem, setup)
        except InputError as error:
            say(f"ipopt is left out: {error}")
            return None, None
        stopwatch = Stopwatch()
        with stopwatch:
            answer = ipopt_run(problem, solver)
        took = figures(stopwatch, per=1e3)
        state = f"{took['p50']:.0f} ms, cost {answer.cost:.6f}"
        say(f"ipopt, {setup}: {state if answer.good else state + ', not converged'}")
        if answer.good:
            found.append((took, answer))
    return min(found, key=lambda x: x[0]["p50"]) if found else (None, None)
