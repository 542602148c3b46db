"""What is committed: no name of a machine or a package host, no door for foreign code."""

import ast
import re
import subprocess
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
SOURCE = ROOT / "src" / "mitt"
#: Written in pieces, so that this file does not hold what it looks for.
HOSTS = re.compile(
    "|".join(
        [
            "pypi" + r"\.org",
            "files" + r"\.pythonhosted",
            "index" + "-url",
            "extra" + "-index",
            "find" + "-links",
            "trusted" + "-host",
            "--" + "registry",
            "arti" + "factory",
        ]
    )
)
PATHS = re.compile(
    r"(?<![\w.~/])/(?:" + "|".join(["home", "root", "work", "Users", "mnt"]) + r")/\w"
)
#: Names of calls that run what a file says.
FORBIDDEN = {"eval", "exec", "compile", "__import__"}
MODULES = {"pickle", "cPickle", "dill", "cloudpickle", "shelve", "marshal", "joblib"}


def committed() -> list[Path]:
    """Return the text files that git knows; all files where there is no git."""
    try:
        names = subprocess.run(
            ["git", "ls-files"], cwd=ROOT, capture_output=True, text=True, check=True
        ).stdout.splitlines()
        found = [ROOT / name for name in names]
    except (OSError, subprocess.CalledProcessError):
        found = [path for top in ("src", "tests", "docs") for path in (ROOT / top).rglob("*.*")]
    return [
        path
        for path in found
        if path.suffix not in (".png", ".jpg", ".mp4", ".gif", ".pyc") and path.is_file()
    ]


def modules() -> list[Path]:
    """Return all modules of the package."""
    return sorted(SOURCE.rglob("*.py"))


@cache
def nodes(path: Path) -> tuple[ast.AST, ...]:
    """Return all that a module says, read once."""
    return tuple(ast.walk(ast.parse(path.read_text(encoding="utf-8"))))


@cache
def calls(path: Path) -> tuple[str, ...]:
    """Return the dotted names of all calls."""
    return tuple(ast.unparse(node.func) for node in nodes(path) if isinstance(node, ast.Call))


def imported(path: Path) -> set[str]:
    """Return the top packages that a module imports, at its head or within."""
    found: set[str] = set()
    for node in nodes(path):
        if isinstance(node, ast.Import):
            found.update(alias.name.split(".")[0] for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module:
            found.add(node.module.split(".")[0])
    return found


def test_there_is_something_to_look_at() -> None:
    """The lists below are not empty by mistake."""
    assert len(committed()) > 50
    assert len(modules()) > 40


def test_no_committed_file_names_a_package_host_or_this_machine() -> None:
    """No index, mirror or registry, and no absolute path of a developer's machine."""
    found = []
    for path in committed():
        text = path.read_text(encoding="utf-8", errors="replace")
        for number, line in enumerate(text.splitlines(), 1):
            if HOSTS.search(line) or PATHS.search(line):
                found.append(f"{path.relative_to(ROOT)}:{number}: {line.strip()[:80]}")
    assert found == []


@pytest.mark.parametrize("path", modules(), ids=lambda path: str(path.relative_to(SOURCE)))
def test_no_module_runs_what_a_file_says(path: Path) -> None:
    """No pickle, eval, unsafe YAML, pickled arrays or shell in the package."""
    assert not imported(path) & MODULES
    assert not set(calls(path)) & FORBIDDEN
    assert not [name for name in calls(path) if name in ("yaml.load", "os.system", "os.popen")]
    for node in nodes(path):
        if isinstance(node, ast.keyword) and node.arg in ("allow_pickle", "shell"):
            assert isinstance(node.value, ast.Constant)
            assert node.value.value is False


@pytest.mark.parametrize("path", modules(), ids=lambda path: str(path.relative_to(SOURCE)))
def test_no_module_keeps_mutable_state_or_hides_arguments(path: Path) -> None:
    """No ``global``, no mutable default, no bare except, no star import."""
    for node in nodes(path):
        assert not isinstance(node, ast.Global)
        assert not (isinstance(node, ast.ExceptHandler) and node.type is None)
        assert not (isinstance(node, ast.ImportFrom) and node.names[0].name == "*")
        if isinstance(node, ast.FunctionDef | ast.Lambda):
            defaults = [*node.args.defaults, *node.args.kw_defaults]
            assert not any(isinstance(x, ast.List | ast.Dict | ast.Set) for x in defaults)


def test_only_the_clock_reads_the_clock() -> None:
    """``time`` and ``datetime`` are imported by the link's clock and nowhere else."""
    found = {
        str(path.relative_to(SOURCE)) for path in modules() if imported(path) & {"time", "datetime"}
    }
    assert found <= {"clock.py"}


def test_no_module_draws_from_global_randomness() -> None:
    """Randomness is a parameter: neither ``random`` nor ``numpy.random`` functions are called."""
    for path in modules():
        assert "random" not in imported(path), path
        for name in calls(path):
            if name.startswith("np.random."):
                allowed = ("np.random.default_rng", "np.random.SeedSequence")
                assert name.startswith(allowed), (path, name)


def _imports(path: Path) -> set[str]:
    """Return the modules of mitt that a module imports as it is loaded, or for types alone."""
    found = set[str]()
    tree = ast.parse(path.read_text(encoding="utf-8"))
    inside = {id(x) for f in ast.walk(tree) if isinstance(f, ast.FunctionDef) for x in ast.walk(f)}
    for node in ast.walk(tree):
        if id(node) in inside:
            continue
        if isinstance(node, ast.Import):
            found |= {x.name for x in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            found |= {node.module, *(f"{node.module}.{x.name}" for x in node.names)}
    return found


def test_no_module_imports_another_in_a_circle_not_even_for_types() -> None:
    """The package itself, which names all that is public, is left out."""
    files = {
        path.relative_to(SOURCE.parent).with_suffix("").as_posix().replace("/", "."): path
        for path in SOURCE.rglob("*.py")
        if path.name != "__init__.py"
    }
    of = {name: _imports(path) & files.keys() for name, path in files.items()}
    assert sum(map(len, of.values())) > 500
    while leaves := [name for name, needs in of.items() if not needs & of.keys()]:
        for name in leaves:
            del of[name]
    circle = list(of)[:1]  # whoever is left leads into a circle
    while circle and circle[-1] not in circle[:-1]:
        circle.append(min(of[circle[-1]] & of.keys()))
    assert circle == []
