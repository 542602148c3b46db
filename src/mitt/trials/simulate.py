"""Throws in the simulated world from Python."""

from pathlib import Path

import numpy as np

from mitt import checks
from mitt.catcher.loading import load_decisions
from mitt.catcher.settings import CatcherSettings
from mitt.errors import InputError, StoppedError
from mitt.files.about import About
from mitt.files.recording import write_recording
from mitt.generator.answers import answering
from mitt.generator.generators import Direct, Generator, Unoptimised, generator_of, map_of
from mitt.generator.learn import Learned
from mitt.generator.mapping import DirectMap
from mitt.generator.several import Several
from mitt.robot.arm import Arm
from mitt.signals import TICK, ArmState, Senses, Sighting
from mitt.trials.recording import recording_of
from mitt.trials.runner import TrialRunner
from mitt.trials.score import Trial, reason_of
from mitt.trials.source import source_of
from mitt.world.scene import Scene
from mitt.world.scenes import scene_from

#: Ticks that load what ticks need, and where the ball is seen in them [m].
_TICKS, _FAR = 20, np.array([3.0, 0.0, 1.0])


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
    source = source_of(used, seed=seed, count=throws, drag=scene.ball.drag)
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
    catcher, q = runner.catcher(), runner.arm.q_ready
    for k in range(_TICKS):
        t = k * TICK
        ball = Sighting(t=t, found=True, r_o=_FAR, covariance=1e-6 * np.eye(3))
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
    names = {Direct: "direct", Several: "several", Unoptimised: "unoptimised"}
    f, name = map_of(generator), names.get(type(generator))
    if f is None or name is None:
        raise InputError("record", "nothing, where the generator is no map", "a folder")
    return runner.about(name, f)
