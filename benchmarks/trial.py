"""How fast is a throw: a trial against real time, a tick, and the stages of a tick.

    python benchmarks/trial.py                      measure, print, save runs/bench-trial.json
    python benchmarks/trial.py --compare A B        two saved files side by side

Every figure is a median over repeats of the same throws. A fixed piece of Python, the probe, is
timed around each repeat, and the processor time of each repeat is held against its wall-clock time:
both say how noisy the machine was. Compare files from one machine only.
"""

import argparse
import gc
import json
import os
import platform
import sys
from collections.abc import Callable
from functools import partial
from importlib.metadata import version
from pathlib import Path
from time import perf_counter, process_time
from typing import Any, TypeVar

import numpy as np

import mitt
from mitt.control.tracking import Tracker
from mitt.generator.generators import Direct
from mitt.generator.mapping import DirectMap
from mitt.link.files import write_json
from mitt.signals import Senses
from mitt.study.bench_tick import take_turns
from mitt.study.source import Source, source_of
from mitt.study.trial import Bench, known_ball
from mitt.vision.camera import fixed_rig
from mitt.vision.eyes import Eyes
from mitt.vision.filter import BallFilter
from mitt.world.motion import TICK
from mitt.world.scene import Scene

SCHEMA = "mitt.bench/1"
#: Loops of the probe, their repeats.
PROBE_LOOPS, PROBE_REPEATS = 2000, 400
#: The ratio of probes above which, and the share of a core below which, a machine is noisy.
NOISY, SHARED = 1.25, 0.97

#: End of the loop that is taken apart, of the stages in it, and of adapting [s].
LOOP_UNTIL, STAGES_UNTIL, ADAPT_UNTIL = 1.0, 0.45, 0.15

Numbers = dict[str, float]
T = TypeVar("T")


def percentiles(seconds: list[float]) -> Numbers:
    """Return median, p99, p99.9 and maximum [us]."""
    us = 1e6 * np.array(seconds)
    p50, p99, p99_9 = (float(x) for x in np.percentile(us, [50.0, 99.0, 99.9]))
    return {"p50": p50, "p99": p99, "p99_9": p99_9, "max": float(us.max())}


def probe() -> list[float]:
    """Return how long a fixed piece of work takes, time after time [s]."""
    times: list[float] = []
    for _ in range(PROBE_REPEATS):
        start, total = perf_counter(), 0
        for k in range(PROBE_LOOPS):
            total += k * k
        times.append(perf_counter() - start)
    return times


class Stopwatches:
    """Times of calls [s] by name, in the order of first use."""

    def __init__(self) -> None:
        """Start without times."""
        self.times: dict[str, list[float]] = {}

    def __call__(self, name: str, call: Callable[..., T], *args: object) -> T:
        """Make a call, keep how long it took, return its value."""
        start = perf_counter()
        value = call(*args)
        self.times.setdefault(name, []).append(perf_counter() - start)
        return value


def one_repeat(bench: Bench, source: Source) -> tuple[Numbers, Numbers]:
    """Throw every ball once; return times of the trials and of their ticks."""
    bench.stopwatch.clear()
    simulated, start, start_cpu = 0.0, perf_counter(), process_time()
    for index in range(source.count):
        bench.run(index, source.ball(index), seed=source.trial_seed(index))
        simulated += bench.world.t
    wall, cpu = perf_counter() - start, process_time() - start_cpu
    trial = {
        "wall_ms": 1e3 * wall / source.count,
        "simulated_ms": 1e3 * simulated / source.count,
        "throws_per_s_core": source.count / cpu,
        "times_real_time": simulated / wall,
        "times_real_time_cpu": simulated / cpu,
        "core_share": cpu / wall,
        "late_per_1000_ticks": 1e3 * bench.stopwatch.misses() / (simulated / TICK),
    }
    return trial, bench.stopwatch.percentiles_us()


def trials(f: DirectMap, source: Source, *, pixels: bool, repeats: int) -> dict[str, Any]:
    """Return the figures of whole trials, with images or with points, and of the probe."""
    bench = Bench(f.arm, Direct(f), Scene(), pixels=pixels)
    bench.run(-1, source.ball(0), seed=0)  # compiles what is not compiled yet
    gc.collect()
    gc.freeze()
    rows, ticks, probes = [], [], [float(np.median(probe()))]
    for _ in range(repeats):
        trial, tick = one_repeat(bench, source)
        rows.append(trial)
        ticks.append(tick)
        probes.append(float(np.median(probe())))
    middle = [{k: float(np.median([x[k] for x in xs])) for k in xs[0]} for xs in (rows, ticks)]
    return {"trial": middle[0], "tick_us": middle[1], "probe_spread": max(probes) / min(probes)}


def take_apart(f: DirectMap, source: Source, *, repeats: int) -> dict[str, Numbers]:
    """Return what each call of a trial's loop and each stage of the catcher takes [us]."""
    bench, timed = Bench(f.arm, Direct(f), Scene(), pixels=True), Stopwatches()
    for k in range(-1, repeats):
        index = max(k, 0) % source.count
        if k == 0:
            timed.times.clear()  # the first throw compiled what was not compiled yet
        world, catcher, seen = bench.world, bench.catcher(), []
        timed("reset (once a trial)", world.reset, source.ball(index), source.trial_seed(index))
        while world.t < LOOP_UNTIL:
            seen.append(timed("sense", world.sense))
            command = timed("catcher.step", catcher.step, seen[-1])
            timed("apply", world.apply, command)
            timed("think", catcher.think)
        replay_stages(f, seen, timed)
    return {name: percentiles(times) for name, times in timed.times.items()}


def replay_stages(f: DirectMap, seen: list[Senses], timed: Stopwatches) -> None:
    """Give what arrived in a trial to the stages of the catcher, one by one."""
    ball = Scene().ball
    eyes, track = Eyes(fixed_rig()), BallFilter(known_ball(ball.drag, ball.mass))
    arm, follow = f.arm, partial(Tracker(f.arm, bandwidth=80.0).step, hand=0.0)
    for senses in seen:
        if not senses.frames or senses.t > STAGES_UNTIL:
            continue
        sighting = timed("  see", eyes.step, senses.frames)
        timed("  estimate", track.update, sighting)
        state = timed("  carry", track.state, senses.t)
        if not state.tracked:
            continue
        if senses.t < ADAPT_UNTIL:
            timed("  adapt (rarely)", f.adapt, state, arm.q_ready, np.zeros(arm.n))
        reference = timed("  generate", f.reference, state)
        wanted = np.array([reference.q_d, reference.dq_d, reference.ddq_d])
        timed("  track", follow, senses.arm, wanted)


def measure(throws: int, repeats: int) -> dict[str, Any]:
    """Return everything that is saved."""
    f = mitt.learn(mitt.load_arm("wam")).map
    source = source_of(
        f, seed=0, count=throws, throws_file=None, flights_file=None, drag=Scene().ball.drag
    )
    before = probe()
    seeing, told = (Bench(f.arm, Direct(f), Scene(), pixels=pixels) for pixels in (True, False))
    ticks, _ = take_turns((seeing, told), {}, source)
    return {
        "schema": SCHEMA,
        "version": mitt.__version__,
        "machine": f"{platform.machine()}, {os.cpu_count()} cores",
        "packages": {name: version(name) for name in ("numpy", "numba", "mujoco", "pin")},
        "throws": throws,
        "repeats": repeats,
        "tick_us": ticks[0].percentiles_us(),
        "tick_without_images_us": ticks[1].percentiles_us(),
        "pixels": trials(f, source, pixels=True, repeats=repeats),
        "points": trials(f, source, pixels=False, repeats=repeats),
        "stages_us": take_apart(f, source, repeats=repeats),
        "probe_us": percentiles(before + probe()),
    }


def show(result: dict[str, Any]) -> None:
    """Print what was measured."""
    print(f"mitt {result['version']}, {result['machine']}, {result['throws']} throws x "
          f"{result['repeats']} repeats, medians over the repeats")  # fmt: skip
    for name in ("pixels", "points"):
        trial, tick = result[name]["trial"], result[name]["tick_us"]
        print(f"{name}: {trial['throws_per_s_core']:.1f} throws per second and core, "
              f"{trial['wall_ms']:.0f} ms for {trial['simulated_ms']:.0f} ms simulated, "
              f"{trial['times_real_time']:.1f} times real time, "
              f"{trial['times_real_time_cpu']:.1f} by processor time\n        tick p50 "
              f"{tick['p50']:.0f}, p99 {tick['p99']:.0f}, p99.9 {tick['p99_9']:.0f} us, "
              f"{trial['late_per_1000_ticks']:.2f} of 1000 late")  # fmt: skip
    for name in ("tick_us", "tick_without_images_us"):
        us = result[name]
        print(f"{name}: p50 {us['p50']:.1f}, p99 {us['p99']:.1f}, p99.9 {us['p99_9']:.1f}")
    print(f"{'stage':22}{'p50':>9}{'p99':>9}{'p99.9':>9}  us")
    for name, us in (result["stages_us"] | {"probe": result["probe_us"]}).items():
        print(f"{name:22}{us['p50']:9.1f}{us['p99']:9.1f}{us['p99_9']:9.1f}")
    spread = max(result[name]["probe_spread"] for name in ("pixels", "points"))
    share = min(result[name]["trial"]["core_share"] for name in ("pixels", "points"))
    print(f"slowest probe over fastest {spread:.2f}, share of a core {share:.2f}"
          + " (a noisy machine)" * (spread > NOISY or share < SHARED))  # fmt: skip


def flat(tree: dict[str, Any], prefix: str = "") -> Numbers:
    """Return the numbers of nested objects by path."""
    out: Numbers = {}
    for name, value in tree.items():
        if isinstance(value, dict):
            out |= flat(value, f"{prefix}{name.strip()}.")
        elif isinstance(value, int | float):
            out[prefix + name] = float(value)
    return out


def compare(paths: list[Path]) -> int:
    """Print two saved files side by side; return the exit status."""
    try:
        a, b = (json.loads(path.read_text(encoding="utf-8")) for path in paths)
        if not a["schema"] == b["schema"] == SCHEMA:
            raise ValueError(f"wanted two files of schema {SCHEMA}")
    except (OSError, ValueError, KeyError, TypeError) as error:
        print(f"benchmarks/trial.py: {type(error).__name__}: {error}", file=sys.stderr)
        return 2
    one, two, pace = flat(a), flat(b), b["probe_us"]["p50"] / a["probe_us"]["p50"]
    print(f"A {paths[0]}\nB {paths[1]}\nprobe B/A {pace:.3f}; at par: as if it had been 1")
    print(f"{'':42}{'A':>10}{'B':>10}{'B/A':>8}{'at par':>8}")
    for name in one:
        if name not in two or one[name] <= 0.0 or name.endswith((".max", "throws", "repeats")):
            continue
        ratio = two[name] / one[name]
        timeless = name.endswith(("simulated_ms", "spread", "share", "late_per_1000_ticks"))
        par = ratio if timeless else ratio * pace if "times_real" in name else ratio / pace
        print(f"{name:42}{one[name]:10.2f}{two[name]:10.2f}{ratio:8.3f}{par:8.3f}")
    return 0


def main() -> int:
    """Measure and save, or compare."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n", 1)[0])
    for name, default in (("--throws", 10), ("--repeats", 5)):
        parser.add_argument(name, type=int, default=default, metavar="N")
    parser.add_argument("--out", type=Path, default=Path("runs/bench-trial.json"), metavar="JSON")
    parser.add_argument("--compare", type=Path, nargs=2, metavar=("A", "B"))
    options = parser.parse_args()
    if options.compare:
        return compare(options.compare)
    result = measure(max(options.throws, 1), max(options.repeats, 1))
    show(result)
    write_json(options.out, result)
    print(f"written: {options.out}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
