"""Statistics of success rates, and of their differences on paired throws."""

from collections.abc import Iterable, Sequence
from math import comb, exp, log, sqrt
from statistics import NormalDist, fmean, stdev

import numpy as np


def wilson(successes: int, trials: int, *, confidence: float = 0.95) -> tuple[float, float]:
    """Return the Wilson score interval of a success rate; (0, 1) without trials.

    E. B. Wilson, Probable inference, the law of succession, and statistical inference,
    J. Am. Stat. Assoc. 22 (1927) 209-212.
    """
    if trials == 0:
        return 0.0, 1.0
    z = NormalDist().inv_cdf(0.5 + 0.5 * confidence)
    rate, spread = successes / trials, z * z / trials
    centre = (rate + 0.5 * spread) / (1.0 + spread)
    half = z * sqrt(rate * (1.0 - rate) / trials + 0.25 * spread / trials) / (1.0 + spread)
    # Exactly 0 and 1 at the ends, where rounding would leave a little.
    low = 0.0 if successes == 0 else centre - half
    return low, 1.0 if successes == trials else centre + half


def mcnemar(only_first: int, only_second: int) -> float:
    """Return the exact two-sided p of McNemar's test, by the binomial of the discordant pairs.

    Q. McNemar, Note on the sampling error of the difference between correlated proportions or
    percentages, Psychometrika 12 (1947) 153-157.

    Args:
        only_first: Pairs in which only the first succeeded.
        only_second: Pairs in which only the second did.
    """
    n, k = only_first + only_second, min(only_first, only_second)
    tail = sum(comb(n, i) for i in range(k + 1))
    return min(1.0, float(2 * tail / (1 << n)))  # whole numbers until the last division


def paired_difference(
    only_first: int, only_second: int, pairs: int, *, confidence: float = 0.95
) -> tuple[float, float, float]:
    """Return by how much the second's rate is above the first's, and the ends of its interval.

    An adjusted Wald interval: half a success is added to each of the four kinds of pairs, so it
    has a width even where no pair differs. Two rates are called equal within a margin where the
    whole interval lies within it.

    D. G. Bonett and R. M. Price, Adjusted Wald confidence interval for a difference of binomial
    proportions based on paired data, J. Educ. Behav. Stat. 37 (2012) 479-488.

    Args:
        only_first: Pairs in which only the first succeeded.
        only_second: Pairs in which only the second did.
        pairs: All pairs.
        confidence: Of the interval.
    """
    if pairs == 0:
        return 0.0, -1.0, 1.0
    z = NormalDist().inv_cdf(0.5 + 0.5 * confidence)
    first, second = (only_first + 1) / (pairs + 2), (only_second + 1) / (pairs + 2)
    centre = second - first
    half = z * sqrt((first + second - centre * centre) / (pairs + 2))
    found = (only_second - only_first) / pairs
    return found, max(centre - half, -1.0), min(centre + half, 1.0)


def ratio_of_means(
    first: Sequence[float], second: Sequence[float], *, confidence: float = 0.95
) -> tuple[float, float, float] | None:
    """Return the second's geometric mean over the first's on the same pairs, and its interval.

    By the normal interval of the mean logarithm of the ratios. None of fewer than two pairs of
    positive numbers.

    Args:
        first: Values of the first.
        second: Values of the second, of the same pairs.
        confidence: Of the interval.
    """
    logs = [log(b / a) for a, b in zip(first, second, strict=True) if a > 0.0 and b > 0.0]
    if len(logs) < 2:
        return None
    z = NormalDist().inv_cdf(0.5 + 0.5 * confidence)
    half = z * stdev(logs) / sqrt(len(logs))
    centre = fmean(logs)
    return exp(centre), exp(centre - half), exp(centre + half)


def spread_of(values: Iterable[float | None], percent: int = 95) -> dict[str, float] | None:
    """Return ``median`` and a percentile, as ``p95``, of what is known; None where nothing is."""
    known = [x for x in values if x is not None]
    if not known:
        return None
    median, most = np.percentile(known, [50.0, percent])
    return {"median": float(median), f"p{percent}": float(most)}


def holm(p: Sequence[float]) -> list[float]:
    """Return p values corrected for their number, step by step.

    S. Holm, A simple sequentially rejective multiple test procedure, Scand. J. Stat. 6 (1979)
    65-70.
    """
    out, worst = [0.0] * len(p), 0.0
    for rank, k in enumerate(sorted(range(len(p)), key=lambda k: p[k])):
        worst = max(worst, min(1.0, (len(p) - rank) * p[k]))
        out[k] = worst
    return out
