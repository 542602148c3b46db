"""Nothing is imported from the folder in which a command is run, by any process that it starts."""

import ast
import os
import subprocess
import sys
from pathlib import Path

import pytest
from support import thorough

import mitt
from mitt.interrupts import safe_path

PACKAGE = Path(mitt.__file__).parent
#: What a module of the working folder leaves when it is run.
_POISON = """
import os
by = open("/proc/self/cmdline", "rb").read().replace(b"\\0", b" ")
os.write(2, b"RUN FROM THE WORKING FOLDER: %s by " + by)
os._exit(66)
"""
#: GLFW, which MuJoCo imports, starts a Python as well; the command line imports it in such a block.
_FIRST = """
import sys
from pathlib import Path
from mitt.interrupts import safe_path
if sys.argv[2] != "command":
    with safe_path():
        import mujoco
"""
#: Each starts processes as a command does, and says that they did their work.
_STARTS = {
    "command": """
        from mitt.cli.main import main
        assert main(["catch", "--check"]) == 0
        print("done")
        """,
    "recorder": """
        from mitt.robot.cell.recorder import Recorder
        from mitt.core.map.mapping import unlearned
        from mitt.robot.cell.prepare import cell_about, prepare
        from mitt.io.cell import read_cell
        cell = prepare(read_cell("wam-sim"))
        about = cell_about(cell, unlearned(cell.arm, cell.work.design))
        Recorder(Path(sys.argv[1]) / "x.mcap", about).close()
        print("done")
        """,
    "workers": """
        from mitt.lab.trials.workers import Processes
        engine = Processes(1)
        print(engine.submit(bytes, b"done").result().decode())
        engine.close(at_once=True)
        """,
    "warming": """
        import numpy as np
        from mitt.io.arm_file import load_arm
        from mitt.core.map.map_design import default_design
        from mitt.lab.trials import runs
        from mitt.lab.world.scene import Scene
        from mitt.lab.world.throws import Throw
        runs.is_cold = lambda: True
        runs._PARTS = ()  # this process compiles nothing, so that the other one has to begin
        arm = load_arm("wam")
        told = []
        real = runs._watch
        def watch(over, progress, done):
            while done.value < 1 and not over.wait(0.05):
                pass
            told.append(done.value)
        runs._watch = watch
        ball = Throw(r=np.array((3.5, 0.1, 0.4)), dr=np.array((-5.5, 0.0, 2.0)))
        with runs.warming(arm, default_design(arm), Scene(), ball, pixels=False,
                          progress=lambda *_: None):
            import time
            end = time.monotonic() + 120.0
            while not told and time.monotonic() < end:
                time.sleep(0.05)
        print("done" if told and told[0] else "nothing was compiled")
        """,
    "live table": """
        from multiprocessing import get_context
        from mitt.robot.cell.session import STATES, shared_numbers, words
        from mitt.cli import screen
        sys.stderr.isatty = lambda: True
        with screen.live_table(shared_numbers(), words(), STATES, ("throws", "caught")):
            import time
            time.sleep(6.0)
        print("done")
        """,
}


@pytest.fixture
def poisoned(tmp_path: Path) -> Path:
    """A folder in which every module of Python, and what mitt needs, has a file of its name."""
    folder = tmp_path / "here"
    folder.mkdir()
    names = {*sys.stdlib_module_names, "numpy", "numba", "mitt", "mujoco", "rich", "pydantic"}
    for name in names:
        (folder / f"{name}.py").write_text(_POISON % name)
    return folder


@pytest.mark.parametrize(
    "what", thorough(["command"], ["recorder", "workers", "warming", "live table"])
)
def test_a_process_that_is_started_imports_nothing_from_the_working_folder(
    tmp_path: Path, poisoned: Path, what: str
) -> None:
    """Workers, the compiler, the recorder, the live table; the trackers that Python starts, too."""
    script = tmp_path / "run.py"
    body = "\n".join(line.removeprefix(" " * 4) for line in _STARTS[what].splitlines())
    script.write_text(f"{_FIRST}if __name__ == '__main__':\n{body}")
    words = [sys.executable, str(script), str(tmp_path), what]
    done = subprocess.run(
        words, cwd=poisoned, text=True, capture_output=True, timeout=300, check=False
    )
    assert "WORKING FOLDER" not in done.stderr
    assert done.returncode == 0, done.stderr
    assert done.stdout.endswith("done\n"), done.stdout + done.stderr


def test_python_with_m_imports_nothing_from_the_working_folder(tmp_path: Path) -> None:
    """What Python itself has imported before mitt begins is not ours to say."""
    for name in ("json", "numpy", "numba", "queue", "rich"):
        (tmp_path / f"{name}.py").write_text(_POISON % name)
    done = subprocess.run(
        [sys.executable, "-m", "mitt", "catch", "--check"],
        cwd=tmp_path,
        text=True,
        capture_output=True,
        timeout=300,
        check=False,
    )
    assert (done.returncode, done.stdout) == (0, ""), done.stderr
    assert "the input is good" in done.stderr


def test_each_start_of_a_process_is_in_a_block_with_a_safe_path() -> None:
    """Of a module that starts some, each call that may do so."""
    starts = {"Popen", "ProcessPoolExecutor", "submit", "start", "Value"}
    unsafe = []
    for path in PACKAGE.rglob("*.py"):
        text = path.read_text(encoding="utf-8")
        if not {"get_context", "subprocess"} & set(
            text.replace("(", " ").replace(".", " ").split()
        ):
            continue
        tree = ast.parse(text)
        safe = {
            id(x)
            for block in ast.walk(tree)
            if isinstance(block, ast.With)
            and any("safe_path" in ast.unparse(i) for i in block.items)
            for x in ast.walk(block)
        }
        unsafe += [
            f"{path.name}: {ast.unparse(x)[:60]}"
            for x in ast.walk(tree)
            if isinstance(x, ast.Call)
            and isinstance(x.func, ast.Attribute | ast.Name)
            and ast.unparse(x.func).rpartition(".")[2] in starts
            and id(x) not in safe
        ]
    allowed = (
        "workers.py: engine.submit",
        "workers.py: self._pool.submit",  # no process starts
        "runs.py: watch.start",
    )
    assert [x for x in unsafe if not x.startswith(allowed)] == []


def test_the_path_is_as_it_was_afterwards(monkeypatch: pytest.MonkeyPatch) -> None:
    for before in (None, "", "1"):
        if before is None:
            monkeypatch.delenv("PYTHONSAFEPATH", raising=False)
        else:
            monkeypatch.setenv("PYTHONSAFEPATH", before)
        with safe_path():
            assert os.environ["PYTHONSAFEPATH"] == "1"
        assert os.environ.get("PYTHONSAFEPATH") == before
