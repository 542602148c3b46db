"""Compiled kernels follow the source of mitt, however it is started."""

import ast
import os
import re
import shutil
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from fresh import fresh
from numba import njit
from numba.core.errors import TypingError
from numpy.typing import NDArray

from mitt.core import kernels
from mitt.core.kernels import PACKAGE, big_kernel, copy, view

CALLER = """
from mitt.core.kernels import kernel
from mitt.callee import inner

@kernel
def outer(x):
    return inner(x)
"""
CALLEE = """
from mitt.core.kernels import kernel

@kernel
def inner(x):
    return {factor} * x
"""


@pytest.fixture
def package(tmp_path: Path) -> Path:
    """Return a package ``mitt`` of one kernel that calls another in another file."""
    folder = tmp_path / "mitt"
    folder.mkdir()
    (folder / "__init__.py").write_text("")
    (folder / "core").mkdir()
    (folder / "core" / "__init__.py").write_text("")
    shutil.copy(kernels.PACKAGE / "core" / "kernels.py", folder / "core" / "kernels.py")
    (folder / "caller.py").write_text(CALLER)
    (folder / "callee.py").write_text(CALLEE.format(factor=2.0))
    return folder


def call(package: Path, **env: str) -> str:
    """Return what a new process prints of ``outer(1.0)``."""
    script = package.parent / "call.py"
    script.write_text(
        "from mitt.caller import outer; print(outer(1.0), sum(outer.stats.cache_hits.values()))"
    )
    done = fresh(script, PYTHONPATH=str(package.parent), **env)
    assert done.status == 0, done.err
    return done.out.strip()


def test_a_cached_kernel_follows_the_kernels_that_it_calls(package: Path, tmp_path: Path) -> None:
    cache = {"NUMBA_CACHE_DIR": "", "XDG_CACHE_HOME": str(tmp_path / "cache")}
    assert call(package, **cache) == "2.0 0"
    assert call(package, **cache) == "2.0 1"
    (package / "callee.py").write_text(CALLEE.format(factor=3.0))
    assert call(package, **cache) == "3.0 0"
    (package / "callee.py").write_text(CALLEE.format(factor=2.0))
    assert call(package, **cache) == "2.0 1"
    assert not list(package.rglob("*.nb[ic]"))


def test_clones_share_compiled_kernels_and_old_versions_go(package: Path, tmp_path: Path) -> None:
    cache = {"NUMBA_CACHE_DIR": str(tmp_path / "cache")}
    clone = shutil.copytree(package, tmp_path / "clone" / "mitt")
    assert call(package, **cache) == "2.0 0"
    assert call(clone, **cache) == "2.0 1"
    (old,) = (tmp_path / "cache").rglob("caller-*")
    os.utime(old, (0.0, 0.0))
    for k in range(8):
        (old.parent / f"{old.name[:-16]}{k:016}").mkdir()
    (clone / "callee.py").write_text(CALLEE.format(factor=3.0))
    assert call(clone, **cache) == "3.0 0"
    assert not old.exists()


def test_without_a_folder_that_can_be_written_to_nothing_is_kept(
    package: Path, tmp_path: Path
) -> None:
    nowhere = tmp_path / "a file"
    nowhere.write_text("")
    assert call(package, NUMBA_CACHE_DIR=str(nowhere)) == "2.0 0"
    assert call(package, NUMBA_CACHE_DIR=str(nowhere)) == "2.0 0"
    assert not list(tmp_path.rglob("*.nb[ic]"))


def test_a_source_is_cold_until_its_tick_is_compiled(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """In an empty cache it is, and no longer where the code of a tick is kept."""
    monkeypatch.setattr(kernels, "cache_folder", lambda: tmp_path)
    assert kernels.is_cold()
    tick = kernels.PACKAGE / "core" / "catcher" / "tick.py"
    folder = kernels._folder_of(tick, tmp_path)
    folder.mkdir(parents=True)
    (folder / "tick.tick-1.py311.1.nbc").touch()
    assert not kernels.is_cold()


def test_all_forms_of_import_are_seen() -> None:
    source = (
        "import mitt.core.ball.flight\n"
        "from mitt.core.arm import (\n    arm,\n    kinematics as c,\n)\n"
        "from mitt.core.ball import filter as f\n"
    )
    found = kernels.imports_of(source)
    assert {
        "mitt.core.ball.flight",
        "mitt.core.arm.arm",
        "mitt.core.arm.kinematics",
        "mitt.core.ball.filter",
    } <= {*found}


def test_a_stamp_covers_all_that_a_file_imports() -> None:
    tick = kernels.PACKAGE / "core" / "catcher" / "tick.py"
    assert kernels.stamp_of(tick) == kernels.stamp_of(tick)
    assert kernels.stamp_of(tick) != kernels.stamp_of(kernels.PACKAGE / "core" / "kernels.py")


BOTH_WAYS = """
import numpy as np
from mitt.core.kernels import kernel

@kernel
def part(v, k=2, factor=1.0):
    return factor * v[k]

@kernel
def whole(v):
    return part(v) + part(v, 0) + part(v, factor=10.0)

print(whole(np.arange(3.0)), part(np.arange(3.0)), part(np.arange(3.0), 1))
print(sum(part.stats.cache_hits.values()) + sum(whole.stats.cache_hits.values()))
"""


def test_a_kernel_that_python_and_kernels_call_is_kept_for_both(tmp_path: Path) -> None:
    """With defaults and names of arguments; a second process takes all from the cache."""
    script, said = tmp_path / "both_ways.py", []
    script.write_text(BOTH_WAYS)
    for _ in range(2):
        done = fresh(script, NUMBA_CACHE_DIR=str(tmp_path / "cache"))
        assert done.status == 0, done.err
        said.append(done.out.splitlines())
    assert said[0] == ["22.0 2.0 1.0", "0"]
    assert said[1][0] == said[0][0]
    assert int(said[1][1]) >= 2
    names = {path.name.split("-")[0] for path in (tmp_path / "cache").rglob("*.nbc")}
    assert names == {"both_ways.part", "both_ways.whole", "both_ways.whole_inner"}


TOWER = """
import sys
import numpy as np
from mitt.core.kernels import big_kernel, kernel

@kernel
def part(v):
    if v[0] < 0.0:
        raise ValueError("negative")
    return v[0]

@big_kernel
def storey(v, k=1):
    return part(v) + v[k]

@kernel
def again(v):
    return 0.0 * part(v)

@kernel
def top(v):
    return storey(v) + storey(v, 2) + again(v)

@kernel
def over(v):
    return top(v)

for name in sys.argv[1:]:
    asked = globals()[name]
    print(asked(np.arange(3.0)), sum(asked.stats.cache_misses.values()), end=" ")
try:
    asked(-np.ones(3))
except ValueError as error:
    print(error)
"""


def test_a_big_kernel_is_compiled_once_and_found_by_its_callers(tmp_path: Path) -> None:
    """By callers of now, by those from the cache, and by those of a kernel from the cache."""
    script, said = tmp_path / "tower.py", []
    script.write_text(TOWER)
    for asked in (["storey", "top"], ["top"], ["over"], ["over"]):
        done = fresh(script, *asked, NUMBA_CACHE_DIR=str(tmp_path / "cache"))
        assert done.status == 0, done.err
        said.append(done.out.strip())
    assert said == ["1.0 1 3.0 1 negative", "3.0 0 negative", "3.0 1 negative", "3.0 0 negative"]
    assert len(list((tmp_path / "cache").rglob("*storey_inner*.nbc"))) == 2


ARRAYS = """
import sys
import numpy as np
from mitt.core.kernels import kernel

@kernel
def one(x):
    return x + 1.0

@kernel
def two(x):
    return one(one(x))

@kernel
def four(x):
    return two(two(x))

@kernel
def made(x):
    out = np.empty(3)
    out[:] = four(x)
    return out

@kernel
def total(x):
    return made(x).sum() + two(x)

print(*(globals()[name](2.0) for name in sys.argv[1:]))
"""


def test_an_array_is_returned_whoever_loaded_the_kernel_first(tmp_path: Path) -> None:
    """Python, or another kernel that calls it, from the cache; whoever compiled it first, too."""
    script, said = tmp_path / "arrays.py", []
    script.write_text(ARRAYS)
    for asked in (["total"], ["made"], ["total", "made"]):
        done = fresh(script, *asked, NUMBA_CACHE_DIR=str(tmp_path / "cache"))
        assert done.status == 0, done.err
        said.append(done.out.strip())
    assert said == ["22.0", "[6. 6. 6.]", "22.0 [6. 6. 6.]"]


COUNTED = """
import sys
from typing import NamedTuple
import numpy as np
from mitt.core.kernels import big_kernel, copy, kernel

class Pair(NamedTuple):
    one: np.ndarray
    two: np.ndarray

@big_kernel
def filled(pair):
    copy(pair.one, pair.two)
    return pair.two[1:].sum()

@kernel
def used(pair):
    return filled(pair) + filled(Pair(pair.two, pair.one))

@kernel
def part(pair):
    return pair.one[1:]

@kernel
def parts(pair):
    return pair.two[:2], part(pair)

@kernel
def made(pair):
    return part(pair).copy().sum() + used(pair)

def held(pair):
    return sys.getrefcount(pair.one), sys.getrefcount(pair.two)

pair = Pair(np.arange(3.0), np.zeros(3))
before = held(pair)
for _ in range(10):
    print(used(pair), *part(pair), *parts(pair)[1], made(pair), held(pair) == before)
for kind in filled.inner.overloads.values():
    print("call void @NRT_" in kind.library.get_llvm_str())
"""


def test_kernels_give_back_the_arrays_that_they_are_given(tmp_path: Path) -> None:
    """Whether they count who holds them or, as those that make none, do not."""
    script = tmp_path / "counted.py"
    script.write_text(COUNTED)
    for _ in ("compiled", "from the cache"):
        done = fresh(script, NUMBA_CACHE_DIR=str(tmp_path / "cache"))
        assert done.out == 10 * "6.0 1.0 2.0 1.0 2.0 9.0 True\n" + "False\n"


def test_a_big_kernel_that_returns_an_array_is_refused() -> None:
    """Who calls it by its address could not know whether it has been counted."""

    def part(v: NDArray[Any]) -> NDArray[Any]:
        return v[1:]

    with pytest.raises(TypeError, match="part_inner: wanted a big kernel that returns no array"):
        big_kernel(part)(np.zeros(3))


BEYOND = """
import numpy as np
from mitt.core.kernels import kernel

@kernel
def third(x):
    return x[2]
"""


@pytest.mark.parametrize("first", ["0", "1"])
def test_code_that_checks_bounds_is_kept_apart(package: Path, tmp_path: Path, first: str) -> None:
    """Whichever is compiled first: what runs does what its own process asked for."""
    (package / "beyond.py").write_text(BEYOND)
    second = "1" if first == "0" else "0"
    script = tmp_path / "beyond.py"
    script.write_text("from mitt.beyond import third, np; third(np.ones(3)); third(np.ones(3)[:2])")
    for checked in (first, second, first):
        done = fresh(
            script,
            PYTHONPATH=str(package.parent),
            NUMBA_BOUNDSCHECK=checked,
            NUMBA_CACHE_DIR="",
            XDG_CACHE_HOME=str(tmp_path / "cache"),
        )
        assert ("IndexError" in done.err) == (done.status != 0) == (checked == "1"), done.err


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
    """Return the names in a function that only ever stand for arguments, their parts and views."""
    arguments = function.args
    held = {x.arg for x in (*arguments.posonlyargs, *arguments.args, *arguments.kwonlyargs)}
    other: set[str] = set()
    for line in ast.walk(function):
        if isinstance(line, ast.Assign):
            for name, value in _pairs(line):
                (held if _is_part(value, held) else other).add(name)
    return held - other


def _pairs(line: ast.Assign) -> Iterator[tuple[str, ast.expr]]:
    """Yield each name that is assigned, with what it is assigned or a part of it."""
    (target,) = line.targets
    targets = target.elts if isinstance(target, ast.Tuple) else [target]
    both = isinstance(target, ast.Tuple) and isinstance(line.value, ast.Tuple)
    values = line.value.elts if both else [line.value] * len(targets)  # type: ignore[attr-defined]
    for one, value in zip(targets, values, strict=True):
        yield from (
            (x.id, value)
            for x in ast.walk(one)
            if isinstance(x, ast.Name) and not isinstance(one, ast.Subscript)
        )


def _is_part(value: ast.expr, held: set[str]) -> bool:
    """Say whether an expression is part of a name that is held, or a view of one."""
    if isinstance(value, ast.Call) and isinstance(value.func, ast.Name):
        return value.func.id in _showing() and _is_part(value.args[0], held)
    while isinstance(value, ast.Subscript | ast.Attribute):
        value = value.value
    return isinstance(value, ast.Name) and value.id in held


@cache
def _showing() -> frozenset[str]:
    """Return the names of the functions that return views of what they are given."""
    texts = [path.read_text(encoding="utf-8") for path in PACKAGE.rglob("*.py")]
    functions = [
        x
        for text in texts
        if "@register_jitable" in text
        for x in ast.walk(ast.parse(text))
        if isinstance(x, ast.FunctionDef) and "view(" in ast.unparse(x)
    ]
    inlined = [
        x.name
        for x in functions
        if any(getattr(d, "id", "") == "register_jitable" for d in x.decorator_list)
    ]
    return frozenset(("view", *inlined))


def _views() -> Iterator[tuple[str, ast.FunctionDef, ast.Call]]:
    """Yield each view that the source takes, with the function that takes it."""
    texts = {path: path.read_text(encoding="utf-8") for path in sorted(PACKAGE.rglob("*.py"))}
    for path in [path for path, text in texts.items() if re.search(r"(?<![\w.])view\(", text)]:
        for function in ast.walk(ast.parse(texts[path])):
            if isinstance(function, ast.FunctionDef):
                for call in ast.walk(function):
                    if isinstance(call, ast.Call) and getattr(call.func, "id", "") == "view":
                        yield f"{path.name}:{call.lineno}", function, call


def test_views_show_arguments_only() -> None:
    """What a kernel has made itself may be freed while a view shows it."""
    found = list(_views())
    assert len(found) > 40
    bad = [where for where, function, call in found if not _is_part(call.args[0], _owned(function))]
    assert not bad


@pytest.mark.parametrize(
    ("act", "fault"),
    [
        ("return view(v, 2, (2, 2)).sum()", "a view reaches beyond its array"),
        ("copy(v, np.zeros(6)); return 4.0", "a copy into an array of another shape"),
    ],
)
def test_what_is_beyond_an_array_is_found_where_bounds_are_checked(
    act: str, fault: str, tmp_path: Path
) -> None:
    """By numba's own switch."""
    script = tmp_path / "beyond.py"
    script.write_text(
        "import numpy as np; from numba import njit; from mitt.core.kernels import copy, view\n"
        f"@njit\ndef f(v): {act}\n"
        "print(f(np.ones(6)))\nf(np.ones(5))"
    )
    done = fresh(script, NUMBA_BOUNDSCHECK="1")
    assert done.out == "4.0\n"
    assert fault in done.err


@njit
def copied(values: NDArray[Any], into: NDArray[Any]) -> None:
    """Copy in compiled code."""
    copy(values, into)


def test_a_copy_is_what_an_assignment_is() -> None:
    """Of rows, columns and numbers of another type, compiled and plain."""
    for values, at in (
        (np.arange(6.0).reshape(2, 3), np.s_[1:3, 2:5]),
        (np.arange(8)[::2], np.s_[0]),
        (np.arange(4.0, dtype=np.float32), np.s_[:, 1]),
    ):
        mine, plain, wanted = (np.zeros((4, 5))[:, : 5 if values.ndim == 2 else 4] for _ in "abc")
        wanted[at] = values
        copied(values, mine[at])
        copy(values, plain[at])
        assert np.array_equal(mine, wanted)
        assert np.array_equal(plain, wanted)


def test_no_kernel_needs_scipy() -> None:
    """Numba computes products and systems of matrices by SciPy, which is not installed by mitt."""
    found = []
    for path in PACKAGE.rglob("*.py"):
        text = path.read_text(encoding="utf-8")
        for function in ast.walk(ast.parse(text)) if "kernel" in text else ():
            if isinstance(function, ast.FunctionDef) and any(
                ast.unparse(by).endswith("kernel") for by in function.decorator_list
            ):
                found += [
                    f"{path.name}: {function.name}"
                    for part in ast.walk(function)
                    if isinstance(part, ast.MatMult)
                    or (isinstance(part, ast.Attribute) and part.attr in ("linalg", "dot"))
                ]
    assert found == []
