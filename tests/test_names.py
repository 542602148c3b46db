"""Every file that source, comments or documents name is there."""

import ast
import re
import subprocess
from pathlib import Path

import pytest

from mitt.core.kernels import PACKAGE

ROOT = Path(__file__).parents[1]
#: Where a name may begin: as from these folders, or from the file that names it.
ROOMS = ("src/mitt/core", "src/mitt/io", "src/mitt/lab", "src/mitt/robot")
STARTS = (".", "src", "src/mitt", *ROOMS, "tests", "docs", "benchmarks", "studies")
#: A document by its name; Python, shell and TOML files by an address with a folder in it.
NAMED = re.compile(
    r"(?<![\w/{}$*.-])((?:[\w.-]+/)*[\w-]+\.md|(?:[\w.-]+/)+[\w-]+\.(?:py|toml|sh))\b"
)
#: Addresses that only an example or a test has, below folders that are made when it runs.
MADE = re.compile(r"^(?:out|runs|DIR|tmp|package|sub)/|^callee|^caller")
#: Most lines of a module.
LONGEST = 800


def committed() -> list[Path]:
    """Return the text files that git knows, those of tests' own data left out."""
    try:
        names = subprocess.run(
            ["git", "ls-files"], cwd=ROOT, capture_output=True, text=True, check=True
        ).stdout.splitlines()
    except (OSError, subprocess.CalledProcessError):
        pytest.skip("no git: other files may lie among ours")
    kinds = (".py", ".md", ".toml", ".cfg", "")
    found = [ROOT / name for name in names if Path(name).suffix in kinds]
    return [path for path in found if path.is_file()]


def missing(path: Path, text: str) -> list[str]:
    """Return the names in a text that stand for no file."""
    starts = [path.parent, *(ROOT / start for start in STARTS)]
    return [
        name
        for name in NAMED.findall(text)
        if not MADE.match(name) and not any((start / name).is_file() for start in starts)
    ]


def test_a_name_that_leads_nowhere_is_found() -> None:
    """What this file looks for, it sees."""
    absent = "nowhere" + ".md"
    assert missing(ROOT / "README.md", f"see {absent}, section 1") == [absent]
    assert missing(ROOT / "README.md", "see `docs/studies.md` and [x](docs/rig.md)") == []
    gone = "benchmarks/" + "gone.py"
    assert missing(ROOT / "src" / "x.py", f'"""Measured by ``{gone}``."""') == [gone]


def test_every_file_that_is_named_is_there() -> None:
    """In code, comments, docstrings and documents alike."""
    found = {
        f"{path.relative_to(ROOT)}: {name}"
        for path in committed()
        for name in missing(path, path.read_text(encoding="utf-8"))
    }
    assert sorted(found) == []


def test_the_functions_that_the_map_of_the_code_names_stand_in_its_files() -> None:
    """Rows of `docs/code.md` with files in one cell and functions in the next."""
    files, functions = r"((?:`[\w/]+\.py`,? ?)+)", r"((?:`\w+`,? ?)+)"
    named = re.compile(rf"^\|.*\| {files}\| {functions}\|$", re.MULTILINE)
    rows = named.findall((ROOT / "docs" / "code.md").read_text())
    assert len(rows) > 12
    for places, names in rows:
        text = "".join((PACKAGE / x).read_text() for x in re.findall(r"`([\w/.]+)`", places))
        defined = {x.name for x in ast.walk(ast.parse(text)) if isinstance(x, ast.FunctionDef)}
        assert set(re.findall(r"`(\w+)`", names)) <= defined, places


def test_no_module_is_longer_than_it_should_be() -> None:
    """800 lines."""
    lengths = {
        path.relative_to(PACKAGE).as_posix(): len(path.read_text().splitlines())
        for path in PACKAGE.rglob("*.py")
    }
    assert [f"{x}: {n}" for x, n in lengths.items() if n > LONGEST] == []


def test_no_function_is_longer_than_a_screen() -> None:
    """70 lines, docstring included, without the lines of its parameters."""
    long = [
        f"{path.name}:{node.name}: {(node.end_lineno or 0) - node.body[0].lineno + 1}"
        for path in sorted(PACKAGE.rglob("*.py"))
        for node in ast.walk(ast.parse(path.read_text()))
        if isinstance(node, ast.FunctionDef) and (node.end_lineno or 0) - node.body[0].lineno >= 70
    ]
    assert not long


def test_each_constant_has_a_line_of_its_own() -> None:
    """Not several names in one assignment of a module or a class."""
    several = [
        f"{path.name}:{node.lineno}"
        for path in sorted(PACKAGE.rglob("*.py"))
        for scope in ast.walk(ast.parse(path.read_text()))
        if isinstance(scope, ast.Module | ast.ClassDef)
        for node in scope.body
        if isinstance(node, ast.Assign)
        and isinstance(node.targets[0], ast.Tuple)
        and isinstance(node.value, ast.Tuple)
    ]
    assert several == []


def test_the_formatter_decides_except_for_matrices() -> None:
    """``fmt: skip`` keeps the rows of matrices and tables of numbers, in few places."""
    kept = {
        path.relative_to(PACKAGE).as_posix(): path.read_text().count("# fmt: skip")
        for path in PACKAGE.rglob("*.py")
    }
    assert sum(kept.values()) <= 10, {x: n for x, n in kept.items() if n}


def test_a_public_name_stands_once() -> None:
    """A class or function without an underscore is defined in one module of the package alone."""
    where: dict[str, set[str]] = {}
    for path in sorted((ROOT / "src").rglob("*.py")):
        for node in ast.parse(path.read_text(encoding="utf-8")).body:
            if isinstance(node, ast.ClassDef | ast.FunctionDef) and not node.name.startswith("_"):
                where.setdefault(node.name, set()).add(str(path.relative_to(ROOT)))
    twice = {name: files for name, files in where.items() if len(files) > 1}
    assert not twice
