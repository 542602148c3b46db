"""The documentation as a site: figures and their commands, answers, pages, links, no strangers."""

import ast
import re
import runpy
import subprocess
import sys
from collections.abc import Callable
from functools import cache
from html.parser import HTMLParser
from itertools import count
from pathlib import Path
from typing import ParamSpec, TypeVar

import numpy as np
import pytest
from PIL import Image, ImageSequence
from support import thorough

import mitt
from mitt.cli.main import main
from mitt.cli.options import COMMANDS
from mitt.core.arm.arm import Arm
from mitt.core.arm.catch import CaughtBall
from mitt.core.arm.tools import TOOLS
from mitt.core.catcher.generators import Direct
from mitt.core.map.demand import Tolerance, shares_of
from mitt.core.map.learn import Learned
from mitt.core.map.neighbourhood import learn
from mitt.core.verdict.feasibility import Outcome, judge
from mitt.core.verdict.impact import shares_after
from mitt.io.arm_file import load_arm
from mitt.io.load import with_hand
from mitt.lab.report import painter, pictures
from mitt.lab.report.painter import painted
from mitt.lab.report.pictures import placed_faces
from mitt.lab.trials.explain import LIMITS
from mitt.lab.trials.tasks import TASKS

P = ParamSpec("P")
T = TypeVar("T")
ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted(DOCS.rglob("*.md"))]
FIGURES = sorted(path for path in (DOCS / "figures").glob("*.py") if path.stem != "drawing")
#: Tutorials that are one file: page and file.
TUTORIALS = {
    "docs/tutorials/own-loop.md": "examples/tutorials/own_loop.py",
    "docs/tutorials/own-cameras.md": "examples/tutorials/cameras.py",
}

_IMAGE = re.compile(r"!\[([^\]]+)\]\(([^)]+)\)\n\n([^\n]*)")
_LIVE = re.compile(r"`python (benchmarks/\w+\.py) docs/img/([\w.-]+)`")
_SCRIPT = re.compile(r"^Drawn by `python (docs/figures/\w+\.py)`")
_SCREEN = re.compile(r"^Screenshot of `mitt (\w+)[^`]*`")
#: What a page, a style or a script may load from elsewhere.
_STRANGER = re.compile(
    r"<(?:link|script|img|iframe|source|video)\b[^>]*\b(?:href|src)=\"(?:https?:)?//"
    r"|@import\s+(?:url\()?[\"']?(?:https?:)?//|url\([\"']?(?:https?:)?//|\bimport\([\"']https?:",
    re.IGNORECASE,
)


def name_of(path: Path) -> str:
    """Return the name of a file below the repository."""
    return path.relative_to(ROOT).as_posix()


def test_every_figure_exists_and_its_command_stands_under_it() -> None:
    """Each has a text for who cannot see it, and a script or a command of mitt that makes it."""
    shown = set()
    for page in PAGES:
        text = page.read_text(encoding="utf-8")
        assert len(_IMAGE.findall(text)) == text.count("!["), name_of(page)
        for _, address, under in _IMAGE.findall(text):
            image = (page.parent / address).resolve()
            assert image.is_file(), (name_of(page), address)
            shown.add(image)
            script, screen = _SCRIPT.match(under), _SCREEN.match(under)
            live = _LIVE.search(under)
            if live:
                assert (ROOT / live.group(1)).is_file(), under
                assert live.group(2) == image.name
            elif script:
                assert ROOT / script.group(1) in FIGURES, under
                assert Path(script.group(1)).stem == image.stem
            else:
                assert screen, (name_of(page), under)
                assert screen.group(1) in COMMANDS
    assert shown == set((DOCS / "img").iterdir())


@cache
def learned_for(limits: str, design: mitt.MapDesign | None) -> Learned:
    """Return what a figure learns; figures share it."""
    return learn(load_arm("wam", limits=limits), design=design)


def shared(arm: Arm, *, design: mitt.MapDesign | None = None) -> Learned:
    """Return what was learned for such an arm."""
    return learned_for(arm.limits.name, design)


def seldom(made: Callable[P, T]) -> Callable[P, T]:
    """Return what makes something in one of 24 calls, and gives it again in the others."""
    calls, last = count(), list[T]()

    def again(*given: P.args, **how: P.kwargs) -> T:
        if next(calls) % 24 == 0:
            last[:] = [made(*given, **how)]
        return last[0]

    return again


@pytest.mark.slow
@pytest.mark.parametrize("script", thorough(FIGURES[:3], FIGURES[3:]), ids=lambda path: path.stem)
def test_a_figure_is_drawn_by_its_script(
    script: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The script writes one picture, with as many lines, or frames, as the one that is shown."""
    # All the pictures that move take a quarter minute.
    monkeypatch.setattr(pictures, "placed_faces", seldom(placed_faces))
    monkeypatch.setattr(painter, "painted", seldom(painted))
    monkeypatch.setattr(sys, "argv", [str(script), str(tmp_path)])
    monkeypatch.syspath_prepend(script.parent)
    monkeypatch.delitem(sys.modules, "drawing", raising=False)  # it has what was set before
    monkeypatch.setattr(
        mitt, "learn", lambda arm, design=None: learned_for(arm.limits.name, design)
    )
    runpy.run_path(str(script), run_name="__main__")
    (drawn,) = tmp_path.iterdir()
    shown = DOCS / "img" / drawn.name
    assert drawn.stem == script.stem
    if drawn.suffix == ".svg":
        assert drawn.read_text().count("<path") == shown.read_text().count("<path")
        assert "<path" in shown.read_text()
    else:
        with Image.open(drawn) as a, Image.open(shown) as b:
            times = [
                [(x.size, x.info["duration"]) for x in ImageSequence.Iterator(image)]
                for image in (a, b)
            ]
        assert {size for size, _ in times[0]} == {size for size, _ in times[1]}
        assert sum(t for _, t in times[0]) == sum(t for _, t in times[1])  # frames alike are one


def kinds_in_code(learned: Learned) -> set[str]:
    """Return the kinds of limits that a verdict or a trial may name."""
    f, basket = learned.map, load_arm("wam", limits="paper", hand="basket")
    seen = mitt.BallState(
        t=0.0,
        tracked=True,
        r_o=np.array([2.9, 0.1, 0.2]),
        dr_o=np.array([-5.5, -0.1, 1.6]),
        ddr_o=np.array([0.0, 0.0, -9.81]),
        drag=0.0,
        covariance=1e-6 * np.eye(6),
        t_seen=0.0,
        t_first=0.0,
    )
    verdict = judge(f, seen, f.arm.q_ready, tolerance=Tolerance())
    assert verdict.approach is not None
    names = set(shares_of(f.arm, verdict.approach.motion, Tolerance(strength=1.0)))
    for arm in (f.arm, basket, with_hand(f.arm, TOOLS["suction"])):
        for mass in (0.05, 0.5):  # an arm that is kept slow for the impact says so
            caught = CaughtBall(mass=mass, radius=0.04)
            names |= set(shares_after(arm, verdict.approach, caught))
    for folder in ("core/catcher", "core/verdict", "lab/rivals", "lab/trials"):
        for path in (ROOT / "src" / "mitt" / folder).glob("*.py"):
            if "binding_limit=" in (text := path.read_text()):
                names |= words_given(ast.parse(text))
    return {name.split(":")[0] for name in names} - NO_LIMITS


#: Words that name no limit: outcomes of a verdict, statuses of trials.
STATUSES = {x for known in TASKS.values() for x in known.scored.statuses}
NO_LIMITS = {"", *(x.value for x in Outcome)} | STATUSES


def words_given(module: ast.Module) -> set[str]:
    """Return what a module assigns, returns, or gives to what makes a verdict, if it is a word."""
    nodes = list(ast.walk(module))
    makers = {
        x.name
        for x in nodes
        if isinstance(x, ast.FunctionDef)
        and isinstance(x.returns, ast.Name)
        and x.returns.id == "Verdict"
    }
    values = list[ast.expr]()
    for node in nodes:
        match node:
            case ast.Assign(value=value) | ast.Return(value=ast.expr() as value):
                values.append(value)
            case ast.keyword(arg="binding_limit", value=value):
                values.append(value)
            case ast.Call(func=ast.Attribute(attr=name) | ast.Name(id=name)) if name in makers:
                values += node.args
    return {x for value in values for x in texts(value) if re.fullmatch(r"[a-z_]+(:.*)?", x)}


def texts(value: ast.AST) -> set[str]:
    """Return the texts that an expression may be; ``..`` stands for what is filled in."""
    match value:
        case ast.Constant(value=str(text)):
            return {text}
        case ast.JoinedStr():
            parts = [x.value if isinstance(x, ast.Constant) else ".." for x in value.values]
            return {"".join(map(str, parts))}
        case ast.IfExp():
            return texts(value.body) | texts(value.orelse)
        case ast.BoolOp():
            return {text for x in value.values for text in texts(x)}
        case ast.Tuple():
            return {text for x in value.elts for text in texts(x)}
    return set()


def test_every_reason_of_a_refusal_has_an_answer(learned: Learned) -> None:
    """The tables of balls and of parts have the kinds that code can name, and no others."""
    table, parts = (
        {kind.split(":")[0] for row in rows for kind in re.findall(r"`([\w:.]+)`", row)}
        for rows in (reasons("faq.md"), reasons("meeting.md"))
    )
    kinds = kinds_in_code(learned) | {"acceleration"}
    assert table | parts == kinds
    notation = (DOCS / "notation.md").read_text(encoding="utf-8")
    listed = notation[notation.index("\n`binding_limit`:") :].split("\n\n")[1]
    assert set(re.findall(r"`(\w+)(?::\w+)?`", listed)) >= table
    assert set(LIMITS) == kinds - {"unseen"}  # a ball that nobody saw had no verdict


def reasons(page: str) -> list[str]:
    """Return what stands in the first column of a page's table of limits, below its head."""
    text = (DOCS / page).read_text(encoding="utf-8")
    table = text[text.index("\n| `binding_limit` |") + 1 :].split("\n\n")[0]
    return [row.split("|")[1] for row in table.splitlines()[2:]]


@pytest.mark.parametrize("page", TUTORIALS)
def test_a_tutorial_is_its_file(page: str) -> None:
    """The blocks of the page, one after the other, are the file that can be run."""
    text = (ROOT / page).read_text(encoding="utf-8")
    blocks = re.findall(r"^```python\n(.*?)^```", text, re.DOTALL | re.MULTILINE)
    lines = [line for line in "".join(blocks).splitlines() if line]
    file = ROOT / TUTORIALS[page]
    assert lines == [line for line in file.read_text().splitlines() if line]


def test_the_tutorial_catches(capsys: pytest.CaptureFixture[str]) -> None:
    """Its own tracker and controller bring the hand to the ball, within all limits, and to rest."""
    runpy.run_path(str(ROOT / "examples/tutorials/own_loop.py"), run_name="__main__")
    out = capsys.readouterr().out
    assert out.startswith("feasible: ")
    found = re.search(r"catch: ([\d.]+) mm and ([\d.]+) m/s", out)
    used = re.search(r"torque (\d+) %, speed (\d+) %", out)
    rest = re.search(r"at ([\d.]+) rad/s", out)
    assert found and used and rest  # noqa: PT018 (one claim: it says all three)
    assert float(found.group(1)) < 5.0
    assert float(found.group(2)) < 0.5
    assert max(int(used.group(1)), int(used.group(2))) <= 100
    assert float(rest.group(1)) < 0.05


@pytest.mark.thorough
def test_the_cameras_of_the_tutorial_see(capsys: pytest.CaptureFixture[str]) -> None:
    """Placed by a ball in the hand, they give a ball that the arm can start for."""
    runpy.run_path(str(ROOT / "examples/tutorials/cameras.py"), run_name="__main__")
    out = capsys.readouterr().out
    for pattern, low, high in (
        (r"cameras: at most ([\d.]+) mm", 0.0, 5.0),
        (r"a track of (\d+) rows", 100.0, 115.0),
        (r"ball: ([\d.]+) mm", 0.0, 4.0),
        (r"and ([\d.]+) m/s from the truth", 0.0, 0.03),
        (r"the arm has (\d+) ms", 300.0, 600.0),
    ):
        found = re.search(pattern, out)
        assert found, f"{pattern!r} is not in:\n{out}"
        assert low <= float(found.group(1)) <= high, found.group(0)


def test_the_tutorial_refuses_what_is_too_fast(learned: Learned) -> None:
    """The question that it asks before it moves has another answer, too."""
    fast = mitt.BallState(
        t=0.0,
        tracked=True,
        r_o=np.array([6.0, 0.0, 0.5]),
        dr_o=np.array([-16.0, 0.0, 1.0]),
        ddr_o=np.array([0.0, 0.0, -9.81]),
        drag=0.0,
        covariance=1e-6 * np.eye(6),
        t_seen=0.0,
        t_first=0.0,
    )
    verdict = Direct(learned.map).verdict(fast, learned.map.arm.q_ready)
    assert verdict.share > 1.0


def test_the_citation_has_this_version() -> None:
    """CITATION.cff and the page say the version of mitt."""
    text = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    assert re.findall(r"^version: (.*)$", text, re.MULTILINE) == [mitt.__version__]
    assert f"{{{mitt.__version__}}}" in (DOCS / "citing.md").read_text(encoding="utf-8")


class Links(HTMLParser):
    """What a page points at, and what can be pointed at in it."""

    def __init__(self) -> None:
        """Begin with nothing."""
        super().__init__()
        self.to: list[str] = []
        self.anchors: set[str] = set()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Note addresses and ids."""
        for name, value in attrs:
            if name in ("href", "src") and value:
                self.to.append(value)
            if name in ("id", "name") and value and tag != "meta":
                self.anchors.add(value)


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the site, built as ``make docs`` builds it; nothing is warned of."""
    for needed in ("sphinx", "myst_parser", "furo"):
        pytest.importorskip(needed, reason="the extra docs is not installed")
    out = tmp_path_factory.mktemp("site")
    command = [sys.executable, "-m", "sphinx", "--fail-on-warning", "--keep-going", "--quiet"]
    made = subprocess.run(
        [*command, "--builder", "html", str(DOCS), str(out)],
        capture_output=True,
        text=True,
        check=False,
    )
    assert made.returncode == 0, made.stderr
    return out


def test_every_link_of_the_site_leads_somewhere(site: Path) -> None:
    """Pages, pictures and anchors, those of the reference included."""
    pages = {path: Links() for path in site.rglob("*.html")}
    for path, links in pages.items():
        links.feed(path.read_text(encoding="utf-8"))
    wrong = []
    for path, links in pages.items():
        for link in links.to:
            if re.match(r"[a-z]+:|data:", link) or path.name in ("search.html", "genindex.html"):
                continue
            file, _, anchor = link.partition("#")
            at = (path.parent / file.split("?")[0]).resolve() if file else path
            lost = anchor and at in pages and anchor not in pages[at].anchors
            if lost or not at.exists():
                wrong.append((path.name, link))
    assert wrong == []
    assert len(pages) > 20


def test_every_page_is_in_the_navigation(site: Path) -> None:
    """From the first page every other can be reached by the side bar."""
    first = Links()
    first.feed((site / "index.html").read_text(encoding="utf-8"))
    reached = {link.split("#")[0] for link in first.to}
    pages = {path.relative_to(DOCS).with_suffix(".html").as_posix() for path in DOCS.rglob("*.md")}
    assert pages - {"index.html"} <= reached


def test_the_site_loads_nothing_from_elsewhere(site: Path) -> None:
    """No font, script, style or picture of another host: it works from a folder, offline."""
    for path in [x for kind in ("html", "css", "js") for x in site.rglob(f"*.{kind}")]:
        assert not _STRANGER.search(path.read_text(encoding="utf-8")), path.name


def test_a_stranger_is_noticed() -> None:
    """What the test above looks for, it sees."""
    for bad in (
        '<script src="https://a.example/x.js">',
        "@import url(//a.example/f.css)",
        '<link rel="x" href="//a.example/y">',
        "url('http://a.example/z.woff')",
    ):
        assert _STRANGER.search(bad)
    assert not _STRANGER.search('<a href="https://a.example">x</a>')


def test_the_reference_has_every_public_name(site: Path) -> None:
    """What stands at the top of ``mitt`` is described, where it is at home."""
    text = (site / "api.html").read_text(encoding="utf-8")
    for name in set(mitt.__all__) - {"__version__"}:
        home = vars(mitt).get(name) or mitt.__getattr__(name)
        assert f'id="{home.__module__}.{name}"' in text, name


def test_the_page_of_commands_has_every_option(
    site: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Each option that ``--help`` names stands on the page, below its command."""
    text = re.sub(r"<[^>]+>", "", (site / "commands.html").read_text(encoding="utf-8"))
    for name in COMMANDS:
        assert main([name, "--help"]) == 0
        said = capsys.readouterr().out
        begins = text.rindex(f"mitt {name}¶")
        ends = text.find("¶", begins + len(name) + 8)
        options = set(re.findall(r"^  (--[a-z-]+)", said, re.MULTILINE))
        assert len(options) >= 2
        for option in options:
            assert option in text[begins : ends if ends > 0 else None], (name, option)
