"""``--check`` and the start judge alike: the same verdict, in the same line, for any bad value."""

import os
import shutil
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from types import UnionType
from typing import Any, NoReturn, Union, get_args, get_origin

import pytest
from pydantic import BaseModel
from support import thorough

from mitt.cli.line import Option, options_of
from mitt.cli.main import main
from mitt.cli.options import COMMANDS
from mitt.io.cell import Cell
from mitt.io.writing import toml_text
from mitt.lab.trials.tasks import TASKS


class Started(BaseException):
    """The work of a command would begin now: nothing was refused."""


def _start(*_: object, **__: object) -> NoReturn:
    """Stand in the place of a command's work."""
    raise Started


#: What makes each command good, and where its work begins.
GOOD: dict[str, tuple[list[str], str]] = {
    **{name: ([name, "--out", "OUT"], "mitt.cli.running._run") for name in TASKS},
    "bat": (["bat", "--out", "OUT", "--shield"], "mitt.cli.running._run"),
    "learn": (["learn", "--out", "NEW.json"], "mitt.cli.catching.learn_map"),
    "design": (["design", "wam", "--out", "NEW.toml"], "mitt.cli.designing.search_design"),
    "run": (["run", "wam-sim"], "mitt.robot.cell.dds.DomainParticipant"),
    "sim": (["sim", "wam-sim"], "mitt.robot.cell.dds.DomainParticipant"),
    "measure": (["measure", "wam-sim"], "mitt.robot.cell.dds.DomainParticipant"),
    "guard": (["guard", "CELL.toml"], "mitt.robot.cell.dds.DomainParticipant"),
    "study": (["study", "STUDY.toml", "--out", "OUT"], "mitt.lab.trials.study_run.run_study"),
    "track": (["track", "POINTS.csv", "--out", "NEW.csv"], "mitt.cli.seeing.follow_all"),
    "see": (
        ["see", "LEFT", "RIGHT", "--rig", "RIG.toml", "--out", "NEW.csv", "--no-video"],
        "mitt.cli.seeing.follow",
    ),
    "calibrate": (
        ["calibrate", "--rig", "RIG.toml", "--hand", "HAND.csv", "--out", "NEW.toml"],
        "mitt.cli.seeing._calibrate",
    ),
    "replay": (["replay", "REC.mcap", "--out", "OUT"], "mitt.cli.replaying.played"),
    "view": (["view", "REC.mcap"], "mitt.lab.report.viewer.served"),
    "bench": (["bench"], "mitt.cli.measuring.measure_all"),
    "report": (["report", "OUT"], "mitt.cli.measuring.progress"),
    "arms": (["arms"], "mitt.cli.listing.show"),
    "evaluate": (["evaluate", "catch"], "mitt.cli.evaluating.played"),
    "completion": (["completion", "bash"], "mitt.cli.completion.script_for"),
}
#: Options of a robot that nobody connects to.
ADDRESS = '[robot.options]\naddress = "192.0.2.1"'
TEXTS = (
    "",
    "nonsense",
    "²",
    "../x",
    "tmp/such/file.toml",
    ".",
    "mine.toml",
    "MAP.json",
    "POINTS.csv",
    "\x1b[31m",
    "x" * 300,
    "dask://x:99999",
    "1e308,0,0",
    "nan,1,2",
)
ALL = [
    (name, option)
    for name in COMMANDS
    for option in options_of(COMMANDS[name])
    if option.kind is not bool
]
Judge = Callable[[str, list[str]], tuple[str, str]]


@pytest.fixture(scope="module")
def here(files: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with good files of each kind, and bad ones."""
    folder = tmp_path_factory.mktemp("doors") / "here"
    shutil.copytree(files, folder)
    (folder / "mine.toml").write_text("mine = 1\n")
    return folder


@pytest.fixture
def judge(
    here: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> Iterator[Judge]:
    """What says how words are judged, by --check and by the start: refused and why, or good."""
    monkeypatch.chdir(here)
    monkeypatch.setattr("mitt.clock._WATCHED", 20)
    monkeypatch.setattr("mitt.cli.cells.made_ready", lambda *_: None)
    monkeypatch.setattr("mitt.cli.cells.cell_about", _start)  # of a recording
    monkeypatch.setattr("mitt.lab.trials.bat_station.learn_strikes", lambda g, *_, **__: (g,))

    def verdict(name: str, words: list[str]) -> tuple[str, str]:
        monkeypatch.setattr(GOOD[name][1], _start)
        found = []
        for more in (["--check"], []):
            try:
                status = main([*words, *more])
                good = status == 0
                assert good == (status != 2), words
            except Started:
                good = True
            said = [x for x in capsys.readouterr().err.splitlines() if ": wanted " in x]
            found.append("good" if good else said[-1])
        return found[0], found[1]

    before = set(here.iterdir()) | set(here.parent.iterdir())
    yield verdict
    for path in (*here.iterdir(), *here.parent.iterdir()):
        if path not in before:
            shutil.rmtree(path) if path.is_dir() else path.unlink()


def one_in_five(cases: Sequence[object]) -> list[object]:
    """Return cases of which each run tries a fifth: all take minutes."""
    return thorough(cases[::5], [x for k, x in enumerate(cases) if k % 5])


def bad_values(option: Option) -> list[str]:
    """Return values of an option that are bad, or nearly so, by how it is declared."""
    edges = (
        []
        if option.arg.range is None
        else [
            f"{x:.15g}" for low, high in [option.arg.range] for x in (low - 1, low, high, high + 1)
        ]
    )
    if option.kind is int:
        return [*edges, "-1", "0", "1000000000000", "-1000000000000", "1" * 5000]
    if option.kind is float:
        return [*edges, "nan", "inf", "-inf", "-1", "0", "1e-300", "1e308", "-1e308"]
    return ["nonsense"] if option.choices else list(TEXTS)


@pytest.mark.parametrize("name", COMMANDS)
def test_what_is_good_is_good_for_both(name: str, judge: Judge) -> None:
    """Without this the other tests would compare refusals alone."""
    if name != "report":  # needs a folder that a study left
        assert judge(name, GOOD[name][0]) == ("good", "good")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "option"), one_in_five(ALL), ids=lambda x: x if isinstance(x, str) else x.name
)
def test_a_bad_value_of_an_option_is_refused_alike(name: str, option: Option, judge: Judge) -> None:
    words = GOOD[name][0]
    overwrite = ["--overwrite"] * any(x.name == "--overwrite" for x in options_of(COMMANDS[name]))
    for value in bad_values(option):
        named = [*words, f"{option.name}={value}"]
        said = [words[0], value, *words[2:]] if option.place else named
        check, start = judge(name, [*said, *overwrite])
        assert check == start, said


def keys(kind: type[BaseModel], at: tuple[str, ...] = ()) -> Iterator[tuple[str, ...]]:
    """Yield each key of a file, those of its tables too."""
    for name, field in kind.model_fields.items():
        inner = [
            x
            for x in (field.annotation, *get_args(field.annotation))
            if isinstance(x, type) and issubclass(x, BaseModel)
        ]
        yield (*at, field.alias or name)
        if inner and get_origin(field.annotation) in (None, Union, UnionType):
            yield from keys(inner[0], (*at, name))


def cell_file(key: tuple[str, ...], value: object) -> str:
    """Return a good cell with one key changed."""
    table: dict[str, Any] = {"schema": "mitt.cell/1", "name": "x", "robot": {"options": {}}}
    at = table
    for part in key[:-1]:
        at = at.setdefault(part, {})
    at[key[-1]] = value
    return toml_text(table)


OPTIONS = [
    ("robot", "options", x)
    for x in (
        "state",
        "command",
        "brake",
        "interface",
        "hand",
        "hand_command",
        "diagnostics",
        "others",
        "controller",
        "unbraked",
        "more",
    )
]


@pytest.mark.slow
@pytest.mark.parametrize("key", one_in_five([".".join(x) for x in (*keys(Cell), *OPTIONS)]))
def test_a_bad_value_of_a_cell_is_refused_alike(key: str, judge: Judge, here: Path) -> None:
    for value in (
        "nonsense",
        "/a b",
        "",
        "../x",
        "eth7",
        -1.0,
        0,
        10**9,
        1e300,
        True,
        ["j1", "j1"],
        [0.0, 0.0, 1e308],
    ):
        (here / "cell.toml").write_text(cell_file(tuple(key.split(".")), value))
        for command in ("run", "sim"):
            check, start = judge(command, [command, "cell.toml"])
            assert check == start, (command, value)


@pytest.mark.parametrize("domain", ["abc", "²", "-1", "233", "1" * 5000])
def test_a_bad_domain_is_refused_alike(
    domain: str, judge: Judge, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("ROS_DOMAIN_ID", domain)
    for command in ("run", "sim"):
        check, start = judge(command, GOOD[command][0])
        assert check == start
        assert "ROS_DOMAIN_ID: wanted a number in 0..232" in check


@pytest.mark.parametrize(
    ("known", "robot", "said"),
    [
        ("wam", 'driver = "mine"', "other drivers come with packages"),
        ("wam", 'driver = "franka"', "robot.joints: wanted some of"),
        ("franka-fr3", 'driver = "franka"', "robot.options.address: wanted the address"),
        ("ur5e", f'driver = "ur"\n{ADDRESS}', "robot.rate: wanted 500 Hz"),
        ("franka-fr3", f'driver = "franka"\n{ADDRESS}', "install mitt[franka]"),
        ("franka-panda", f'driver = "franka"\n{ADDRESS}', "install mitt[franka]"),
        ("franka-fr3", f'driver = "franka"\n{ADDRESS}\nload = 1', "install mitt[franka]"),
        ("franka-fr3", f'driver = "franka"\n{ADDRESS}\nloads = 1.0', "robot.options.loads"),
        ("ur5e", f'driver = "ur"\nrate = 500\n{ADDRESS}', "install mitt[ur]"),
        ("ur5e", f'driver = "ur"\nrate = 500\n{ADDRESS}\ngain = 9.0', "robot.options.gain"),
    ],
)
def test_a_driver_that_cannot_be_is_refused_alike(
    known: str, robot: str, said: str, judge: Judge, here: Path
) -> None:
    """By what it wants of joints, rate and options; then by the extra that has its library."""
    (here / "cell.toml").write_text(
        f'schema = "mitt.cell/1"\nname = "x"\n[arm]\nfile = "{known}"\n[robot]\n{robot}\n'
    )
    check, start = judge("run", ["run", "cell.toml"])
    assert check == start
    assert said in check


def test_the_folder_is_left_as_it_was(here: Path) -> None:
    """What is refused, or only checked, writes nothing."""
    assert not (here / "OUT").exists() or not os.listdir(here / "OUT")
