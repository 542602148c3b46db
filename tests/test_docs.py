"""The documents name only what exists, and their tables say what the code says."""

import ast
import importlib
import inspect
import json
import re
import runpy
from dataclasses import fields
from pathlib import Path

import pytest
from documents import BLOCK

from mitt.clock import Stopwatch
from mitt.core.map.learn import Learned
from mitt.io.maps import save_map
from mitt.lab.trials.catch_study import read_catch_study
from mitt.lab.trials.result import result
from mitt.lab.trials.score import CATCH, STATUSES, Trial
from mitt.lab.world.scene import read_scene

ROOT = Path(__file__).parents[1]
DOCS = sorted((ROOT / "docs").rglob("*.md"))
PAGES = [*sorted(ROOT.glob("*.md")), *sorted(ROOT.glob("[!.]*/**/*.md"))]
#: The equations that the paper numbers.
NUMBERED = [str(k) for k in (*range(1, 21), 22)]

_CODE = re.compile(r"`(mitt\.[\w.]+\w)`")
_TEST = re.compile(r"`(?:tests/)?([\w/]+\.py)::(\w+)`")
_LINK = re.compile(r"\[[^\]]*\]\(([^)\s]+)\)")
_FENCE = re.compile(r"```.*?```", re.DOTALL)


def text_of(path: Path) -> str:
    """Return a document without its blocks of code."""
    return _FENCE.sub("", path.read_text(encoding="utf-8"))


def rows(text: str, first: str) -> list[list[str]]:
    """Return the cells of the table whose head begins with the cell ``first``."""
    lines = iter(text.splitlines())
    head = next(line for line in lines if line.startswith(f"| {first} |"))
    count, out = head.count("|") - 1, []
    for line in lines:
        if not line.startswith("|"):
            break
        cells = [cell.strip() for cell in re.split(r"(?<!\\)\|", line)[1:-1]]
        assert len(cells) == count, line
        out.append(cells)
    return out[1:]


def codes(cell: str) -> list[str]:
    """Return what a cell sets in code."""
    return re.findall(r"`([^`]+)`", cell)


def exists(name: str) -> bool:
    """Say whether a dotted name is a module, or something in a module or in a class of one."""
    parts = name.split(".")
    for count in range(len(parts), 0, -1):
        try:
            module = importlib.import_module(".".join(parts[:count]))
        except ModuleNotFoundError:
            continue
        rest = parts[count:]
        if len(rest) < 2:
            return not rest or rest[0] in {*vars(module), *dir(module)}
        owner = vars(module).get(rest[0])
        known = owner.__mro__[:-1] if isinstance(owner, type) else ()
        return len(rest) == 2 and any(rest[1] in {*vars(x), *x.__annotations__} for x in known)
    return False


def names_in(path: Path) -> set[str]:
    """Return the names of a file's test functions."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    return {node.name for node in tree.body if isinstance(node, ast.FunctionDef)}


def slug(heading: str) -> str:
    """Return the anchor that a heading gets on common forges."""
    return re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-")


@pytest.mark.parametrize("path", DOCS, ids=lambda path: path.name)
def test_every_name_in_a_document_exists(path: Path) -> None:
    """Names that begin with ``mitt.`` can be imported, and tests named are in their files."""
    text = text_of(path)
    missing = [name for name in _CODE.findall(text) if not exists(name)]
    for file, test in _TEST.findall(text):
        at = ROOT / "tests" / file
        if not at.is_file() or test not in names_in(at):
            missing.append(f"{file}::{test}")
    assert missing == []


def test_a_name_that_does_not_exist_is_noticed() -> None:
    """The check above can fail: at the module, at the function, at the method and at the field."""
    for name in (
        "mitt.core.signals.Array",
        "mitt.core.signals.BallState.r_o",
        "mitt.core.arm.arm.Arm.torque",
    ):
        assert exists(name)
    for name in (
        "mitt.nowhere",
        "mitt.nowhere.Arm",
        "mitt.core.signals.Nothing",
        "mitt.core.signals.BallState.r_x",
        "mitt.core.signals.BallState.r_o.x",
    ):
        assert not exists(name)


@pytest.mark.parametrize("path", PAGES, ids=lambda path: path.relative_to(ROOT).as_posix())
def test_relative_links_lead_somewhere(path: Path) -> None:
    """Each relative link is a file or folder of the repository, each anchor a heading there."""
    for link in _LINK.findall(text_of(path)):
        if re.match(r"[a-z]+:", link):
            continue
        file, _, anchor = link.partition("#")
        at = (path.parent / file).resolve() if file else path
        assert at.exists(), link
        assert at.is_relative_to(ROOT), link
        if anchor and at.suffix == ".md":
            headings = re.findall(r"^#+ (.*)$", text_of(at), re.MULTILINE)
            assert anchor in [slug(heading) for heading in headings], link


def test_every_numbered_equation_has_its_code_and_its_test() -> None:
    """The table of equations has one row a number, each with a function and a test."""
    table = rows(text_of(ROOT / "docs" / "paper-map.md"), "eq.")
    assert [row[0] for row in table] == NUMBERED
    for number, says, code, test in table:
        assert says, number
        assert _CODE.findall(code), number
        assert _TEST.findall(test), number


def test_every_figure_of_an_experiment_has_its_place() -> None:
    """Figs. 7 to 12 and Table 1 name an element of the report, a function and a test."""
    table = rows(text_of(ROOT / "docs" / "paper-map.md"), "paper")
    assert [row[0] for row in table][:7] == [*(f"Fig. {k}" for k in range(7, 13)), "Table 1"]
    for name, _, place, code, test in table:
        assert codes(place)[0].startswith("#"), name
        assert _CODE.findall(code), name
        assert _TEST.findall(test), name


#: Tables that the site makes from the models that read a file, and a row of each.
TABLES = {
    "scenes": ("mitt.lab.world.scene.Scene", ("sensing.frame_rate", "1000", "[1, 1000]")),
    "cell": ("mitt.io.cell.Cell", ("robot.takes", "torque", "torque, velocity, position")),
    "rig": ("mitt.io.rig.RigFile", ("camera.K", "needed", "3 x 3 x number")),
    "studies": (
        "mitt.lab.world.faults.AnyFault",
        ("bounce", "`share`, `restitution`, `size`", "(0, 1.5]"),
    ),
}


@pytest.mark.parametrize("page", TABLES)
def test_every_key_of_a_file_has_its_range_and_its_meaning(page: str) -> None:
    """The table on the page is made from the code; no key is without words."""
    made = runpy.run_path(str(ROOT / "docs" / "_ext" / "settings_table.py"))
    name, row = TABLES[page]
    assert f"```{{settings}} {name}\n" in (ROOT / "docs" / f"{page}.md").read_text()
    module, _, given = name.rpartition(".")
    found = [*made["rows_in"](vars(importlib.import_module(module))[given])]
    assert row in [cells[:3] for cells in found]
    assert [cells[0] for cells in found if not (cells[2] and cells[3])] == []
    assert not any(re.search(r":(?= \w+:| *$)", cells[3]) for cells in found), "words left out"


def test_the_scene_in_the_document_can_be_read(tmp_path: Path) -> None:
    """The TOML example of scenes.md is a scene, and changes what it says."""
    page = (ROOT / "docs" / "scenes.md").read_text(encoding="utf-8")
    path = tmp_path / "scene.toml"
    path.write_text(re.findall(r"```toml\n(.*?)```", page, re.DOTALL)[0], encoding="utf-8")
    scene = read_scene(path)
    assert (scene.base, scene.sensing.latency, scene.ball.material) == ("lab", 3, "foam")


def test_the_study_in_the_document_can_be_read(tmp_path: Path) -> None:
    """The TOML example of studies.md is a study of six conditions."""
    page = (ROOT / "docs" / "studies.md").read_text(encoding="utf-8")
    path = tmp_path / "study.toml"
    path.write_text(re.findall(r"```toml\n(.*?)```", page, re.DOTALL)[0], encoding="utf-8")
    study = read_catch_study(path, generators=("direct", "unoptimised"))
    assert len(study.conditions) == 6
    counts = {"direct": 300, "unoptimised": 100}
    assert all(condition.counts == counts for condition in study.conditions)


def section(name: str) -> str:
    """Return a section of notation.md by the beginning of its heading."""
    parts = re.split(r"^## ", text_of(ROOT / "docs" / "notation.md"), flags=re.MULTILINE)
    return next(part for part in parts if part.startswith(name))


def keys_of(table: list[list[str]]) -> list[str]:
    """Return all keys that the first column of a table names, sorted."""
    return sorted(key for row in table for key in codes(row[0]))


def test_the_keys_of_a_result_are_those_of_the_document() -> None:
    """Head and summary have the keys of notation.md, and no others; a trial those of its class."""
    head = {
        "version": "",
        "arm": "",
        "limits": "",
        "generator": "",
        "vision": "",
        "seed": 0,
        "scene": "ideal",
        "scene_changed": {},
        "clock": {},
    }
    written = result(CATCH, [], Stopwatch(), head, 1)
    text = section("Result")
    assert keys_of(rows(text, "key")) == sorted(written)
    assert keys_of(rows(text, "key of the summary")) == sorted(written["summary"])
    said = inspect.cleandoc(Trial.__doc__ or "")
    assert re.findall(r"^    (\w+):", said, re.MULTILINE) == [field.name for field in fields(Trial)]
    assert set(STATUSES) <= set(re.findall(r"``(\w+)``", said))


def test_the_keys_of_a_map_are_those_of_the_document(learned: Learned, tmp_path: Path) -> None:
    """A saved map has the keys of notation.md, and no others."""
    path = tmp_path / "map.json"
    save_map(path, learned, version="0")
    written = json.loads(path.read_text(encoding="utf-8"))
    assert keys_of(rows(section("Map"), "key")) == sorted(written)


#: Numbers in a hundred words outside tables, at most.
DENSE = 10.0


def density(text: str) -> float:
    """Return the numbers in a hundred words of a page outside tables, code and addresses."""
    lines = [x for x in BLOCK.sub("", text).splitlines() if not x.lstrip().startswith("|")]
    prose = re.sub(r"\]\([^)]*\)", "]", re.sub(r"`[^`]*`", "code", "\n".join(lines)))
    words = re.findall(r"\S*\w\S*", prose)
    return 100.0 * sum(bool(re.search(r"(?<![A-Za-z])\d", x)) for x in words) / max(len(words), 1)


def test_figures_stand_in_tables() -> None:
    """A sentence is read; more than ten numbers in a hundred words are looked up."""
    assert density("ten words with 1 number, and 2, and a `7`\n| 3 | 4 |") == pytest.approx(20.0)
    pages = [x for x in PAGES if x.name != "CHANGELOG.md" and "docs" in x.parts[len(ROOT.parts) :]]
    dense = {x.name: density(x.read_text(encoding="utf-8")) for x in (ROOT / "README.md", *pages)}
    assert len(dense) > 30
    assert {name: round(n, 1) for name, n in dense.items() if n > DENSE} == {}
