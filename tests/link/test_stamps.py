"""Time from a robot's stamps: only forward, and jumps of its clock are found."""

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mitt.link.readings import DRIFT, LATER, Lag, Stamps
from mitt.signals import TICK


def test_time_is_that_of_the_stamps() -> None:
    """Whatever the way of the messages took."""
    s = Stamps()
    for k in range(100):
        t = s.take(1.7e9 + k * TICK, 5.0 + k * TICK + 0.004 * (k % 3))
        assert t is not None
        assert abs(t - k * TICK) < 1e-6
    assert s.fault == ""


def test_repeated_and_swapped_stamps_are_left_out() -> None:
    """A message that comes twice, or behind the next one, is no fault."""
    s = Stamps()
    given = [0.0, 0.001, 0.001, 0.003, 0.002, 0.004]
    assert [s.take(x, 0.0) is None for x in given] == [False, False, True, False, True, False]
    assert s.fault == ""


def test_a_clock_that_is_set_is_found_and_time_goes_on() -> None:
    """Back or forward; the next times follow by a tick."""
    for jump, word in ((-3600.0, "back by 3.6e+03 s"), (5.0, "forward by 5 s")):
        s = Stamps()
        s.take(10.0, 0.0)
        s.take(10.0 + TICK, TICK)
        before = s.t
        after = s.take(10.0 + 2 * TICK + jump, 2 * TICK)
        assert after is not None
        assert abs(after - before - TICK) < 1e-9
        assert word in s.fault
        later = s.take(10.0 + 3 * TICK + jump, 3 * TICK)
        assert later is not None
        assert abs(later - after - TICK) < 1e-9


def faults(lag: Lag, ticks: int, late: Callable[[float], float]) -> list[tuple[float, str]]:
    """Return when readings were found late, and how; ``late`` is their delay [s] by time [s]."""
    found = []
    for k in range(ticks):
        t = k * TICK
        said = lag.fault(1.7e9 + t, 5.0 + t + late(t))
        found += [(t, said)] if said else []
    return found


def test_readings_that_come_later_and_later_are_found() -> None:
    """A queue that grows by 1 ms in 20 ms: within 30 ms of its being 10 ms late, and how late."""
    found = faults(Lag(), 500, lambda t: 0.0005 + max(t - 0.1, 0.0) / 20.0)
    assert 0.3 < found[0][0] < 0.1 + 20.0 * LATER + 0.03
    assert found[0][1] == "readings come 11 ms later than they did"
    assert len(found) > 150


def test_what_is_late_stays_late_until_it_comes_as_before() -> None:
    """However long somebody waits: the allowance for drift does not forget it."""
    late = 0.02
    found = faults(Lag(), 60_000, lambda t: late if 1.0 < t < 59.0 else 0.0)
    assert len(found) > 57_900
    assert found[-1][0] < 59.001


def test_a_clock_that_runs_slow_is_found_and_one_that_drifts_is_not() -> None:
    """2000 ppm and 400 ppm, over 20 min of readings each 10 ms."""
    for drift, ever in ((2e-3, True), (0.8 * DRIFT, False), (-2e-3, False)):
        lag = Lag()
        said = [lag.fault(t, t + drift * t) for t in 0.01 * np.arange(120_000)]
        assert any(said) == ever


def test_readings_that_waited_for_us_are_not_late() -> None:
    """Some 15 ms old ones behind a stall of ours, a jitter of 5 ms, a clock that was set."""
    rng = np.random.default_rng(1)
    assert not faults(Lag(), 3000, lambda t: 0.015 if t % 0.5 < 0.015 else 0.001)
    assert not faults(Lag(), 3000, lambda _: float(rng.uniform(0.0, 0.005)))


def test_a_robot_that_was_away_may_stamp_otherwise() -> None:
    """Started anew, its stamps are 13 ms behind what they were: that is how they come now."""
    lag = Lag()
    assert not any(lag.fault(k * TICK, 5.0 + k * TICK) for k in range(1000))
    assert not any(lag.fault(k * TICK, 5.013 + k * TICK) for k in range(3000, 4000))
    assert any(lag.fault(k * TICK, 5.033 + k * TICK) for k in range(4000, 4100))


def test_a_clock_that_is_set_is_no_queue_and_a_queue_is_no_clock() -> None:
    """Stamps go back by 50 ms or an hour, or one is wrong: not late. A queue of 150 ms is."""
    for back in (0.05, 3600.0):
        lag = Lag()
        stamps = [k * TICK - (back if k > 1000 else 0.0) for k in range(3000)]
        assert not any(lag.fault(x, 5.0 + k * TICK) for k, x in enumerate(stamps))
    lag = Lag()
    stamps = [k * TICK + (0.05 if k == 1000 else 0.0) for k in range(3000)]
    assert not any(lag.fault(x, 5.0 + k * TICK) for k, x in enumerate(stamps))
    lag = Lag()
    assert not any(lag.fault(k * TICK, 5.0 + k * TICK) for k in range(1000))
    assert any(lag.fault(k * TICK, 5.15 + k * TICK) for k in range(1000, 1100))


@given(st.lists(st.tuples(st.floats(-1e6, 1e6), st.floats(0.0, 10.0)), min_size=1, max_size=60))
def test_time_never_runs_backwards(given: list[tuple[float, float]]) -> None:
    """Whatever the stamps say."""
    s, arrived, before = Stamps(), 0.0, -1.0
    for stamp, passed in given:
        arrived += passed
        t = s.take(stamp, arrived)
        if t is not None:
            assert t > before
            before = t


@pytest.mark.parametrize("at", [0, 1, 2, 3, 500])
def test_one_stamp_that_is_ahead_makes_no_later_reading_late(at: int) -> None:
    """Wherever it comes: 15 ms ahead, then as before."""
    wrong = 1e-3 * at
    assert not faults(Lag(), 1000, lambda t: -0.015 if abs(t - wrong) < 5e-4 else 0.001)
