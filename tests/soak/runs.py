"""Runs of ``mitt catch`` ended at random moments: what was finished is kept, and one line is said.

Killed with SIGKILL, a run leaves every throw that had ended, bit for bit those of a run left in
peace. Ended by SIGINT or SIGTERM it exits with the signal's status, and soon.
"""

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from mitt.core.errors import FileError
from mitt.lab.trials.journal import read_kept
from mitt.lab.trials.scored_task import NAME

#: Throws of a run: enough that the moments fall before, among and behind them.
THROWS = 40
SIGNALS = (signal.SIGINT, signal.SIGTERM)
#: What mitt says of its progress: not the one line.
PROGRESS = "mitt: throwing"


@dataclass(slots=True)
class Ended:
    """What became of the runs.

    Attributes:
        killed: Runs that SIGKILL ended.
        throws: Throws that had ended in them.
        signalled: Runs that SIGINT or SIGTERM ended.
        longest: Longest time from a signal to the end of the process [s].
        faults: What was lost, said wrongly or exited wrongly.
    """

    killed: int = 0
    throws: int = 0
    signalled: int = 0
    longest: float = 0.0
    faults: list[str] = field(default_factory=list)


def soak(kills: int, signals: int, *, seed: int, folder: Path) -> Ended:
    """End ``kills`` runs by SIGKILL and ``signals`` runs by SIGINT or SIGTERM."""
    rng, ended = np.random.default_rng(seed), Ended()
    began = time.monotonic()
    with _run(folder / "whole", seed) as process:
        process.communicate()
    span = time.monotonic() - began
    whole = read_kept(folder / "whole").result["trials"]
    for k in range(kills):
        _kill(folder / f"kill{k}", seed, float(rng.uniform(0.0, span)), whole, ended)
    for k in range(signals):
        number = SIGNALS[k % len(SIGNALS)]
        # every second one in the first second
        moment = float(rng.uniform(0.0, 1.0 if k % 4 < len(SIGNALS) else span))
        _interrupt(folder / f"signal{k}", seed, moment, number, ended)
    return ended


@contextmanager
def _run(out: Path, seed: int) -> Iterator[subprocess.Popen[str]]:
    """Start a run, and see it ended."""
    words = ["catch", "--throws", str(THROWS), "--seed", str(seed), "--vision", "points"]
    process = subprocess.Popen(
        [sys.executable, "-m", "mitt", *words, "--record", "none", "--out", str(out)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env=os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)},
    )
    try:
        yield process
    finally:
        process.kill()
        process.communicate()


def _kill(out: Path, seed: int, moment: float, whole: list[Any], ended: Ended) -> None:
    """Kill a run after a time and compare its throws with those of the whole run."""
    with _run(out, seed) as process:
        time.sleep(moment)
        before = _lines(out)
        process.kill()
        process.communicate()
    ended.killed += process.returncode == -signal.SIGKILL
    if not before:  # the list was not begun
        return
    try:
        kept = read_kept(out).result["trials"]
    except FileError as error:
        ended.faults.append(f"{out.name}: {error}")
        return
    ended.throws += len(kept)
    if len(kept) < before - 1 or kept != whole[: len(kept)]:
        ended.faults.append(f"{out.name}: {len(kept)} throws of {before - 1}, or others")


def _listens(process: int) -> bool:
    """Say whether a process sees to SIGTERM itself, by what the system knows of it."""
    text = Path(f"/proc/{process}/status").read_text()
    caught = int(next(x for x in text.splitlines() if x.startswith("SigCgt:")).split()[1], 16)
    return bool(caught >> (signal.SIGTERM - 1) & 1)


def _lines(out: Path) -> int:
    """Return the whole lines of a run's list of throws."""
    return (out / NAME).read_bytes().count(b"\n") if (out / NAME).exists() else 0


def _interrupt(out: Path, seed: int, moment: float, number: signal.Signals, ended: Ended) -> None:
    """Send a run a signal some time after it listens; check status, line and result."""
    with _run(out, seed) as process:
        while not _listens(process.pid):  # until then a signal is the interpreter's
            time.sleep(0.001)
        time.sleep(moment)
        alive, sent = process.poll() is None, time.monotonic()
        process.send_signal(number)
        _, said = process.communicate()
    if not alive or (process.returncode == 0 and not said.strip()):
        return  # it was over
    ended.signalled += 1
    ended.longest = max(ended.longest, time.monotonic() - sent)
    lines = [line for line in said.splitlines() if not line.startswith(PROGRESS)]
    if process.returncode != 128 + number or len(lines) != 1:
        ended.faults.append(f"{out.name} {moment:.2f} s: {process.returncode}, {said!r}")
    elif _lines(out):
        try:
            json.loads((out / "result.json").read_text())
        except (OSError, ValueError) as error:
            ended.faults.append(f"{out.name}: {error}")
