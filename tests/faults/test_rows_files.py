"""Rows 23 to 36 of the fault table: files, processes, servers, and the real-time loop.

Row 27, of a study that was killed, and 33 to 35, of two runs in a folder, workers that die and
signals, are in tests/trials.
"""

import ast
import gc
import json
import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import viser
from faults.conftest import Range
from small_study import TEXT, Here, quiet, thrown_again, write_study

import mitt
from mitt.clock import uncollected
from mitt.core.arm.arm import Arm
from mitt.core.catcher.catcher import Catcher
from mitt.core.catcher.generators import Direct
from mitt.core.errors import FileError, InputError, MittError
from mitt.core.map.learn import Learned
from mitt.io.load import build_arm
from mitt.io.maps import read_map, save_map
from mitt.io.writing import write_text
from mitt.lab.report.replay_3d import served
from mitt.lab.trials.runner import TrialRunner
from mitt.lab.trials.score import CATCH
from mitt.lab.trials.study_results import columns_of, read_part
from mitt.lab.trials.study_run import run_study
from mitt.lab.world.scene import Scene, read_scene

SOURCE = Path(mitt.__file__).parent
OWN_ARM = Path(__file__).parents[2] / "examples" / "own_arm.urdf"
LOOPBACK = {"0100007F", "00000000000000000000000001000000"}


def one_line(error: BaseException) -> bool:
    """Say whether an error speaks in one line."""
    return "\n" not in str(error)


@pytest.mark.parametrize(
    "text",
    [
        "ball = 3",
        "unknown = 1",
        "[ball]\nradius = nan",
        "[ball]\nradius = 25",
        "[ball]\nradius = '1'",
        "floor = -1\nfloor = -2",
        "[[faults]]\nkind = 'magic'",
        "[sensing]\nlatency = 1.5",
        "= 3",
        "a" * 2_000_000,
    ],
)
def test_row_23_malformed_config(tmp_path: Path, text: str) -> None:
    """Wrong types, unknown and double keys, NaN, wrong units, too much: one line names the file."""
    path = tmp_path / "scene.toml"
    path.write_text(text)
    with pytest.raises((InputError, FileError)) as caught:
        read_scene(path)
    assert one_line(caught.value)
    assert "scene.toml" in str(caught.value)


@pytest.mark.parametrize(
    ("found", "instead"),
    [
        ('mass value="[^"]*"', 'mass value="nan"'),
        ('mass value="[^"]*"', 'mass value="-1"'),
        ('mass value="[^"]*"', 'mass value="abc"'),
        ('mass value="[^"]*"', 'mass value="1e300"'),
        ('ixx="[^"]*"', 'ixx="-1"'),
        ('lower="[^"]*"', 'lower="9"'),
        ('effort="[^"]*"', 'effort="0"'),
        ('velocity="[^"]*"', 'velocity="nan"'),
        ('axis xyz="[^"]*"', 'axis xyz="0 0 0"'),
        ("</robot>", ""),
    ],
)
def test_row_24_malformed_urdf(tmp_path: Path, found: str, instead: str) -> None:
    """What cannot be an arm is refused in one line, also where a parser accepts it."""
    text = OWN_ARM.read_text()
    assert re.search(found, text)
    path = tmp_path / "arm.urdf"
    path.write_text(re.sub(found, instead, text, count=0))
    tip, joints = _names(text)
    build_arm(OWN_ARM, tip=tip, joints=joints)
    with pytest.raises(MittError) as caught:
        build_arm(path, tip=tip, joints=joints)
    assert one_line(caught.value)


def _names(text: str) -> tuple[str, list[str]]:
    """Return tip and joints of the example's arm."""
    joints = re.findall(r'<joint name="([^"]+)" type="revolute"', text)
    return re.findall(r'<link name="([^"]+)"', text)[-1], joints[:3]


def test_row_25_malformed_log(tmp_path: Path, learned: Learned, arm: Arm) -> None:
    """A map with any byte altered is refused or says the same; never other numbers in silence."""
    path, rng = tmp_path / "map.json", np.random.default_rng(25)
    save_map(path, learned, version="0")
    good, refused = path.read_bytes(), 0
    for _ in range(60):
        data = bytearray(good)
        data[rng.integers(len(data))] ^= 1 << int(rng.integers(8))
        path.write_bytes(data)
        try:
            alpha = read_map(path, arm).map.alpha
        except MittError as error:
            refused += one_line(error)
        else:
            assert np.array_equal(alpha, learned.map.alpha)
    assert refused > 50


@pytest.mark.thorough
def test_row_26_truncated_log(tmp_path: Path, thrown_study: Path) -> None:
    """A part of a study cut anywhere is refused, and only what it held is thrown again."""
    study, folder = thrown_again(thrown_study, tmp_path)
    whole, part = folder.trials.read_bytes(), folder.part(3)
    for share in (0.0, 0.3, 0.99):
        data = part.read_bytes()
        part.write_bytes(data[: int(share * len(data))])
        with pytest.raises(MittError):
            read_part(part, columns_of(CATCH.trial, CATCH.extra))
        engine = Here()
        assert run_study(study, folder, engine, progress=quiet).status == 0
        assert folder.trials.read_bytes() == whole
        assert len(engine.done) <= 1


def test_row_28_disk_full(tmp_path: Path) -> None:
    """A file that does not fit is an error of one line; the old one stays, nothing else is left."""
    code = (
        "import resource, sys; from pathlib import Path; from mitt.core.errors import MittError\n"
        "from mitt.io.writing import write_text\n"
        "resource.setrlimit(resource.RLIMIT_FSIZE, (4000, 4000))\n"
        "try: write_text(Path(sys.argv[1]), 'x' * 100000)\n"
        "except MittError as error: print(error); sys.exit(2)\n"
    )
    path = tmp_path / "page.html"
    write_text(path, "old")
    done = subprocess.run(
        [sys.executable, "-c", code, str(path)], capture_output=True, text=True, check=False
    )
    assert done.returncode == 2, done.stderr
    assert done.stdout.count("\n") == 1
    assert path.read_text() == "old"
    assert os.listdir(tmp_path) == ["page.html"]


def test_row_29_no_code_in_data() -> None:
    """Nowhere in the package: pickle, eval, exec, yaml, marshal, shells, allow_pickle=True."""
    for path in SOURCE.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.Import | ast.ImportFrom):
                names = [a.name for a in node.names] + [getattr(node, "module", None) or ""]
                assert not {"pickle", "yaml", "marshal", "shelve", "dill"} & set(names), path
            if isinstance(node, ast.Call):
                called = node.func.id if isinstance(node.func, ast.Name) else ""
                assert called not in ("eval", "exec", "compile", "__import__"), path
                for word in node.keywords:
                    set_on = isinstance(word.value, ast.Constant) and word.value.value is True
                    assert not (word.arg in ("shell", "allow_pickle") and set_on), path


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("bomb.urdf", '<!DOCTYPE r [<!ENTITY a "aaaa"><!ENTITY b "&a;&a;">]><robot name="&b;"/>'),
        ("file.urdf", '<!DOCTYPE r [<!ENTITY x SYSTEM "file:///etc/passwd">]><robot name="&x;"/>'),
        ("mesh.xml", '<mujoco><asset><mesh name="m" file="../../secret.stl"/></asset></mujoco>'),
        ("include.xml", '<mujoco><include file="/etc/passwd"/></mujoco>'),
        ("deep.xml", "<a>" * 20_000 + "</a>" * 20_000),
    ],
)
def test_row_30_xml_bombs_and_paths(tmp_path: Path, name: str, text: str) -> None:
    """Entities, files outside and endless nesting are refused in one line."""
    (tmp_path / name).write_text(text)
    with pytest.raises(MittError) as caught:
        build_arm(tmp_path / name, tip="tip", joints=["a", "b", "c"])
    assert one_line(caught.value)


def _listeners() -> set[str]:
    """Return the addresses on which this process listens, in hexadecimal."""
    mine = set()
    for entry in Path("/proc/self/fd").iterdir():
        try:
            mine.add(os.readlink(entry))
        except OSError:
            continue
    found = set()
    for table in ("/proc/net/tcp", "/proc/net/tcp6"):
        for line in Path(table).read_text().splitlines()[1:]:
            field = line.split()
            if field[3] == "0A" and f"socket:[{field[9]}]" in mine:
                found.add(field[1].split(":")[0])
    return found


@pytest.mark.slow
def test_row_31_servers_listen_to_the_loopback_only() -> None:
    """The one server that we start, Viser's for the replay, is not to be reached from outside."""
    before = _listeners()
    with served() as server:
        assert isinstance(server, viser.ViserServer)
        opened = _listeners() - before
        assert opened
        assert opened <= LOOPBACK


@pytest.mark.parametrize(
    "name", ["../x", "/etc/x", "x" * 300, "-rf", ".hidden", "a\0b", "", "a\nb"]
)
def test_row_32_output_names(tmp_path: Path, name: str) -> None:
    """A name that leads out of the folder, or is none, is refused by the study that bears it."""
    text = TEXT.replace('name = "clean"', f"name = {json.dumps(name)}")
    with pytest.raises(MittError) as caught:
        write_study(tmp_path, text)
    assert one_line(caught.value)


def test_row_36_no_collection_in_the_loop(place: Range) -> None:
    """Four hundred ticks within ``uncollected``: the garbage collector does not run once."""
    runner = TrialRunner(place.taught.map.arm, Direct(place.taught.map), Scene(), pixels=False)
    ran: list[int] = []

    def note(phase: str, info: dict[str, int]) -> None:
        if phase == "start":
            ran.append(info["generation"])

    catcher: Catcher = runner.catcher()
    runner.world.reset(place.throws[0], 1)
    with uncollected():
        gc.callbacks.append(note)
        try:
            for _ in range(400):
                runner.world.apply(catcher.step(runner.world.sense()))
                catcher.think()
        finally:
            gc.callbacks.remove(note)
    assert ran == []
    assert gc.isenabled()
