"""Trials of every kind to be recorded and replayed, by tests and by ``benchmarks/replays.py``."""

from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import Any

from mitt.core.catcher.generators import Generator, refining
from mitt.core.map.mapping import DirectMap
from mitt.core.map.neighbourhood import learn
from mitt.io.load import build_arm
from mitt.io.recordings import Recorded, write_recording
from mitt.lab.trials.log import recording_of
from mitt.lab.trials.registry import make_generator
from mitt.lab.trials.replayed import Replayed, replay
from mitt.lab.trials.runner import TrialRunner
from mitt.lab.trials.source import source_of
from mitt.lab.world.scene import read_scene


@dataclass(frozen=True, slots=True, kw_only=True)
class Case:
    """A kind of trial: how it sees, what moves it, what goes wrong."""

    name: str
    vision: str = "points"
    images: bool = False
    generator: str = "single"
    limits: str = "paper"
    scene: str = "lab"
    changes: dict[str, Any] = field(default_factory=dict)


def _faults(*faults: dict[str, Any]) -> dict[str, Any]:
    return {"faults": list(faults)}


CASES = (
    Case(name="points"),
    Case(name="behind the eyes", vision="pixels"),
    Case(name="images", vision="pixels", images=True),
    Case(name="rough", vision="pixels", scene="rough"),
    Case(name="wam-48v, 0.5 kg", limits="wam-48v", changes={"ball": {"mass": 0.5}}),
    Case(
        name="kicked",
        vision="pixels",
        generator="direct",
        changes=_faults({"kind": "kick", "magnitude": 2.0}),
    ),
    Case(name="unoptimised", generator="unoptimised"),
    Case(name="refined in flight", generator="refine"),
    Case(name="ik", generator="ik"),
    Case(name="quintic", generator="quintic", vision="pixels"),
    Case(name="ruckig", generator="ruckig"),
    Case(name="mpc", generator="mpc"),
    Case(name="turning cameras", vision="pixels", changes={"sensing": {"cameras": "active"}}),
    Case(
        name="turning cameras, images",
        vision="pixels",
        images=True,
        changes={"sensing": {"cameras": "active"}},
    ),
    Case(
        name="outliers, half lost",
        vision="pixels",
        changes=_faults(
            {"kind": "outlier", "magnitude": 0.3, "chance": 0.1},
            {"kind": "dropout", "magnitude": 0.5},
        ),
    ),
    Case(
        name="frozen, one late, images",
        vision="pixels",
        images=True,
        changes=_faults(
            {"kind": "frozen", "numbered": True, "start": 0.1, "length": 0.1, "camera": 0},
            {"kind": "late", "magnitude": 0.005, "chance": 0.3},
        ),
    ),
    Case(
        name="late, doubled points",
        changes=_faults(
            {"kind": "late", "magnitude": 0.005, "chance": 0.5},
            {"kind": "duplicate", "magnitude": 0.2},
        ),
    ),
    Case(
        name="stamps 40 ms late",
        changes=_faults({"kind": "latency", "magnitude": 0.04, "stamped": False}),
    ),
    Case(
        name="NaN",
        changes=_faults(
            {"kind": "nan", "where": "points", "magnitude": 0.1},
            {"kind": "nan", "where": "stamps", "magnitude": 0.1},
            {"kind": "nan", "where": "encoders", "magnitude": 0.02},
        ),
    ),
    Case(
        name="clock set back",
        changes=_faults({"kind": "clock", "clock": "tick", "magnitude": -5.0, "start": 0.2}),
    ),
    Case(
        name="camera clock set forward",
        vision="pixels",
        changes=_faults({"kind": "clock", "clock": "camera", "magnitude": 3.0, "start": 0.2}),
    ),
    Case(
        name="encoder stuck",
        changes=_faults({"kind": "encoder", "fault": "stuck", "joint": 1, "start": 0.3}),
    ),
    Case(
        name="encoder silent",
        vision="pixels",
        changes=_faults({"kind": "encoder", "fault": "dropout", "joint": 2, "start": 0.25}),
    ),
    Case(
        name="blind from 0.2 s", vision="pixels", changes=_faults({"kind": "dropout", "start": 0.2})
    ),
    Case(name="carried, then thrown", changes=_faults({"kind": "carried"})),
    Case(
        name="weak motors, payload",
        changes=_faults(
            {"kind": "torque", "magnitude": 0.4}, {"kind": "payload", "magnitude": 2.0}
        ),
    ),
)
"""Kinds of trials; eight throws of each make 208."""


@lru_cache(maxsize=4)
def map_for(limits: str) -> DirectMap:
    """Return the map of the WAM for a limit set."""
    return learn(build_arm("wam", limits=limits)).map


@lru_cache(maxsize=16)
def _generator(name: str, limits: str) -> Generator:
    f = map_for(limits)
    return refining(f) if name == "refine" else make_generator(name, f)


def recorded(case: Case, folder: Path, *, throws: int, seed: int) -> Iterator[tuple[str, Path]]:
    """Throw, record, and yield status and file of each throw."""
    changes = case.changes
    scene = read_scene(case.scene)
    merged = scene.model_dump()
    for key, value in changes.items():
        merged[key] = {**merged[key], **value} if isinstance(value, dict) else value
    scene = type(scene).model_validate(merged)
    f, generator = map_for(case.limits), _generator(case.generator, case.limits)
    runner = TrialRunner(f.arm, generator, scene, pixels=case.vision == "pixels")
    source = source_of(f.arm, seed=seed, count=throws, drag=scene.ball.drag)
    about = runner.about("single" if case.generator == "refine" else case.generator, f)
    for k in range(throws):
        outcome = runner.throw(source, k, log=True, images=case.images)
        assert outcome.log is not None
        path = folder / f"{case.name.replace(' ', '-')}-{seed}-{k}.mcap"
        write_recording(path, recording_of(outcome.log, outcome.trial, about))
        yield outcome.trial.status, path


def replayed(path: Path) -> Replayed:
    """Replay a file."""
    return replay(Recorded(path))
