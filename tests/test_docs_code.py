"""What the documents show as code runs, or is a command that mitt understands."""

import ast
import json
import re
import runpy
import shlex
import tomllib
from collections.abc import Callable
from dataclasses import fields
from itertools import pairwise
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from documents import BLOCK, ROOT, blocks, is_part, lines_of
from support import install

from mitt.cli.line import parse
from mitt.cli.main import main
from mitt.cli.options import COMMANDS
from mitt.core.arm.arm import Arm
from mitt.core.catcher.catcher import Catcher, Phase
from mitt.core.catcher.generators import Direct
from mitt.core.map.learn import Learned
from mitt.core.signals import ArmState, Command, Sighting
from mitt.core.verdict.feasibility import Outcome
from mitt.io.cell import cell_of, read_cell
from mitt.io.maps import save_map
from mitt.io.reading import shipped_path
from mitt.lab.report.run_page import Blocks
from mitt.lab.trials.runner import TrialRunner
from mitt.lab.trials.source import source_of
from mitt.lab.world.scene import read_scene
from mitt.lab.world.simulation import World

PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").rglob("*.md"))]
_INLINE = re.compile(r"`(mitt [a-z]+(?: [^`]*)?)`")
#: Files of two tutorials.
PLANNER, ROBOT = (ROOT / "examples" / "tutorials" / name for name in ("planner", "robot"))
#: Words of a command that stand for files of a reader's own.
_OWN = re.compile(r"^[A-Z][A-Z.]*$|\.(?:toml|json|csv|mcap|urdf|xml|mkv)$|[/*]|^runs$")
#: Options that have another name than their field.
NAMED = {"help", "version", "flights"}
#: Languages of blocks that are checked here or by test_docs.py, or are no code.
KNOWN = {"", "python", "toml", "csv", "bibtex", "{toctree}", "{eval-rst}", "{include}"}


def name_of(path: Path) -> str:
    """Return the name of a document below the repository."""
    return path.relative_to(ROOT).as_posix()


def test_every_block_is_of_a_kind_that_is_checked() -> None:
    """A block in another language would be checked by nobody."""
    for path in PAGES:
        for language, _ in BLOCK.findall(path.read_text(encoding="utf-8")):
            assert language.strip().split(" ")[0] in {*KNOWN, "{command-options}", "{settings}"}, (
                name_of(path)
            )


@pytest.mark.parametrize("path", PAGES, ids=name_of)
def test_every_console_line_is_a_command(path: Path) -> None:
    """Those of mitt are parsed; scripts, targets and installed extras exist."""
    targets = re.findall(r"^([a-z]+):", (ROOT / "Makefile").read_text(), re.MULTILINE)
    extras = re.findall(r"^([a-z0-9]+) = \[", (ROOT / "pyproject.toml").read_text(), re.MULTILINE)
    for line in lines_of(path):
        program, *words = shlex.split(line)
        if program == "mitt":
            parse(words)
        elif program == "python":
            assert (ROOT / words[0]).is_file(), line
        elif program == "make":
            assert words[0] in targets, line
        else:
            assert [program, words[0]] == ["pip", "install"], line
            if words[1] == "--editable":
                folder = words[2].partition("[")[0]
                assert (ROOT / folder / "pyproject.toml").is_file(), line
                continue
            extra = re.fullmatch(r"mitt\[(\w+)\]|\.", words[1])
            assert extra, line
            assert extra.group(1) in (None, *extras), line


def test_a_command_that_does_not_parse_is_noticed() -> None:
    """What the test above looks for, it sees."""
    with pytest.raises(Exception, match="thorws"):
        parse(["catch", "--thorws", "3"])


def checkable() -> list[str]:
    """Return the mitt lines that name no file of a reader's own and can be checked."""
    found = {line for path in PAGES for line in lines_of(path) if line.startswith("mitt ")}
    out = []
    for line in sorted(found):
        words = shlex.split(line)[1:]
        if words[0] in ("view", "bench", "report", "replay") or "--check" in words:
            continue
        given = [b for a, b in pairwise(words) if a != "--out"]
        if not any(_OWN.search(word) for word in given):
            out.append(line)
    return out


@pytest.fixture
def no_pages(monkeypatch: pytest.MonkeyPatch) -> None:
    """Draw no page of a run: others do."""
    monkeypatch.setattr("mitt.lab.report.outputs.blocks_of", lambda *_: Blocks())


@pytest.fixture
def planner(tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return the planner of the tutorial, as if it were installed."""
    install(PLANNER, tmp_path_factory.mktemp("installed"), monkeypatch)
    return PLANNER


@pytest.mark.usefixtures("planner", "watched_shortly")
@pytest.mark.parametrize("line", checkable())
def test_a_command_without_files_passes_its_check(
    line: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """``--check`` finds nothing wrong, and writes nothing."""
    monkeypatch.chdir(tmp_path)
    assert main([*shlex.split(line)[1:], "--check"]) == 0
    assert list(tmp_path.iterdir()) == []


@pytest.mark.usefixtures("no_pages")
def test_the_arm_of_the_tutorial_catches(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The design is checked as the page says; the arm file is the page's, and catches."""
    page, run = ROOT / "docs/tutorials/own-urdf.md", tmp_path / "run"
    assert blocks(page, "toml") == [(ROOT / "examples/tutorials/arm/arm.toml").read_text()]
    design, catch = lines_of(page)[0], lines_of(page)[2]
    assert design.endswith("--check")
    monkeypatch.chdir(ROOT)
    words = ["--throws", "5", "--out", str(run)]
    assert main([*shlex.split(design)[1:-2], str(tmp_path / "arm.toml"), "--check"]) == 0
    assert main([*shlex.split(catch)[1:], *words]) == 0
    summary = json.loads((run / "result.json").read_text())["summary"]
    assert (summary["throws"], summary["caught"] >= 2) == (5, True)


def test_scene_and_cell_of_the_ur5e_tutorial_can_be(tmp_path: Path) -> None:
    """The scene is one for its arm; the table of the driver fits into the cell that ships."""
    scene, robot, source = blocks(ROOT / "docs/tutorials/ur5e.md", "toml")
    path = tmp_path / "ur.toml"
    path.write_text(scene)
    line = ["--arm", "ur5e", "--scene", str(path), "--vision", "points", "--check"]
    assert main(["catch", *line]) == 0
    raw = tomllib.loads(shipped_path("cells", "ur5e-sim").read_text())
    raw |= tomllib.loads(robot) | tomllib.loads(source)
    cell = cell_of(raw, place="CELL.toml")
    assert cell.robot.takes == read_cell("ur5e-sim").robot.takes == read_scene(path).actuation.takes


def test_the_tutorial_on_planners_is_its_files() -> None:
    """The blocks of the page are parts of the four files."""
    page = ROOT / "docs/tutorials/own-planner.md"
    found = [*blocks(page, "toml"), *blocks(page, "python")]
    names = ("pyproject.toml", "study.toml", "cubic_planner.py", "careful_planner.py")
    for text, name in zip(found, names, strict=True):
        assert is_part(text, PLANNER / name), name


@pytest.mark.thorough
@pytest.mark.slow
@pytest.mark.usefixtures("no_pages")
def test_the_planner_of_the_tutorial_catches(
    planner: Path, tmp_path: Path, learned: Learned, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It is found by its name, catches, and is compared by the study, here of one throw."""
    run, study = tmp_path / "run", tmp_path / "study.toml"
    save_map(tmp_path / "map.json", learned, version="0")
    words = ["--throws", "3", "--seed", "300", "--vision", "points", "--out", str(run)]
    words = ["--map", str(tmp_path / "map.json"), "--record", "none", *words]
    monkeypatch.setattr("mitt.lab.trials.catch_study.learn", lambda *_, **__: learned)
    assert main(["catch", "--generator", "cubic", *words]) == 0
    assert json.loads((run / "result.json").read_text())["summary"]["caught"] == 3
    assert main(["catch", "--generator", "careful", *words[:-1], str(tmp_path / "careful")]) == 0
    trials = json.loads((tmp_path / "careful" / "result.json").read_text())["trials"]
    assert {t["status"] for t in trials} == {"caught", "unreachable"}
    refused = [t["certificate"]["margin"] for t in trials if t["status"] == "unreachable"]
    assert max(x for x in refused if x is not None) < 0.4  # a later one may have none
    text = (planner / "study.toml").read_text()
    assert "throws = 100" in text
    study.write_text(text.replace("throws = 100", "throws = 1").replace('"quintic", ', ""))
    assert main(["study", str(study), "--out", str(tmp_path / "out"), "--workers", "1"]) == 0
    rows = json.loads((tmp_path / "out" / "summary.json").read_text())["rows"]
    assert {row["generator"] for row in rows} == {"direct", "cubic"}
    assert all(row["throws"] == 1 for row in rows)


def test_commands_within_sentences_exist() -> None:
    """`mitt X --option` in a sentence names a command, and options that it has."""
    wrong = []
    for path in PAGES:
        for said in _INLINE.findall(path.read_text(encoding="utf-8")):
            name = said.split()[1]
            kind = COMMANDS.get(name)
            known = {x.name for x in fields(kind)} if isinstance(kind, type) else set()
            options = [x.replace("-", "_") for x in re.findall(r"--([a-z][a-z-]*)", said)]
            if name not in COMMANDS or not set(options) <= known | NAMED:
                wrong.append((name_of(path), said))
    assert wrong == []


class Countdown:
    """True so many times."""

    def __init__(self, count: int) -> None:
        """Take how often."""
        self._left = count

    def __bool__(self) -> bool:
        """Say whether there is another."""
        self._left -= 1
        return self._left >= 0


class Thrown:
    """A simulated arm and a tracker, as somebody else's are reached; one throw."""

    def __init__(self, arm: Arm) -> None:
        """Throw the ball."""
        scene = read_scene("ideal")
        self.world, self._points = World(scene, arm.model, limits=arm.limits), list[Sighting]()
        source = source_of(arm, seed=80000, count=1, drag=scene.ball.drag)
        self.world.reset(source.ball(0), 80000)

    def read(self) -> ArmState:
        """Return the encoders, and keep what the tracker saw."""
        senses = self.world.sense()
        assert senses.t < 3.0
        self._points = list(senses.points)
        return senses.arm

    def points(self) -> list[Sighting]:
        """Return new positions of the ball."""
        return self._points

    def write(self, command: Command) -> None:
        """Let the drives do it."""
        self.world.apply(command)


def around_readme(learned: Learned, folder: Path) -> tuple[dict[str, object], Callable[[], None]]:
    """Return a tracker and an arm for the ten lines, and what must hold after them."""
    assert not any(folder.iterdir())
    thing = Thrown(learned.map.arm)
    names: dict[str, object] = {"my_tracker": thing, "my_arm": thing}

    def holds() -> None:
        catcher, world = names["catcher"], thing.world
        assert isinstance(catcher, Catcher)
        assert catcher.verdict is not None
        assert catcher.verdict.outcome is Outcome.FEASIBLE
        assert catcher.phase is Phase.BRAKE
        assert np.abs(world.data.qvel[:3]).max() < 0.2
        assert np.linalg.norm(world.data.qpos[-7:-4] - world.catch_point) < 0.06

    return names, holds


def around_gym(learned: Learned, folder: Path) -> tuple[dict[str, object], Callable[[], None]]:
    """Return a folder with a map; the episode ends."""
    save_map(folder / "MAP.json", learned, version="0")
    names: dict[str, object] = {}

    def holds() -> None:
        info = names["info"]
        assert isinstance(info, dict)
        assert info["status"] in ("caught", "dropped", "missed")

    return names, holds


def around_recordings(
    learned: Learned, folder: Path
) -> tuple[dict[str, object], Callable[[], None]]:
    """Return a catcher before a simulated world; its ticks are recorded."""
    scene = read_scene("ideal")
    runner = TrialRunner(learned.map.arm, Direct(learned.map), scene, pixels=False)
    source = source_of(learned.map.arm, seed=80000, count=1, drag=scene.ball.drag)
    catcher = runner.release(source.ball(0), seed=80000)
    robot = SimpleNamespace(read=runner.world.sense, write=runner.world.apply)
    names: dict[str, object] = {
        "Path": Path,
        "about": runner.about("direct", learned.map),
        "catching": Countdown(50),
        "catcher": catcher,
        "robot": robot,
    }

    def holds() -> None:
        assert catcher.tick is not None
        assert (folder / "throw.mcap").stat().st_size > 1000

    return names, holds


def around_nothing(_: Learned, __: Path) -> tuple[dict[str, object], Callable[[], None]]:
    """Return nothing: the document brings all that it needs."""
    return {}, lambda: None


def around_files(_: Learned, folder: Path) -> tuple[dict[str, object], Callable[[], None]]:
    """Return nothing, in a folder that has the examples."""
    (folder / "examples").symlink_to(ROOT / "examples")
    return {}, lambda: None


def around_planner(_: Learned, __: Path) -> tuple[dict[str, object], Callable[[], None]]:
    """Return the names of the file of which the document shows a method."""
    return runpy.run_path(str(PLANNER / "careful_planner.py")), lambda: None


def around_robot(_: Learned, __: Path) -> tuple[dict[str, object], Callable[[], None]]:
    """Return the names of the file of which the document shows two methods."""
    return runpy.run_path(str(ROBOT / "acme_driver.py")), lambda: None


#: Documents with Python that needs something of a reader's own.
AROUND = {
    "README.md": around_readme,
    "docs/gym.md": around_gym,
    "docs/recordings.md": around_recordings,
    "docs/tutorials/own-planner.md": around_planner,
    "docs/tutorials/own-robot.md": around_robot,
    "docs/tutorials/own-urdf.md": around_files,
}


@pytest.mark.parametrize("path", [p for p in PAGES if blocks(p, "python")], ids=name_of)
def test_the_python_of_a_document_runs(
    path: Path, learned: Learned, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """All blocks of a document, one after the other, as a reader would try them."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(ROBOT)
    names, holds = AROUND.get(name_of(path), around_nothing)(learned, tmp_path)
    for block in blocks(path, "python"):
        ast.parse(block)
        exec(compile(block, name_of(path), "exec"), names)  # noqa: S102 (our own documents)
    holds()
