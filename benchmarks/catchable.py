"""What the direct map catches of what can be caught, and whether its verdict is right.

    python benchmarks/catchable.py --throws 1000 --seed 40000 --limits paper --workers 2

Each throw is seen in pixels and given to the direct map. What the map does not catch, and a random
share of what it catches, is given to the clairvoyant optimum as well: same ball, plant, hand and
noise. A throw counts as catchable where the clairvoyant's plan, run, catches it; of the throws that
the map catches that share is estimated from the sample. Prints one JSON object.
"""

import argparse
import json
import sys
from functools import partial

from mitt.rivals.clairvoyant import make_clairvoyant
from mitt.robot.load import load_arm
from mitt.study.lesson import learn
from mitt.study.registry import make_generator
from mitt.study.source import source_for
from mitt.study.trial import Bench
from mitt.study.yardstick import Row, counted, is_sampled, judged, parallel, thrown
from mitt.world.scene import Scene

#: Share of the throws that the map catches which are given to the clairvoyant as well.
SAMPLE = 0.05


def part(options: argparse.Namespace, number: int) -> list[Row]:
    """Run one worker's share of the throws."""
    f = learn(load_arm("wam", limits=options.limits)).map
    scene = Scene()
    source = source_for(f, seed=options.seed, count=options.throws, drag=scene.ball.drag)
    made = make_generator(options.generator, f)
    by_map = partial(thrown, source, Bench(f.arm, made, scene))
    by_optimum = partial(thrown, source, Bench(f.arm, make_clairvoyant(f), scene))
    rows: list[Row] = []
    for k in range(number, options.throws, options.workers):
        sampled = is_sampled(options.seed, k, options.sample)
        rows.append(judged(by_map, by_optimum, k, sampled=sampled))
        if len(rows) % 50 == 0 or rows[-1]["status"] != "caught":
            print(f"worker {number}: {len(rows)} throws, the last {rows[-1]}",
                  file=sys.stderr, flush=True)  # fmt: skip
    return rows


def main() -> None:
    """Measure and print one JSON object."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n", 1)[0])
    parser.add_argument("--throws", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=40000)
    parser.add_argument("--limits", default="paper", choices=("paper", "wam-48v", "wam-80v"))
    parser.add_argument("--generator", default="direct", choices=("direct", "several"))
    parser.add_argument("--sample", type=float, default=SAMPLE)
    parser.add_argument("--workers", type=int, default=1)
    options = parser.parse_args()
    rows = parallel(partial(part, options), options.workers)
    head = {"limits": options.limits, "seed": options.seed, "generator": options.generator}
    print(json.dumps({**head, **counted(rows)}, indent=1))


if __name__ == "__main__":
    main()
