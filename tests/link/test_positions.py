"""Positions of the ball reach the reading that they belong to; a stream of no use is named."""

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mitt.errors import InputError
from mitt.link.readings import STRAY, WINDOW, Counts, Positions
from mitt.signals import TICK, Sighting

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
@given(st.lists(st.integers(1, 12), min_size=1, max_size=12), st.integers(-3, 5),
       st.integers(0, 2**32 - 1))  # fmt: skip
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
    "no time": (lambda k, r: at(np.nan * k, r), "stamps of the ball are no numbers", False),
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
        kept.take([change(k, np.array([2.0, 0.1, 0.5]) + 1e-3 * rng.normal(size=3))],
                  NOW + k * TICK)  # fmt: skip
        kept.upto(NOW + k * TICK)
    assert says in (kept.fault if fault else kept.note + kept.absent)
    assert bool(kept.fault) == fault
    kept.take([], NOW + 3.0)
    assert kept.fault == ""
    kept.take([at(NOW + 3.0, [1.0, 2.0, 3.0])], NOW + 3.0)
    assert kept.absent == ""


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
