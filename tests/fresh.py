"""Fresh processes in which Numba works and nothing of mitt is loaded: no start takes a second.

They are forked from one in which Numba has compiled something. What they load, compile, keep and
say is their own.
"""

import json
import os
import runpy
import subprocess
import sys
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

import numba
import numpy as np


class Ended(NamedTuple):
    """What a process left: its status and what it said."""

    status: int
    out: str
    err: str


def fresh(script: Path, *words: str, **env: str) -> Ended:
    """Run a script with words, and with variables of the environment, PYTHONPATH among them."""
    with TemporaryDirectory() as folder:
        said = [str(Path(folder) / name) for name in ("out", "err")]
        server = _server()
        assert server.stdin is not None
        assert server.stdout is not None
        server.stdin.write(json.dumps([said, env, [str(script), *words]]) + "\n")
        server.stdin.flush()
        return Ended(int(server.stdout.readline()), *(Path(path).read_text() for path in said))


@cache
def _server() -> "subprocess.Popen[str]":
    """Return the process that forks; it ends with this one."""
    return subprocess.Popen(
        [sys.executable, __file__], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    )


def _serve() -> None:
    """Fork for each line, and answer with the status."""
    numba.njit(lambda x: x[1:] + 1.0)(np.ones(2))
    for asked in sys.stdin:
        line, child = asked, os.fork()
        if child == 0:
            break
        print(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]), flush=True)  # noqa: T201
    else:
        return
    said, env, words = json.loads(line)
    for descriptor, path in enumerate(said, 1):
        os.dup2(os.open(path, os.O_WRONLY | os.O_CREAT), descriptor)
    os.environ.update(env)
    numba.config.reload_config()
    sys.path[:1] = [x for x in env.get("PYTHONPATH", "").split(os.pathsep) if x]
    sys.argv = words
    runpy.run_path(words[0], run_name="__main__")


if __name__ == "__main__":
    _serve()
