"""Time from a robot's stamps: only forward, and jumps of its clock are found."""

from hypothesis import given
from hypothesis import strategies as st

from mitt.link.stamps import Stamps
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
