"""Where only the core is installed: what works, and what names the extra that it needs.

The other packages of this environment cannot be imported in the processes that are started here.
"""

import json
import subprocess
import sys
from pathlib import Path

import pytest
from bare_run import extras
from throws_on_film import calibrated

from mitt.files.rig import write_rig


def bare(code: str, *words: str, cwd: Path) -> "subprocess.CompletedProcess[str]":
    """Run Python without them."""
    head = "import sys; sys.modules.update(dict.fromkeys(sys.argv.pop(1).split(',')))\n"
    command = [sys.executable, "-c", head + code, ",".join(extras()), *words]
    return subprocess.run(command, cwd=cwd, capture_output=True, text=True, check=False)


#: Imports every command, and what workers of a design import; says what is missing for which.
IMPORTS = """
from importlib import import_module
from mitt.cli.options import COMMANDS
from mitt.errors import MissingPackageError
commands = (f"mitt.cli.{x.module}" for x in COMMANDS.values())
for name in (*commands, "mitt.design.search_jobs", "mitt.gym"):
    try:
        import_module(name)
    except MissingPackageError as error:
        print(name, error)
try:
    import mitt.gym
except ImportError:
    print("no gym")
"""
#: Runs several commands in turn; each says its status and its lines on stderr.
COMMANDS = """
import contextlib, io, json
from mitt.cli.main import main
for line in sys.argv[1:]:
    said = io.StringIO()
    with contextlib.redirect_stderr(said):
        status = main(line.split())
    print(json.dumps([status, said.getvalue().splitlines()]))
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


@pytest.mark.slow
def test_every_command_loads_without_extras(tmp_path: Path) -> None:
    """So do the workers of ``mitt design``; what needs an extra names it."""
    done = bare(IMPORTS, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines() == [
        "mitt.gym mitt.gym: wanted the package gymnasium, got a Python without it; "
        "install mitt[gym]",
        "no gym",
    ]


@pytest.mark.slow
def test_the_check_of_a_command_names_the_extra_that_it_will_need(tmp_path: Path) -> None:
    """One line and status 2, before anything is done; nothing is written."""
    write_rig(tmp_path / "RIG.toml", calibrated(), version="0")
    for name in ("L", "R", "DIR"):
        (tmp_path / name).mkdir()
    for name in ("L.mkv", "R.mkv"):
        (tmp_path / name).write_bytes(b"")
    assert {"pytest", "cv2", "pyarrow", "gymnasium", "casadi"} <= set(extras())
    before = sorted(tmp_path.iterdir())
    done = bare(COMMANDS, *(f"{words} --check" for words in NEEDS), cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    for line, (words, extra) in zip(done.stdout.splitlines(), NEEDS.items(), strict=True):
        status, lines = json.loads(line)
        assert (status, len(lines)) == (2, 1), words
        assert f"mitt[{extra}]" in lines[0], words
    assert sorted(tmp_path.iterdir()) == before
