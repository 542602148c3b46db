"""Processes killed while they save: what is left is whole, the old file or the new one.

As a program it is the victim: it saves the same few files again and again until it is killed.
"""

import json
import os
import signal
import subprocess
import sys
import time
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from mitt.core.map.learn import Learned
from mitt.core.map.map_design import default_design
from mitt.core.map.mapping import unlearned
from mitt.io.load import build_arm
from mitt.io.maps import read_map, save_map
from mitt.io.reading import read_json
from mitt.io.writing import write_json, write_text

#: What is saved: a result, a page, a map.
RESULT = "result.json"
PAGE = "page.html"
MAP = "map.json"
#: Longest that a victim lives after its first saves [s].
_LIFE = 0.12
_SIZE = 20_000


@dataclass(slots=True)
class Killed:
    """What became of the victims.

    Attributes:
        kills: How many died while they saved.
        unreadable: Files that could not be read afterwards.
    """

    kills: int = 0
    unreadable: list[str] = field(default_factory=list)


def soak(kills: int, *, seed: int, folder: Path) -> Killed:
    """Kill ``kills`` processes at random moments and read what they left."""
    rng, killed = np.random.default_rng(seed), Killed()
    for k in range(kills):
        place = folder / str(k)
        place.mkdir()
        victim = subprocess.Popen(
            [sys.executable, "-m", "soak.kills", str(place)],
            stdout=subprocess.PIPE,
            env=os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)},
        )
        assert victim.stdout is not None
        victim.stdout.readline()  # it has saved everything once
        time.sleep(float(rng.uniform(0.0, _LIFE)))
        victim.send_signal(signal.SIGKILL)
        victim.wait()
        victim.stdout.close()
        killed.kills += victim.returncode == -signal.SIGKILL
        killed.unreadable += [f"{k}: {name}" for name in _unreadable(place)]
    return killed


def _unreadable(place: Path) -> list[str]:
    """Return the files of a dead process that are not whole."""
    found = []
    try:
        rows = read_json(place / RESULT, max_bytes=10**8)["rows"]
        if rows != [rows[0]] * _SIZE:
            found.append(RESULT)
    except (ValueError, KeyError, IndexError):
        found.append(RESULT)
    text = (place / PAGE).read_text(encoding="utf-8")
    if not (text.startswith("<p>") and text.endswith("</p>")):
        found.append(PAGE)
    try:
        read_map(place / MAP, build_arm("wam"))
    except ValueError:
        found.append(MAP)
    return found


def _victim(place: Path) -> None:
    """Save for ever."""
    arm = build_arm("wam")
    f = replace(unlearned(arm, default_design(arm)), region=np.array([arm.q_min, arm.q_max]))
    learned = Learned(map=f, maps=(f,), steps=(), flights=0, left_out=0, status="converged")
    k = 0
    while True:
        write_json(place / RESULT, {"rows": [k] * _SIZE})
        write_text(place / PAGE, f"<p>{json.dumps([k] * _SIZE)}</p>")
        save_map(place / MAP, learned, version=f"0.0.{k}")
        if k == 0:
            os.write(1, b"ready\n")
        k += 1


if __name__ == "__main__":
    _victim(Path(sys.argv[1]))
