"""Studies of catching: what their files may say, and how their throws are run."""

import hashlib
import json
import threading
from collections.abc import Sequence
from dataclasses import asdict
from functools import lru_cache
from pathlib import Path
from typing import Annotated, Any, ClassVar, Final, Literal

import numpy as np
from pydantic import Field

from mitt.clock import Progress, Stopwatch
from mitt.core.arm.arm import Arm
from mitt.core.catcher.generators import Generator
from mitt.core.errors import InputError
from mitt.core.map.learn import Learned
from mitt.core.map.map_design import warnings_of
from mitt.core.map.neighbourhood import learn
from mitt.io.arm_file import ArmSpec, ThrowSettings
from mitt.io.csv_table import MAX_BYTES
from mitt.io.maps import map_from, save_map
from mitt.io.reading import read_bytes, read_json
from mitt.io.recordings import Recording
from mitt.io.schema import validated
from mitt.lab.trials.log import recording_of
from mitt.lab.trials.registry import available, check_generator, make_generator, origin_of
from mitt.lab.trials.runner import LoggedTrial, TrialRunner
from mitt.lab.trials.score import CATCH, STATE_AXES
from mitt.lab.trials.scored_task import Row, ScoredTask
from mitt.lab.trials.source import Source, source_of, widened
from mitt.lab.trials.study import Chunk, Condition, KeptFiles, Material, Study
from mitt.lab.trials.study_file import (
    ConditionSettings,
    Count,
    Spelled,
    StudySettings,
    Table,
    head_of,
    read_settings,
    spelled,
)
from mitt.lab.world.disturbances import Undisturbed
from mitt.lab.world.flights import builtin_flights, read_flights
from mitt.lab.world.overlap import check_scene
from mitt.lab.world.scene import DEFAULT_SCENE
from mitt.lab.world.throws import Throw

#: Arms with their maps, and generators, that a worker keeps.
_KEPT: Final = 16


class CatchConditionSettings(ConditionSettings):
    """One condition of a study of catching.

    Attributes:
        arm: Settings of arm and map, over those of the study.
        vision: What the catcher sees.
        flights: Recorded flights instead of throws: ``builtin`` or a CSV file.
        throws: Ranges of the default throws.
    """

    arm: Table = Field(default_factory=dict)
    vision: Literal["pixels", "points"] | None = None
    flights: str | None = None
    throws: ThrowSettings = ThrowSettings()


class CatchStudySettings(StudySettings):
    """The file of a study of catching.

    Attributes:
        task: Says that it is one.
        trials: Throws of each generator in each condition; in the file ``throws``.
        trials_of: Another number for some generators; in the file ``throws_of``.
        arm: Arm and map.
        vision: What the catcher sees.
        conditions: Conditions one by one.
        chunk: Throws of one piece of work.
        record: Most failures to record, of each generator in each condition.
    """

    task: Literal["catch"] = "catch"
    trials: Count = Field(100, alias="throws")
    trials_of: dict[str, Count] = Field(default_factory=dict, alias="throws_of")
    arm: ArmSpec = ArmSpec()
    vision: Literal["pixels", "points"] = "pixels"
    conditions: Annotated[tuple[CatchConditionSettings, ...], Field(strict=False)] = ()
    chunk: Annotated[int, Field(ge=1, le=1000)] = 25
    record: Annotated[int, Field(ge=0, le=100)] = 1


class CatchCondition(Condition):
    """One condition with everything in its place.

    Attributes:
        arm: Arm and map.
        vision: What the catcher sees.
        flights: Recorded flights instead of throws, a file's address or ``builtin``.
        throws: Ranges of the default throws.
    """

    arm: ArmSpec
    vision: Literal["pixels", "points"]
    flights: str | None = None
    throws: ThrowSettings = ThrowSettings()


class CatchStudy(Study):
    """A study of catching that can run."""

    kind: ClassVar[ScoredTask] = CATCH

    conditions: Annotated[tuple[CatchCondition, ...], Field(strict=False)]

    @property
    def setting(self) -> str:
        """What its page says of arms and vision, in words."""
        arms = {f"{c.arm.arm}, limits {c.arm.limits or 'default'}" for c in self.conditions}
        vision = ", ".join(sorted({c.vision for c in self.conditions}))
        return f"{'; '.join(sorted(arms))}, {vision}"

    def check(self) -> list[str]:
        """Refuse generators that do not load; return what is odd about the designs of maps."""
        for name in self.generators:
            check_generator(name)
        chosen = [spec.read() for spec in dict.fromkeys(c.arm for c in self.conditions)]
        return [words for x in chosen for words in warnings_of(x.arm, x.design)]

    def material(
        self, condition: CatchCondition, folder: KeptFiles, progress: Progress
    ) -> Material:
        """Return the map of an arm, learned once and kept in the folder, and recorded flights."""
        path = folder.map(condition.arm)
        if not path.exists():
            progress("learning", 0, 1)
            of = condition.arm.read(was=condition.arm_files)
            save_map(path, learn(of.arm, design=of.design), version=self.version)
            progress("learning", 1, 1)
        read_json(path)  # refuses a file that was altered into no JSON
        text = path.read_text(encoding="utf-8")
        if condition.flights is None:
            return Material(map=text)
        if condition.flights == "builtin":
            return Material(map=text, recordings=builtin_flights())
        return Material(map=text, recordings=read_flights(folder.flights(self, condition.flights)))

    def played(self, chunk: Chunk) -> tuple[list[dict[str, Any]], Stopwatch]:
        """Throw the balls of a chunk; return trials by their fields, and the times of the ticks."""
        runner, source, learned = runner_of(chunk)
        arm = learned.map.arm
        return [_thrown(runner, source, arm, k) for k in chunk.trials], runner.stopwatch

    def recorded(self, chunk: Chunk, index: int) -> Recording:
        """Throw a ball of a chunk once more and return its recording."""
        runner, source, learned = runner_of(chunk)
        outcome = runner.throw(source, index, log=True)
        if outcome.log is None:
            raise RuntimeError("a throw left no log")
        about = runner.about(chunk.player.name, learned.map)
        notes = {"condition": chunk.condition.model_dump_json(), "seed": self.seed}
        return recording_of(outcome.log, outcome.trial, about, dict(chunk.notes) | notes)

    def answer(self, rows: Sequence[Row]) -> list[str]:  # noqa: ARG002
        """Return nothing: it may have a thousand conditions, which the page counts instead."""
        return []


_ArmOfChunk = tuple[ArmSpec, tuple[tuple[str, str], ...], str, int]
"""Settings of an arm, digests of its files, its map, and the thread that throws."""


@lru_cache(maxsize=_KEPT)
def _learned(of: _ArmOfChunk) -> tuple[Learned, ThrowSettings | None]:
    """Return arm and map, and where its balls come from; held to what the study was made with.

    They are kept for the thread alone: an arm's scratch is not to be shared.
    """
    settings, files, text, _ = of
    found = settings.read(was=dict(files))
    return map_from(json.loads(text), found.arm, place="map of the study"), found.throws


@lru_cache(maxsize=_KEPT)
def _generator(name: str, origin: str, of: _ArmOfChunk) -> Generator:
    """Return a generator, kept as its map is: some learn or build much before they begin."""
    if origin and (here := origin_of(name)) != origin:
        raise InputError(f"generator {name!r}", f"that of the study, {origin}", here)
    return make_generator(name, _learned(of)[0].map)


def runner_of(chunk: Chunk) -> tuple[TrialRunner, Source, Learned]:
    """Return a fresh runner for a chunk, so that none depends on one before it.

    A generator is a value and may be shared; what a throw teaches it stays with that throw.
    """
    study, condition = chunk.study, chunk.condition
    files = tuple(condition.arm_files.items())
    of = condition.arm, files, chunk.material.map, threading.get_ident()
    origin = study.plugins.get(chunk.player.name, "")
    (learned, own), generator = _learned(of), _generator(chunk.player.name, origin, of)
    pixels = condition.vision == "pixels"
    runner = TrialRunner(learned.map.arm, generator, condition.scene, pixels=pixels)
    source = source_of(
        learned.map.arm,
        seed=study.seed,
        count=chunk.stop,
        recordings=chunk.material.recordings,
        drag=condition.scene.ball.drag,
        spinning=condition.scene.ball.spinning,
    )
    throws = condition.throws
    if throws == ThrowSettings():
        throws = own or throws
    return runner, widened(source, throws), learned


def throw_again(chunk: Chunk, index: int) -> tuple[LoggedTrial, Arm]:
    """Throw one ball of a chunk once more, with a log; it gives the same trial."""
    runner, source, learned = runner_of(chunk)
    return runner.throw(source, index, log=True), learned.map.arm


def _thrown(runner: TrialRunner, source: Source, arm: Arm, index: int) -> dict[str, Any]:
    """Throw one ball and return its trial by fields, with what the task adds."""
    ball, trial = source.ball(index), runner.throw(source, index).trial
    truth = runner.world.trace()
    power = np.abs(truth.tau * truth.dq).sum(axis=1)
    energy_j = float(np.sum(0.5 * (power[1:] + power[:-1]) * np.diff(truth.t)))
    release = np.concatenate((ball.r, ball.dr) if isinstance(ball, Throw) else ball.at(0.0))
    flight = Undisturbed(ball=ball, drag=source.drag, hand=arm.position(arm.q_ready))
    passing = np.concatenate(flight.at(flight.nearest()))
    row = asdict(trial) | {"energy_j": energy_j}
    for name, state in (("release", release), ("passing", passing)):
        row |= {f"{name}_{axis}": float(x) for axis, x in zip(STATE_AXES, state, strict=True)}
    return row


def read_catch_study(path: Path, *, generators: tuple[str, ...] | None = None) -> CatchStudy:
    """Read the file of a study of catching, or one that ships, by name.

    Args:
        path: The file, or the name of a study that ships.
        generators: Names that are available; all that there are if left out.

    Raises:
        FileError: The file cannot be read or is no TOML.
        InputError: A key is unknown or its value cannot be used.
        UnknownNameError: A generator is not available; InputError: one does not load.
    """
    known = available() if generators is None else generators
    path, settings = read_settings(path, CatchStudySettings, known)
    given = spelled(settings, CatchConditionSettings, path)
    conditions = _with_files([_condition(settings, x, path) for x in given])
    head = head_of(settings, path, conditions)
    names = dict.fromkeys(name for c in conditions for name in c.counts)
    return CatchStudy(
        **head,
        flights={
            c.flights: _digest(Path(c.flights))
            for c in conditions
            if c.flights is not None and c.flights != "builtin"
        },
        plugins={name: origin for name in names if (origin := origin_of(name))},
    )


def _digest(path: Path) -> str:
    """Return the SHA-256 of a file."""
    content = read_bytes(path, max_bytes=MAX_BYTES, wanted="a readable CSV file")
    return hashlib.sha256(content).hexdigest()


def _with_files(conditions: list[CatchCondition]) -> list[CatchCondition]:
    """Return conditions with the digests of what their arms are read from; each is read once."""
    chosen = {spec: spec.read() for spec in dict.fromkeys(c.arm for c in conditions)}
    for c in conditions:
        check_scene(chosen[c.arm].arm, c.scene)
    return [c.model_copy(update={"arm_files": chosen[c.arm].files}) for c in conditions]


def _condition(
    settings: CatchStudySettings, of: Spelled[CatchConditionSettings], path: Path
) -> CatchCondition:
    """Return a condition with the study's settings under its own."""
    given, flights = of.given, of.given.flights
    if flights is not None and flights != "builtin":
        flights = str((path.parent / flights).resolve())
    arm = settings.arm.model_dump() | given.arm
    return CatchCondition(
        **of.common,
        scene=of.world(DEFAULT_SCENE, flights=flights is not None),
        arm=validated(ArmSpec, arm, place=f"{of.place} arm"),
        vision=given.vision or settings.vision,
        flights=flights,
        throws=given.throws,
    )
