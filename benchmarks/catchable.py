r"""What the direct map catches of what can be caught, and whether its verdict is right.

    python benchmarks/catchable.py --throws 1000 --seed 40000 --limits paper --workers 2
    python benchmarks/catchable.py --throws 200 --seed 40000 --limits all --conditions all \
        --vision points --oracle 10 --workers 2

Each throw is given to the direct map. What the map does not catch, and a random share of what it
catches, is given to the clairvoyant optimum as well: same ball, plant, hand and noise. A throw
counts as catchable where the clairvoyant's plan, run, catches it within all limits; of the throws
that the map catches that share is estimated from the sample. ``--oracle`` bounds how many throws
of a condition go to the clairvoyant, which takes seconds for each. Prints a JSON object a line, one
for each limit set and condition.
"""

import argparse
import json
import sys
from dataclasses import dataclass, field, replace
from functools import partial

from mitt.rivals.clairvoyant import make_clairvoyant
from mitt.robot.load import load_arm
from mitt.study.lesson import learn
from mitt.study.registry import make_generator
from mitt.study.source import source_for
from mitt.study.trial import Bench
from mitt.study.yardstick import Row, counted, is_sampled, judged, parallel, thrown
from mitt.world.scene import Ball, Scene
from mitt.world.throws import ThrowRanges

#: Share of the throws that the map catches which are given to the clairvoyant as well.
SAMPLE = 0.05
LIMITS = ("paper", "wam-80v", "wam-48v")


@dataclass(frozen=True, slots=True)
class Condition:
    """Throws and ball of a condition."""

    throws: ThrowRanges = field(default_factory=ThrowRanges)
    ball: Ball = field(default_factory=Ball)


WIDE = ThrowRanges(distance=(2.0, 6.0), duration=(0.3, 0.9), height=(-0.4, 1.0))
CONDITIONS = {
    "default": Condition(),
    "3 to 3.7 m/s": Condition(
        replace(WIDE, speed=(3.0, 3.7), distance=(1.0, 2.2), duration=(0.4, 0.8))
    ),
    "3.7 to 5 m/s": Condition(replace(WIDE, speed=(3.7, 5.0), distance=(1.2, 3.0))),
    "7 to 9 m/s": Condition(replace(WIDE, speed=(7.0, 9.0), duration=(0.3, 0.7))),
    "9 to 10 m/s": Condition(replace(WIDE, speed=(9.0, 10.0), duration=(0.3, 0.7))),
    "flat": Condition(
        replace(WIDE, speed=(7.0, 9.0), distance=(2.5, 4.5), duration=(0.3, 0.45), height=(0, 0.5))
    ),
    "high": Condition(replace(WIDE, speed=(5.0, 9.0), distance=(2.0, 4.5), duration=(0.7, 1.1))),
    "60 degrees": Condition(ThrowRanges(azimuth=(-1.05, 1.05))),
    **{f"{mass:g} kg": Condition(ball=Ball(mass=mass)) for mass in (0.02, 0.2, 0.5, 1.0, 2.0)},
    **{f"drag {drag:g}": Condition(ball=Ball(drag=drag)) for drag in (0.0, 0.2, 0.5)},
}


def part(options: argparse.Namespace, limits: str, name: str, number: int) -> list[Row]:
    """Run one worker's share of the throws of a condition."""
    condition = CONDITIONS[name]
    f, scene = learn(load_arm("wam", limits=limits)).map, Scene(ball=condition.ball)
    source = source_for(f, seed=options.seed, count=options.throws, drag=scene.ball.drag)
    source = replace(source, ranges=condition.throws)
    pixels = options.vision == "pixels"
    made = make_generator(options.generator, f)
    by_map = partial(thrown, source, Bench(f.arm, made, scene, pixels=pixels))
    by_optimum = partial(thrown, source, Bench(f.arm, make_clairvoyant(f), scene, pixels=pixels))
    rows: list[Row] = []
    left = options.oracle // options.workers
    for k in range(number, options.throws, options.workers):
        sampled = is_sampled(options.seed, k, options.sample)
        rows.append(judged(by_map, by_optimum, k, sampled=sampled, oracle=left > 0))
        left -= rows[-1]["clairvoyant"] is not None
        if len(rows) % 50 == 0:
            print(f"{limits}, {name}, worker {number}: {len(rows)} throws", file=sys.stderr,
                  flush=True)  # fmt: skip
    return rows


def main() -> None:
    """Measure and print a JSON object a line."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n", 1)[0])
    parser.add_argument("--throws", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=40000)
    parser.add_argument("--limits", default="paper", choices=(*LIMITS, "all"))
    parser.add_argument("--conditions", default="default", help="names with commas, or all")
    parser.add_argument("--vision", default="pixels", choices=("pixels", "points"))
    parser.add_argument("--generator", default="direct", choices=("direct", "several"))
    parser.add_argument("--sample", type=float, default=SAMPLE)
    parser.add_argument("--oracle", type=int, default=sys.maxsize)
    parser.add_argument("--workers", type=int, default=1)
    options = parser.parse_args()
    names = list(CONDITIONS) if options.conditions == "all" else options.conditions.split(",")
    for limits in LIMITS if options.limits == "all" else (options.limits,):
        for name in names:
            rows = parallel(partial(part, options, limits, name), options.workers)
            head = {"limits": limits, "condition": name, "seed": options.seed,
                    "generator": options.generator, "vision": options.vision}  # fmt: skip
            print(json.dumps({**head, **counted(rows)}), flush=True)


if __name__ == "__main__":
    main()
