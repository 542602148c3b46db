"""Intervals, paired tests and corrections: known values, and the laws they must keep."""

from itertools import pairwise
from math import comb

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mitt.lab.trials.statistics import (
    holm,
    mcnemar,
    paired_difference,
    ratio_of_means,
    wilson,
)

#: Agreement with values printed to four digits.
PRINTED = 5e-5
EXACT = 1e-12

counts = st.integers(1, 2000).flatmap(lambda n: st.tuples(st.integers(0, n), st.just(n)))


@pytest.mark.parametrize(
    ("successes", "trials", "low", "high"),
    [
        (49, 50, 0.8950, 0.9965),
        (5, 10, 0.2366, 0.7634),
        (0, 10, 0.0, 0.2775),
        (10, 10, 0.7225, 1.0),
        (81, 263, 0.2553, 0.3662),
    ],
)
def test_known_intervals(successes: int, trials: int, low: float, high: float) -> None:
    """Intervals in print; 81 of 263 is that of R. G. Newcombe, Stat. Med. 17 (1998) 857."""
    assert wilson(successes, trials) == pytest.approx((low, high), abs=PRINTED)


def test_without_trials_nothing_is_known() -> None:
    """No trials: the whole range."""
    assert wilson(0, 0) == (0.0, 1.0)


@given(count=counts)
def test_the_interval_holds_the_rate_and_stays_a_probability(count: tuple[int, int]) -> None:
    """0 <= low <= rate <= high <= 1, and never of width 0."""
    low, high = wilson(*count)
    assert 0.0 <= low <= count[0] / count[1] + EXACT
    assert count[0] / count[1] - EXACT <= high <= 1.0
    assert high > low


@given(count=counts)
def test_successes_and_failures_mirror_each_other(count: tuple[int, int]) -> None:
    """The interval of the failures is one minus that of the successes."""
    low, high = wilson(*count)
    assert wilson(count[1] - count[0], count[1]) == pytest.approx((1 - high, 1 - low), abs=EXACT)


@given(count=counts, factor=st.integers(2, 20))
def test_more_trials_or_less_confidence_narrow_it(count: tuple[int, int], factor: int) -> None:
    """At the same rate, more trials or less confidence give a narrower interval."""
    low, high = wilson(*count)
    for narrower in (
        wilson(factor * count[0], factor * count[1]),
        wilson(*count, confidence=0.8),
    ):
        assert narrower[1] - narrower[0] < high - low


@given(st.integers(0, 60), st.integers(0, 60))
def test_mcnemar_is_the_two_sided_sign_test_of_the_discordant_pairs(b: int, c: int) -> None:
    """Against the sum of binomial probabilities no larger than that of what was seen."""
    n = b + c
    each = [comb(n, i) / 2**n for i in range(n + 1)]
    wanted = sum(p for p in each if p <= each[b] * (1.0 + 1e-9))
    assert mcnemar(b, c) == pytest.approx(min(1.0, wanted))
    assert mcnemar(b, c) == mcnemar(c, b)


@given(st.lists(st.floats(0.0, 1.0), max_size=30))
def test_holm_lies_between_no_correction_and_bonferroni_and_keeps_the_order(p: list[float]) -> None:
    corrected = holm(p)
    for raw, value in zip(p, corrected, strict=True):
        assert raw <= value <= min(1.0, len(p) * raw) + 1e-15
    order = sorted(range(len(p)), key=lambda k: p[k])
    assert all(corrected[a] <= corrected[b] for a, b in pairwise(order))


def test_holm_does_what_the_textbook_example_says() -> None:
    assert holm([0.01, 0.04, 0.03, 0.005]) == pytest.approx([0.03, 0.06, 0.06, 0.02])


@pytest.mark.parametrize(("p_first", "p_second"), [(0.05, 0.05), (0.10, 0.02), (0.0, 0.03)])
def test_the_interval_of_a_paired_difference_covers_what_it_says(
    p_first: float, p_second: float
) -> None:
    """Of many simulated comparisons of 300 pairs, about 95 of 100 intervals hold the truth."""
    rng = np.random.default_rng(3)
    kinds = rng.multinomial(300, [p_first, p_second, 1.0 - p_first - p_second], size=4000)
    held = 0
    for only_first, only_second, _ in kinds:
        found, low, high = paired_difference(int(only_first), int(only_second), 300)
        assert low <= found <= high
        held += low <= p_second - p_first <= high
    assert 0.935 < held / len(kinds) < 0.985


def test_no_differing_pair_is_no_certainty() -> None:
    """Sixty equal pairs leave a difference of some points open; none leaves all open."""
    assert paired_difference(0, 0, 0) == (0.0, -1.0, 1.0)
    found, low, high = paired_difference(0, 0, 60)
    assert found == 0.0
    assert low == -high
    assert 0.02 < high < 0.08


def test_a_ratio_of_geometric_means_is_that_of_the_pairs() -> None:
    """Of equal ratios exactly; its interval grows with their spread; one pair has none."""
    assert ratio_of_means([1.0, 2.0, 3.0], [2.0, 4.0, 6.0]) == pytest.approx((2.0, 2.0, 2.0))
    found = ratio_of_means([1.0, 1.0, 1.0], [1.0, 2.0, 4.0])
    assert found is not None
    assert found[0] == pytest.approx(2.0)
    assert found[1] < 1.0 < 2.0 < found[2]
    assert ratio_of_means([1.0], [2.0]) is None
    assert ratio_of_means([0.0, 1.0], [2.0, 2.0]) is None
