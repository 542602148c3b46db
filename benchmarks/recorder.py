"""What recording costs a live loop: microseconds a tick, and megabytes a throw.

    python benchmarks/recorder.py              20 throws each, points and images, in real time

A catcher runs in the simulated world, one tick each millisecond; measured is the call
``Recorder.tick`` in it. The writer shares the machine with the loop.
"""

import argparse
from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter_ns, sleep

import numpy as np

import mitt
from mitt.clock import uncollected
from mitt.core.catcher.generators import Direct
from mitt.core.map.mapping import DirectMap
from mitt.lab.trials.runner import LONGEST, TrialRunner
from mitt.lab.trials.score import HELD_AFTER
from mitt.lab.trials.source import source_of
from mitt.lab.world.scene import read_scene
from mitt.robot.cell.recorder import Recorder

SEED = 80_000


def measured(f: DirectMap, throws: int, *, images: bool) -> None:
    """Print what recording costs with points, or with images."""
    scene = read_scene("lab")
    runner = TrialRunner(f.arm, Direct(f), scene, pixels=images)
    source, about = source_of(f.arm, seed=SEED, count=throws, drag=scene.ball.drag), None
    about = runner.about("direct", f)
    costs, ticks, size, dropped, fullest = [], 0, 0, 0, 0.0
    with TemporaryDirectory() as folder:
        for k in range(throws):
            path = Path(folder) / f"{k}.mcap"
            with Recorder(path, about, images=images) as recorder, uncollected():
                catcher = runner.release(source.ball(k), seed=source.trial_seed(k))
                due = perf_counter_ns()
                while not runner.world.over(longest=LONGEST, held=HELD_AFTER):
                    senses = runner.world.sense(look=catcher.looking)
                    command = catcher.step(senses)
                    runner.world.apply(command)
                    start = perf_counter_ns()
                    recorder.tick(senses, command, catcher.result)
                    costs.append(perf_counter_ns() - start)
                    catcher.think()
                    due += 1_000_000
                    sleep(max(due - perf_counter_ns(), 0) * 1e-9)
            ticks, size = ticks + recorder.count, size + path.stat().st_size
            dropped, fullest = dropped + recorder.dropped, max(fullest, recorder.fullest)
    us = np.percentile(np.array(costs) * 1e-3, [50.0, 99.0, 99.9, 100.0])
    print(
        f"{'images' if images else 'points'}: {throws} throws, {ticks} ticks; "
        f"p50 {us[0]:.1f}, p99 {us[1]:.1f}, p99.9 {us[2]:.1f}, max {us[3]:.1f} us a tick; "
        f"{1e-6 * size / throws:.2f} MB a throw; {dropped} dropped, ring {100 * fullest:.0f} % full"
    )


def main() -> None:
    """Measure both."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--throws", type=int, default=20)
    options = parser.parse_args()
    f = mitt.learn(mitt.load_arm("wam", limits="paper")).map
    for images in (False, True):
        measured(f, options.throws, images=images)


if __name__ == "__main__":
    main()
