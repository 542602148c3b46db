"""Loops whose ticks do not come each millisecond: no throw may be stopped for that.

    python benchmarks/late_ticks.py                       100 throws of each arm
    python benchmarks/late_ticks.py --throws 1000         1000 of each
    python benchmarks/late_ticks.py --arms wam-48v --seed 9100

The arm does exactly what its model says, and moves on while a tick is late (tests/exact_plant.py);
encoders are exact, positions of the ball have 1 mm of noise. Throws take turns: one tick late by
1.5 to 20 ms at one of 20 instants of the swing; all ticks off by up to 0.5 ms; a tick each 0.5, 2
or 4 ms; readings up to 5 ms old; none of it, to compare with. Near is a ball that comes within
20 mm of the open hand's catch point. The Panda keeps all limits of its data sheet.
"""

import argparse
import sys
from collections import Counter, defaultdict
from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
from exact_plant import SETTINGS, Change, as_read, each, throw
from franka_design import panda_file

from mitt.core.arm.arm import Arm
from mitt.core.catcher.catcher import Catcher
from mitt.core.catcher.generators import Direct
from mitt.core.map.mapping import DirectMap
from mitt.core.map.neighbourhood import learn
from mitt.core.signals import TICK, ArmState, Array
from mitt.io.arm_file import load_arm, read_arm_file
from mitt.lab.trials.source import Source, source_of, widened
from mitt.lab.trials.statistics import wilson
from mitt.lab.world.throws import Throw

SEED = 9000
ARMS = ("paper", "wam-48v", "panda")
#: Longest throw [s], when the swing may begin and end, instants in it, and what is near [m].
LONGEST = 1.6
SWING = (0.1, 0.75)
INSTANTS = 20
NEAR = 0.02
LATE = (0.0015, 0.020)
PERIODS = (0.0005, 0.002, 0.004)
OLD = 5
KINDS = ("late", "jitter", "late", "period", "old", "none")


def setting(name: str, seed: int, count: int) -> tuple[Arm, DirectMap, Source]:
    """Return an arm, its map, and what is thrown."""
    if name != "panda":
        arm = load_arm("wam", limits=name)
        return arm, learn(arm).map, source_of(arm, seed=seed, count=count, drag=0.0)
    with TemporaryDirectory() as folder:
        path = panda_file(Path(folder))
        arm, file = load_arm(path), read_arm_file(path)
    f = learn(arm).map
    source = source_of(arm, seed=seed, count=count, drag=0.0)
    assert file.throws is not None
    return arm, f, widened(source, file.throws)


def drawn(kind: str, rng: np.random.Generator) -> tuple[Array, Change, str]:
    """Draw when the ticks come and how old the readings are; return it in words, too."""
    times = each(TICK, round(LONGEST / TICK))
    if kind == "late":
        at = np.linspace(*SWING, INSTANTS)[rng.integers(INSTANTS)]
        late = rng.uniform(*LATE)
        times[times > at] += late - TICK
        return times, as_read, f"{1e3 * late:.2f} ms at {at:.3f} s"
    if kind == "jitter":
        off = rng.uniform(-0.5 * TICK, 0.5 * TICK, len(times))
        return np.unique(times + off - off[0]), as_read, "jitter"
    if kind == "period":
        period = PERIODS[rng.integers(len(PERIODS))]
        return each(period, round(LONGEST / period)), as_read, f"each {1e3 * period:g} ms"
    if kind == "old":
        old, past = int(rng.integers(1, OLD + 1)), list[ArmState]()

        def late_by(k: int, reading: ArmState) -> ArmState:
            past.append(reading)
            return past[max(k - old, 0)]

        return times, late_by, f"{old} ms old"
    return times, as_read, "none"


def main() -> None:
    """Throw and print."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n", 1)[0])
    parser.add_argument("--throws", type=int, default=100, metavar="N", help="of each arm")
    parser.add_argument("--arms", default=",".join(ARMS), metavar="A,B,...")
    parser.add_argument("--seed", type=int, default=SEED, metavar="S")
    options = parser.parse_args()
    for name in options.arms.split(","):
        arm, f, source = setting(name, options.seed, options.throws)
        first, generator, begun = Catcher(arm, f, settings=SETTINGS), Direct(f), perf_counter()
        rows: dict[str, Counter[str]] = defaultdict(Counter)
        for k in range(options.throws):
            kind, ball = KINDS[k % len(KINDS)], source.ball(k)
            assert isinstance(ball, Throw)
            times, change, what = drawn(kind, np.random.default_rng([options.seed, k]))
            out = throw(first.again(generator), arm, ball, times, seed=k, change=change)
            row = rows[kind]
            row["throws"] += 1
            row["refused"] += out.phase.value == "refused"
            row["near"] += out.nearest < NEAR
            row["stopped"] += out.stopped is not None
            if out.stopped is not None:
                print(f"  {name} throw {k}: {what}: {out.stopped.value}", flush=True)
        for kind, row in rows.items():
            low, high = wilson(row["stopped"], row["throws"])
            print(
                f"{name:8s} {kind:7s} {row['throws']:5d} throws  {row['stopped']} stopped"
                f" [{low:.4f}, {high:.4f}]  {row['near']} near  {row['refused']} refused",
                flush=True,
            )
        print(f"{name}: {perf_counter() - begun:.0f} s")


if __name__ == "__main__":
    main()
