"""Faults at a simulated cell, many times each: how long until the arm is at rest, and what is said.

    python benchmarks/cell_faults.py --times 20 [--faults kill-run,cut] [--json FILE]
    python benchmarks/cell_faults.py --faults none --times 400 --record DIR

Each fault comes while the arm moves faster than 1 rad/s in a catch. The cell runs in a process of
its own that is this script again; it sees all true joint speeds, also those that it does not send.
Where a process is killed or stalled, the fault is the last command. Throws without a fault say
besides how much memory both processes take, and how large the recording is. The brake's time is
that of Ruckig's stop from the state at the fault, or 20 ms later if that is longer.
"""

import argparse
import json
import os
import pty
import re
import signal
import subprocess
import sys
import threading
import time
from collections import deque
from collections.abc import Iterator, Sequence
from pathlib import Path
from queue import Empty, Queue
from typing import Any

import numpy as np

from mitt.core.control.stop import plan_brake
from mitt.core.signals import TICK, Array, Image
from mitt.interrupts import tell
from mitt.io.cell import read_cell
from mitt.robot.cell.prepare import PreparedCell, feed_of, prepare, scene_of_cell
from mitt.robot.cell.robot import ReceivedCommand
from mitt.robot.cell.session import Server

#: Speed that counts as moving and as at rest [rad/s]; how long rest has to last, and how long it is
#: watched how the arm sags onto its brakes then [s].
MOVING = 1.0
REST = 0.05
LASTS = 0.01
SAGS = 0.3
#: Length of a stall and of a cut [s], and by how much a clock is set back [s].
STALL = 0.1
CUT = 0.5
BACK = 3600.0
#: What the cell does on a signal from the script.
MARK = signal.SIGUSR1
DO_CUT = signal.SIGUSR2
DO_BACK = signal.SIGRTMIN
FAULTS = ("none", "kill-run", "kill-sim", "stall", "cut", "clock", "lossy")
#: Share of the messages that is lost, either way, where nothing else goes wrong.
LOST = {"none": 0.0, "lossy": 0.1}


class FaultyPort:
    """The port of a simulated cell with faults of the link; measures what the arm does then."""

    def __init__(self, prepared: PreparedCell, lose: float) -> None:
        """Join the network; ``lose`` is the share of messages that is lost either way."""
        from mitt.robot.cell.ros2 import Ros2Cell  # noqa: PLC0415 (after the loop is hurried)

        self._inner, self._arm = Ros2Cell(prepared.cell, prepared.arm), prepared.arm
        self._lose, self._rng = lose, np.random.default_rng(80100)
        self._cut, self._shift, self._wanted = 0.0, 0.0, ""
        self._since: float | None = None
        self._brake, self._still, self._told = 0.0, 0, False
        self._places: deque[Array] = deque(maxlen=5)
        self._now, self._protected, self._waits = 0.0, False, False
        self._rested: tuple[float, Array] | None = None
        self._sag, self._inside = 0.0, True
        for number, name in ((MARK, "mark"), (DO_CUT, "cut"), (DO_BACK, "clock")):
            signal.signal(number, lambda *_, name=name: setattr(self, "_wanted", name))

    def _lost(self) -> bool:
        """Say whether the next message is lost."""
        return time.monotonic() < self._cut or bool(self._rng.random() < self._lose)

    def state(self, t: float, q: Array, dq: Array) -> None:
        """Publish a reading, begin a fault, and watch how the arm comes to rest."""
        self._now = t
        if self._wanted:
            self._begin(t, q, dq)
        self._places.append(q)  # one count of an encoder in a tick is 0.09 rad/s
        dq = (q - self._places[0]) / (TICK * max(len(self._places) - 1, 1))
        fast = float(np.max(np.abs(dq)))
        if fast > MOVING and not self._told and self._since is None:
            self._told = True
            say({"moving": True})
        if fast < MOVING and self._since is None and self._told and self._still > 100:
            self._told = False
        self._still = self._still + 1 if fast < REST else 0
        if self._since is not None and 0.019 < t - self._since < 0.0205:
            self._brake = max(self._brake, self._planned(t, q, dq))
        if self._since is not None:
            self._watch(t - self._since, q)
        if not self._lost():
            self._inner.state(t - self._shift, q, dq)

    def _watch(self, passed: float, q: Array) -> None:
        """Note when the arm has come to rest, and how far it sags onto its brakes after that."""
        self._inside &= bool(np.all(q > self._arm.q_min) and np.all(q < self._arm.q_max))
        if self._rested is None and self._still * 1e-3 > LASTS:
            self._rested = (max(passed - self._still * 1e-3, 0.0), q.copy())
        if self._rested is not None:
            rest, place = self._rested
            self._sag = max(self._sag, float(np.max(np.abs(q - place))))
            if passed > rest + SAGS:
                say(
                    {
                        "rest_s": round(rest, 4),
                        "brake_s": round(self._brake, 4),
                        "inside": self._inside,
                        "sag_rad": round(self._sag, 4),
                    }
                )
                self._since, self._told = None, False

    def _begin(self, t: float, q: Array, dq: Array) -> None:
        """Begin what a signal has asked for."""
        wanted, self._wanted, self._since, self._still = self._wanted, "", t, 0
        self._rested, self._sag, self._inside = None, 0.0, True
        self._waits = wanted == "mark"
        self._brake = self._planned(t, q, dq)
        if wanted == "cut":
            self._cut = time.monotonic() + CUT
        elif wanted == "clock":
            self._shift += BACK

    def _planned(self, t: float, q: Array, dq: Array) -> float:
        """Return the brake's time from a state [s]."""
        return plan_brake(self._arm, t, np.array([q, dq, np.zeros(len(q))])).duration

    def ball(self, t: float, r_o: Array) -> None:
        """Publish a position."""
        if not self._lost():
            self._inner.ball(t - self._shift, r_o)

    def status(self, t: float, trouble: str) -> None:
        """Publish how the robot is."""
        self._protected = bool(trouble)
        if not self._lost():
            self._inner.status(t - self._shift, trouble)

    def result(self, said: str) -> None:
        """Publish how a throw ended."""
        say({"result": json.loads(said)})
        self._inner.result(said)

    def command(self) -> ReceivedCommand | None:
        """Return the newest command, unless it is lost."""
        new = self._inner.command()
        if new is None or self._lost():
            return None
        if self._since is not None and self._waits and not self._protected:
            self._since, self._brake = self._now, 0.0  # the other process is not stopped yet
        return new._replace(answers=new.answers + self._shift)

    def frames(self, t: float, images: Sequence[Image]) -> None:
        """Publish images."""
        self._inner.frames(t, images)

    def close(self) -> None:
        """Take away what others should not find any more."""
        self._inner.close()

    def brake(self) -> bool | None:
        """Return what was said to the brakes, unless it is lost."""
        said = self._inner.brake()
        return None if time.monotonic() < self._cut else said


def say(value: dict[str, Any]) -> None:
    """Tell the script."""
    print(json.dumps(value), flush=True)


def serve(name: str, lose: float, seed: int) -> None:
    """Be the cell."""
    prepared = prepare(read_cell(name))
    scene = scene_of_cell(prepared.cell, None)
    source = feed_of(prepared, scene, seed=seed, count=None)
    Server(prepared, scene, source, tell, lambda: FaultyPort(prepared, lose)).run()


class Process:
    """A process whose lines come into a queue."""

    def __init__(self, words: list[str], *, keyboard: bool = False) -> None:
        """Start it; ``keyboard`` gives it a terminal to read from."""
        self._keys, theirs = pty.openpty() if keyboard else (-1, -1)
        self.process = subprocess.Popen(  # noqa: S603 (ourselves)
            [sys.executable, *words],
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            stdin=theirs if keyboard else subprocess.DEVNULL,
        )
        self.lines: Queue[str] = Queue()
        threading.Thread(target=self._listen, daemon=True).start()

    def _listen(self) -> None:
        """Take lines over."""
        assert self.process.stdout is not None
        for line in self.process.stdout:
            self.lines.put(line.rstrip())

    def until(self, pattern: str, *, timeout: float = 60.0) -> str:
        """Return the first line that has a pattern."""
        end, seen = time.monotonic() + timeout, []
        while time.monotonic() < end and (self.process.poll() is None or not self.lines.empty()):
            try:
                line = self.lines.get(timeout=0.05)
            except Empty:
                continue
            seen.append(line)
            if re.search(pattern, line):
                return line
        raise TimeoutError(f"no {pattern!r} in {seen[-8:]}")

    @property
    def memory_mb(self) -> float:
        """Memory that it holds now [MB]."""
        status = Path(f"/proc/{self.process.pid}/status").read_text()
        found = re.search(r"VmRSS:\s+(\d+) kB", status)
        return int(found[1]) / 1e3 if found else float("nan")

    def enter(self) -> None:
        """Press Enter."""
        os.write(self._keys, b"\n")

    def end(self) -> None:
        """End it at once."""
        self.process.kill()
        self.process.wait()


def start_sim(cell: str, lose: float, seed: int) -> Process:
    """Start the cell."""
    sim = Process([__file__, "--cell", cell, "--serve", str(lose), "--seed", str(seed)])
    try:
        sim.until("is there", timeout=180.0)
    except TimeoutError:
        sim.end()
        raise
    return sim


def start_run(cell: str, record: Path | None = None) -> Process:
    """Start the loop at the cell, and say that the arm may move."""
    out = [] if record is None else ["--out", str(record)]
    run = Process(["-m", "mitt", "run", cell, *out], keyboard=True)
    try:
        run.until("press Enter|waiting: protective", timeout=180.0)
        run.enter()
        run.until("the arm moves")
    except TimeoutError:
        run.end()
        raise
    return run


def started(
    cell: str, lose: float, seed: int, record: Path | None = None
) -> tuple[Process, Process]:
    """Start the cell, and the loop at it."""
    sim = start_sim(cell, lose, seed)
    try:
        return sim, start_run(cell, record)
    except TimeoutError:
        sim.end()
        raise


def trials(cell: str, fault: str, times: int, seed: int) -> Iterator[dict[str, Any]]:
    """Bring about a fault again and again; each time somebody says that the arm may move again."""
    sim, run = started(cell, 0.0, seed)
    try:
        for _ in range(times):
            await_moving(sim, run)
            found: dict[str, Any]
            if fault == "kill-run":
                sim.process.send_signal(MARK)
                run.end()
                found, why = json.loads(sim.until("rest_s")), "the cell: no command for 20 ms"
                run = start_run(cell)
            elif fault == "kill-sim":
                sim.end()
                why = run.until("stopped:")
                found = {}
                sim = start_sim(cell, 0.0, seed)
                again(run)
            else:
                sim.process.send_signal({"cut": DO_CUT, "clock": DO_BACK}.get(fault, MARK))
                if fault == "stall":
                    run.process.send_signal(signal.SIGSTOP)
                    time.sleep(STALL)
                    run.process.send_signal(signal.SIGCONT)
                found, why = json.loads(sim.until("rest_s")), run.until("stopped:")
                again(run)
            yield {"why": why.removeprefix("mitt: ")} | found
    finally:
        run.end()
        sim.end()


def await_moving(sim: Process, run: Process) -> None:
    """Wait until the arm moves in a catch; an arm that has stopped for another reason goes on."""
    for _ in range(240):
        try:
            sim.until('"moving"', timeout=0.5)
        except TimeoutError:
            goes_on(run)
        else:
            return
    raise TimeoutError("the arm does not move")


def again(run: Process) -> None:
    """Say that the arm may move again."""
    run.until("press Enter|waiting: protective")
    run.enter()
    run.until("the arm moves")


def goes_on(run: Process) -> str:
    """Say that the arm may move again if it has stopped; return why it had."""
    while not run.lines.empty():
        said = run.lines.get()
        if "stopped:" in said:
            again(run)
            return said
    return ""


def throws(
    cell: str, share: float, times: int, seed: int, record: Path | None
) -> Iterator[dict[str, Any]]:
    """Lose a share of all messages either way, throw after throw."""
    sim, run = started(cell, share, seed, record)
    try:
        for _ in range(times):
            why, line = "", None
            while line is None:
                try:
                    line = json.loads(sim.until('"result"', timeout=0.5))["result"]
                except TimeoutError:
                    why = goes_on(run) or why
            yield {
                "why": why,
                "status": line["status"],
                "violations": line["limit_violations"],
                "age_us": line["command_age_us"],
                "memory_mb": [round(sim.memory_mb, 1), round(run.memory_mb, 1)],
                "record_mb": recorded(record),
            }
    finally:
        run.end()
        sim.end()


def recorded(folder: Path | None) -> float:
    """Return how large the recordings in a folder are [MB]."""
    files = [] if folder is None else folder.glob("*.mcap")
    return round(sum(file.stat().st_size for file in files) / 1e6, 1)


def main() -> None:
    """Bring about all faults and print a table."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--times", type=int, default=20)
    parser.add_argument("--faults", default=",".join(FAULTS))
    parser.add_argument("--cell", default="wam-sim")
    parser.add_argument("--seed", type=int, default=80200)
    parser.add_argument("--json", type=Path)
    parser.add_argument("--record", type=Path, help="folder for recordings of throws")
    parser.add_argument("--serve", type=float)
    given = parser.parse_args()
    if given.serve is not None:
        serve(given.cell, given.serve, given.seed)
        return
    found: dict[str, list[dict[str, Any]]] = {}
    for fault in given.faults.split(","):
        found[fault] = []
        lost, many = LOST.get(fault), (given.times, given.seed)
        made = (
            trials(given.cell, fault, *many)
            if lost is None
            else throws(given.cell, lost, *many, given.record)
        )
        try:
            for trial in made:
                found[fault].append(trial)
                print(fault, json.dumps(trial), flush=True)
        except TimeoutError as error:
            print(fault, "ended early:", error, flush=True)
        report(fault, found[fault])
    if given.json:
        given.json.write_text(json.dumps(found, indent=1))


def report(fault: str, rows: list[dict[str, Any]]) -> None:
    """Print what a fault did."""
    if not rows:
        return
    if fault in LOST:
        caught = sum(row["status"] == "caught" for row in rows)
        stops, last = [row["why"] for row in rows if row["why"]], rows[-1]
        print(
            f"{fault}: caught {caught} of {len(rows)}, stopped {len(stops)} times, ticks beyond"
            f" a limit {last['violations']}, age of commands {last['age_us']}"
        )
        for row in (rows[min(9, len(rows) - 1)], last):
            sim, run = row["memory_mb"]
            print(f"{fault}: sim {sim} MB, run {run} MB, recorded {row['record_mb']} MB")
        return
    timed = [row for row in rows if "rest_s" in row]
    over = [1e3 * (row["rest_s"] - row["brake_s"]) for row in timed]
    print(f"{fault}: {len(rows)} times, {sum(bool(row['why']) for row in rows)} times said why")
    if over:
        sag = max(row["sag_rad"] for row in timed)
        late = f"{np.median(over):.0f} ms after the brake's time, {max(over):.0f} at most"
        inside = sum(row["inside"] for row in timed)
        print(f"{fault}: inside the joints' ranges {inside} times")
        print(f"{fault}: at rest {late}; {1e3 * sag:.0f} mrad of sag onto the brakes at most")


if __name__ == "__main__":
    main()
