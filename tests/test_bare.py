"""Where only the core is installed: what works, and what names the extra that it needs.

The other packages of this environment cannot be imported in the process that is started here.
"""

import json
import subprocess
import sys
from pathlib import Path

import pytest
from bare_run import extras
from throws_on_film import calibrated

from mitt.cli.main import main
from mitt.io.rig import write_rig
from mitt.lab.report.run_page import Blocks

#: Imports every command, and what workers of a design import; says what is missing for which.
IMPORTS = """
from importlib import import_module
from mitt.cli.options import COMMANDS
from mitt.core.errors import MissingPackageError
commands = (f"mitt.cli.{x.module}" for x in COMMANDS.values())
for name in (*commands, "mitt.lab.design.search_jobs", "mitt.gym"):
    try:
        import_module(name)
    except MissingPackageError as error:
        print(name, error)
try:
    import mitt.gym
except ImportError:
    print("no gym")
"""
#: Runs several commands in turn; each says its status, its lines on stderr, and its JSON.
RUNS = """
import contextlib, io, json
from mitt.cli.main import main
for line in sys.argv[1:]:
    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        status = main(line.split())
    print(json.dumps([status, err.getvalue().splitlines(), out.getvalue()]))
"""
#: Commands, and the extra that each will need.
NEEDS = {
    "catch --generator clairvoyant": "rivals",
    "study smoke --out study": "study",
    "report DIR": "study",
    "see L R --rig RIG.toml --out TRACK.csv": "cameras",
    "see L.mkv R.mkv --rig RIG.toml --out TRACK.csv": "cameras",
    "see basler:1 genicam:P.cti#1 --rig RIG.toml --out TRACK.csv": "cameras",
    "calibrate --left L --right R --out OUT.toml": "cameras",
    "calibrate --left L.mkv --right R.mkv --out OUT.toml": "cameras",
    "run wam-sim": "ros2",
    "sim wam-sim": "ros2",
}


#: A map that is learned, and throws that are caught with it.
CATCH = "catch --map MAP.json --throws 2 --seed 3 --json --out"
CATCHES = ("learn --flights 12 --out MAP.json", f"{CATCH} run")

Said = tuple[Path, list[str], list[tuple[int, list[str], str]]]


@pytest.fixture(scope="module")
def said(tmp_path_factory: pytest.TempPathFactory) -> Said:
    """A folder, what is missing for what is imported, and what commands said: one process."""
    folder = tmp_path_factory.mktemp("bare")
    write_rig(folder / "RIG.toml", calibrated(), version="0")
    for name in ("L", "R", "DIR"):
        (folder / name).mkdir()
    for name in ("L.mkv", "R.mkv"):
        (folder / name).write_bytes(b"")
    assert {"pytest", "cv2", "pyarrow", "gymnasium", "casadi"} <= set(extras())
    head = "import sys; sys.modules.update(dict.fromkeys(sys.argv.pop(1).split(',')))\n"
    command = [sys.executable, "-c", head + IMPORTS + RUNS, ",".join(extras())]
    done = subprocess.run(
        [*command, *(f"{words} --check" for words in NEEDS), *CATCHES],
        cwd=folder,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    lines, commands = done.stdout.splitlines(), len(NEEDS) + len(CATCHES)
    return folder, lines[:-commands], [json.loads(line) for line in lines[-commands:]]


@pytest.mark.slow
def test_every_command_loads_without_extras(said: Said) -> None:
    """So do the workers of ``mitt design``; what needs an extra names it."""
    assert said[1] == [
        "mitt.gym mitt.gym: wanted the package gymnasium, got a Python without it; "
        "install mitt[gym]",
        "no gym",
    ]


@pytest.mark.slow
def test_the_check_of_a_command_names_the_extra_that_it_will_need(said: Said) -> None:
    """One line and status 2, before anything is done; nothing is written."""
    folder, _, ran = said
    for (status, lines, _), (words, extra) in zip(ran, NEEDS.items(), strict=False):
        assert (status, len(lines)) == (2, 1), words
        assert f"mitt[{extra}]" in lines[0], words
    given = {"RIG.toml", "L", "R", "DIR", "L.mkv", "R.mkv"}
    assert {path.name for path in folder.iterdir()} == given | {"MAP.json", "run"}


@pytest.mark.slow
def test_catching_and_its_page_need_no_extra_and_are_alike_in_any_process(
    said: Said, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """A map is learned, balls are caught in images; here they are caught the same but for times."""
    folder, _, ran = said
    assert [status for status, _, _ in ran[len(NEEDS) :]] == [0, 0], ran
    assert (folder / "run" / "report.html").read_text().startswith("<!")
    assert (folder / "run" / "report.html").stat().st_size > 100_000
    monkeypatch.chdir(folder)
    monkeypatch.setattr("mitt.lab.report.outputs.blocks_of", lambda *_: Blocks())
    assert main([*CATCH.split(), "here"]) == 0
    here, there = (json.loads(text) for text in (capsys.readouterr().out, ran[-1][2]))
    assert len(here["trials"]) == 2
    for result in (here, there):
        for name in ("tick_us", "deadline_misses"):
            del result["summary"][name]
    assert here == there
