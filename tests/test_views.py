"""Views in compiled code are those of NumPy, and show nothing that could be freed meanwhile."""

import ast
import os
import subprocess
import sys
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from numba import njit
from numba.core.errors import TypingError
from numpy.typing import NDArray

from mitt.jit import PACKAGE
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


def _owned(function: ast.FunctionDef) -> set[str]:
    """Return the names in a function that stand for arguments, or for parts and views of them."""
    arguments = function.args
    held = {x.arg for x in (*arguments.posonlyargs, *arguments.args, *arguments.kwonlyargs)}
    for line in ast.walk(function):
        if isinstance(line, ast.Assign) and all(_is_part(x, held) for x in _values(line)):
            held |= {x.id for x in ast.walk(line.targets[0]) if isinstance(x, ast.Name)}
    return held


def _values(line: ast.Assign) -> list[ast.expr]:
    """Return what is assigned."""
    return line.value.elts if isinstance(line.value, ast.Tuple) else [line.value]


def _is_part(value: ast.expr, held: set[str]) -> bool:
    """Say whether an expression is part of a name that is held, or a view of one."""
    if isinstance(value, ast.Call) and isinstance(value.func, ast.Name):
        return value.func.id == "view" and _is_part(value.args[0], held)
    while isinstance(value, ast.Subscript | ast.Attribute):
        value = value.value
    return isinstance(value, ast.Name) and value.id in held


def _views() -> Iterator[tuple[str, ast.FunctionDef, ast.Call]]:
    """Yield each view that the source takes, with the function that takes it."""
    for path in sorted(PACKAGE.rglob("*.py")):
        for function in ast.walk(ast.parse(path.read_text())):
            if isinstance(function, ast.FunctionDef):
                for call in ast.walk(function):
                    if isinstance(call, ast.Call) and getattr(call.func, "id", "") == "view":
                        yield f"{path.name}:{call.lineno}", function, call


def test_views_show_arguments_only() -> None:
    """What a kernel has made itself may be freed while a view shows it."""
    found = list(_views())
    assert len(found) > 40
    bad = [where for where, function, call in found
           if not _is_part(call.args[0], _owned(function))]  # fmt: skip
    assert not bad


def test_kernels_that_take_views_return_numbers() -> None:
    """Only functions that become part of their caller return a view."""
    for where, function, _ in _views():
        if any(getattr(x, "id", "") == "kernel" for x in function.decorator_list):
            assert function.returns is not None
            assert "Array" not in ast.unparse(function.returns), where


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
