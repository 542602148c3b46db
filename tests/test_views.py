"""Views in compiled code are those of numpy, of the same numbers, and count no references."""

from typing import Any

import numpy as np
import pytest
from numba import njit
from numba.core.errors import TypingError
from numpy.typing import NDArray

from mitt.views import view


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
