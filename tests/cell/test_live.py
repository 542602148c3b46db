"""The live loop at a simulated cell in this process: it catches, and stops as it should."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from local_cell import LocalCell, Readings

from mitt.cell.session import Person, Session
from mitt.control.brake import plan_brake
from mitt.errors import InputError
from mitt.files.recorded import Recorded
from mitt.link.modes import Mode
from mitt.signals import ArmState, Sighting
from mitt.trials.replay import replay

#: Speed of a joint in a catch at which faults begin [rad/s].
FAST = 1.5
#: Ticks that a watchdog takes, and some for the drives' lag.
WATCHDOG, LAG = 20, 5


def in_a_catch(*, throws: int = 1) -> LocalCell:
    """Return a cell in the middle of its first catch."""
    cell = LocalCell(throws=throws)
    cell.begin()
    cell.until(lambda: cell.fastest > FAST)
    return cell


def rests_in_time(cell: LocalCell) -> None:
    """Go on and demand that the arm is at rest within its brake's time and the watchdog's."""
    arm, brake = cell.prepared.arm, 0.0
    for k in range(2000):
        now = cell.simulated.truth
        assert np.all((now.q > arm.q_min) & (now.q < arm.q_max))
        if k <= WATCHDOG:  # from the fastest state until it can be known
            motion = np.array([now.q, now.dq, np.zeros(3)])
            brake = max(brake, plan_brake(arm, 0.0, motion).duration)
        elif k > WATCHDOG + LAG + round(1e3 * brake):
            break
        cell.loop.cycle()
    assert cell.fastest < 0.05
    cell.until(lambda: cell.loop.mode is Mode.STOPPED)
    assert cell.robot.braked[-1]


def goes_on(cell: LocalCell) -> None:
    """Demand that nothing moves until a person says so, and that a ball is caught then."""
    before = cell.simulated.truth.q
    for _ in range(300):
        cell.loop.cycle()
    assert np.allclose(cell.simulated.truth.q, before, atol=0.02)
    assert cell.loop.mode is Mode.STOPPED
    count = len(cell.simulated.statuses)
    cell.loop.begin()
    cell.until(lambda: len(cell.simulated.statuses) > count + 1)
    assert cell.simulated.statuses[-1] == "caught"
    assert cell.simulated.violations == 0


def test_balls_are_caught_one_after_another_and_replay_to_the_bit(tmp_path: Path) -> None:
    """Each throw with a fresh catcher, from the ready pose, within all limits, all recorded."""
    path = tmp_path / "cell.mcap"
    cell = LocalCell(throws=2, record=path)
    cell.begin()
    cell.until(lambda: cell.loop.counts.throws == 2 and cell.loop.idle)
    assert cell.simulated.statuses == ["caught", "caught"]
    assert cell.simulated.violations == 0
    assert cell.loop.counts.throws == 2
    assert cell.recorder is not None
    cell.recorder.close()
    assert cell.recorder.dropped == 0
    again = replay(Recorded(path))
    assert 1000 < len(again.recorded.ticks) < cell.loop.counts.ticks
    assert again.identical


def test_a_stop_that_is_asked_for_is_latched() -> None:
    """The arm comes to rest, the brakes engage, and it moves again once a person says so."""
    cell = in_a_catch(throws=3)
    cell.loop.stop("asked for")
    rests_in_time(cell)
    assert cell.loop.why == "asked for"
    goes_on(cell)


def test_a_clock_that_is_set_back_stops_the_arm() -> None:
    """By an hour in flight; the reason says by how much."""
    cell = in_a_catch(throws=3)
    cell.robot.on_read = lambda got: [replace(x, t=x.t - 3600.0) for x in got]
    cell.robot.on_points = lambda got: [replace(x, t=x.t - 3600.0) for x in got]
    rests_in_time(cell)
    assert "set back by 3.6e+03 s" in cell.loop.why
    goes_on(cell)


def test_a_robot_that_falls_silent_is_given_up() -> None:
    """No reading arrives and no command is taken: its own watchdog stops it, we say why."""
    cell = in_a_catch(throws=3)
    cell.robot.on_read = lambda _: []
    cell.robot.on_write = lambda _: False
    rests_in_time(cell)
    assert cell.loop.why == "no joint states for 20 ms"
    cell.robot.on_read = lambda got: got
    cell.robot.on_write = lambda _: True
    for _ in range(5):
        cell.loop.healthy()
    goes_on(cell)


def test_commands_that_are_lost_end_in_a_protective_stop() -> None:
    """The robot brakes by itself, says so, and the loop stays stopped for that reason."""
    cell = in_a_catch(throws=3)
    cell.robot.on_write = lambda _: False
    rests_in_time(cell)
    assert "protective stop: no command for 20 ms" in cell.loop.why
    cell.robot.on_write = lambda _: True
    goes_on(cell)


def test_a_robot_in_trouble_is_stopped() -> None:
    """What it says of itself is the reason."""
    cell = in_a_catch()
    cell.robot.said = "emergency stop pressed"
    rests_in_time(cell)
    assert cell.loop.why == "the robot says: emergency stop pressed"


def test_lost_messages_are_bridged() -> None:
    """With a tenth of readings, commands and points lost the ball is caught all the same."""
    cell, rng = LocalCell(throws=2), np.random.default_rng(3)

    def lossy(got: Readings) -> Readings:
        while got and rng.random() < 0.1:  # the robot goes on meanwhile
            got = cell.robot._inner.read(0.02)
        return got

    def some(got: Sequence[Sighting]) -> Sequence[Sighting]:
        return [x for x in got if rng.random() > 0.1]

    cell.begin()
    cell.robot.on_read, cell.robot.on_points = lossy, some
    cell.robot.on_write = lambda _: bool(rng.random() > 0.1)
    cell.until(lambda: cell.simulated.done)
    assert cell.simulated.statuses == ["caught", "caught"]
    assert cell.simulated.violations == 0
    assert cell.loop.counts.lost > 100
    assert cell.loop.counts.stops == []


def test_readings_that_come_all_at_once_are_all_taken() -> None:
    """After a stall of 10 ms of ours each is a tick, and the newest is answered."""
    cell = in_a_catch()
    held: list[ArmState] = []

    def late(got: Readings) -> Readings:
        held.extend(got)
        for _ in range(9):
            held.extend(cell.robot._inner.read(0.02))
        cell.robot.on_read = lambda x: x
        return held

    cell.robot.on_read = late
    ticks = cell.loop.counts.ticks
    cell.loop.cycle()
    assert cell.loop.counts.ticks == ticks + 10
    assert cell.loop.counts.late == 9
    cell.until(lambda: cell.simulated.done)
    assert cell.simulated.statuses == ["caught"]


def test_positions_with_impossible_stamps_are_left_out() -> None:
    """Those of another clock are counted, none reaches the catcher."""
    cell = LocalCell(throws=1)
    cell.begin()
    cell.robot.on_points = lambda got: [replace(x, t=x.t - 100.0) for x in got]
    cell.until(lambda: cell.simulated.done)
    assert cell.simulated.statuses == ["missed"]
    assert cell.loop.counts.stray > 100
    assert cell.loop.counts.throws == 0


def test_degrees_are_refused_before_anything_moves() -> None:
    """In one line that names the joint and its range."""
    cell = LocalCell(throws=1)
    cell.robot.on_read = lambda got: [replace(x, q=np.degrees(x.q)) for x in got]
    with pytest.raises(InputError, match="degrees"):
        cell.loop.healthy()
    assert cell.robot.braked == []


def test_balls_are_caught_in_images() -> None:
    """The catcher learns its background in the ready pose before each throw."""
    cell = LocalCell(throws=2, name="wam-sim-images")
    cell.begin()
    cell.until(lambda: cell.loop.counts.throws == 2 and cell.loop.idle)
    assert cell.simulated.statuses == ["caught", "caught"]
    assert cell.simulated.violations == 0


def test_an_arm_that_moves_is_waited_for() -> None:
    """Nobody knows what moves it."""
    cell = LocalCell(throws=1)
    cell.robot.on_read = lambda got: [replace(x, dq=x.dq + 1.0) for x in got]
    assert cell.loop.healthy() == "the arm moves already"


def test_whatever_a_driver_raises_stops_the_arm() -> None:
    """While it is read, asked or written to; the reason is the driver's."""

    def broken(*_: object) -> bool:
        raise OSError("cable out")

    for place, says in (
        ("on_write", "takes no command: cable out"),
        ("on_read", "cannot be read: cable out"),
        ("on_points", "cable out"),
    ):
        cell = in_a_catch()
        setattr(cell.robot, place, broken)
        cell.until(lambda cell=cell: cell.loop.mode is Mode.STOPPED)  # type: ignore[misc]
        assert says in cell.loop.why
        assert cell.robot.braked[-1]


def test_a_first_reading_without_a_number_moves_nothing() -> None:
    """Where the arm is is not known then: brakes, and no torque towards the ready pose."""
    cell = LocalCell(throws=1)
    assert cell.loop.healthy() == ""
    cell.robot.on_read = lambda got: [replace(x, q=np.full(len(x.q), np.nan)) for x in got]
    cell.loop.begin()
    cell.loop.cycle()
    assert cell.loop.mode is Mode.STOPPED
    assert cell.robot.braked[-1]
    assert "first reading" in cell.loop.why


def test_readings_without_a_time_stop_the_arm() -> None:
    """A stamp that is no number is a fault; nothing raises, the brakes engage."""
    cell = in_a_catch(throws=1)
    cell.robot.on_read = lambda got: [replace(x, t=np.nan) for x in got]
    cell.loop.cycle()
    assert cell.loop.mode is Mode.STOPPED
    assert cell.robot.braked[-1]


def test_a_word_said_during_trouble_moves_nothing_later() -> None:
    """Enter counts once it is asked for; brakes are not released for what is no protective stop."""
    cell, person, heard = LocalCell(throws=1), Person(yes=False), list[str]()
    person.keyboard = True
    session = Session(cell.loop, cell.robot, person, lambda _: None, throws=1)
    troubles = ["no joint states", "the arm moves already", "", "", ""]

    def healthy() -> str:
        trouble = troubles[len(heard)]
        heard.append(trouble)
        if trouble or len(heard) == len(troubles):
            person._pressed.set()
        return trouble

    cell.loop.healthy = healthy  # type: ignore[method-assign]
    assert session._waited()
    assert len(heard) == len(troubles)
    assert cell.robot.braked == []
