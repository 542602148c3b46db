"""Views in compiled code are those of numpy; what is lent or fetched early is what it was."""

import sys
from typing import Any

import numpy as np
import pytest
from numba import njit
from numba.core.errors import TypingError
from numpy.typing import NDArray

from mitt.signals import Array
from mitt.views import fetch, lent, view


@njit
def shown(v: NDArray[Any], start: int, rows: int, columns: int) -> NDArray[Any]:
    """Return a copy of a view, two of whose numbers have changed places."""
    x = view(v, start, (rows, columns))
    x[0, 0], x[rows - 1, columns - 1] = x[rows - 1, columns - 1], x[0, 0]
    return x.copy()


@pytest.mark.parametrize("shape", [(24,), (4, 6), (2, 3, 4)])
@pytest.mark.parametrize("dtype", [np.float64, np.int64, np.uint8])
def test_a_view_shows_the_numbers_themselves(shape: tuple[int, ...], dtype: type) -> None:
    """Compiled and plain: the same rows, and what is written there is written into the array."""
    v: NDArray[Any] = np.arange(24, dtype=dtype).reshape(shape)
    plain, mine = v.copy(), v.copy()
    x = view(plain, 5, (3, 4))
    x[0, 0], x[2, 3] = x[2, 3], x[0, 0]
    assert np.array_equal(shown(mine, 5, 3, 4), x)
    assert np.array_equal(mine, plain)
    assert mine.ravel()[5] == 16
    assert mine.ravel()[16] == 5


def test_what_has_gaps_is_refused() -> None:
    """Columns of a table do not lie one after another: the kernel does not compile."""
    with pytest.raises(TypingError):
        shown(np.zeros((6, 8))[:, ::2], 0, 2, 2)


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
