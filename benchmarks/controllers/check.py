"""mitt's drivers at the makers' own clients, as ``make controllers`` runs them.

Makes no robot of them: franka-sim, which others wrote, enforces the FCI's limits of communication
and motion against libfranka; ur_controller.py latches what ur_rtde sends each 2 ms. Each runs in
real time, so that on a busy machine mitt may rightly stop; how often is part of what is printed.
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import closing, contextmanager, suppress
from pathlib import Path

import numpy as np

from mitt.clock import hurried, monotonic, pinned, uncollected
from mitt.io.cell import read_cell
from mitt.robot.cell.drivers import connect_robot
from mitt.robot.cell.live import Mode
from mitt.robot.cell.prepare import prepare
from mitt.robot.cell.session import loop_of, made_ready

HERE = Path(__file__).parent
#: Commands of ur_rtde's script, as ur_controller.py numbers them.
UR = {"velocity": "9", "position": "11", "torque": "66"}
#: How far from the ready pose the arm of a controller begins [rad].
_AWAY = 0.2
#: Time for which it stands there under command [s], and in which a server is there [s].
_STANDS = 2.0
_THERE = 20.0
#: Distance of hand and ball at their nearest that counts as there [m].
_NEAR = 0.015


@contextmanager
def served(command: list[str], env: dict[str, str], log: Path) -> Iterator[None]:
    """Run a server in the block, hurried and on the first core, where that is allowed."""
    hurry = ["chrt", "-f", "60"] if os.geteuid() == 0 else []
    with log.open("w") as out:
        process = subprocess.Popen(
            ["taskset", "-c", "0", *hurry, *command],
            env=os.environ | env,
            stdout=out,
            stderr=subprocess.STDOUT,
        )
        try:
            yield
        finally:
            process.kill()
            process.wait()


def ur_by_rtde(takes: str, folder: Path) -> dict[str, object]:
    """Move a UR5e to its ready pose and stand there; say which commands the controller saw."""
    cell = read_cell(HERE / "ur5e.toml")
    robot = cell.robot.model_copy(update={"takes": takes})
    prepared = prepare(cell.model_copy(update={"robot": robot}))
    f = made_ready(prepared, lambda _: None)
    names = [x.name for x in prepared.arm.model.links]
    q = np.array([x.held or 0.0 for x in prepared.arm.model.links])
    q[list(prepared.arm.model.active)] = prepared.arm.q_ready - _AWAY
    log = folder / "ur.json"
    command = [sys.executable, str(HERE / "ur_controller.py"), str(log), json.dumps(q.tolist())]
    assert len(names) == 6
    with served(command, {}, folder / "ur.log"):
        end = monotonic() + _THERE
        while not log.exists() and monotonic() < end:
            time.sleep(0.1)
        connection = connect_robot(prepared)
        with closing(connection.robot), uncollected(), hurried(), pinned(-1):
            loop = loop_of(prepared, f, connection)
            while (wrong := loop.healthy()) and monotonic() < end + _THERE:
                pass
            loop.begin()
            stands = np.inf
            while loop.mode is not Mode.STOPPED and monotonic() < stands:
                loop.cycle()
                if loop.mode is Mode.CATCHING and stands == np.inf:
                    stands = monotonic() + _STANDS
            ticks, why, mode = loop.counts.ticks, loop.why, loop.mode.value
            loop.finish()
        time.sleep(0.5)
        seen = json.loads(log.read_text())
    sent = seen["sent"].get(UR[takes], 0)
    return {
        "takes": takes,
        "ticks": ticks,
        "sent": sent,
        "seen": seen["seen"].get(UR[takes], 0),
        "longest_gap": seen["longest_gap"],
        "ended": f"{mode} {why} {wrong}".strip(),
        "off_rad": round(float(np.max(np.abs(np.array(seen["q"]) - q))) - _AWAY, 4),
    }


def franka_by_libfranka(server: str, throws: int, folder: Path) -> dict[str, object]:
    """Throw balls at an FR3; say how it went, by the robot's own states."""
    mjcf, log = fr3_model(server, folder), folder / "franka.jsonl"
    env = {"FR3_MJCF": str(mjcf)}
    command = [server, "-m", "franka_sim.run_server", "--no-gripper"]
    command += ["--enforce-comm-constraints", "--enforce-motion-limits"]
    with served(command, env, folder / "franka-sim.log"):
        time.sleep(6.0)
        with (folder / "run.err").open("w") as err, suppress(subprocess.TimeoutExpired):
            words = ["run", str(HERE / "fr3.toml"), "--yes", "--throws", str(throws), "--json"]
            paths = [str(HERE), installed(folder), os.environ.get("PYTHONPATH", "")]
            subprocess.run(
                [sys.executable, "-m", "mitt", *words],
                env=os.environ | {"PYTHONPATH": os.pathsep.join(paths), "CONTROLLER_LOG": str(log)},
                stdout=(folder / "run.json").open("w"),
                stderr=err,
                timeout=60.0 + 8.0 * throws,
                check=False,
            )
    said = [json.loads(line) for line in log.read_text().splitlines()] if log.exists() else []
    nearest = [x["nearest_m"] for x in said if "nearest_m" in x]
    run = json.loads((folder / "run.json").read_text() or "{}")
    return {
        "balls": len(nearest),
        "within_15_mm": sum(x < _NEAR for x in nearest),
        "nearest_mm": [round(1e3 * x, 1) for x in nearest],
        "least_success_rate": min((x["success_rate"] for x in said if "nearest_m" in x), default=0),
        "reflexes": [x["reflex"] for x in said if "reflex" in x],
        "ticks": run.get("ticks"),
        "stops": run.get("stops"),
    }


def fr3_model(server: str, folder: Path) -> Path:
    """Return the FR3's model of the package franky-sim, its meshes where the file looks."""
    code = "import importlib.util; print(importlib.util.find_spec('franky_sim').origin)"
    found = subprocess.run([server, "-c", code], capture_output=True, text=True, check=True)
    assets = Path(found.stdout.strip()).parent / "assets"
    (folder / "assets").symlink_to(assets / "meshes")
    (folder / "fr3.xml").write_text((assets / "fr3.xml").read_text())
    return folder / "fr3.xml"


def installed(folder: Path) -> str:
    """Return a folder by which the driver of this one is found by its name."""
    about = folder / "metadata" / "mitt_controllers-0.1.dist-info"
    about.mkdir(parents=True)
    (about / "METADATA").write_text("Metadata-Version: 2.1\nName: mitt-controllers\nVersion: 0.1\n")
    (about / "entry_points.txt").write_text("[mitt.robots]\nfranka-sim = franka_at_sim:at_sim\n")
    return str(about.parent)


def main() -> int:
    """Run all; return 1 where something was not as it should be."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--server", help="Python of the environment that has franka-sim")
    parser.add_argument("--throws", type=int, default=20)
    parser.add_argument("--takes", nargs="*", default=list(UR))
    given = parser.parse_args()
    good = True
    for takes in given.takes:
        with tempfile.TemporaryDirectory() as name:
            found = ur_by_rtde(takes, Path(name))
        print(json.dumps({"ur_rtde": found}), flush=True)
        good &= found["sent"] == found["seen"] != 0
    if given.server:
        with tempfile.TemporaryDirectory() as name:
            found = franka_by_libfranka(given.server, given.throws, Path(name))
        print(json.dumps({"libfranka": found}), flush=True)
        good &= found["balls"] == given.throws and not found["reflexes"]
    return int(not good)


if __name__ == "__main__":
    sys.exit(main())
