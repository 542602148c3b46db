"""A run of throws as ``mitt catch`` makes it: learn, throw, keep."""

from collections.abc import Callable, Mapping
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Literal, final

import mitt
from mitt.errors import FileError
from mitt.files.arm_file import is_arm_file, read_arm_file
from mitt.files.arms import load_arm
from mitt.files.throws import ThrowSettings
from mitt.generator.design import MapDesign, default_design, tangent_of
from mitt.generator.generators import Generator, refining
from mitt.generator.learn import Learned
from mitt.interrupts import notice, status_of
from mitt.link.clock import Stopwatch, settled
from mitt.reading import difference, noted
from mitt.robot.arm import Arm
from mitt.robot.hands import HandModel
from mitt.trials.choice import ArmChoice
from mitt.trials.learning import learn
from mitt.trials.neighbourhood import neighbourhood_of_ball
from mitt.trials.registry import make_generator
from mitt.trials.result import result
from mitt.trials.runner import TrialRunner
from mitt.trials.score import Trial
from mitt.trials.source import Source
from mitt.trials.warm import warming
from mitt.vision.calibration.caught import ClockOffset, LearnedClock, caught_offset
from mitt.world.scene import Scene
from mitt.world.scenes import changed

#: Index of the throw that is run once before the others, so that compiling is not measured.
_WARM_UP = 2**31


def arm_of(choice: ArmChoice) -> Arm:
    """Return the arm that is chosen; with a hand at its tip, unless an arm file says otherwise."""
    names = None if choice.joints is None else [x.strip() for x in choice.joints.split(",")]
    hand = None if is_arm_file(choice.arm) else HandModel()
    return load_arm(choice.arm, tip=choice.tip, joints=names, limits=choice.limits, hand=hand)


def design_of(choice: ArmChoice, arm: Arm) -> MapDesign:
    """Return the map design that is chosen.

    What is left out is that of the arm file, if the arm comes from one that has a design, or else
    follows from the arm.
    """
    base = read_arm_file(Path(choice.arm)).map if is_arm_file(choice.arm) else None
    design = default_design(
        arm,
        base=base,
        catch_joint=choice.catch_joint,
        q_catch=choice.q_catch,
        kappa=choice.kappa,
        inward=choice.inward,
        order=choice.order,
    )
    tangent_of(arm, design)  # refuses angles and ratios that cannot be, before anything is run
    return design


def throws_of(choice: ArmChoice) -> ThrowSettings | None:
    """Return where the arm file wants balls to come from; None where it says nothing."""
    return read_arm_file(Path(choice.arm)).throws if is_arm_file(choice.arm) else None


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class ChosenArm:
    """An arm with all that its files say, read at one time.

    Attributes:
        arm: The arm.
        design: Design of its map.
        throws: Where balls are to come from; None where no file says so.
        files: Digests of what was read, by name, in the order of reading.
    """

    arm: Arm
    design: MapDesign
    throws: ThrowSettings | None
    files: dict[str, str]


def chosen_arm(choice: ArmChoice, *, wanted: Mapping[str, str] | None = None) -> ChosenArm:
    """Return the arm that is chosen, and what it was read from.

    Args:
        choice: The choice.
        wanted: Digests of the files as they were; as they are if left out.

    Raises:
        FileError: A file holds something else than it did.
    """
    with noted() as files:
        arm = arm_of(choice)
        found = ChosenArm(arm=arm, design=design_of(choice, arm), throws=throws_of(choice),
                          files=files)  # fmt: skip
    if wanted is not None and (name := difference(wanted, files)):
        raise FileError(name, "the file that the study was made with", "another content",
                        do="put it back, or begin the study anew")  # fmt: skip
    return found


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class RunSettings:
    """How a run throws, and what it leaves.

    Attributes:
        generator: Name of the generator.
        adapt: How the direct map is adapted to a throw: once before moving, by ``projection``, or
            refined for that throw besides (``refine``).
        vision: What the catcher sees: ``pixels`` of two cameras, or noisy ``points``.
        seed: Seed of throws, plant and noise.
        record: Which throws to record besides the first: ``none`` at all, ``failures`` or ``all``.
        record_images: Whether recordings keep the images.
        overwrite: Use a folder that has files in it.
        learn_clock: Whether the eyes' clock is learned from catch to catch and corrected.
    """

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
        changes, of = changed(self.scene), self.settings
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


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class FinishedRun:
    """A run that is over, by itself or because it was interrupted."""

    prepared: Prepared
    learned: Learned
    trials: list[Trial]
    stopwatch: Stopwatch
    interrupt: int | None
    clock: LearnedClock | None = None

    @property
    def status(self) -> int:
        """Exit status of the command."""
        return 0 if self.interrupt is None else self.interrupt

    @property
    def result(self) -> dict[str, Any]:
        """The result as the contract writes it."""
        head = self.prepared.head | ({} if self.clock is None else {"clock": self.clock.figures})
        return result(self.trials, self.stopwatch, head, self.prepared.source.count)


def make_runner(prepared: Prepared, learned: Learned, *, generator: str) -> TrialRunner:
    """Return the runner of a run, for a generator by name."""
    if prepared.settings.adapt == "refine" and generator == "direct":
        return runner_for(prepared, refining(learned.map))
    return runner_for(prepared, make_generator(generator, learned.map))


def runner_for(prepared: Prepared, generator: Generator) -> TrialRunner:
    """Return the runner of a run, for any generator."""
    pixels = prepared.settings.vision == "pixels"
    return TrialRunner(prepared.arm, generator, prepared.scene, pixels=pixels)


def run(
    prepared: Prepared,
    *,
    progress: Callable[[str, int, int], None],
    keeping: Callable[[Learned], AbstractContextManager[Callable[[Trial], None]]] | None = None,
) -> FinishedRun:
    """Learn if no map was given, and throw; an interrupt ends the run and keeps what is done.

    Args:
        prepared: The run.
        progress: Is told what is being done, how many are done, and of how many.
        keeping: Is called when the first ball is about to be thrown, and gives what keeps each
            throw that has ended.
    """
    count = prepared.source.count
    ball, pixels = prepared.source.ball(_WARM_UP), prepared.settings.vision == "pixels"
    parts = prepared.arm, prepared.design, prepared.scene, ball
    with warming(*parts, pixels=pixels, progress=progress):
        progress("learning", 0, 1)
        learned = prepared.learned or learn(
            prepared.arm,
            design=prepared.design,
            around=neighbourhood_of_ball(prepared.scene.ball.drag),
        )
        progress("learning", 1, 1)
    runner = make_runner(prepared, learned, generator=prepared.settings.generator)
    runner.run(-1, ball, seed=0)
    runner.stopwatch.clear()
    clock = LearnedClock() if prepared.settings.learn_clock else None
    trials: list[Trial] = []
    interrupt = None
    try:
        with settled(), keeping(learned) if keeping else nullcontext(lambda _: None) as keep:
            for index in range(count):
                progress("throwing", index, count)
                trial = _thrown(runner, prepared.source, index, clock)
                keep(trial)
                trials.append(trial)
        progress("throwing", count, count)
    except KeyboardInterrupt as stop:
        notice()
        interrupt = status_of(stop)
    return FinishedRun(
        prepared=prepared,
        learned=learned,
        trials=trials,
        stopwatch=runner.stopwatch,
        interrupt=interrupt,
        clock=clock,
    )


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
    return replace(trial, clock={
        "offset_s": used, "found_s": used + found.offset if known else None,
        "sigma_s": found.sigma if known else None, "unknown": found.unknown or None,
    })  # fmt: skip
