"""Ages of commands: the percentiles of all, from counts."""

import numpy as np
import pytest

from mitt.cell.simulated import Ages


@pytest.mark.parametrize("scale", [2e-5, 1e-3, 0.3])
def test_percentiles_are_those_of_all_ages_within_a_class(scale: float) -> None:
    drawn = scale * np.random.default_rng(5).lognormal(sigma=0.7, size=5000)
    ages = Ages()
    for age in drawn:
        ages.add(float(age))
    told = ages.percentiles_us()
    assert told is not None
    for name, share in (("p50", 0.5), ("p99", 0.99), ("p99_9", 0.999)):
        exact = 1e6 * np.quantile(drawn, share, method="inverted_cdf")
        assert exact <= told[name] <= 1.0101 * exact
    assert told["max"] == pytest.approx(1e6 * drawn.max(), rel=1e-12)


def test_without_ages_there_is_none_and_odd_ones_are_counted() -> None:
    ages = Ages()
    assert ages.percentiles_us() is None
    for age in (-1e-3, 0.0, 100.0):
        ages.add(age)
    told = ages.percentiles_us()
    assert told is not None
    assert told["max"] == pytest.approx(1e8)
    assert told["p50"] < 1.1
