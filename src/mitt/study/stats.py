"""Statistics of success rates."""

from math import sqrt
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
