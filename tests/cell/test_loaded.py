"""Nothing is compiled or loaded in front of a robot: the rehearsal has done it."""

import json
import subprocess
import sys

import pytest

#: In a process of its own: tests before this one have loaded what they needed.
_SCRIPT = """
import json
import sys
from dataclasses import replace

import numpy as np
from numba.core import dispatcher

sys.path.insert(0, "tests")
from local_cell import LocalCell

from mitt.robot.cell.prepare import cell_map, prepare
from mitt.robot.cell.session import rehearse
from mitt.io.cell import read_cell

prepared = prepare(read_cell("wam-sim"))
rehearse(prepared, cell_map(prepared))
load, begun = dispatcher.Dispatcher.compile, []


def note(self, signature):
    begun.append(self.py_func.__name__)
    return load(self, signature)


dispatcher.Dispatcher.compile = note


def moved(by, scale=(1.0, 1.0, 1.0)):
    return lambda points: [replace(p, r_o=p.r_o * scale + by) for p in points]


def seen_first(points):
    global left
    left -= len(points)
    return points if left > 0 else []


seen = {}
for name, on_points in {
    "plain": moved((0.0, 0.0, 0.0)),
    "aside": moved((0.0, 0.9, 0.0)),
    "below": moved((0.0, 0.0, -0.5)),
    "fast": moved((-0.8, 0.0, 0.0), (1.9, 1.5, 1.0)),
    "lost": seen_first,
}.items():
    left = 150
    throws = 2 if name in ("fast", "lost") else 1
    cell = LocalCell(throws=throws, seed=3, prepared=prepared)
    begun.clear()
    cell.robot.on_points = on_points
    cell.begin()
    cell.until(lambda: cell.simulated.done, ticks=20_000)
    seen[name] = {"loaded": list(begun), "statuses": cell.simulated.statuses}
print(json.dumps(seen))
"""


@pytest.mark.thorough
@pytest.mark.slow
def test_balls_of_each_kind_load_nothing() -> None:
    """Refused, open, too fast and lost ones, after one that was caught in the rehearsal."""
    run = subprocess.run(
        [sys.executable, "-c", _SCRIPT], capture_output=True, text=True, timeout=300, check=False
    )
    assert run.returncode == 0, run.stderr
    seen = json.loads(run.stdout)
    assert "caught" in seen["plain"]["statuses"]
    for name in ("aside", "below", "fast", "lost"):
        assert "missed" in seen[name]["statuses"], name
    assert {name: of["loaded"] for name, of in seen.items()} == {name: [] for name in seen}
