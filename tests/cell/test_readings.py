"""What a robot sends: stamps become the time, positions reach their reading, faults are said."""

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mitt.core.errors import InputError
from mitt.core.signals import TICK, Sighting
from mitt.robot.cell.readings import DRIFT, LATER, STRAY, WINDOW, Counts, Lag, Positions, Stamps


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


#: A time of the day [s].
NOW = 1.7e9


def positions() -> tuple[Positions, Counts]:
    """Return positions that have come, and what is counted of them."""
    counts = Counts(0, 0, 0, 0, 0, 0, 0, 0, [])
    return Positions(counts), counts


def at(t: float, r_o: object = (1.0, 0.2, 0.3), *, found: bool = True) -> Sighting:
    """Return a position."""
    return Sighting(t=t, found=found, r_o=np.array(r_o), covariance=1e-6 * np.eye(3))


@settings(max_examples=100, deadline=None)
@given(
    st.lists(st.integers(1, 12), min_size=1, max_size=12),
    st.integers(-3, 5),
    st.integers(0, 2**32 - 1),
)
def test_each_position_reaches_the_first_reading_that_can_know_it(
    batches: list[int], ahead: int, seed: int
) -> None:
    """However many readings come at once, each position once, none lost, none from the future."""
    kept, counts = positions()
    rng, k, given_, got = np.random.default_rng(seed), 0, list[float](), list[float]()
    for size in [*batches, 20]:
        stamps = NOW + TICK * np.arange(k, k + size)
        k += size
        points = [at(t + TICK * ahead, rng.normal(size=3)) for t in stamps]
        given_ += [x.t for x in points]
        kept.take(points, float(stamps[-1]))
        for stamp in stamps:
            known = [x.t for x in kept.upto(float(stamp))]
            assert all(t <= stamp + TICK for t in known)
            assert all(t > stamp - TICK * (1 + max(-ahead, 0)) for t in known) or ahead < 0
            got += known
    got += [x.t for x in kept.upto(NOW + 1.0)]
    assert got == given_
    assert counts.stray == counts.repeated == 0


Change = Callable[[int, np.ndarray], Sighting]

#: What a source does wrong, what is said of it, and whether that is a fault.
ODD: dict[str, tuple[Change, str, bool]] = {
    "3 ms ahead": (lambda k, r: at(NOW + k * TICK + 3e-3, r), "3 ms ahead of", False),
    "10 ms ahead": (lambda k, r: at(NOW + k * TICK + 0.01, r), "10 ms ahead of", True),
    "1 s ahead": (lambda k, r: at(NOW + k * TICK + 1.0, r), "1000 ms ahead of", True),
    "a day ahead": (lambda k, r: at(NOW + k * TICK + 86400.0, r), "8.64e+04 s ahead of", True),
    "12 ms old": (lambda k, r: at(NOW + k * TICK - 0.012, r), "come 12 ms after", False),
    "1 s behind": (lambda k, r: at(NOW + k * TICK - 1.0, r), "1000 ms behind", True),
    "of another clock": (lambda k, r: at(k * TICK, r), "behind", True),
    "in millimetres": (lambda k, r: at(NOW + k * TICK, 1e3 * r), "millimetres?", True),
    "no numbers": (lambda k, r: at(NOW + k * TICK, np.nan * r), "no numbers", False),
    "not found": (lambda k, r: at(NOW + k * TICK, r, found=False), "no numbers", False),
    "all zero": (lambda k, r: at(NOW + k * TICK, 0.0 * r), "all zero", False),
    "no time": (lambda k, r: at(np.nan * k, r), "stamps are no numbers", False),
    "stuck": (lambda k, r: at(NOW + k * TICK, 0.0 * r + 1.0), "is stuck", False),
    "now and then": (lambda k, r: at(NOW + k * TICK, r * (k % 3 == 0)), "of 25 positions", False),
    "repeated": (lambda k, r: at(NOW + k * TICK, 0.0 * r + [k // 4, 1.0, 0.0]), "repeat", False),
}


@pytest.mark.parametrize("name", ODD)
def test_a_source_of_no_use_is_named(name: str) -> None:
    """Within as many positions as are looked at together; where nothing is wrong, nothing is."""
    change, says, fault = ODD[name]
    kept, counts = positions()
    rng, before = np.random.default_rng(0), NOW - 60.0
    for k in range(2 * WINDOW):
        r = np.array([2.0, 0.1, 0.5]) + rng.normal(size=3) * 1e-3
        kept.take([at(before + k * TICK - 2e-3, r)], before + k * TICK)
        assert len(kept.upto(before + k * TICK)) == 1
    assert (kept.fault, kept.note, counts.stray, counts.repeated) == ("", "", 0, 0)
    for k in range(2 * WINDOW):
        kept.take(
            [change(k, np.array([2.0, 0.1, 0.5]) + 1e-3 * rng.normal(size=3))], NOW + k * TICK
        )
        kept.upto(NOW + k * TICK)
    assert says in (kept.fault if fault else kept.note + kept.absent)
    assert bool(kept.fault) == fault
    kept.take([], NOW + 3.0)
    assert kept.fault == ""
    kept.take([at(NOW + 3.0, [1.0, 2.0, 3.0])], NOW + 3.0)
    assert kept.absent == ""


def test_what_stands_still_goes_on_to_the_filter() -> None:
    """To the last digit: for 50 ms it may be a slow source's, then the filter has each of them."""
    kept, counts = positions()
    passed = []
    for k in range(300):
        kept.take([at(NOW + k * TICK, [1.0, 0.001 * min(k, 100), 1.0])], NOW + k * TICK)
        passed += [x.t for x in kept.upto(NOW + k * TICK)]
    assert len(passed) + counts.repeated == 300
    assert 45 <= counts.repeated <= 55
    assert passed[-1] == NOW + 299 * TICK


@pytest.mark.parametrize("away", [0.0, np.nan])
def test_a_tracker_that_sends_nothing_between_throws_is_a_good_one(away: float) -> None:
    """Zeros or no numbers while no ball is there, whenever it comes."""
    kept, _ = positions()
    rng, notes = np.random.default_rng(0), set[str]()
    for k in range(3000):
        r = np.array([2.0, 0.1, 0.5]) + 1e-3 * rng.normal(size=3)
        flies = k < 2 * WINDOW or k % 700 > 260
        kept.take([at(NOW + k * TICK, r if flies else away * r)], NOW + k * TICK)
        kept.upto(NOW + k * TICK)
        notes |= {kept.note, kept.fault, kept.absent}
    assert notes == {""}


def test_what_never_can_be_used_is_counted_and_not_kept() -> None:
    """Beyond every stamp, and where the clock is set back while some wait."""
    kept, counts = positions()
    for k in range(100):
        kept.take([at(NOW + (1.0 if k % 2 else -1.0) * (STRAY + 0.1), [1.0, 2.0, k])], NOW)
    assert counts.stray == 100
    kept.take([at(NOW + 0.2)], NOW)
    kept.take([], NOW - 3600.0)
    assert counts.stray == 101
    assert kept.upto(NOW + 1.0) == []


def test_what_is_no_position_is_refused() -> None:
    """By one line."""
    kept, _ = positions()
    for bad in (None, "x", 7):
        with pytest.raises(InputError, match="a position of the ball"):
            kept.take([bad], NOW)  # type: ignore[list-item]
