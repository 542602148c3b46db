"""Statistics of success rates, and of their differences on paired throws."""

from collections.abc import Sequence
from math import comb, sqrt
from statistics import NormalDist


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
