"""How many balls kicked in flight are caught, of those that could still be caught.

    python benchmarks/kicks.py --throws 200 --seed 44000 --workers 2

The ball's velocity changes at once, in a random direction, after a share of the time until it is
nearest to the waiting hand; the catcher sees pixels. What the direct map does not catch, and a
random share of what it catches, is run again by a clairvoyant that plans for the flight as it would
have been, is told of the kick when it happens, and plans anew from the state that its arm is in
then. Prints a line a cell, and one JSON object at the end.
"""

import argparse
import json
import sys
from functools import partial
from itertools import product

import numpy as np

from mitt.generator.generators import Direct
from mitt.generator.mapping import DirectMap
from mitt.rivals.clairvoyant import Flight, make_clairvoyant
from mitt.rivals.surprised import Surprised
from mitt.robot.load import load_arm
from mitt.study.lesson import learn
from mitt.study.score import Trial
from mitt.study.source import Source, source_for
from mitt.study.trial import Bench
from mitt.study.yardstick import Row, counted, is_sampled, judged, parallel, thrown
from mitt.world.scene import Scene

#: Changes of the velocity [m/s] and shares of the flight.
KICKS, SHARES = (0.5, 1.0), (0.5, 0.7, 0.85)
#: Share of the caught throws that are given to the clairvoyant as well.
SAMPLE = 0.05
#: Step in which the kick is looked for [s], and until when.
_STEP, _LONGEST = 0.001, 1.5


def surprised(f: DirectMap, scene: Scene, source: Source, index: int) -> Trial:
    """Run a kicked throw by the clairvoyant that is told of the kick when it happens."""
    ball, seed = source.ball(index), source.trial_seed(index)
    flights: list[Flight] = []
    for known in (Scene(), scene):
        world = Bench(f.arm, Direct(f), known).world
        world.reset(ball, seed)
        flights.append(world.flight)
    plain = make_clairvoyant(f)
    told = Surprised(
        before=plain.told(flights[0]), after=plain.told(flights[1]), when=parting(*flights)
    )
    return Bench(f.arm, told, scene).run(index, ball, seed=seed).trial


def parting(one: Flight, other: Flight) -> float:
    """Return when the velocities of two flights part [s]."""
    instants = np.arange(0.0, _LONGEST, _STEP)
    apart = [float(np.linalg.norm(one(t)[1] - other(t)[1])) > 0.1 for t in instants.tolist()]
    return float(instants[int(np.argmax(apart))])


def part(options: argparse.Namespace, kick: float, share: float, number: int) -> list[Row]:
    """Run one worker's share of a cell."""
    f = learn(load_arm("wam", limits=options.limits)).map
    source = source_for(f, seed=options.seed, count=options.throws, drag=Scene().ball.drag)
    faults = [{"kind": "kick", "magnitude": kick, "share": share}]
    scene = Scene.model_validate({"faults": faults})
    by_map = partial(thrown, source, Bench(f.arm, Direct(f), scene))
    by_optimum = partial(surprised, f, scene, source)
    return [
        judged(by_map, by_optimum, k, sampled=is_sampled(options.seed, k, SAMPLE))
        for k in range(number, options.throws, options.workers)
    ]


def main() -> None:
    """Measure, print a line a cell, and one JSON object."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n", 1)[0])
    parser.add_argument("--throws", type=int, default=200)
    parser.add_argument("--seed", type=int, default=44000)
    parser.add_argument("--limits", default="paper", choices=("paper", "wam-48v", "wam-80v"))
    parser.add_argument("--workers", type=int, default=1)
    options = parser.parse_args()
    cells = []
    for kick, share in product(KICKS, SHARES):
        found = counted(parallel(partial(part, options, kick, share), options.workers))
        cells.append({"kick": kick, "share": share, **found})
        rate = found["caught_of_catchable"]
        print(
            f"{kick:g} m/s at {share:.0%}: caught {found['caught']} of {found['throws']}, of the "
            f"catchable {rate['rate']:.3f} [{rate['low']:.3f}, {rate['high']:.3f}]",
            file=sys.stderr,
            flush=True,
        )
    print(json.dumps({"limits": options.limits, "seed": options.seed, "cells": cells}, indent=1))


if __name__ == "__main__":
    main()
