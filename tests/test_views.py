"""Views in compiled code are those of numpy; what is lent is what it was."""

import os
import re
import subprocess
import sys
from typing import Any

import numpy as np
import pytest
from numba import njit
from numba.core.errors import TypingError
from numba.typed import List
from numpy.typing import NDArray

from mitt.signals import Array
from mitt.views import lent, view


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


def test_a_lent_array_is_the_array() -> None:
    """What is cut out of it writes the owner's memory."""
    one, other = np.zeros((2, 3)), np.arange(4.0) + 5.0
    assert [_write((one, other), float(k)) for k in range(50)] == 50 * [5.0]
    assert np.array_equal(one, [[0.0, 0.0, 0.0], [0.0, 0.0, 49.0]])


@njit
def _kept(x: Array) -> Array:
    """Return what was given, which counts."""
    return x


def _kernel(take: Any) -> Any:  # noqa: ANN401 (numba's functions)
    """Return a kernel that finds the second number of the row whose first is the largest."""

    @njit
    def largest(rows: Array, best: Array) -> float:
        rows, best = take(rows), take(best)
        for k in range(len(rows)):
            row = rows[k]
            if row[0] > best[0]:
                best = row
        return float(best[1])

    return largest


@njit
def _largest_viewed(rows: Array, best: Array) -> float:
    """Find the same among views."""
    best = lent(best)
    for k in range(len(rows)):
        row = view(rows, 3 * k, (3,))
        if row[0] > best[0]:
            best = row
    return float(best[1])


def _counts(kernel: Any) -> int:  # noqa: ANN401 (a numba dispatcher)
    """Return how often a kernel counts a reference."""
    assert kernel(np.arange(9.0).reshape(3, 3), np.zeros(3)) == 7.0
    (code,) = kernel.inspect_llvm().values()
    bodies = re.findall(r"^define .*?^}", str(code), re.MULTILINE | re.DOTALL)
    own = [body for body in bodies if "@NRT_" not in body.split("{", 1)[0]]
    return sum(body.count("@NRT_incref") for body in own)


def test_a_kernel_counts_no_references_to_what_it_has_lent() -> None:
    """Nor to what it views; the same kernel without does."""
    assert _counts(_kernel(_kept)) > 0
    assert _counts(_kernel(lent)) == 0
    assert _counts(_largest_viewed) == 0


@pytest.mark.parametrize("owned", ["text", List([1.0])])
def test_only_arrays_and_numbers_are_lent(owned: object) -> None:
    """Another value with an owner would be freed while in use: the kernel does not compile."""

    @njit
    def borrow(pair: tuple[Array, object]) -> float:
        return float(lent(pair)[0][0])

    with pytest.raises(TypingError):
        borrow((np.ones(2), owned))


def test_a_view_beyond_its_array_is_found_where_bounds_are_checked() -> None:
    """By numba's own switch."""
    code = (
        "import numpy as np; from numba import njit; from mitt.views import view\n"
        "@njit\ndef f(v): return view(v, 2, (2, 2)).sum()\n"
        "print(f(np.ones(6)))\nf(np.ones(5))"
    )
    run = subprocess.run(
        [sys.executable, "-c", code], env=os.environ | {"NUMBA_BOUNDSCHECK": "1"},
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert run.stdout == "4.0\n"
    assert "a view reaches beyond its array" in run.stderr
