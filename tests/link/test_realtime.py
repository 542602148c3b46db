"""What is there before a loop is left alone by the garbage collector."""

import gc
import os
import threading

import pytest

from mitt.link.clock import hurried, longest_stall, pinned, settle, timekeeping


def test_a_machine_that_stalls_is_told_from_one_that_keeps_time(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """By the latest tick of many; the stop that it leads to is said."""
    for latest, warned in ((0.0004, False), (0.012, True)):
        late = iter([0.0] * 1000 + [latest] + [0.0] * 999)
        monkeypatch.setattr("mitt.link.clock.sleep_until", lambda _, late=late: next(late))
        assert longest_stall(0) == latest
        late = iter([latest] * 2000)
        monkeypatch.setattr("mitt.link.clock.sleep_until", lambda _, late=late: next(late))
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
