"""Compiled kernels follow the source of mitt, however it is started."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from mitt import jit

CALLER = """
from mitt.jit import kernel
from mitt.callee import inner

@kernel
def outer(x):
    return inner(x)
"""
CALLEE = """
from mitt.jit import kernel

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
    shutil.copy(jit.PACKAGE / "jit.py", folder / "jit.py")
    (folder / "caller.py").write_text(CALLER)
    (folder / "callee.py").write_text(CALLEE.format(factor=2.0))
    return folder


def call(package: Path, **env: str) -> str:
    """Return what a new process prints of ``outer(1.0)``."""
    code = "from mitt.caller import outer; print(outer(1.0), sum(outer.stats.cache_hits.values()))"
    done = subprocess.run(
        [sys.executable, "-c", code],
        env=os.environ | {"PYTHONPATH": str(package.parent)} | env,
        capture_output=True,
        text=True,
        check=True,
    )
    return done.stdout.strip()


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


def test_all_forms_of_import_are_seen() -> None:
    source = (
        "import mitt.ball.flight\nfrom mitt.robot import (\n    arm,\n    kinematics as c,\n)\n"
        "from mitt.ball import filter as f\n"
    )
    found = jit.imports_of(source)
    assert {"mitt.ball.flight", "mitt.robot.arm", "mitt.robot.kinematics", "mitt.ball.filter"} <= {
        *found
    }


def test_a_stamp_covers_all_that_a_file_imports() -> None:
    tick = jit.PACKAGE / "catcher" / "tick.py"
    assert jit.stamp_of(tick) == jit.stamp_of(tick)
    assert jit.stamp_of(tick) != jit.stamp_of(jit.PACKAGE / "views.py")


BOTH_WAYS = """
import numpy as np
from mitt.jit import kernel

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
        run = subprocess.run(
            [sys.executable, str(script)], capture_output=True, text=True, check=True,
            env=os.environ | {"NUMBA_CACHE_DIR": str(tmp_path / "cache")},
        )  # fmt: skip
        said.append(run.stdout.splitlines())
    assert said[0] == ["22.0 2.0 1.0", "0"]
    assert said[1][0] == said[0][0]
    assert int(said[1][1]) >= 2
    names = {path.name.split("-")[0] for path in (tmp_path / "cache").rglob("*.nbc")}
    assert names == {"both_ways.part", "both_ways.part_inner", "both_ways.whole"}


BEYOND = """
import numpy as np
from mitt.jit import kernel

@kernel
def third(x):
    return x[2]
"""


@pytest.mark.parametrize("first", ["0", "1"])
def test_code_that_checks_bounds_is_kept_apart(package: Path, tmp_path: Path, first: str) -> None:
    """Whichever is compiled first: what runs does what its own process asked for."""
    (package / "beyond.py").write_text(BEYOND)
    second = "1" if first == "0" else "0"
    code = "from mitt.beyond import third, np; third(np.ones(3)); third(np.ones(3)[:2])"
    for checked in (first, second, first, second):
        done = subprocess.run(
            [sys.executable, "-c", code],
            env=os.environ | {"PYTHONPATH": str(package.parent), "NUMBA_BOUNDSCHECK": checked,
                              "NUMBA_CACHE_DIR": "", "XDG_CACHE_HOME": str(tmp_path / "cache")},
            capture_output=True, text=True, check=False,
        )  # fmt: skip
        assert ("IndexError" in done.stderr) == (checked == "1")
