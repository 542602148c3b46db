"""What a live loop waits for: the longest calls of a catcher in a session, and what they work out.

    python benchmarks/loop_times.py                              all that are listed below
    python benchmarks/loop_times.py wam-direct panda --throws 12

A session is one catcher after the other, as ``mitt run`` takes them: loaded once, then default
throws, of which each third is turned aside, is low, or is disturbed (a kick, a bounce, a flutter),
so that verdicts of all kinds are given. After each throw the hand opens and the arm moves away;
after some it is stopped, and recovers. ``ur5e-meet`` and ``wam-bat`` are trials of the other tasks.
Times are of this thread's processor, without garbage
collection, in milliseconds: the largest, how often it was taken, and in which calls.
"""

import argparse
import sys
from collections import defaultdict
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from time import thread_time_ns
from typing import ParamSpec, TypeVar

import numpy as np

from mitt.clock import uncollected
from mitt.core.arm.arm import Arm
from mitt.core.arm.tools import TOOLS
from mitt.core.catcher.catcher import Catcher
from mitt.core.catcher.generators import Generator
from mitt.core.catcher.loading import load_decisions
from mitt.core.catcher.settings import CatcherSettings, Phase
from mitt.core.map.neighbourhood import learn
from mitt.core.verdict.pieces import Pieces
from mitt.interrupts import tell
from mitt.io.arm_file import ArmSpec
from mitt.lab.trials.bat_station import bat_station
from mitt.lab.trials.batting import BatRunner
from mitt.lab.trials.meeting import MeetRunner
from mitt.lab.trials.registry import make_generator
from mitt.lab.trials.runner import TrialRunner
from mitt.lab.trials.slow_motion import slow_motion
from mitt.lab.trials.source import Source, source_of, widened
from mitt.lab.trials.station import station
from mitt.lab.world.scene import Scene, scene_of
from mitt.lab.world.throws import Throw

_P = ParamSpec("_P")
_T = TypeVar("_T")

SEED = 82_000
#: What is measured: an arm, its limits where it has several, and a generator.
CASES = {
    "wam-single": ("wam", "paper", "single"),
    "wam-direct": ("wam", "paper", "direct"),
    "wam-48v-direct": ("wam", "wam-48v", "direct"),
    "wam-quintic": ("wam", "paper", "quintic"),
    "ur5e-single": ("ur5e", None, "single"),
    "ur5e-direct": ("ur5e", None, "direct"),
    "panda-single": ("franka-panda", None, "single"),
    "panda-direct": ("franka-panda", None, "direct"),
}
#: Trials of other tasks.
TASKS = ("ur5e-meet", "wam-bat")
#: What disturbs each third ball.
FAULTS = (
    {"kind": "kick", "magnitude": 1.0},
    {"kind": "bounce"},
    {"kind": "flutter", "magnitude": 10.0},
)
#: How each third ball is thrown: as it is, aside, low, high.
TURNED = (
    np.zeros(3),
    np.array([0.0, 1.2, 0.0]),
    np.array([0.0, 0.0, -1.0]),
    np.array([0.0, 0.0, 0.6]),
)
#: Longest throw, and how long the arm is watched after it [ticks].
THROW = 1600
AFTER = 600


class Times:
    """The processor times of calls, by a name [ms]."""

    def __init__(self) -> None:
        """Begin with none."""
        self._ms = defaultdict[str, list[float]](list)

    def of(self, name: str, call: Callable[_P, _T], /, *args: _P.args, **kwargs: _P.kwargs) -> _T:
        """Return what a call returns, or raise what it raises, and note how long it took."""
        start = thread_time_ns()
        try:
            return call(*args, **kwargs)
        finally:
            self._ms[name].append(1e-6 * (thread_time_ns() - start))

    def rename(self, name: str, new: str) -> None:
        """Call the last entry of a name by another."""
        self._ms[new].append(self._ms[name].pop())

    def show(self, least: float) -> None:
        """Print the calls that took at least so long once [ms], the longest first."""
        rows = sorted(((max(x), name, x) for name, x in self._ms.items() if x), reverse=True)
        for most, name, x in rows:
            if most >= least:
                print(f"  {most:7.3f} {np.median(x):7.3f} {len(x):6}  {name}")


class Session:
    """A session with one arm and one generator."""

    def __init__(self, arm: Arm, generator: Generator, source: Source, times: Times) -> None:
        """Load all that a live loop loads."""
        self.arm, self.generator, self.source, self.times = arm, generator, source, times
        load_decisions(arm, generator, CatcherSettings())
        self.scenes = (Scene(), *(scene_of({"faults": [x]}, place="fault") for x in FAULTS))
        self.runner = TrialRunner(arm, generator, Scene(), pixels=False)
        self.catcher = self.runner.catcher()

    def throw(self, k: int) -> str:
        """Throw a ball and go through all that comes after it; return how it ended."""
        ball, third = self.source.ball(k), k // 3
        assert isinstance(ball, Throw)
        scene = self.scenes[1 + third % len(FAULTS)] if k % 3 == 2 else self.scenes[0]
        if k % 3 == 1:
            ball = replace(ball, dr=ball.dr + TURNED[1 + third % (len(TURNED) - 1)])
        runner = TrialRunner(self.arm, self.generator, scene, pixels=False)
        runner.world.reset(ball, self.source.trial_seed(k))
        self.catcher = c = self.times.of("again", self.catcher.again, self.generator)
        for tick in range(THROW):
            if k % 7 == 6 and tick == 500:
                c.stop()
            self._tick(runner, c)
            if c.done and tick > 500:
                break
        ended = c.phase.value
        self._afterwards(runner, c)
        return ended

    def _afterwards(self, runner: TrialRunner, c: Catcher) -> None:
        """Open the hand, move away; or recover from a stop."""
        self.times.of("clock_offset", lambda: c.clock_offset)
        self.times.of("verdict", lambda: c.verdict)
        if c.phase is Phase.STOPPED and c.done:
            self.times.of("recover", c.recover, checked=True)
        elif c.phase is Phase.BRAKE and c.done:
            self.times.of("let_go", c.let_go)
        for tick in range(AFTER):
            if tick == 20 and c.halted and c.phase in (Phase.WATCH, Phase.BRAKE, Phase.REFUSED):
                q = c.result.command[0].copy()
                way = self.times.of("slow_motion", slow_motion, self.arm, q, self.arm.q_ready, 0.3)
                self.times.of("move", c.move, way)
            self._tick(runner, c)

    def _tick(self, runner: TrialRunner, c: Catcher) -> None:
        """Make a tick, as a live loop does."""
        before, senses = c.phase.value, runner.world.sense(look=c.looking)
        command = self.times.of("step", c.step, senses)
        self.times.rename("step", f"step {before} -> {c.phase.value}")
        runner.world.apply(command)
        before = c.phase.value
        self.times.of("think", c.think)
        self.times.rename("think", f"think {before} -> {c.phase.value}")
        self.times.of("hint", lambda: c.hint)


def measured(name: str, throws: int, seed: int, least: float) -> None:
    """Measure a case and print it."""
    arm_name, limits, generator = CASES[name]
    chosen = ArmSpec(arm=arm_name, limits=limits).read()
    arm = chosen.arm
    f = learn(arm, design=chosen.design).map
    source = source_of(arm, seed=seed, count=throws, drag=0.04)
    if chosen.throws is not None:
        source = widened(source, chosen.throws)
    times, pieces = Times(), Times()
    made = make_generator(generator, f)
    warm = Session(arm, made, source, Times())  # its first throws load what is not loaded yet
    for k in range(3):
        warm.throw(k)
    session = Session(arm, made, source, times)
    with noted(pieces):
        ends = _ends(name, session.throw, throws)
    _show(f"{name}: {throws} throws, seed {seed}; ended {ends}", times, pieces, least)


def measured_task(name: str, trials: int, seed: int, least: float) -> None:
    """Measure trials of another task and print them."""
    times, pieces = Times(), Times()
    runner = task_runner(name, trials, seed)
    runner.trial(0)  # loads what is not loaded yet
    calls = {call: getattr(Catcher, call) for call in ("step", "think")}

    def timed_of(call: str) -> Callable[..., object]:
        def timed(catcher: Catcher, *args: object) -> object:
            before = catcher.phase.value
            answer = times.of(call, calls[call], catcher, *args)
            times.rename(call, f"{call} {before} -> {catcher.phase.value}")
            return answer

        return timed

    for call in calls:
        setattr(Catcher, call, timed_of(call))
    try:
        with noted(pieces):
            ends = _ends(name, lambda k: str(runner.trial(k).status), trials)
    finally:
        for call, own in calls.items():
            setattr(Catcher, call, own)
    _show(f"{name}: {trials} trials, seed {seed}; ended {ends}", times, pieces, least)


def task_runner(name: str, trials: int, seed: int) -> BatRunner | MeetRunner:
    """Return what runs the trials of a task: a suction cup at a belt, or a paddle."""
    if name == "wam-bat":
        scene = scene_of({"base": "lab"}, place="scene")
        at = bat_station("wam", scene=scene, target=np.array([3.0, 0.0, 0.3]), limits="wam-48v")
        balls = source_of(at.arm, seed=seed, drag=at.scene.ball.drag, count=trials)
        return BatRunner(at, balls, pixels=False)
    sensing = {"latency": 30, "point_noise": 0.002, "frame_rate": 60.0}
    scene = scene_of({"base": "lab", "sensing": sensing}, place="scene")
    station_at = station("ur5e", TOOLS["suction"], "belt", scene, speed=np.inf)
    return MeetRunner(station_at, seed=seed, speed=0.3)


@contextmanager
def noted(pieces: Times) -> Iterator[None]:
    """Note how long each piece takes."""
    whole = Pieces.of

    def of(
        self: Pieces, called: str, work: Callable[_P, _T], /, *args: _P.args, **kwargs: _P.kwargs
    ) -> _T:
        return whole(self, called, _timed(pieces, called, work), *args, **kwargs)

    Pieces.of = of  # type: ignore[method-assign]
    try:
        yield
    finally:
        Pieces.of = whole  # type: ignore[method-assign]


def _ends(name: str, play: Callable[[int], str], count: int) -> dict[str, int]:
    """Play so many and return how often each ended how."""
    ends = defaultdict[str, int](int)
    with uncollected():
        for k in range(count):
            ends[play(k)] += 1
            tell(f"{name}: {k + 1} of {count}")
    return dict(ends)


def _show(title: str, times: Times, pieces: Times, least: float) -> None:
    """Print what was measured."""
    print(title)
    print("  largest  median  times  call [ms]")
    times.show(least)
    print("  largest  median  times  piece [ms]")
    pieces.show(0.0)
    sys.stdout.flush()


def _timed(times: Times, name: str, work: Callable[_P, _T]) -> Callable[_P, _T]:
    """Return some work that notes how long it took; ``run 50`` as ``run``, of which it is one."""
    kind = name.partition(" Tolerance")[0].rstrip("0123456789. ")

    def timed(*args: _P.args, **kwargs: _P.kwargs) -> _T:
        return times.of(kind, work, *args, **kwargs)

    return timed


def main() -> None:
    """Measure the cases that are named."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    known = [*CASES, *TASKS]
    parser.add_argument("cases", nargs="*", default=known, help=", ".join(known))
    parser.add_argument("--throws", type=int, default=30)
    parser.add_argument("--seed", type=int, default=SEED)
    parser.add_argument("--least", type=float, default=0.1, help="shortest call that is shown [ms]")
    options = parser.parse_args()
    for name in options.cases:
        measure = measured_task if name in TASKS else measured
        measure(name, options.throws, options.seed, options.least)


if __name__ == "__main__":
    main()
