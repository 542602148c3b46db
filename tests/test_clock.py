"""Timing of blocks, and loops that keep their time."""

import gc
import os
import threading
from types import SimpleNamespace
from unittest.mock import patch

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mitt.clock import Pace, Stopwatch, hurried, longest_stall, pinned, settle, timekeeping


@pytest.fixture
def fake(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """A clock whose readings [ns] are taken from a list."""
    readings: list[int] = []
    monkeypatch.setattr("mitt.clock.steady_ns", lambda: readings.pop(0))
    return readings


def timed(durations_us: list[int], readings: list[int]) -> Stopwatch:
    """Return a stopwatch that was entered for some durations."""
    watch = Stopwatch(deadline_us=1000.0)
    for us in durations_us:
        readings.extend([5_000, 5_000 + 1000 * us])
        with watch:
            pass
    return watch


def test_without_entries_all_is_zero() -> None:
    """Percentiles and misses of nothing are zero, not NaN."""
    watch = Stopwatch()
    assert set(watch.percentiles_us().values()) == {0.0}
    assert watch.misses() == 0


def test_percentiles_and_misses_of_known_times(fake: list[int]) -> None:
    """Of 1 to 1001 us the median is 501, the maximum 1001, and one misses 1000."""
    watch = timed(list(range(1, 1002)), fake)
    times = watch.percentiles_us()
    assert times["p50"] == pytest.approx(501.0)
    assert times["p99"] == pytest.approx(991.0)
    assert times["p99_9"] == pytest.approx(1000.0)
    assert times["max"] == pytest.approx(1001.0)
    assert watch.misses() == 1


def test_clearing_forgets(fake: list[int]) -> None:
    """What was measured while warming up does not count."""
    watch = timed([9_000_000], fake)
    watch.clear()
    assert watch.percentiles_us()["max"] == 0.0


def test_a_block_that_fails_is_timed_and_fails(fake: list[int]) -> None:
    """The stopwatch neither swallows an error nor forgets the entry."""
    fake.extend([0, 7000])
    watch = Stopwatch()
    with pytest.raises(ValueError, match="ours"), watch:
        raise ValueError("ours")
    assert watch.percentiles_us()["max"] == pytest.approx(7.0)


@given(st.lists(st.integers(0, 10**7), min_size=1, max_size=50))
def test_percentiles_rise(durations: list[int]) -> None:
    """p50 <= p99 <= p99.9 <= max, whatever was measured."""
    readings: list[int] = []
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("mitt.clock.steady_ns", lambda: readings.pop(0))
        times = timed(durations, readings).percentiles_us()
    assert times["p50"] <= times["p99"] <= times["p99_9"] <= times["max"]
    assert times["max"] == pytest.approx(max(durations))


def test_a_machine_that_stalls_is_told_from_one_that_keeps_time(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """By the latest tick of many; the stop that it leads to is said."""
    for latest, warned in ((0.0004, False), (0.012, True)):
        late = iter([0.0] * 1000 + [latest] + [0.0] * 999)
        monkeypatch.setattr("mitt.clock.sleep_until", lambda _, late=late: next(late))
        assert longest_stall(0) == latest
        late = iter([latest] * 2000)
        monkeypatch.setattr("mitt.clock.sleep_until", lambda _, late=late: next(late))
        said = timekeeping(-1)
        assert f"{1e3 * latest:.1f} ms late at most" in said
        assert ("stop the arm" in said) == warned


def test_settling_freezes_what_is_there() -> None:
    """All containers that live are frozen, and those made later are not."""
    before = gc.get_freeze_count()
    mine: list[list[int]] = [[k] for k in range(100)]
    settle()
    try:
        frozen = gc.get_freeze_count()
        assert frozen >= before + len(mine)
        mine.append([0])
        assert gc.get_freeze_count() == frozen
    finally:
        gc.unfreeze()


def test_a_hurried_loop_takes_the_threads_that_there_are_with_it() -> None:
    """And gives all of them back; where it is not allowed nothing is changed."""
    over, seen = threading.Event(), list[int]()
    other = threading.Thread(target=over.wait)
    other.start()
    assert other.native_id is not None
    before = os.sched_getscheduler(other.native_id)
    with hurried() as granted:
        seen = [os.sched_getscheduler(k) for k in (0, other.native_id)]
        wanted = os.SCHED_FIFO if "FIFO 50" in granted else before
    assert seen == [wanted, wanted]
    assert os.sched_getscheduler(other.native_id) == before
    over.set()
    other.join()


@pytest.mark.parametrize("place", [0, -1])
def test_a_loop_has_a_core_of_its_own(place: int) -> None:
    """The calling thread stays on one core of those allowed, another thread does not."""
    before = os.sched_getaffinity(0)
    done, others = threading.Event(), list[set[int]]()

    def look() -> None:
        done.wait()
        others.append(os.sched_getaffinity(0))

    other = threading.Thread(target=look)
    other.start()
    with pinned(place):
        assert os.sched_getaffinity(0) == {sorted(before)[place]}
        done.set()
        other.join()
    assert os.sched_getaffinity(0) == before
    assert others == [before]


def _left(steps: list[tuple[float, int]], of: int) -> list[float | None]:
    """Return the times left that are told of work, by the time and the work of each step."""
    now = [100.0]
    with patch("mitt.clock.time", SimpleNamespace(monotonic=lambda: now[0])):
        pace, done = Pace(), 0
        out = [pace.left(done, of)]
        for lasts, more in steps:
            now[0] += lasts
            done += more
            out.append(pace.left(done, of))
    return out


@given(st.lists(st.tuples(st.floats(0.01, 100.0), st.integers(0, 20)), max_size=40))
def test_the_time_left_is_told_once_it_is_known(steps: list[tuple[float, int]]) -> None:
    """However the pace changes; nothing is told before the first report is due."""
    left = _left(steps, 1000)
    told = [x for x in left if x is not None]
    assert left == [None] * (len(left) - len(told)) + told
    assert all(0.0 <= x < np.inf for x in told)


@given(
    slower=st.floats(1.0, 5.0),
    before=st.integers(20, 200),
    after=st.integers(60, 200),
    more=st.integers(0, 200),
)
def test_the_time_left_never_grows_in_silence(
    slower: float, before: int, after: int, more: int
) -> None:
    """A machine that slows down, work that turns out to be more: what is said is true, and new."""
    now, of, ends = [100.0], before + after, list[float]()
    with patch("mitt.clock.time", SimpleNamespace(monotonic=lambda: now[0])):
        pace, said, least = Pace(), "", np.inf
        pace.left(0, of)
        for k in range(before + after + more):
            now[0] += 5.0 if k < before else 5.0 * slower
            of += more if k == before else 0
            left = pace.left(k + 1, of)
            if left is None:
                continue
            said, end = pace.words(left), now[0] + left
            grown = end - least > 0.1 * (least - 100.0) + 30.0 + 1e-6
            assert ("more than was said" in said) == grown
            least = end if grown else min(least, end)
            ends.append(end)
    assert now[0] / 1.5 < ends[len(ends) - after // 2] < 1.5 * now[0]


def test_the_time_left_is_that_of_the_pace_and_follows_it() -> None:
    """Exact at an even pace; nearer to the new pace than to the old one after two minutes."""
    even = _left([(5.0, 1)] * 100, 100)
    assert even[:2] == [None, None]
    assert even[2:] == pytest.approx([500.0 - 5.0 * k for k in range(2, 101)])
    faster = _left([(10.0, 1)] * 10 + [(5.0, 2)] * 40, 90)
    assert faster[10] == pytest.approx(800.0)
    assert faster[34] is not None
    assert 80.0 < faster[34] < 200.0  # at the new pace and half way to that at the old one
