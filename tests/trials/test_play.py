"""The compiled loop and the way through Python are the same trial, byte for byte."""

from collections.abc import Sequence

import numpy as np
import pytest
from support import thorough

from mitt.core.arm.arm import Arm
from mitt.core.catcher.catcher import Catcher
from mitt.core.catcher.family import Family
from mitt.core.catcher.generators import Direct, Generator
from mitt.core.catcher.settings import BRAKE, FOLLOW, REFUSED, STOPPED, WATCH
from mitt.core.map.learn import Learned
from mitt.core.map.map_design import MapDesign
from mitt.core.map.neighbourhood import Neighbourhood, learn
from mitt.core.signals import TICK
from mitt.lab.trials.log import TrialLog
from mitt.lab.trials.runner import LoggedTrial, TrialRunner
from mitt.lab.trials.source import source_of
from mitt.lab.world.flights import BallPath, builtin_flights
from mitt.lab.world.imaging import BLOCK
from mitt.lab.world.motion import WATCHED
from mitt.lab.world.scene import Scene, Sensing, named_scene, scene_of
from mitt.lab.world.simulation import World
from mitt.lab.world.throws import Throw

#: Time in which the pieces of a verdict are worked out [s].
WORKED_OUT = 0.008
#: Flies past the arm, out of its reach, and is up for longer than a block of frames.
ASIDE = Throw(r=np.array([3.0, 0.5, 0.5]), dr=np.array([-4.0, 3.0, 3.0]))


def throws(learned: Learned, count: int) -> list[Throw]:
    """Return default throws, which fly for longer than a block of frames."""
    source = source_of(learned.map.arm, seed=77, count=count, drag=0.04)
    return [ball for k in range(count) if isinstance(ball := source.ball(k), Throw)]


def through_both(
    runner: TrialRunner, balls: Sequence[Throw | BallPath], monkeypatch: pytest.MonkeyPatch
) -> list[TrialLog]:
    """Throw all balls both ways, compare score, ticks and true states, and return the logs.

    The same runner again, so that nothing may be left over from a trial before.
    """
    compiled = _all(runner, balls)
    with monkeypatch.context() as patch:
        patch.setattr(World, "stage", property(lambda _: None))
        python = _all(runner, balls)
    for mine, theirs in zip(compiled, python, strict=True):
        assert mine.trial == theirs.trial
        _same(_log(mine), _log(theirs))
    assert runner.stopwatch.percentiles_us()["p50"] > 0.0
    return [_log(x) for x in compiled]


def _all(runner: TrialRunner, balls: Sequence[Throw | BallPath]) -> list[LoggedTrial]:
    """Throw all balls."""
    return [runner.run(k, ball, seed=300 + k, log=True) for k, ball in enumerate(balls)]


def _log(outcome: LoggedTrial) -> TrialLog:
    """Return the log, which is there."""
    assert outcome.log is not None
    return outcome.log


def _same(mine: TrialLog, theirs: TrialLog) -> None:
    """Compare two logs to the last bit."""
    for name in ("t", "phase", "encoders", "ball", "desired", "command", "tau", "hand"):
        assert getattr(mine, name).tobytes() == getattr(theirs, name).tobytes(), name
    for name in ("t", "qpos", "qvel", "tau", "position", "velocity", "force", "seen"):
        a, b = getattr(mine.truth, name), getattr(theirs.truth, name)
        assert np.array_equal(a, b), name


@pytest.mark.parametrize("latency", thorough([1], [0, 3]))
@pytest.mark.parametrize("pixels", [True, False])
def test_both_ways_through_a_trial_are_the_same(
    arm: Arm, learned: Learned, latency: int, pixels: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Images or points, late or not, and beyond the end of a block of their noise."""
    scene = Scene(sensing=Sensing(latency=latency))
    runner = TrialRunner(arm, Direct(learned.map), scene, pixels=pixels)
    logs = through_both(runner, throws(learned, 2), monkeypatch)
    for log in logs:
        assert {WATCH, FOLLOW, BRAKE} <= set(log.phase.tolist())
        assert log.phase[BLOCK + 20] == FOLLOW


def test_a_bright_world_is_the_same(
    arm: Arm, learned: Learned, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Painted images, and what is drawn of them where the eyes look, are those of the whole."""
    sensing = Sensing(
        body=180.0,
        hand=220.0,
        shading=0.3,
        grain=0.2,
        pattern=(30.0, 8.0),
        light=(0.1, 100.0),
        shadow=(0.2, 50.0),
        blur=0.5,
        second=(2.0, 0.6, -0.8, 0.06),
        second_velocity=(-1.0, 0.0, 0.0),
    )
    runner = TrialRunner(arm, Direct(learned.map), Scene(sensing=sensing))
    log = through_both(runner, throws(learned, 1), monkeypatch)[0]
    assert {WATCH, FOLLOW, BRAKE} <= set(log.phase.tolist())


@pytest.mark.parametrize(("name", "pixels"), [("lab", True), ("lab", False), ("rough", True)])
def test_a_laboratory_is_the_same_both_ways(
    arm: Arm, learned: Learned, name: str, pixels: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Counting encoders, late drives, a ball and cameras that are not as the catcher was told."""
    runner = TrialRunner(arm, Direct(learned.map), named_scene(name), pixels=pixels)
    runner.world.reset(throws(learned, 1)[0], 1)
    assert runner.world.stage is not None
    logs = through_both(runner, throws(learned, 2), monkeypatch)
    assert all({WATCH, FOLLOW, BRAKE} <= set(log.phase.tolist()) for log in logs)


@pytest.mark.parametrize(
    "faults",
    [
        ({"kind": "kick", "magnitude": 1.0}, {"kind": "payload", "magnitude": 0.2}),
        ({"kind": "bounce"},),
        ({"kind": "flutter", "magnitude": 10.0},),
        pytest.param(({"kind": "spring", "magnitude": 4.0},), marks=pytest.mark.thorough),
    ],
    ids=lambda faults: str(faults[0]["kind"]),
)
def test_a_disturbed_ball_is_the_same_both_ways(
    arm: Arm,
    learned: Learned,
    faults: tuple[dict[str, object], ...],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """What does not depend on the arm until it touches the ball is laid into the compiled loop."""
    scene = scene_of({"base": "lab", "faults": list(faults)}, place="scene")
    runner = TrialRunner(arm, Direct(learned.map), scene, pixels=False)
    runner.world.reset(throws(learned, 1)[0], 1)
    assert runner.world.stage is not None
    through_both(runner, throws(learned, 2), monkeypatch)


def test_a_recorded_flight_is_the_same_both_ways(
    arm: Arm, learned: Learned, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A path that the ball follows, in images, until the hand has it."""
    source = source_of(arm, seed=5, count=2, drag=0.12, recordings=builtin_flights()[:2])
    runner = TrialRunner(arm, Direct(learned.map), named_scene("lab"))
    balls = [source.ball(k) for k in range(2)]
    runner.world.reset(balls[0], 1)
    assert runner.world.stage is not None
    through_both(runner, balls, monkeypatch)


@pytest.mark.parametrize("pixels", [True, False])
def test_a_throw_that_is_refused_is_the_same(
    arm: Arm, learned: Learned, pixels: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A ball out of reach is watched, without moving, until it is down; then one is caught."""
    runner = TrialRunner(arm, Direct(learned.map), Scene(), pixels=pixels)
    logs = through_both(runner, [ASIDE, *throws(learned, 1)], monkeypatch)
    assert logs[0].phase[BLOCK + 20] == REFUSED
    assert BRAKE in logs[1].phase


def test_a_catcher_that_stops_is_the_same(
    arm: Arm, learned: Learned, monkeypatch: pytest.MonkeyPatch
) -> None:
    """An arm that strays farther than is allowed stops as it is, both ways."""
    monkeypatch.setattr("mitt.lab.trials.runner._max_tracking_error", lambda _: 0.001)
    runner = TrialRunner(arm, Direct(learned.map), Scene())
    log = through_both(runner, throws(learned, 1), monkeypatch)[0]
    assert {FOLLOW, STOPPED} <= set(log.phase.tolist())
    assert log.t[-1] - log.t[log.phase == STOPPED][0] == pytest.approx(WATCHED, abs=0.003)


def test_a_choice_among_maps_is_the_same(
    arm: Arm, learned: Learned, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Where the choice of the map is reviewed in flight, the loop ends for it."""
    inward = learn(arm, design=MapDesign(q_catch=0.6, inward=3.0), around=Neighbourhood(flights=40))
    reviews: list[float] = []
    think = Catcher.think

    def thinking(catcher: Catcher) -> None:
        reviews.append(catcher.result.scalars["t"].item())
        think(catcher)

    monkeypatch.setattr(Catcher, "think", thinking)
    generator: Generator = Family((Direct(learned.map), Direct(inward.map)))
    runner = TrialRunner(arm, generator, Scene())
    through_both(runner, throws(learned, 1), monkeypatch)
    assert len(reviews) > 10


def test_the_true_torques_are_those_of_the_last_tick(arm: Arm, learned: Learned) -> None:
    """After a trial in the compiled loop the world says what its motors gave last."""
    runner = TrialRunner(arm, Direct(learned.map), Scene())
    runner.run(0, throws(learned, 1)[0], seed=300)
    last = runner.world.truth()
    assert np.array_equal(last.tau, runner.world.trace().tau[-1])
    assert np.any(last.tau != 0.0)


def test_a_verdict_that_cannot_be_given_yet_asks_for_no_python(
    arm: Arm, learned: Learned, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The loop goes on while the ball is not known well enough; Python is asked a few times.

    Once it is known, the verdict is worked out in pieces, a tick each, and the arm moves.
    """
    asked: list[float] = []
    ticked = Catcher.ticked

    def counted(catcher: Catcher, todo: int, since: float) -> None:
        asked.append(since)
        ticked(catcher, todo, since)

    monkeypatch.setattr(Catcher, "ticked", counted)
    runner = TrialRunner(arm, Direct(learned.map), Scene())
    log = runner.run(0, throws(learned, 1)[0], seed=300, log=True).log
    assert log is not None
    watched = np.sum(log.phase == WATCH)
    assert watched > 20
    before = [t for t in asked if t <= log.t[watched - 1]]
    assert sum(t <= log.t[watched - 1] - WORKED_OUT for t in before) <= 2
    assert len(before) <= 2 + round(WORKED_OUT / TICK)
