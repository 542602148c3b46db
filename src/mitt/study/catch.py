"""A run of throws as ``mitt catch`` makes it: prepare, throw, write."""

from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import Any, final

import mitt
from mitt.errors import InputError
from mitt.generator.design import MapDesign, default_design, tangent_of
from mitt.generator.generators import Generator, refining
from mitt.generator.learn import Learned
from mitt.generator.mapping import unlearned
from mitt.interrupts import notice, status_of
from mitt.link.clock import Stopwatch
from mitt.link.files import check_folder
from mitt.link.maps import read_map
from mitt.link.realtime import settled
from mitt.options import ArmOptions, CatchOptions
from mitt.robot.arm import Arm
from mitt.robot.hands import HandModel
from mitt.robot.load import load_arm
from mitt.robot.shapes import Surroundings
from mitt.study.lesson import learn
from mitt.study.neighbourhood import neighbourhood_of_ball
from mitt.study.registry import check_name, make_generator
from mitt.study.result import result
from mitt.study.score import Trial
from mitt.study.source import Source, source_of
from mitt.study.trial import Bench, Outcome
from mitt.world.scene import Scene
from mitt.world.scenes import DEFAULT, changed, read_scene

#: Most throws in one run; more belong into a study.
_MOST_THROWS = 100_000
#: Index of the throw that is run once before the others, so that compiling is not measured.
_WARM_UP = 2**31


def arm_of(options: ArmOptions) -> Arm:
    """Return the arm that the options name, a hand mounted at its tip."""
    names = None if options.joints is None else [x.strip() for x in options.joints.split(",")]
    return load_arm(
        options.arm, tip=options.tip, joints=names, limits=options.limits, hand=HandModel()
    )


def design_of(options: ArmOptions, arm: Arm) -> MapDesign:
    """Return the map design that the options name; what they leave out follows from the arm."""
    design = default_design(
        arm,
        catch_joint=options.catch_joint,
        q_catch=options.q_catch,
        kappa=options.kappa,
        inward=options.inward,
        order=options.order,
    )
    tangent_of(arm, design)  # refuses angles and ratios that cannot be, before anything is run
    return design


def _refuse_design(job: CatchOptions) -> None:
    """Refuse options of the design beside a map, which has its own."""
    stated = {"--catch-joint": job.catch_joint, "--q-catch": job.q_catch, "--kappa": job.kappa,
              "--inward": job.inward, "--order": job.order}  # fmt: skip
    given = [name for name, value in stated.items() if value is not None]
    if given:
        raise InputError("--map", "no option that the map itself decides", " and ".join(given))


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Prepared:
    """A run that can start: every input read and found good."""

    job: CatchOptions
    arm: Arm
    scene: Scene
    source: Source
    learned: Learned | None
    out: Path

    @property
    def head(self) -> dict[str, object]:
        """What the result says of the run; the scene, and in what it was changed."""
        settings = changed(self.scene)
        return {
            "version": mitt.__version__,
            "arm": self.arm.model.name,
            "limits": self.arm.limits.name,
            "generator": self.job.generator,
            "vision": self.job.vision,
            "seed": self.job.seed,
            **({"adapt": self.job.adapt} if self.job.adapt != "projection" else {}),
            "scene": self.scene.base,
            **({"scene_changed": settings} if settings else {}),
        }


def prepare(job: CatchOptions) -> Prepared:
    """Read and check all that a run needs, without learning or writing anything.

    Raises:
        MittError: An input cannot be used.
    """
    check_name(job.generator)
    if job.adapt == "refine" and job.generator != "direct":
        raise InputError("--adapt refine", "--generator direct", job.generator)
    if job.throws is not None and not 1 <= job.throws <= _MOST_THROWS:
        raise InputError("--throws", f"a number in 1..{_MOST_THROWS}", job.throws)
    if not 0 <= job.seed < 2**63:
        raise InputError("--seed", "a number from 0 to 2^63 - 1", job.seed)
    if job.throws_file is not None and job.flights is not None:
        raise InputError("--throws-file and --flights", "one of them", "both")
    arm = arm_of(job)
    scene = read_scene(job.scene or DEFAULT, flights=job.flights is not None)
    if job.cameras is not None:
        sensing = scene.sensing.model_copy(update={"cameras": job.cameras})
        scene = scene.model_copy(update={"sensing": sensing})
    if job.map is not None:
        _refuse_design(job)
    learned = None if job.map is None else read_map(job.map, arm)
    f = unlearned(arm, design_of(job, arm)) if learned is None else learned.map
    source = source_of(
        f,
        seed=job.seed,
        count=job.throws,
        throws_file=job.throws_file,
        flights_file=job.flights,
        drag=scene.ball.drag,
    )
    out = job.out or Path("runs") / f"{job.seed}-{job.generator}"
    check_folder(out, overwrite=job.overwrite)
    return Prepared(job=job, arm=arm, scene=scene, source=source, learned=learned, out=out)


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Finished:
    """A run that is over, by itself or because it was interrupted."""

    prepared: Prepared
    learned: Learned
    trials: list[Trial]
    stopwatch: Stopwatch
    interrupt: int | None

    @property
    def status(self) -> int:
        """Exit status of the command."""
        return 0 if self.interrupt is None else self.interrupt

    @property
    def result(self) -> dict[str, Any]:
        """The result as the contract writes it."""
        return result(self.trials, self.stopwatch, self.prepared.head, self.prepared.source.count)


def make_bench(prepared: Prepared, learned: Learned, *, generator: str) -> Bench:
    """Return the bench of a run, for a generator by name."""
    if prepared.job.adapt == "refine" and generator == "direct":
        around = Surroundings(floor=prepared.scene.floor)
        return bench_for(prepared, refining(learned.map, around))
    return bench_for(prepared, make_generator(generator, learned.map))


def bench_for(prepared: Prepared, generator: Generator) -> Bench:
    """Return the bench of a run, for any generator."""
    pixels = prepared.job.vision == "pixels"
    return Bench(prepared.arm, generator, prepared.scene, pixels=pixels)


def run(
    prepared: Prepared,
    *,
    progress: Callable[[str, int, int], None],
    keeping: Callable[[Learned], AbstractContextManager[Callable[[Trial], None]]] | None = None,
) -> Finished:
    """Learn if no map was given, and throw; an interrupt ends the run and keeps what is done.

    Args:
        prepared: The run.
        progress: Is told what is being done, how many are done, and of how many.
        keeping: Is called when the first ball is about to be thrown, and gives what keeps each
            throw that has ended.
    """
    job, count = prepared.job, prepared.source.count
    progress("learning", 0, 1)
    learned = prepared.learned or learn(
        prepared.arm,
        design=design_of(job, prepared.arm),
        around=neighbourhood_of_ball(prepared.scene.ball.drag),
    )
    progress("learning", 1, 1)
    bench = make_bench(prepared, learned, generator=job.generator)
    bench.run(-1, prepared.source.ball(_WARM_UP), seed=0)
    bench.stopwatch.clear()
    trials: list[Trial] = []
    interrupt = None
    try:
        with settled(), nullcontext(_forget) if keeping is None else keeping(learned) as keep:
            for index in range(count):
                progress("throwing", index, count)
                trial = one_throw(bench, prepared, index).trial
                keep(trial)
                trials.append(trial)
        progress("throwing", count, count)
    except KeyboardInterrupt as stop:
        notice()
        interrupt = status_of(stop)
    return Finished(
        prepared=prepared,
        learned=learned,
        trials=trials,
        stopwatch=bench.stopwatch,
        interrupt=interrupt,
    )


def _forget(trial: Trial) -> None:
    """Keep nothing."""


def one_throw(bench: Bench, prepared: Prepared, index: int, *, log: bool = False) -> Outcome:
    """Throw one ball of a run; run again, it gives the same trial."""
    source = prepared.source
    return bench.run(index, source.ball(index), seed=source.trial_seed(index), log=log)
