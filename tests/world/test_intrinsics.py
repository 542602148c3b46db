"""What is lent to compiled code is the array itself; what is fetched early changes nothing."""

import sys

import numpy as np
import pytest
from numba import njit

from mitt.signals import Array
from mitt.world.intrinsics import fetch, lent


@njit
def _write(pair: tuple[Array, Array], number: float) -> float:
    """Write into a row of the one, and return a number of the other."""
    one, other = lent(pair)
    row = one[1]
    row[2] = number
    return float(other[0])


@njit
def _sum(numbers: Array, ahead: int) -> float:
    """Add up numbers, each of which is fetched ``ahead`` before it is read."""
    total = 0.0
    for i in range(len(numbers)):
        fetch(numbers, i + ahead)
        total += numbers[i]
    return total


def test_a_lent_array_is_the_array() -> None:
    """What is cut out of it writes the owner's memory, and nobody's count of references moves."""
    one, other = np.zeros((2, 3)), np.arange(4.0) + 5.0
    assert _write((one, other), 1.0) == 5.0
    before = sys.getrefcount(one), sys.getrefcount(other)
    assert [_write((one, other), float(k)) for k in range(50)] == 50 * [5.0]
    assert (sys.getrefcount(one), sys.getrefcount(other)) == before
    assert np.array_equal(one, [[0.0, 0.0, 0.0], [0.0, 0.0, 49.0]])


@pytest.mark.parametrize("ahead", [0, 8, -(10**12), 10**15])
def test_any_place_may_be_fetched(ahead: int) -> None:
    """Numbers are what they are, and memory that is not there harms nobody."""
    assert _sum(np.arange(100.0), ahead) == 4950.0
