"""The driver ``ros2`` beside Fast DDS in C++: joint states one way, trajectories back, 1 kHz.

    apt-get install libfastrtps-dev fastddsgen default-jre-headless g++
    python benchmarks/ros2_interop.py --seconds 60

Builds ``benchmarks/interop/peer.cpp``, answers each of its joint states by a command whose torques
are the positions read, and compares both sides' counts. Fails where a message was lost or differs.
"""

import argparse
import json
import os
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from mitt.clock import hurried, uncollected
from mitt.core.signals import Command
from mitt.io.cell import arm_of, read_cell

HERE = Path(__file__).parent / "interop"
#: Domain of the two, and where commands go.
DOMAIN = "173"
COMMANDS = "/peer/joint_trajectory"
JOINTS = ["a", "b", "c"]


def build(folder: Path) -> Path:
    """Build the peer and return it."""
    missing = [x for x in ("fastddsgen", "g++") if shutil.which(x) is None]
    if missing:
        sys.exit(
            f"{', '.join(missing)} not found: apt-get install libfastrtps-dev fastddsgen"
            " default-jre-headless g++"
        )
    for name in ("messages.idl", "peer.cpp"):
        shutil.copy(HERE / name, folder)
    work(folder, "fastddsgen", "-replace", "messages.idl")
    sources = [str(x.name) for x in folder.glob("*.cxx") if "PubSubMain" not in x.name]
    peer = folder / "peer"
    work(
        folder,
        "g++",
        "-O2",
        "-std=c++17",
        "-o",
        str(peer),
        "peer.cpp",
        *sources,
        "-lfastrtps",
        "-lfastcdr",
        "-lpthread",
    )
    return peer


def work(folder: Path, *words: str) -> None:
    """Run a tool in a folder; its words are heard only where it fails."""
    done = subprocess.run(words, cwd=folder, capture_output=True, text=True, check=False)  # noqa: S603
    if done.returncode:
        sys.exit(f"{words[0]} failed: {(done.stderr or done.stdout)[-2000:]}")


def exchange(peer: Path, count: int) -> dict[str, int]:
    """Let the peer send so many joint states, answer each, and return both sides' counts."""
    os.environ["ROS_DOMAIN_ID"] = DOMAIN
    from mitt.robot.cell.ros2 import Ros2Robot  # noqa: PLC0415 (reads the domain)

    cell = read_cell("wam-sim")
    options = {"command": COMMANDS, "unbraked": True}
    robot_part = cell.robot.model_copy(update={"joints": JOINTS, "options": options})
    cell = cell.model_copy(update={"robot": robot_part})
    theirs = subprocess.Popen(  # noqa: S603
        [str(peer), DOMAIN, str(count)], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    )
    assert theirs.stdin is not None
    assert theirs.stdout is not None
    theirs.stdout.readline()
    robot = Ros2Robot(cell, arm_of(cell))
    while not robot.listened():
        time.sleep(0.05)
    time.sleep(1.0)  # and the other way round
    theirs.stdin.write("\n")
    theirs.stdin.flush()
    got = wrong = 0
    end = time.monotonic() + 1e-3 * count + 5.0
    told = np.zeros((4, 3))
    while got < count and time.monotonic() < end:
        for reading in robot.read(0.1):
            k = round(1e3 * reading.t) - 1000
            right = np.array_equal(reading.q, k + 0.25 * np.arange(3)) and np.all(reading.dq == -k)
            got, wrong = got + 1, wrong + (not right)
            told[3] = reading.q
            robot.write(Command(t=reading.t, joints=told, hand=0.0), reading.t)
    words = theirs.communicate()[0].split()
    said = dict(zip(words[::2], map(int, words[1::2]), strict=True))
    return {
        "sent": said["sent"],
        "received": got,
        "wrong": wrong,
        "answered": said["answered"],
        "answers_wrong": said["wrong"],
    }


def main() -> None:
    """Build, run, compare."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--seconds", type=float, default=60.0)
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        peer = build(Path(folder))
        with hurried(), uncollected():
            found = exchange(peer, round(1e3 * given.seconds))
    print(json.dumps(found))
    whole = found["sent"] == found["received"] == found["answered"]
    sys.exit(0 if whole and found["wrong"] == found["answers_wrong"] == 0 else 1)


if __name__ == "__main__":
    main()
