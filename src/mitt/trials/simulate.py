"""Throws in the simulated world from Python."""

from pathlib import Path

from mitt import checks
from mitt.errors import InputError, StoppedError
from mitt.files.recording import write_recording
from mitt.generator.generators import Direct
from mitt.generator.learn import Learned
from mitt.generator.mapping import DirectMap
from mitt.trials.recording import recording_of
from mitt.trials.runner import TrialRunner
from mitt.trials.score import Trial, reason_of
from mitt.trials.source import source_of
from mitt.world.scene import Scene
from mitt.world.scenes import DEFAULT, read_scene


def simulate(
    f: DirectMap | Learned,
    *,
    throws: int = 10,
    seed: int = 0,
    scene: Scene | str | None = None,
    pixels: bool = True,
    raise_stopped: bool = False,
    record: Path | None = None,
) -> list[Trial]:
    """Throw default throws at an arm that uses a learned map, and return the scored trials.

    The same throws, plant and noise as ``mitt catch --throws N --seed S``.

    Args:
        f: The map, which knows its arm, or what :func:`mitt.learn` returned.
        throws: Number of throws.
        seed: Seed of throws, plant and noise.
        scene: The world's settings, or the name or file of a scene; the scene of ``mitt catch`` if
            left out.
        pixels: Whether the catcher sees images; noisy points otherwise.
        raise_stopped: Whether a throw that is stopped raises instead of being one of the trials.
        record: Folder for a recording of each throw, to be replayed; none if left out.

    Raises:
        StoppedError: A throw was stopped; its data say by what.
    """
    f = checks.instance("f", f.map if isinstance(f, Learned) else f, DirectMap)
    throws = checks.whole("throws", throws, least=1)
    seed, pixels = checks.whole("seed", seed, least=0), checks.flag("pixels", pixels)
    if scene is not None and not isinstance(scene, Scene | str):
        raise InputError("scene", "a Scene, or the name or file of one", checks.shown(scene))
    scene = scene if isinstance(scene, Scene) else read_scene(scene or DEFAULT)
    source = source_of(f, seed=seed, count=throws, drag=scene.ball.drag)
    runner = TrialRunner(f.arm, Direct(f), scene, pixels=pixels)
    about, trials = runner.about("direct", f), []
    for k in range(source.count):
        outcome = runner.throw(source, k, log=record is not None)
        trial = outcome.trial
        if record is not None and outcome.log is not None:
            recording = recording_of(outcome.log, trial, about, {"seed": seed})
            write_recording(record / f"throw-{k:05d}.mcap", recording)
        if raise_stopped and trial.stopped_by is not None:
            raise StoppedError(k, reason_of(trial.stopped_by), trial.stopped_by)
        trials.append(trial)
    return trials
