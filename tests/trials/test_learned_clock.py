"""The eyes' clock is learned from throw to throw, corrected, recorded, and read from recordings."""

from pathlib import Path

import numpy as np
import pytest
from recorded_trials import replayed
from throws_on_film import calibrated

from mitt.core.catcher.catcher import Catcher
from mitt.core.catcher.generators import Direct
from mitt.core.catcher.settings import BRAKE
from mitt.core.errors import InputError
from mitt.core.eyes.clock_offset import LearnedClock, caught_offset
from mitt.core.map.learn import Learned
from mitt.io.recordings import Recorded, write_recording
from mitt.lab.trials.log import recording_of
from mitt.lab.trials.result import plain_fields
from mitt.lab.trials.runner import TrialRunner
from mitt.lab.trials.runs import _thrown
from mitt.lab.trials.source import Source, source_of
from mitt.lab.world.faults import Clock
from mitt.lab.world.scene import Scene
from mitt.lab.world.throws import Throw
from mitt.robot.cameras.hand_calibration import calibrate_by_catches, catches_in

#: By how much the clock of what the eyes say is ahead of the arm's [s].
HIDDEN = 0.0015


def source(learned: Learned, count: int) -> Source:
    """Return default throws."""
    return source_of(learned.map.arm, seed=9, count=count, drag=Scene().ball.drag)


def runner_of(learned: Learned, *, hidden: float = 0.0, pixels: bool = False) -> TrialRunner:
    """Return a runner whose eyes stamp by a clock of their own; they see a tick late."""
    faults = (Clock(magnitude=hidden, clock="camera"),) if hidden else ()
    scene = Scene(faults=faults)
    return TrialRunner(learned.map.arm, Direct(learned.map), scene, pixels=pixels)


@pytest.mark.parametrize("hidden", [0.0, HIDDEN])
@pytest.mark.parametrize("pixels", [False, True])
def test_catches_tell_the_clock(learned: Learned, hidden: float, pixels: bool) -> None:
    """By the compiled loop and by that in Python, from points and from images."""
    runner, clock = runner_of(learned, hidden=hidden, pixels=pixels), LearnedClock()
    for index in range(3):
        assert _thrown(runner, source(learned, 3), index, clock).status == "caught"
    assert clock.count >= 2
    assert abs(clock.offset + hidden) < (1.2e-3 if pixels else 5e-4)


def test_what_is_seen_after_the_catch_changes_no_command(
    learned: Learned, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Blind from then on, the arm does the same to the bit."""
    runner = runner_of(learned, pixels=True)
    sees = runner.run(0, source(learned, 1).ball(0), seed=3, log=True, images=True)
    flies = Catcher.flying
    monkeypatch.setattr(Catcher, "looking", flies)
    blind = runner.run(0, source(learned, 1).ball(0), seed=3, log=True, images=True)
    assert sees.log is not None
    assert blind.log is not None
    held = sees.log.phase == BRAKE
    assert np.sum(sees.log.ticks.scalars["sighted"][held]) > 50
    assert np.sum(blind.log.ticks.scalars["sighted"][held]) <= 1  # what was exposed before
    for mine, other in zip(sees.log.ticks, blind.log.ticks, strict=True):
        if mine.ndim > 1 and mine is not sees.log.ticks.sighting:
            assert mine.tobytes() == other.tobytes()


def test_the_next_throw_is_corrected_and_its_recording_tells_the_whole_offset(
    learned: Learned, tmp_path: Path
) -> None:
    """It replays to the bit, and calibration adds what its stamps bear already."""
    runner, clock, throws = runner_of(learned, hidden=HIDDEN), LearnedClock(), source(learned, 2)
    first = _thrown(runner, throws, 0, clock)
    assert first.clock is not None
    assert first.clock["offset_s"] == 0.0
    assert runner.clock_offset == clock.offset == first.clock["found_s"]
    used, outcome = runner.clock_offset, runner.throw(throws, 1, log=True)
    assert outcome.log is not None
    path = tmp_path / "x.mcap"
    about = runner.about("single", learned.map)
    write_recording(path, recording_of(outcome.log, outcome.trial, about))
    assert replayed(path).identical
    ((said, catch),) = catches_in(Recorded(path))
    assert said == used
    total = said + caught_offset(learned.map.arm, catch).offset
    assert abs(total + HIDDEN) < 5e-4
    rig, stage = calibrate_by_catches(calibrated(), [path])
    assert rig.clock_offset == pytest.approx(total, abs=1e-4)
    assert stage.numbers["catches"] == 1


def test_a_recording_without_a_catch_tells_no_clock(learned: Learned, tmp_path: Path) -> None:
    """It is refused in words."""
    runner, path = runner_of(learned), tmp_path / "x.mcap"
    ball = Throw(r=np.array([3.0, 0.0, 0.5]), dr=np.array([-1.0, 3.0, 0.0]))
    outcome = runner.run(0, ball, seed=3, log=True)
    assert outcome.log is not None
    about = runner.about("single", learned.map)
    write_recording(path, recording_of(outcome.log, outcome.trial, about))
    with pytest.raises(InputError, match="say nothing of the clocks"):
        calibrate_by_catches(calibrated(), [path])


def test_a_run_that_learns_no_clock_says_nothing_of_one(learned: Learned) -> None:
    """Its trials have no key for it."""
    trial = _thrown(runner_of(learned), source(learned, 1), 0, None)
    assert "clock" not in plain_fields(trial)
