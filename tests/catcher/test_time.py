"""The catcher goes by stamps: late ticks, jitter, other periods, old readings, in any loop."""

import numpy as np
import pytest
from exact_plant import SETTINGS, Change, Thrown, as_read, each, throw

from mitt.core.arm.arm import Arm
from mitt.core.catcher.catcher import Catcher, Phase
from mitt.core.control.encoders import BRIDGED_TIME, IN_TIME, LOSSY_TICKS, SILENT_TICKS
from mitt.core.control.envelope import bounds_of
from mitt.core.control.health import OLD_READING, Reason
from mitt.core.map.learn import Learned
from mitt.core.signals import TICK, ArmState, Array
from mitt.lab.world.throws import Throw

BALL = Throw(r=np.array([3.6, 0.15, 0.2]), dr=np.array([-5.9, -0.2, 2.2]))
#: Ticks of a throw, instants of the swing [s], and how near the ball comes to the hand [m].
TICKS = 900
INSTANTS = (0.42, 0.5)
NEAR = 0.005
#: How fast the ball is about, by which stamps that are all late bring the hand late [m/s].
BALL_SPEED = 6.0


@pytest.fixture(scope="module")
def first(arm: Arm, learned: Learned) -> Catcher:
    """Return a catcher of which others are made."""
    return Catcher(arm, learned, settings=SETTINGS)


def on(
    times: Array,
    first: Catcher,
    arm: Arm,
    learned: Learned,
    change: Change = as_read,
    seed: int = 7,
) -> Thrown:
    """Throw the ball once, with ticks at the given times."""
    return throw(first.again(learned), arm, BALL, times, seed=seed, change=change)


def late_by(late: float, at: float) -> Array:
    """Return the times of ticks of which one comes late [s]."""
    times = each(TICK, TICKS)
    times[times > at] += late - TICK
    return times


def keeps_limits(arm: Arm, thrown: Thrown) -> bool:
    """Say whether no joint is commanded faster, or to change more, than the time allows."""
    b, passed = bounds_of(arm), np.diff(thrown.t)[:, None]
    q, dq = thrown.commands[:, 0], thrown.commands[:, 1]
    moved, changed = np.abs(np.diff(q, axis=0)), np.abs(np.diff(dq, axis=0))
    return bool(
        np.all(moved <= b["dq_max"] * passed + 1e-9)
        and np.all(changed <= b["ddq_max"] * passed + 1e-9)
        and np.all(np.abs(dq) <= arm.dq_max)
    )


@pytest.mark.parametrize("at", INSTANTS)
@pytest.mark.parametrize("late", [0.0015, 0.0033, 0.005, 0.0123, 0.02])
def test_a_tick_up_to_20_ms_late_is_bridged(
    first: Catcher, arm: Arm, learned: Learned, late: float, at: float
) -> None:
    """The arm moves on meanwhile. Up to 5 ms it is in time; the ball is met as if it had been."""
    thrown = on(late_by(late, at), first, arm, learned)
    assert thrown.stopped is None
    assert thrown.phase is Phase.BRAKE
    assert thrown.nearest < NEAR
    assert thrown.reasons.count(Reason.LATE) == (late > IN_TIME)
    assert Reason.BRIDGED not in thrown.reasons
    assert keeps_limits(arm, thrown)


@pytest.mark.parametrize("at", INSTANTS)
@pytest.mark.parametrize("late", [0.0201, 0.1])
def test_a_later_tick_is_an_overrun_and_no_fault_of_an_encoder(
    first: Catcher, arm: Arm, learned: Learned, late: float, at: float
) -> None:
    """The arm is stopped, held by position control, wherever it has got to."""
    assert late > BRIDGED_TIME
    thrown = on(late_by(late, at), first, arm, learned)
    assert thrown.stopped is Reason.OVERRUN
    assert not thrown.brakes


@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize("jitter", [1e-4, 5e-4])
def test_jitter_is_no_fault(
    first: Catcher, arm: Arm, learned: Learned, jitter: float, seed: int
) -> None:
    """Ticks that are off by up to half a period, and read when they are made, are all in time."""
    off = np.random.default_rng(seed).uniform(-jitter, jitter, TICKS)
    times = np.unique(each(TICK, TICKS) + off - off[0])
    thrown = on(times, first, arm, learned, seed=seed)
    assert thrown.stopped is None
    assert set(thrown.reasons) == {Reason.NONE}
    assert thrown.nearest < NEAR
    assert keeps_limits(arm, thrown)


@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize("off", [5e-5, 2e-4, 5e-4])
def test_stamps_that_are_a_little_off_are_no_fault(
    first: Catcher, arm: Arm, learned: Learned, off: float, seed: int
) -> None:
    """Readings each millisecond, stamped by a clock that is read sooner or later than they."""
    rng = np.random.default_rng(seed)

    def stamped(_: int, new: ArmState) -> ArmState:
        return ArmState(t=new.t - off + rng.uniform(-off, off), q=new.q, dq=new.dq)

    thrown = on(each(TICK, TICKS), first, arm, learned, stamped, seed=seed)
    assert thrown.stopped is None
    assert set(thrown.reasons) == {Reason.NONE}
    assert thrown.nearest < NEAR + off * BALL_SPEED


@pytest.mark.parametrize("period", [0.0005, 0.00098, 0.002, 0.004])
def test_another_period_is_no_fault(
    first: Catcher, arm: Arm, learned: Learned, period: float
) -> None:
    """A loop may have its own rate, as long as a tick comes within 5 ms of the last."""
    times = each(period, round(TICKS * TICK / period))
    thrown = on(times, first, arm, learned)
    assert thrown.stopped is None
    assert set(thrown.reasons) == {Reason.NONE}
    assert thrown.nearest < NEAR
    assert keeps_limits(arm, thrown)


@pytest.mark.parametrize("old", [2, 5])
@pytest.mark.parametrize("begin", [0, 450])
def test_a_reading_is_taken_at_its_own_time(
    first: Catcher, arm: Arm, learned: Learned, old: int, begin: int
) -> None:
    """Readings up to 5 ms old, as their stamps say, are carried on: the ball is met as ever."""
    past: list[ArmState] = []

    def delayed(k: int, reading: ArmState) -> ArmState:
        past.append(reading)
        return past[max(k - old, 0)] if k >= begin else reading

    assert old * TICK <= OLD_READING
    thrown = on(each(TICK, TICKS), first, arm, learned, delayed)
    assert thrown.stopped is None
    assert thrown.reasons.count(Reason.BRIDGED) == old  # those that come again
    assert thrown.nearest < NEAR


@pytest.mark.parametrize("kind", ["frozen", "stamp", "hour", "nan", "future"])
def test_old_readings_in_the_swing_are_none(
    first: Catcher, arm: Arm, learned: Learned, kind: str
) -> None:
    """Whatever an old reading says: it is bridged, and so many in a row are a silent encoder."""
    begin, kept = 430, list[ArmState]()

    def stale(k: int, new: ArmState) -> ArmState:
        kept.append(new)
        if k < begin:
            return new
        last = kept[begin - 1]
        told = {"frozen": last, "stamp": ArmState(t=last.t, q=new.q, dq=new.dq)}
        shift = {"hour": -3600.0, "nan": np.nan, "future": 0.002}.get(kind, 0.0)
        return told.get(kind, ArmState(t=new.t + shift, q=new.q, dq=new.dq))

    thrown = on(each(TICK, TICKS), first, arm, learned, stale)
    assert thrown.stopped is Reason.SILENT
    assert thrown.reasons[begin : begin + SILENT_TICKS - 1] == [Reason.BRIDGED] * (SILENT_TICKS - 1)
    assert thrown.reasons[begin + SILENT_TICKS - 1] is Reason.SILENT
    assert thrown.brakes


@pytest.mark.parametrize("shift", [-3600.0, np.nan, 1.0])
def test_a_loop_whose_stamps_are_of_another_clock_is_told_so(
    first: Catcher, arm: Arm, learned: Learned, shift: float
) -> None:
    """Nothing moves, and the reason names the two stamps."""
    catcher = first.again(learned)

    def shifted(_: int, reading: ArmState) -> ArmState:
        return ArmState(t=reading.t + shift, q=reading.q, dq=reading.dq)

    thrown = throw(catcher, arm, BALL, each(TICK, 50), change=shifted)
    assert thrown.stopped is Reason.SILENT
    assert thrown.reasons.index(Reason.SILENT) + 1 == LOSSY_TICKS
    assert not thrown.commands[:, 1:].any()
    assert catcher.stopped_by is not None
    assert "ArmState.t" in catcher.stopped_by.hint
    assert "\n" not in catcher.stopped_by.hint


@pytest.mark.parametrize("period", [0.0005, 0.001, 0.004])
def test_silence_is_a_time(first: Catcher, arm: Arm, learned: Learned, period: float) -> None:
    """Six milliseconds without a number stop the arm, however many calls that is."""
    begin = round(0.43 / period)

    def silent(k: int, new: ArmState) -> ArmState:
        return new if k < begin else ArmState(t=new.t, q=np.full(3, np.nan), dq=new.dq)

    times = each(period, round(TICKS * TICK / period))
    thrown = on(times, first, arm, learned, silent)
    assert thrown.stopped is Reason.SILENT
    calls = thrown.reasons.index(Reason.SILENT) - begin + 1
    assert calls == np.ceil(SILENT_TICKS * TICK / period - 1e-9)


@pytest.mark.parametrize("late", [0.003, 0.02])
@pytest.mark.parametrize("jump", [-0.2, 1.0])
def test_a_late_tick_hides_no_jump(
    first: Catcher, arm: Arm, learned: Learned, late: float, jump: float
) -> None:
    """An encoder that jumps 10 ms after it is found as ever."""
    begin = 460

    def jumps(k: int, new: ArmState) -> ArmState:
        off = np.array([0.0, jump, 0.0]) if k >= begin else np.zeros(3)
        return ArmState(t=new.t, q=new.q + off, dq=new.dq)

    thrown = on(late_by(late, TICK * (begin - 10)), first, arm, learned, jumps)
    assert thrown.stopped is Reason.JUMPED
    assert thrown.reasons.index(Reason.JUMPED) == begin + 2
    assert thrown.brakes
