"""What a worker does: throw one chunk, or one ball once more to record it.

A worker gets everything it needs in its job and gives back bytes, so that it need not see the
folder of the study. A chunk is the same whoever throws it and whatever was thrown before.
"""

import hashlib
import json
import threading
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from mitt.errors import InputError, MittError
from mitt.files.maps import map_of
from mitt.files.recording import write_recording
from mitt.files.throws import ThrowSettings
from mitt.generator.generators import Generator
from mitt.generator.learn import Learned
from mitt.link.clock import Stopwatch
from mitt.robot.arm import Arm
from mitt.signals import Array
from mitt.sweep.parts import Row, row_of, write_rows
from mitt.sweep.study import ArmSettings, Condition
from mitt.trials.recording import recording_of
from mitt.trials.registry import make_generator, origin_of
from mitt.trials.run import chosen_arm
from mitt.trials.runner import LoggedTrial, TrialRunner
from mitt.trials.source import Source, source_of, widened
from mitt.world.faults.flight import Undisturbed
from mitt.world.flights import BallPath, Recording
from mitt.world.throws import Throw

#: Arms with their maps, and generators, that a worker keeps.
_KEPT = 16


@dataclass(frozen=True, slots=True, kw_only=True)
class Job:
    """A chunk of one generator in one condition.

    Attributes:
        number: Number of the chunk in the study.
        generator: Name of the generator.
        condition: The condition.
        seed: Seed of the study.
        start: First throw.
        stop: Throw after the last.
        map: The learned map as its file says it.
        recordings: Recorded flights to throw; none for default throws.
        notes: What the metadata of a part say of the study.
        origin: Package and digest of the generator, where another package adds it.
    """

    number: int
    generator: str
    condition: Condition
    seed: int
    start: int
    stop: int
    map: str
    recordings: tuple[Recording, ...]
    notes: tuple[tuple[str, str], ...]
    origin: str = ""

    @property
    def map_digest(self) -> str:
        """SHA-256 of the map."""
        return hashlib.sha256(self.map.encode()).hexdigest()


_ArmOfJob = tuple[ArmSettings, tuple[tuple[str, str], ...], str, int]
"""Settings of an arm, digests of its files, its map, and the thread that throws."""


@lru_cache(maxsize=_KEPT)
def _learned(of: _ArmOfJob) -> tuple[Learned, ThrowSettings | None]:
    """Return arm and map, and where its balls come from; held to what the study was made with.

    They are kept for the thread alone: an arm's scratch is not to be shared.
    """
    settings, files, text, _ = of
    found = chosen_arm(settings, wanted=dict(files))
    return map_of(json.loads(text), found.arm, place="map of the study"), found.throws


@lru_cache(maxsize=_KEPT)
def _generator(name: str, origin: str, of: _ArmOfJob) -> Generator:
    """Return a generator, kept as its map is: some learn or build much before they begin."""
    if origin and (here := origin_of(name)) != origin:
        raise InputError(f"generator {name!r}", f"that of the study, {origin}", here)
    return make_generator(name, _learned(of)[0].map)


def runner_of(job: Job) -> tuple[TrialRunner, Source, Learned]:
    """Return a fresh runner for a job, so that no chunk depends on one before it.

    A generator is a value and may be shared; what a throw teaches it stays with that throw.
    """
    files = tuple(job.condition.arm_files.items())
    of = job.condition.arm, files, job.map, threading.get_ident()
    (learned, own), generator = _learned(of), _generator(job.generator, job.origin, of)
    pixels = job.condition.vision == "pixels"
    runner = TrialRunner(learned.map.arm, generator, job.condition.scene, pixels=pixels)
    source = source_of(
        learned.map.arm,
        seed=job.seed,
        count=job.stop,
        recordings=job.recordings,
        drag=job.condition.scene.ball.drag,
    )
    throws = job.condition.throws
    if throws == ThrowSettings():
        throws = own or throws
    return runner, widened(source, throws), learned


class ChunkError(MittError):
    """What a chunk cannot be thrown for; one text, so that it comes back from any worker."""


def throw_chunk(job: Job) -> bytes:
    """Throw the balls of a chunk and return its part of the table.

    Raises:
        ChunkError: What the job asks for cannot be.
    """
    try:
        return _thrown(job)
    except MittError as error:
        raise ChunkError(str(error)) from None


def _thrown(job: Job) -> bytes:
    """Throw the balls of a chunk and return its part of the table."""
    watch = Stopwatch()
    with watch:
        runner, source, learned = runner_of(job)
        rows = [_row(job, runner, source, learned.map.arm, k) for k in range(job.start, job.stop)]
    timing = runner.stopwatch.percentiles_us() | {"seconds": 1e-6 * watch.percentiles_us()["max"]}
    timing["deadline_misses"] = float(runner.stopwatch.misses())
    notes = {"condition": job.condition.model_dump_json(), "timing": json.dumps(timing),
             "map": job.map_digest}  # fmt: skip
    return write_rows(rows, dict(job.notes) | notes)


def throw_again(job: Job, index: int) -> tuple[LoggedTrial, Arm]:
    """Throw one ball of a chunk once more, with a log; it gives the same trial."""
    runner, source, learned = runner_of(job)
    return runner.throw(source, index, log=True), learned.map.arm


def record_throw(task: tuple[Job, int]) -> bytes:
    """Return the recording of one throw of a chunk, by its index."""
    job, index = task
    runner, source, learned = runner_of(job)
    outcome = runner.throw(source, index, log=True)
    if outcome.log is None:
        raise RuntimeError("a throw left no log")
    about = runner.about(job.generator, learned.map)
    notes = dict(job.notes) | {"condition": job.condition.model_dump_json(), "seed": job.seed}
    with TemporaryDirectory() as folder:
        path = Path(folder) / "throw.mcap"
        write_recording(path, recording_of(outcome.log, outcome.trial, about, notes))
        return path.read_bytes()


def _row(job: Job, runner: TrialRunner, source: Source, arm: Arm, index: int) -> Row:
    """Throw one ball and return its row."""
    ball, trial = source.ball(index), runner.throw(source, index).trial
    truth = runner.world.trace()
    power = np.abs(truth.tau * truth.dq).sum(axis=1)
    energy_j = float(np.sum(0.5 * (power[1:] + power[:-1]) * np.diff(truth.t)))
    release, passing = _release(ball), _passing(ball, arm, source.drag)
    return row_of(job.generator, job.condition.name, trial, energy_j, release, passing)


def _release(ball: Throw | BallPath) -> Array:
    """Return position [m] and velocity [m/s] at release, shape (6,)."""
    return np.concatenate((ball.r, ball.dr) if isinstance(ball, Throw) else ball.at(0.0))


def _passing(ball: Throw | BallPath, arm: Arm, drag: float) -> Array:
    """Return where the undisturbed ball is nearest to the waiting hand [m, m/s], shape (6,)."""
    flight = Undisturbed(ball=ball, drag=drag, hand=arm.position(arm.q_ready))
    return np.concatenate(flight.at(flight.nearest()))
