"""A live loop on an ordinary machine: stalls at every phase of a catch, and real sessions.

    python benchmarks/late_loop.py stalls --cell wam-sim --throws 40 --every 20
    python benchmarks/late_loop.py pairs --cell wam-sim --sessions 20 --throws 3

``stalls``: one process, no clock. At each EVERY-th tick in which something comes to the cell the
process is copied once for each stall; the copy lets the loop be late by so many ms, in which the
arm obeys the last command, and goes on until the throw is judged. Told are the ends, why it was
stopped, readings that were called repeated, and ticks beyond a limit.

``pairs``: ``mitt sim`` beside ``mitt run --yes`` in real time, session after session, each with a
seed and a domain of its own. Told is how each session ended and why, and how late its loop was.
"""

import argparse
import json
import os
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Sequence

from mitt.core.catcher.loading import load_decisions
from mitt.core.signals import TICK, ArmState
from mitt.io.cell import read_cell
from mitt.lab.trials.statistics import wilson
from mitt.robot.cell.drivers import LocalRobot, local_connection, local_robot
from mitt.robot.cell.live import LiveLoop, Mode
from mitt.robot.cell.prepare import cell_about, cell_generator, cell_map, prepare
from mitt.robot.cell.session import loop_of

#: Longest time that is given to what has come [s], and to a session [s].
LONGEST = 40.0
SESSION = 300.0


class LateRobot:
    """The robot of a simulated cell, read late once.

    Attributes:
        late: Ticks by which the next reading is late.
    """

    brakes = True

    def __init__(self, inner: LocalRobot) -> None:
        """Take the robot; not late yet."""
        self._inner, self.late = inner, 0

    def __getattr__(self, name: str) -> object:
        """Pass everything else on."""
        return getattr(self._inner, name)

    def read(self, timeout: float) -> Sequence[ArmState]:
        """Return readings; where it is late, those that came meanwhile too."""
        found, cell = list(self._inner.read(timeout)), self._inner.simulated
        late, self.late = self.late, 0
        for _ in range(late):
            cell.act()
            cell.tick()
        more, self._inner.port.states = self._inner.port.states, []
        return [*found, *more]


def ended(loop: LiveLoop, robot: LateRobot, local: LocalRobot, stall: int) -> list[object]:
    """Go on in a copy of this process, late by a stall [ticks]; return what became of the throw."""
    ours, theirs = os.pipe()
    child = os.fork()
    if child:
        os.close(theirs)
        with os.fdopen(ours, "rb") as said:
            found: list[object] = json.loads(said.read())
        os.waitpid(child, 0)
        return found
    cell, counts, robot.late = local.simulated, loop.counts, stall
    done, repeated, beyond, end = (
        len(cell.statuses),
        counts.repeated,
        cell.violations,
        cell.t + LONGEST,
    )
    while loop.mode is not Mode.STOPPED and len(cell.statuses) == done and cell.t < end:
        loop.cycle()
    status = (cell.statuses[done:] or ["not judged"])[0]
    found = [status, loop.why, counts.repeated - repeated, cell.violations - beyond]
    os.write(theirs, json.dumps(found).encode())
    os._exit(0)


def stalls(name: str, throws: int, every: int, lengths: Sequence[int], seed: int) -> None:
    """Try stalls at the phases of throws, and print what became of them."""
    prepared = prepare(read_cell(name))
    f = cell_map(prepared)
    load_decisions(prepared.arm, cell_generator(prepared, f), cell_about(prepared, f).settings)
    local = local_robot(prepared, seed=seed, count=throws)
    robot, cell = LateRobot(local), local.simulated
    loop = loop_of(prepared, f, local_connection(prepared.cell, robot))  # type: ignore[arg-type]
    loop.healthy()
    loop.begin()
    found, since = Counter[tuple[object, ...]](), 0
    while not cell.done and loop.mode is not Mode.STOPPED:
        since = since + 1 if loop.mode is Mode.CATCHING and cell.flying else 0
        if since and (since + 3 * len(cell.statuses)) % every == 0:
            for stall in lengths:
                found[(stall, *ended(loop, robot, local, stall))] += 1
        loop.cycle()
    print(f"{name}: {sum(found.values())} stalls; without: {Counter(cell.statuses)} {loop.why}")
    for (length, *said), count in sorted(found.items(), key=str):
        print(
            f"  {length} ms, {count} times: {said[0]}, stopped: {said[1] or 'no'}, repeated"
            f" {said[2]}, ticks beyond a limit {said[3]}",
            flush=True,
        )


def session(cell: str, throws: int, seed: int) -> dict[str, object]:
    """Run a session of two processes; return how it ended."""
    domain = {"ROS_DOMAIN_ID": str(100 + (os.getpid() + seed) % 100)}
    words = [sys.executable, "-m", "mitt"]
    count = ["--throws", str(throws), "--json"]
    with subprocess.Popen(  # noqa: S603 (ourselves)
        [*words, "sim", cell, "--seed", str(seed), *count],
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
        env=os.environ | domain,
    ) as sim:
        begun = time.monotonic()
        run = subprocess.run(  # noqa: S603 (ourselves)
            [*words, "run", cell, "--yes", *count],
            capture_output=True,
            text=True,
            stdin=subprocess.DEVNULL,
            env=os.environ | domain,
            timeout=SESSION,
            check=False,
        )
        try:
            said, _ = sim.communicate(timeout=30.0)
        except subprocess.TimeoutExpired:
            sim.terminate()
            said, _ = sim.communicate()
    told = json.loads(run.stdout) if run.stdout.strip().startswith("{") else {}
    there = json.loads(said) if said.strip().startswith("{") else {}
    return {
        "seed": seed,
        "status": run.returncode,
        "s": round(time.monotonic() - begun, 1),
        "throws": told.get("throws"),
        "caught": told.get("caught"),
        "met": told.get("met"),
        "stops": told.get("stops"),
        "notes": told.get("notes"),
        "late": told.get("late_ticks"),
        "repeated": told.get("repeated"),
        "age_us": told.get("command_age_us"),
        "slipped": there.get("slipped_ticks"),
        "beyond": there.get("limit_violations"),
        "last": run.stderr.strip().splitlines()[-1:],
    }


def pairs(cell: str, sessions: int, throws: int, seed: int) -> None:
    """Run sessions one after another; print how each ended."""
    whole = 0
    for k in range(sessions):
        try:
            found = session(cell, throws, seed + k)
        except subprocess.TimeoutExpired:
            found = {"seed": seed + k, "status": "not ended"}
        whole += found["status"] == 0
        print(json.dumps(found), flush=True)
    print(f"{cell}: {whole} of {sessions} sessions whole, {wilson(whole, sessions)}")


def main() -> None:
    """Take the words."""
    parser = argparse.ArgumentParser()
    parser.add_argument("what", choices=("stalls", "pairs"))
    parser.add_argument("--cell", default="wam-sim")
    parser.add_argument("--throws", type=int, default=3)
    parser.add_argument("--every", type=int, default=20, help="ticks from one phase to the next")
    parser.add_argument("--stalls", default="3,6,9,12,15,18", help="lengths [ms]")
    parser.add_argument("--sessions", type=int, default=20)
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args()
    if given.what == "pairs":
        pairs(given.cell, given.sessions, given.throws, given.seed)
        return
    lengths = [round(float(x) * 1e-3 / TICK) for x in given.stalls.split(",")]
    stalls(given.cell, given.throws, given.every, lengths, given.seed)


if __name__ == "__main__":
    main()
