"""Simulation, design, studies and environments ask the system for nothing that Linux alone has.

What macOS has not is taken away here; this is no macOS.
"""

import os
import select
import subprocess
import sys

import pytest

import mitt.gym
from mitt.core.map.mapping import DirectMap
from mitt.lab.trials.runs import simulate
from mitt.lab.trials.workers import Processes, engine_of

#: What Python has on Linux and not on macOS.
LINUX_ALONE = (
    (os, [x for x in vars(os) if x.startswith(("sched_", "SCHED_", "pidfd_", "memfd_"))]),
    (os, ["posix_fallocate", "posix_fadvise", "getresuid", "setresuid", "copy_file_range"]),
    (select, ["epoll"]),
)
#: Takes that away, with what reads /proc, and imports all that does not need a robot.
IMPORTS = f"""
import builtins, os, select, sys
opened = builtins.open
def refuse(path, *rest, **named):
    assert not str(path).startswith("/proc"), path
    return opened(path, *rest, **named)
import asyncio, gymnasium, mujoco, numba, viser  # they may ask for what they like
builtins.open = refuse
for name in {[name for _, names in LINUX_ALONE for name in names]}:
    for home in (os, select):
        if hasattr(home, name):
            delattr(home, name)
from importlib import import_module
for name in ("catching", "meeting", "batting", "designing", "measuring", "replaying", "listing"):
    import_module(f"mitt.cli.{{name}}")
import mitt.gym, mitt.lab.design.search_jobs, mitt.lab.trials.study_run
from mitt.cli.main import main
sys.exit(main(["catch", "--check"]))
"""


def test_all_but_the_robots_side_is_imported_without_linux() -> None:
    done = subprocess.run(
        [sys.executable, "-c", IMPORTS], capture_output=True, text=True, check=False
    )
    assert (done.returncode, "input is good" in done.stderr) == (0, True), done.stderr


def test_a_throw_a_study_and_an_environment_run_without_linux(
    plain: DirectMap, monkeypatch: pytest.MonkeyPatch
) -> None:
    for home, names in LINUX_ALONE:
        for name in names:
            monkeypatch.delattr(home, name, raising=False)
    assert simulate(plain, throws=1, seed=1, pixels=False)
    engine = engine_of("local", None)
    assert isinstance(engine, Processes)
    env = mitt.gym.CatchEnv()
    env.reset(seed=1)
    env.step(env.action_space.sample())
