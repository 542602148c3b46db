"""The stopwatch: counts, orders and forgets; how long anything takes is not asserted."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mitt.link.clock import Stopwatch


@pytest.fixture
def fake(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """A clock whose readings [ns] are taken from a list."""
    readings: list[int] = []
    monkeypatch.setattr("mitt.link.clock.steady_ns", lambda: readings.pop(0))
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
        patch.setattr("mitt.link.clock.steady_ns", lambda: readings.pop(0))
        times = timed(durations, readings).percentiles_us()
    assert times["p50"] <= times["p99"] <= times["p99_9"] <= times["max"]
    assert times["max"] == pytest.approx(max(durations))
