"""The documents name only what exists, and their tables say what the code says."""

import ast
import importlib
import json
import math
import re
from collections.abc import Iterable
from dataclasses import fields
from pathlib import Path
from typing import get_args, get_origin

import annotated_types
import pytest
from pydantic import BaseModel
from pydantic.fields import FieldInfo

from mitt.clock import Stopwatch
from mitt.files.maps import save_map
from mitt.map.learn import Learned
from mitt.trials.result import STATUSES, result
from mitt.trials.score import Trial
from mitt.trials.study_file import read_study
from mitt.world.faults import AnyFault
from mitt.world.scene import Scene, read_scene

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
    for name in ("mitt.signals.Array", "mitt.signals.BallState.r_o", "mitt.arm.arm.Arm.torque"):
        assert exists(name)
    for name in (
        "mitt.nowhere",
        "mitt.nowhere.Arm",
        "mitt.signals.Nothing",
        "mitt.signals.BallState.r_x",
        "mitt.signals.BallState.r_o.x",
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


def parts_of(annotation: object) -> tuple[list[object], list[str]]:
    """Return the bounds and the words that an annotation of one value or several holds."""
    bounds: list[object] = []
    words: list[str] = []
    for part in get_args(annotation):
        if isinstance(part, str):
            words.append(part)
        elif isinstance(part, FieldInfo):
            bounds += part.metadata
        else:
            inner = parts_of(part)
            bounds, words = bounds + inner[0], words + inner[1]
    return bounds, words


def span_of(bounds: Iterable[object]) -> str:
    """Return the range that some bounds leave, as the document writes it."""
    low, high = "(-inf", "inf)"
    for bound in bounds:
        low = f"[{bound.ge:g}" if isinstance(bound, annotated_types.Ge) else low
        low = f"({bound.gt:g}" if isinstance(bound, annotated_types.Gt) else low
        high = f"{bound.le:g}]" if isinstance(bound, annotated_types.Le) else high
        high = f"{bound.lt:g})" if isinstance(bound, annotated_types.Lt) else high
    return f"{low}, {high.replace('1e+05', '100000')}"


def scene_keys(model: BaseModel, prefix: str = "") -> dict[str, tuple[str, str]]:
    """Return default and range of each key of a scene, as the document writes them."""
    out: dict[str, tuple[str, str]] = {}
    for name, field in type(model).model_fields.items():
        if isinstance(field.default, BaseModel):
            out |= scene_keys(field.default, f"{prefix}{name}.")
            continue
        spans = {"second": "x, y, z, radius", "second_velocity": "x, y, z",
                 "distortion": "[-0.5, 0.5] each", "sides": "[0.005, 0.5] each",
                 "belt": "table"}  # fmt: skip
        if name in spans:
            out[prefix + name] = (str(field.default), spans[name])
            continue
        if get_origin(field.annotation) is tuple:
            each = [span_of(parts_of(part)[0]) for part in get_args(field.annotation)]
            out[prefix + name] = (str(field.default), ", ".join(each))
            continue
        bounds, words = parts_of(field.annotation)
        if words and not (field.metadata or bounds):
            out[prefix + name] = (str(field.default), ", ".join(words))
            continue
        span = span_of((*field.metadata, *bounds))
        out[prefix + name] = (str(field.default), ", ".join((span, *words)))
    return out


def test_the_scene_table_is_the_scene() -> None:
    """Every key of a scene stands in scenes.md with its default and its range."""
    table = rows(text_of(ROOT / "docs" / "scenes.md"), "key")
    written = {codes(key)[0]: (default, span) for key, _, default, span, _ in table}
    wanted = {key: said for key, said in scene_keys(Scene()).items() if key != "faults"}
    assert written == wanted
    numbers = [
        default for default, span in written.values() if span[0] in "[(" and default[0] != "("
    ]
    assert all(default == "None" or math.isfinite(float(default)) for default in numbers)


def test_the_scene_in_the_document_can_be_read(tmp_path: Path) -> None:
    """The TOML example of scenes.md is a scene, and changes what it says."""
    page = (ROOT / "docs" / "scenes.md").read_text(encoding="utf-8")
    path = tmp_path / "scene.toml"
    path.write_text(re.findall(r"```toml\n(.*?)```", page, re.DOTALL)[0], encoding="utf-8")
    scene = read_scene(path)
    assert (scene.base, scene.sensing.latency, scene.ball.material) == ("lab", 3, "foam")


def test_the_table_of_faults_is_the_faults() -> None:
    """Every kind stands in studies.md with all keys that it has beside the common ones."""
    table = rows(text_of(ROOT / "docs" / "studies.md"), "kind")
    common = {"kind", "start", "length", "magnitude"}
    written = {codes(kind)[0]: set(codes(keys)) for kind, _, keys, _ in table}
    models = [kind for kind in get_args(AnyFault) if issubclass(kind, BaseModel)]
    assert written == {
        model.model_fields["kind"].default: set(model.model_fields) - common for model in models
    }


def test_the_study_in_the_document_can_be_read(tmp_path: Path) -> None:
    """The TOML example of studies.md is a study of six conditions."""
    page = (ROOT / "docs" / "studies.md").read_text(encoding="utf-8")
    path = tmp_path / "study.toml"
    path.write_text(re.findall(r"```toml\n(.*?)```", page, re.DOTALL)[0], encoding="utf-8")
    study = read_study(path, generators=("direct", "unoptimised"))
    assert len(study.conditions) == 6
    assert study.counts == {"direct": 300, "unoptimised": 100}


def section(name: str) -> str:
    """Return a section of notation.md by the beginning of its heading."""
    parts = re.split(r"^## ", text_of(ROOT / "docs" / "notation.md"), flags=re.MULTILINE)
    return next(part for part in parts if part.startswith(name))


def keys_of(table: list[list[str]]) -> list[str]:
    """Return all keys that the first column of a table names, sorted."""
    return sorted(key for row in table for key in codes(row[0]))


def test_the_keys_of_a_result_are_those_of_the_document() -> None:
    """Head, trial and summary of a result have the keys of notation.md, and no others."""
    head = {"version": "", "arm": "", "limits": "", "generator": "", "vision": "", "seed": 0,
            "scene": "ideal", "scene_changed": {}, "clock": {}}  # fmt: skip
    written = result([], Stopwatch(), head, 1)
    text = section("Result")
    assert keys_of(rows(text, "key")) == sorted(written)
    trial = rows(text, "key of a trial")
    assert keys_of(trial) == sorted(field.name for field in fields(Trial))
    assert keys_of(rows(text, "key of the summary")) == sorted(written["summary"])
    statuses = next(row[2] for row in trial if row[0] == "`status`")
    assert set(codes(statuses)) == set(STATUSES)


def test_the_keys_of_a_map_are_those_of_the_document(learned: Learned, tmp_path: Path) -> None:
    """A saved map has the keys of notation.md, and no others."""
    path = tmp_path / "map.json"
    save_map(path, learned, version="0")
    written = json.loads(path.read_text(encoding="utf-8"))
    assert keys_of(rows(section("Map"), "key")) == sorted(written)
