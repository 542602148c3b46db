"""The live loop at a simulated cell in this process: it catches, and stops as it should."""

import re
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from local_cell import LocalCell, Readings
from support import thorough

from mitt.core.catcher.catcher import Catcher
from mitt.core.control.stop import plan_brake
from mitt.core.errors import InputError
from mitt.core.eyes.clock_offset import caught_offset
from mitt.core.eyes.lens import Lens
from mitt.core.signals import ArmState, Command, Senses, Sighting
from mitt.io.cell import read_cell
from mitt.io.recordings import Recorded
from mitt.lab.trials.replayed import replay
from mitt.robot.cameras.hand_calibration import catches_in
from mitt.robot.cell.drivers import LocalPort
from mitt.robot.cell.frames import FrameSet
from mitt.robot.cell.live import Mode
from mitt.robot.cell.prepare import prepare
from mitt.robot.cell.session import Person, Session
from mitt.robot.cell.ticks import Ticks

#: Speed of a joint in a catch at which faults begin [rad/s].
FAST = 1.5
#: Ticks that a watchdog takes, and some for the drives' lag.
WATCHDOG = 20
LAG = 5


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
    assert "clock" not in cell.loop.notes
    assert cell.recorder is not None
    cell.recorder.close()
    assert cell.recorder.dropped == 0
    again = replay(Recorded(path))
    assert 1000 < len(again.recorded.ticks) < cell.loop.counts.ticks
    assert again.identical


def test_the_eyes_clock_is_learned_told_corrected_and_recorded(tmp_path: Path) -> None:
    """From catch to catch; the recording replays to the bit and tells the whole offset."""
    path, behind = tmp_path / "cell.mcap", 0.003
    cell = LocalCell(throws=2, record=path)
    cell.robot.on_points = lambda got: [replace(x, t=x.t - behind) for x in got]
    cell.begin()
    cell.until(lambda: cell.loop.counts.throws == 2 and cell.loop.idle, ticks=20_000)
    clock = cell.loop.clock
    assert clock.count == 2
    assert abs(clock.offset - behind) < 0.001
    assert "clock" in cell.loop.notes
    assert cell.simulated.violations == 0
    assert cell.recorder is not None
    cell.recorder.close()
    recorded = Recorded(path)
    assert replay(recorded).identical
    told = [used + caught_offset(recorded.about.arm, x).offset for used, x in catches_in(recorded)]
    assert len(told) == 2
    assert abs(np.mean(told) - behind) < 0.001


def test_a_stop_that_is_asked_for_is_latched() -> None:
    """The arm comes to rest, the brakes engage, and it moves again once a person says so."""
    cell = in_a_catch(throws=3)
    cell.loop.stop("asked for")
    rests_in_time(cell)
    assert cell.loop.why == "asked for"
    goes_on(cell)


def test_notes_say_what_is_so_now_and_reasons_what_happened() -> None:
    """An oddity that is over is not noted any more, and none is put beside the reason of a stop."""
    cell = in_a_catch()
    positions, ticks = cell.loop._positions, cell.loop._ticks
    positions.note, ticks.repeating = "the positions repeat", 50.0
    cell.loop.cycle()
    assert set(cell.loop.notes) == {"ball", "readings"}
    cell.loop.stop("asked for")
    cell.until(lambda: cell.loop.mode is Mode.STOPPED)
    assert cell.loop.why == "asked for"
    assert cell.loop.counts.stops == ["asked for"]
    positions.note, ticks.repeating = "", 0.0
    cell.loop._look_at_ball(cell.simulated.t)
    assert cell.loop.notes == {}


def test_a_clock_that_is_set_back_stops_the_arm() -> None:
    """By an hour in flight; the reason says by how much."""
    cell = in_a_catch(throws=3)
    cell.robot.on_read = lambda got: [replace(x, t=x.t - 3600.0) for x in got]
    cell.robot.on_points = lambda got: [replace(x, t=x.t - 3600.0) for x in got]
    rests_in_time(cell)
    assert "set back by 3.6e+03 s" in cell.loop.why
    goes_on(cell)


def test_readings_that_come_later_and_later_stop_the_arm() -> None:
    """From a queue on their way that grows by one reading in 20; the reason says how late."""
    cell, waiting, count, grows = in_a_catch(throws=3), deque[ArmState](), 0, True

    def clogged(got: Readings) -> Readings:
        nonlocal count
        waiting.extend(got)
        count += grows
        return [waiting.popleft() for _ in range(len(waiting) - count // 20)]

    cell.robot.on_read = clogged
    cell.until(lambda: cell.loop.mode is Mode.STOPPED)
    assert re.search("readings come 1[1-3] ms later than they did", cell.loop.why)
    assert cell.robot.braked[-1]
    grows = False
    assert "later than they did" in cell.loop.healthy()
    waiting.clear()
    cell.robot.on_read = lambda x: x
    for _ in range(200):  # its brakes take some time
        if "moves already" not in cell.loop.healthy():
            break
    assert cell.loop.healthy() == ""


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


def test_a_protective_stop_that_is_acknowledged_does_not_come_at_once_again() -> None:
    """Between a person's word and the first command no time passes in which the watchdog trips."""
    cell = in_a_catch(throws=3)
    cell.robot.on_write = lambda _: False
    cell.until(lambda: cell.loop.mode is Mode.STOPPED)
    cell.robot.on_write = lambda _: True
    for _ in range(300):
        cell.loop.healthy()
    assert "protective stop" in cell.loop.healthy()
    cell.robot.release()
    before = cell.simulated.t
    assert cell.loop.healthy() == ""
    assert cell.simulated.t - before < 0.005
    cell.begin()


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


def test_readings_that_come_together_make_one_tick(monkeypatch: pytest.MonkeyPatch) -> None:
    """After a stall of 10 ms of ours the newest is answered; all positions are taken."""
    cell = in_a_catch()
    held: list[ArmState] = []
    taken, taking = list[tuple[float, float]](), Catcher.step

    def noted(self: Catcher, senses: Senses) -> Command:
        taken.extend((senses.t, p.t) for p in senses.points)
        return taking(self, senses)

    monkeypatch.setattr(Catcher, "step", noted)

    def late(got: Readings) -> Readings:
        held.extend(got)
        for _ in range(9):
            held.extend(cell.robot._inner.read(0.02))
        cell.robot.on_read = lambda x: x
        return held

    cell.robot.on_read = late
    ticks = cell.loop.counts.ticks
    cell.loop.cycle()
    assert cell.loop.counts.ticks == ticks + 1
    assert cell.loop.counts.late == 9
    assert cell.loop.counts.lost == 0
    assert len(taken) == 10
    assert all(-1.1e-2 < p - t < 1e-6 for t, p in taken)
    cell.until(lambda: cell.simulated.done)
    assert cell.simulated.statuses == ["caught"]


def test_positions_with_impossible_stamps_are_left_out() -> None:
    """Those of another clock are counted, none reaches the catcher, and the arm stops for that."""
    cell = LocalCell(throws=1)
    cell.begin()
    cell.robot.on_points = lambda got: [replace(x, t=x.t - 100.0) for x in got]
    cell.until(lambda: cell.loop.mode is Mode.STOPPED)
    assert "100 s behind the joint states" in cell.loop.why
    assert cell.loop.counts.stray > 20
    assert cell.loop.counts.throws == 0
    assert cell.robot.braked[-1]


@pytest.mark.parametrize(
    ("changed", "says", "stops"),
    [
        (lambda x, _: replace(x, r_o=1e3 * x.r_o), "millimetres", True),
        (lambda x, _: replace(x, t=x.t + 0.03), "ahead of the joint states", True),
        (lambda x, _: replace(x, t=x.t - 0.02), "ms after their stamps", False),
        (lambda x, _: replace(x, r_o=np.full(3, np.nan)), "no numbers, or all zero", False),
        (lambda x, _: replace(x, r_o=np.zeros(3)), "no numbers, or all zero", False),
        (lambda x, k: replace(x, r_o=np.array([2.0, 0.01 * (k // 8), 0.5])), "repeat", False),
    ],
)
def test_what_blinds_the_catcher_is_said_within_a_second(
    changed: Callable[[Sighting, int], Sighting], says: str, *, stops: bool
) -> None:
    """Of flight: in the reason of the stop, or beside the numbers and in the summary."""
    cell, count, first = LocalCell(throws=1), 0, list[float]()
    cell.begin()

    def on_points(got: Sequence[Sighting]) -> Sequence[Sighting]:
        nonlocal count
        count += len(got)
        first.extend([cell.simulated.t] * (bool(got) and not first))
        return [changed(x, count) for x in got]

    cell.robot.on_points = on_points
    session = Session(cell.loop, cell.robot, Person(yes=True), lambda _: None, throws=1)
    cell.until(lambda: bool(first) and cell.simulated.t > first[0] + 0.9)
    session._show()
    said = session.summary()
    where = cell.loop.why if stops else said["notes"][0]
    assert says in where
    assert (cell.loop.mode is Mode.STOPPED) == stops
    assert stops or says in session.words.value.decode()


@pytest.mark.parametrize("times", thorough([4], [2]))
def test_joint_states_that_repeat_are_lost_readings(times: int) -> None:
    """As of hardware of 500 or 250 Hz behind a publisher of 1 kHz: caught, and said."""
    cell, count, last = LocalCell(throws=1), 0, list[ArmState]()

    def held(got: Readings) -> Readings:
        nonlocal count
        out = []
        for x in got:
            if count % times == 0:
                last[:] = [x]
            count += 1
            out.append(replace(x, q=last[0].q, dq=last[0].dq))
        return out

    cell.robot.on_read = held
    cell.begin()
    cell.until(lambda: cell.simulated.done)
    assert cell.simulated.statuses == ["caught"]
    assert cell.loop.counts.stops == []
    assert cell.loop.counts.repeated > 100
    assert "joint states repeat" in cell.loop.notes["readings"]


def test_a_reading_that_came_with_its_repeat_is_taken() -> None:
    """Hardware of 500 Hz behind 1 kHz, and a loop that finds two at a time, the newer a repeat."""
    cell, kept = LocalCell(throws=1), list[ArmState]()

    def paired(got: Readings) -> Readings:
        kept.extend(got)
        if len(kept) < 2:
            return []
        out = [replace(x, q=kept[k - k % 2].q, dq=kept[k - k % 2].dq) for k, x in enumerate(kept)]
        kept.clear()
        return out

    cell.begin()
    cell.robot.on_read = paired
    cell.until(lambda: cell.simulated.done or cell.loop.mode is Mode.STOPPED)
    assert cell.loop.why == ""
    assert cell.simulated.statuses == ["caught"]


def test_joint_states_that_freeze_stop_the_arm() -> None:
    """With stamps that go on: the reason says so, whatever the catcher makes of it."""
    cell, last = in_a_catch(), list[ArmState]()

    def frozen(got: Readings) -> Readings:
        last[:] = last or list(got)[-1:]
        return [replace(x, q=last[0].q, dq=last[0].dq) for x in got]

    cell.robot.on_read = frozen
    cell.until(lambda: cell.loop.mode is Mode.STOPPED)
    assert "joint states repeat" in cell.loop.why
    assert cell.robot.braked[-1]


def test_degrees_are_refused_before_anything_moves() -> None:
    """In one line that names the joint and its range."""
    cell = LocalCell(throws=1)
    cell.robot.on_read = lambda got: [replace(x, q=np.degrees(x.q)) for x in got]
    with pytest.raises(InputError, match="degrees"):
        cell.loop.healthy()
    assert cell.robot.braked == []


def test_balls_are_caught_in_images() -> None:
    """The catcher learns its background in the ready pose before each throw."""
    cell = LocalCell(throws=2, seed=6, name="wam-sim-images")
    cell.begin()
    cell.until(lambda: cell.loop.counts.throws == 2 and cell.loop.idle)
    assert cell.simulated.statuses == ["caught", "caught"]
    assert cell.simulated.violations == 0


@pytest.mark.parametrize("moving", [True, False])
def test_cameras_that_fall_silent_stop_the_arm(
    monkeypatch: pytest.MonkeyPatch, *, moving: bool
) -> None:
    """On its way as well as in a catch; without images nothing moves again."""
    cell = LocalCell(throws=2, name="wam-sim-images")
    assert cell.loop.healthy() == ""
    cell.loop.begin()
    cell.until(lambda: cell.loop.mode is Mode.CATCHING or moving)
    with monkeypatch.context() as patch:
        patch.setattr(LocalPort, "take", lambda _: ())
        cell.until(lambda: cell.loop.mode is Mode.STOPPING, ticks=53)
        cell.until(lambda: cell.loop.mode is Mode.STOPPED)
        assert cell.loop.why == "no images for 50 ms"
        assert cell.robot.braked[-1]
        assert cell.loop.healthy() == "no images for 50 ms"
    assert cell.loop.healthy() == ""


def test_a_camera_that_repeats_its_last_image_is_silent(monkeypatch: pytest.MonkeyPatch) -> None:
    """As one does whose process hangs in its driver."""
    cell = LocalCell(throws=2, name="wam-sim-images")
    cell.begin()
    last = list[FrameSet]()
    take = LocalPort.take

    def repeated(port: LocalPort) -> Sequence[FrameSet]:
        last[:] = last or list(take(port))[-1:]
        return last

    monkeypatch.setattr(LocalPort, "take", repeated)
    cell.until(lambda: cell.loop.mode is Mode.STOPPED, ticks=1000)
    assert cell.loop.why == "no images for 50 ms"


def bent_cell() -> LocalCell:
    """Return a cell whose lenses bend the images by some pixels, one up and the other down."""
    lenses = tuple(
        Lens(width=128, height=128, numbers=np.array([220.0, 220.0, 63.5, 63.5, *k]))
        for k in ((0.0, 0.0, 0.9, 0.0, 0.0), (0.0, 0.0, -0.9, 0.0, 0.0))
    )
    return LocalCell(
        throws=1, prepared=replace(prepare(read_cell("wam-sim-images")), lenses=lenses)
    )


@pytest.mark.thorough
def test_balls_are_caught_in_images_of_bent_lenses(monkeypatch: pytest.MonkeyPatch) -> None:
    """The loop straightens them; with the images as they are it misses or drops the ball."""
    cell = bent_cell()
    cell.begin()
    cell.until(lambda: cell.simulated.done)
    assert cell.simulated.statuses == ["caught"]
    monkeypatch.setattr("mitt.robot.cell.frames.straightener", lambda _: lambda pixels: pixels)
    cell = bent_cell()
    cell.begin()
    cell.until(lambda: cell.simulated.done)
    assert cell.simulated.statuses[0] in ("dropped", "missed")


def test_an_arm_outside_its_range_is_not_moved() -> None:
    """It would be pulled in at once: a person moves it back."""
    cell = LocalCell(throws=1)
    outside = cell.prepared.arm.q_max + np.array([-1.0, 0.3, -1.0])
    cell.robot.on_read = lambda got: [replace(x, q=outside, dq=0.0 * x.dq) for x in got]
    assert cell.loop.healthy() == "j2 is 0.30 rad outside its range: move it back by hand"
    assert cell.robot.braked == []


@pytest.mark.parametrize(("gap", "mode"), [(0.3, Mode.STOPPED), (0.05, Mode.MOVING)])
def test_an_arm_that_was_pushed_does_not_go_back_by_itself(
    monkeypatch: pytest.MonkeyPatch, gap: float, mode: Mode
) -> None:
    """After a stop for a lost ball; in its place it does."""
    cell = in_a_catch(throws=2)
    cell.robot.on_points = lambda _: ()
    monkeypatch.setattr(Ticks, "gap", property(lambda _: gap))
    cell.until(lambda: cell.loop.mode in (Mode.STOPPED, Mode.MOVING))
    assert cell.loop.mode is mode
    assert ("was pushed 0.30 rad" in cell.loop.why) == (mode is Mode.STOPPED)
    assert cell.robot.braked[-1] == (mode is Mode.STOPPED)


@pytest.mark.thorough
@pytest.mark.parametrize("takes", thorough(["position"], ["velocity"]))
def test_the_last_setpoint_moves_nothing(takes: str) -> None:
    """Whoever takes it may hold it for ever."""
    cell = read_cell("wam-sim")
    robot = cell.robot.model_copy(update={"takes": takes})
    local = LocalCell(throws=1, prepared=prepare(cell.model_copy(update={"robot": robot})))
    told = list[Command]()
    local.begin()
    local.robot.on_write = lambda command: not told.append(command)  # type: ignore[func-returns-value]
    local.until(lambda: local.simulated.done and local.loop.idle)
    for _ in range(200):
        local.loop.cycle()
    assert np.any(told[-1].dq != 0.0) == (takes == "velocity")  # what corrects small gaps
    local.loop.finish()
    assert np.all(told[-1].dq == 0.0)
    assert told[-1].q == pytest.approx(local.simulated.truth.q, abs=2e-3)
    assert local.simulated.statuses == ["caught"]


def test_a_last_setpoint_that_fails_keeps_no_brakes_off() -> None:
    """An arm that rests, and takes no command any more, is braked all the same."""
    cell = read_cell("wam-sim")
    robot = cell.robot.model_copy(update={"takes": "velocity"})
    local = LocalCell(throws=1, prepared=prepare(cell.model_copy(update={"robot": robot})))
    local.begin()
    for _ in range(200):
        local.loop.cycle()

    def broken(_: Command) -> bool:
        raise BrokenPipeError("cable out")

    local.robot.on_write = broken
    local.loop.cycle()
    assert local.loop.mode is Mode.STOPPED
    assert local.loop.why == "the robot takes no command: cable out"
    assert local.robot.braked[-1]


def test_an_arm_that_moves_is_waited_for() -> None:
    """Nobody knows what moves it."""
    cell = LocalCell(throws=1)
    for speed, said in ((0.0, np.ones(3)), (0.6, np.full(3, np.nan)), (0.6, np.zeros(3))):
        cell.robot.on_read = lambda _: []
        assert cell.loop.healthy() == "no joint states"
        cell.robot.on_read = lambda got, speed=speed, said=said: [  # type: ignore[misc]
            replace(x, q=x.q + speed * (x.t - 1.7e9), dq=said) for x in got
        ]
        assert cell.loop.healthy() == "the arm moves already"
    cell.robot.on_read = lambda got: [replace(x, dq=np.full(3, np.nan)) for x in got]
    for _ in range(120):
        cell.loop.healthy()
    assert cell.loop.healthy() == ""


def test_joint_states_whose_stamps_stand_still_are_waited_for() -> None:
    """How fast the arm is cannot be known then."""
    cell = LocalCell(throws=1)
    cell.robot.on_read = lambda got: [replace(x, t=1.7e9) for x in got]
    assert "stamps go on by 0 ms" in cell.loop.healthy()


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


def at_a_keyboard() -> Person:
    """Return a person who may press Enter."""
    person = Person(yes=False)
    person.keyboard = person._listens = True
    return person


def test_a_word_said_during_trouble_moves_nothing_later() -> None:
    """Enter counts once it is asked for; brakes are not released for what is no protective stop."""
    cell, person, heard = LocalCell(throws=1), at_a_keyboard(), list[str]()
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


def test_a_word_said_before_the_robot_is_there_moves_nothing_later() -> None:
    """Enter acknowledges what the robot says, not that nobody takes commands."""
    cell, person, heard = LocalCell(throws=1), at_a_keyboard(), list[str]()
    session = Session(cell.loop, cell.robot, person, lambda _: None, throws=1)
    kept = ["nobody takes commands", "nobody takes commands", "", "", "", ""]

    def healthy() -> str:
        cell.robot.kept = kept[len(heard)]
        heard.append(cell.robot.kept)
        if cell.robot.kept or len(heard) == len(kept):
            person._pressed.set()
        return cell.robot.waits() or cell.robot.trouble()

    cell.loop.healthy = healthy  # type: ignore[method-assign]
    assert session._waited()
    assert len(heard) == len(kept)
    assert cell.robot.braked == []


def test_another_commander_that_comes_later_stops_the_arm() -> None:
    cell = in_a_catch()
    cell.robot.meddled = "another program commands the arm"
    rests_in_time(cell)
    assert "another program commands the arm" in cell.loop.why


def test_a_release_that_fails_leaves_the_brakes_engaged(monkeypatch: pytest.MonkeyPatch) -> None:
    """The driver has released them when it raises."""
    cell = LocalCell(throws=1)
    release = cell.robot.release

    def broken() -> None:
        release()
        raise BrokenPipeError("cable out")

    monkeypatch.setattr(cell.robot, "release", broken)
    assert cell.loop.healthy() == ""
    cell.loop.begin()
    assert cell.loop.mode is Mode.STOPPED
    assert cell.robot.braked[-1]
    assert "cannot be released: cable out" in cell.loop.why


def test_brakes_that_a_wild_first_reading_engages_are_a_stop() -> None:
    """A fresh catcher cannot use it: the arm is on its brakes, and that is said."""
    cell = LocalCell(throws=2)
    cell.begin()
    wild = list[bool]()

    def once(got: Readings) -> Readings:
        if wild or not got:
            return got
        wild.append(True)
        return [replace(x, q=x.q + 10.0) for x in got]

    cell.loop._ticks.fresh()
    cell.robot.on_read = once
    for _ in range(5):
        cell.loop.cycle()
    assert wild
    assert cell.loop.mode is Mode.STOPPED
    assert cell.robot.braked[-1]
    assert "a joint was not read" in cell.loop.why


def test_an_arm_that_is_fast_on_its_slow_way_is_stopped(monkeypatch: pytest.MonkeyPatch) -> None:
    """As one does that swings because its readings come late."""
    cell = LocalCell(throws=1)
    assert cell.loop.healthy() == ""
    cell.loop.begin()
    cell.loop.cycle()
    fast = np.array([cell.prepared.arm.q_ready, [3.0, 0.0, 0.0]])
    monkeypatch.setattr(Catcher, "estimated", property(lambda _: fast))
    cell.loop.cycle()
    assert cell.loop.mode is Mode.STOPPING
    assert "faster than it was told" in cell.loop.why
