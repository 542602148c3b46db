"""Runs of throws: as ``mitt catch`` makes them (learn, throw, keep), and from Python.

All that a throw needs is compiled in two processes at once, before the first ball flies.
"""

import signal
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from multiprocessing import get_context
from multiprocessing.sharedctypes import Synchronized
from pathlib import Path
from threading import Event, Thread
from typing import Any, Final, Literal, TypeAlias, final

import numpy as np
from numba import typeof

import mitt
from mitt.clock import Progress, Stopwatch
from mitt.core import checks
from mitt.core.arm.arm import Arm
from mitt.core.catcher.catcher import Catcher
from mitt.core.catcher.family import Family
from mitt.core.catcher.generators import Direct, Generator, Unoptimised, refining
from mitt.core.catcher.given import answering, generator_of, map_of
from mitt.core.catcher.loading import load_decisions
from mitt.core.catcher.planner import undecided
from mitt.core.catcher.settings import CatcherSettings
from mitt.core.catcher.tick import act, perceive, refer
from mitt.core.errors import InputError, StoppedError
from mitt.core.eyes.clock_offset import ClockOffset, LearnedClock, caught_offset
from mitt.core.kernels import cache_folder, is_cold
from mitt.core.map.learn import Learned
from mitt.core.map.map_design import MapDesign, warnings_of
from mitt.core.map.mapping import DirectMap, unlearned
from mitt.core.map.neighbourhood import learn, neighbourhood_of_ball
from mitt.core.signals import TICK, ArmState, Senses, Sighting
from mitt.interrupts import end_with_parent, safe_path
from mitt.io.about import About
from mitt.io.maps import save_map
from mitt.io.recordings import Recording, write_recording
from mitt.lab.trials.log import recording_of
from mitt.lab.trials.play import NOTHING, capture, sight_of
from mitt.lab.trials.registry import make_generator
from mitt.lab.trials.runner import TrialRunner
from mitt.lab.trials.score import CATCH, MAP, Trial, reason_of
from mitt.lab.trials.scored_task import ScoredTask
from mitt.lab.trials.source import Source, source_of
from mitt.lab.trials.task_runner import LOOKS
from mitt.lab.world.flights import BallPath
from mitt.lab.world.motion import move_motors
from mitt.lab.world.scene import Scene, changed_settings, scene_from
from mitt.lab.world.throws import Throw

Count: TypeAlias = "Synchronized[int]"
"""A number that processes share."""
#: What the bar says.
_COMPILING = "compiling, once"


@contextmanager
def warming(
    arm: Arm,
    design: MapDesign,
    scene: Scene,
    ball: Throw | BallPath,
    *,
    pixels: bool,
    progress: Progress,
) -> Iterator[None]:
    """Compile what a throw needs, part by part, in a second process and, when it is free, in this.

    Does nothing where the kernels have been compiled before, or cannot be kept. What a process
    could not compile is compiled when it is needed. ``ball`` is any throw.
    """
    if cache_folder() is None or not is_cold():
        yield
        return
    context, over = get_context("spawn"), Event()
    with safe_path():
        begun, done = context.Value("i"), context.Value("i")
    job = unlearned(arm, design), scene, ball, pixels, begun, done
    other = context.Process(target=_compile_beside, args=job, daemon=True)
    watch = Thread(target=_watch, args=(over, progress, done), daemon=True)
    signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})  # for the second process, for good
    try:
        with safe_path():
            other.start()
    finally:
        signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})
    watch.start()
    try:
        yield
        _compile_parts(*job)
        other.join()
        progress(_COMPILING, len(_PARTS), len(_PARTS))
    finally:
        other.terminate()
        over.set()
        watch.join()


def _watch(over: Event, progress: Progress, done: Count) -> None:
    """Report each second how many parts are compiled, until it is over."""
    while not over.wait(1.0):
        progress(_COMPILING, min(done.value, len(_PARTS) - 1), len(_PARTS))


def _compile_beside(*job: Any) -> None:  # noqa: ANN401
    """Compile parts in a process that ends with its parent."""
    end_with_parent()
    _compile_parts(*job)


def _compile_parts(
    f: DirectMap,
    scene: Scene,
    ball: Throw | BallPath,
    pixels: bool,
    begun: Count,
    done: Count,
) -> None:
    """Compile the next part that nobody has begun, until none is left."""
    runner = TrialRunner(f.arm, Direct(f), scene, pixels=pixels)
    runner.world.reset(ball, 0)
    catcher = runner.catcher()
    while True:
        with begun.get_lock():
            k, begun.value = begun.value, begun.value + 1
        if k >= len(_PARTS):
            return
        _PARTS[k](runner, catcher)
        with done.get_lock():
            done.value += 1


def _eyes(runner: TrialRunner, catcher: Catcher) -> None:
    """Compile what draws images, and what finds the ball in them."""
    if views := runner.world.views_before(LOOKS):
        catcher.learn_background(views)
    state, result = catcher.kernel_arguments[1:]
    q = np.zeros(runner.arm.n)
    seen, read = (NOTHING, catcher.backgrounds, 0, 0.0), (0.0, 0.0, q, q)
    _compile(perceive.inner, seen, read, state, result)


def _control(_: TrialRunner, catcher: Catcher) -> None:
    """Compile what moves the arm."""
    brake, state, result = catcher.kernel_arguments
    _compile(act.inner, brake, state, result)


def _map(_: TrialRunner, catcher: Catcher) -> None:
    """Compile what tells where the arm is to be."""
    state, result = catcher.kernel_arguments[1:]
    _compile(refer.inner, state, result)


def _verdict(_: TrialRunner, catcher: Catcher) -> None:
    """Compile what tells whether there is something to think about."""
    state, result = catcher.kernel_arguments[1:]
    _compile(undecided.inner, 0, state, result)


def _plant(runner: TrialRunner, catcher: Catcher) -> None:
    """Compile what moves the world."""
    if (stage := runner.world.stage) is not None:
        rows, tau = stage.trace_buffer.reserve(2), catcher.result.command[3]
        _compile(move_motors.inner, stage.plant, tau, 0.0, rows, stage.rows(0))


def _pictures(runner: TrialRunner, catcher: Catcher) -> None:
    """Compile what draws in a trial."""
    if (stage := runner.world.stage) is not None:
        state = catcher.kernel_arguments[1]
        _compile(capture.inner, stage.plant, sight_of(stage, catcher), state, 0, False)


_PARTS: Final = (_eyes, _control, _map, _plant, _pictures, _verdict)


def _compile(kernel: Any, *args: object) -> None:  # noqa: ANN401
    """Compile a kernel for the types of its arguments."""
    kernel.compile(tuple(typeof(x) for x in args))


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class RunSettings:
    """How a run throws, and what it leaves: the options of the same names of ``mitt catch``."""

    generator: str = "direct"
    adapt: Literal["projection", "refine"] = "projection"
    vision: Literal["pixels", "points"] = "pixels"
    seed: int = 0
    record: Literal["none", "failures", "all"] = "failures"
    record_images: bool = False
    overwrite: bool = False
    learn_clock: bool = False


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Prepared:
    """A run that can start: every input read and found good.

    Attributes:
        settings: How it throws.
        arm: The arm.
        design: Design of the map to be learned, where none is given.
        scene: The world.
        source: What is thrown.
        learned: The map; None to learn it first.
        out: Folder to write.
        again: What makes the run again, as JSON: its options, and what it read.
    """

    settings: RunSettings
    arm: Arm
    design: MapDesign
    scene: Scene
    source: Source
    learned: Learned | None
    out: Path
    again: Mapping[str, Any] = field(default_factory=dict)

    @property
    def head(self) -> dict[str, object]:
        """What the result says of the run; the scene, and in what it was changed."""
        changes, of = changed_settings(self.scene), self.settings
        return {
            "version": mitt.__version__,
            "arm": self.arm.model.name,
            "limits": self.arm.limits.name,
            "generator": of.generator,
            "vision": of.vision,
            "seed": of.seed,
            **({"adapt": of.adapt} if of.adapt != "projection" else {}),
            "scene": self.scene.base,
            **({"scene_changed": changes} if changes else {}),
        }

    @property
    def task(self) -> ScoredTask:
        """What is run: throws to be caught."""
        return CATCH

    @property
    def overwrite(self) -> bool:
        """Whether a folder with files in it may be used."""
        return self.settings.overwrite

    @property
    def count(self) -> int:
        """Number of throws."""
        return self.source.count

    @property
    def warnings(self) -> Sequence[str]:
        """What is odd about arm and map, in words."""
        return warnings_of(self.arm, self.design)

    def records(self, trial: Trial) -> bool:
        """Say whether a throw is to be recorded: of failures the first is there for comparison."""
        failed = trial.index == 0 or trial.status != CATCH.success
        return self.settings.record == "all" or (self.settings.record == "failures" and failed)

    def begin(self, progress: Progress) -> "ThrownBalls":
        """Compile and learn what is not there yet, and throw once before all others."""
        # A ball that no throw has comes first, so that compiling is not measured.
        ball, pixels = self.source.ball(2**31), self.settings.vision == "pixels"
        parts = self.arm, self.design, self.scene, ball
        with warming(*parts, pixels=pixels, progress=progress):
            progress("learning", 0, 1)
            learned = self.learned or learn(
                self.arm,
                design=self.design,
                around=neighbourhood_of_ball(self.scene.ball.drag),
            )
            progress("learning", 1, 1)
        throws = ThrownBalls(self, learned)
        throws.runner.run(-1, ball, seed=0)
        throws.runner.stopwatch.clear()
        return throws


@final
class ThrownBalls:
    """What throws the balls of a run, one after the other.

    Attributes:
        learned: The map.
        runner: What throws.
        clock: What is learned of the clock of the eyes; None where it is not learned.
    """

    def __init__(self, prepared: Prepared, learned: Learned) -> None:
        """Build the runner of a run."""
        self._prepared, self.learned = prepared, learned
        self.runner = make_runner(prepared, learned, generator=prepared.settings.generator)
        self.clock = LearnedClock() if prepared.settings.learn_clock else None
        self._again: TrialRunner | None = None

    @property
    def stopwatch(self) -> Stopwatch:
        """Times of the catcher's ticks."""
        return self.runner.stopwatch

    @property
    def said(self) -> dict[str, object]:
        """What the result says of a clock that was learned."""
        return {} if self.clock is None else {"clock": self.clock.figures}

    @property
    def warning(self) -> str | None:
        """What is odd about a clock that was learned."""
        return None if self.clock is None else self.clock.warning or None

    def trial(self, index: int) -> Trial:
        """Throw a ball."""
        return _thrown(self.runner, self._prepared.source, index, self.clock)

    def recording(self, trial: Trial) -> Recording:
        """Throw a ball once more, which gives the same trial, and return its recording."""
        p = self._prepared
        if self._again is None:
            self._again = make_runner(p, self.learned, generator=p.settings.generator)
        offset = None if trial.clock is None else trial.clock["offset_s"]
        self._again.clock_offset = float(offset or 0.0)
        images = p.settings.record_images and p.settings.vision == "pixels"
        outcome = self._again.throw(p.source, trial.index, log=True, images=images)
        if outcome.log is None:
            raise RuntimeError("a throw left no log")
        about = self._again.about(p.settings.generator, self.learned.map)
        return recording_of(outcome.log, outcome.trial, about, p.head)

    def keep(self, folder: Path) -> None:
        """Write the map."""
        save_map(folder / MAP, self.learned)


def make_runner(prepared: Prepared, learned: Learned, *, generator: str) -> TrialRunner:
    """Return the runner of a run, for a generator by name."""
    if prepared.settings.adapt == "refine" and generator == "single":
        return runner_for(prepared, refining(learned.map))
    return runner_for(prepared, make_generator(generator, learned.map))


def runner_for(prepared: Prepared, generator: Generator) -> TrialRunner:
    """Return the runner of a run, for any generator."""
    pixels = prepared.settings.vision == "pixels"
    return TrialRunner(prepared.arm, generator, prepared.scene, pixels=pixels)


def _thrown(runner: TrialRunner, source: Source, index: int, clock: LearnedClock | None) -> Trial:
    """Throw once; where a clock is learned, corrected by it and with what the catch says of it."""
    trial, used = runner.throw(source, index).trial, runner.clock_offset
    if clock is None:
        return trial
    found = ClockOffset(unknown="the arm has not braked for a ball")
    if runner.caught is not None:
        found = caught_offset(runner.arm, runner.caught)
        clock.take(found, used)
    runner.clock_offset = clock.offset
    known = not found.unknown
    return replace(
        trial,
        clock={
            "offset_s": used,
            "found_s": used + found.offset if known else None,
            "sigma_s": found.sigma if known else None,
            "unknown": found.unknown or None,
        },
    )


def simulate(
    f: DirectMap | Learned | Generator,
    *,
    arm: Arm | None = None,
    throws: int = 10,
    seed: int = 0,
    scene: Scene | str | Path | None = None,
    pixels: bool = True,
    raise_stopped: bool = False,
    record: Path | None = None,
) -> list[Trial]:
    """Throw default throws at an arm, and return the scored trials.

    The same throws, plant and noise as ``mitt catch --throws N --seed S``. One throw also loads all
    that a catcher with the same kind of map needs, which takes a tenth of a second in its first
    throw otherwise, and seconds where it has to be compiled: too long for an arm that moves.

    Args:
        f: What moves the arm: a map, which knows its arm, what :func:`mitt.learn` returned, or a
            generator.
        arm: The arm of a generator that is no map; otherwise that of the map.
        throws: Number of throws.
        seed: Seed of throws, plant and noise.
        scene: The world's settings, or the name or file of a scene; the scene of ``mitt catch`` if
            left out.
        pixels: Whether the catcher sees images; noisy points otherwise.
        raise_stopped: Whether a throw that is stopped raises instead of being one of the trials.
        record: Folder for a recording of each throw, to be replayed; none if left out. Only of
            maps: a replay makes its generator again.

    Raises:
        InputError: An argument is not what it should be.
        StoppedError: A throw was stopped; its data say by what.
    """
    generator, used = _moved_by(f, arm)
    throws = checks.whole("throws", throws, least=1)
    seed, pixels = checks.whole("seed", seed, least=0), checks.flag("pixels", pixels)
    raise_stopped = checks.flag("raise_stopped", raise_stopped)
    record = None if record is None else checks.path("record", record)
    scene = scene_from(scene)
    source = source_of(
        used, seed=seed, count=throws, drag=scene.ball.drag, spinning=scene.ball.spinning
    )
    runner = TrialRunner(used, generator, scene, pixels=pixels)
    if map_of(generator) is not None:
        load_decisions(used, generator, CatcherSettings())
        _load(runner)
    about = None if record is None else _about(runner, generator)
    trials = []
    for k in range(source.count):
        outcome = runner.throw(source, k, log=about is not None)
        trial = outcome.trial
        if record is not None and about is not None and outcome.log is not None:
            recording = recording_of(outcome.log, trial, about, {"seed": seed})
            write_recording(record / f"throw-{k:05d}.mcap", recording)
        if raise_stopped and trial.stopped_by is not None:
            raise StoppedError(k, reason_of(trial.stopped_by), trial.stopped_by)
        trials.append(trial)
    return trials


def _load(runner: TrialRunner) -> None:
    """Make some ticks as a loop in Python does; those of a trial are made in compiled code."""
    catcher, q, far = runner.catcher(), runner.arm.q_ready, np.array([3.0, 0.0, 1.0])
    for k in range(20):
        t = k * TICK
        ball = Sighting(t=t, found=True, r_o=far, covariance=1e-6 * np.eye(3))
        arm = ArmState(t=t, q=q, dq=np.zeros(len(q)))
        catcher.step(Senses(t=t, arm=arm, points=(ball,)))


def _moved_by(f: object, arm: Arm | None) -> tuple[Generator, Arm]:
    """Return the generator and the arm that it moves."""
    generator = generator_of(f, name="f")
    own = map_of(generator)
    if arm is not None:
        checks.instance("arm", arm, Arm)
    elif own is None:
        raise InputError("arm", "the arm of a generator that is no map", "none")
    used = own.arm if arm is None and own is not None else arm
    used = checks.instance("arm", used, Arm)
    return answering(generator, used.n), used


def _about(runner: TrialRunner, generator: Generator) -> About:
    """Return what makes the catcher of a recording again; InputError where nothing does."""
    names = {Direct: "single", Family: "direct", Unoptimised: "unoptimised"}
    f, name = map_of(generator), names.get(type(generator))
    if f is None or name is None:
        raise InputError("record", "nothing, where the generator is no map", "a folder")
    return runner.about(name, f)
