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
from dataclasses import dataclass
from functools import partial
from itertools import product

import numpy as np

from mitt.generator.generators import Direct
from mitt.rivals.clairvoyant import Clairvoyant, Flight, make_clairvoyant
from mitt.rivals.surprised import Surprised
from mitt.robot.load import load_arm
from mitt.study.lesson import learn
from mitt.study.score import Trial
from mitt.study.source import Source, source_for
from mitt.study.trial import Bench
from mitt.study.yardstick import Row, counted, is_sampled, judged, parallel, thrown
from mitt.world.scene import Scene
from mitt.world.simulation import World

#: Changes of the velocity [m/s] and shares of the flight.
KICKS, SHARES = (0.5, 1.0), (0.5, 0.7, 0.85)
#: Share of the caught throws that are given to the clairvoyant as well.
SAMPLE = 0.05
#: Step in which the kick is looked for [s], and until when.
_STEP, _LONGEST = 0.001, 1.5


@dataclass(frozen=True)
class Cell:
    """Balls kicked by so much at such a share of their flight, and who catches them.

    Attributes:
        plain: The clairvoyant, told nothing yet.
        clean: A world without kicks.
        kicked: A bench of the map with them.
        scene: Their scene.
    """

    plain: Clairvoyant
    clean: World
    kicked: Bench
    scene: Scene

    def surprised(self, source: Source, index: int) -> Trial:
        """Run a throw by the clairvoyant that is told of the kick when it happens."""
        ball, seed, arm = source.ball(index), source.trial_seed(index), self.kicked.arm
        flights: list[Flight] = []
        for world in (self.clean, self.kicked.world):
            world.reset(ball, seed)
            flights.append(world.flight)
        before, after = (self.plain.told(flight) for flight in flights)
        told = Surprised(before=before, after=after, when=parting(*flights))
        return Bench(arm, told, self.scene).run(index, ball, seed=seed).trial


def parting(one: Flight, other: Flight) -> float:
    """Return when the velocities of two flights part [s]."""
    instants = np.arange(0.0, _LONGEST, _STEP)
    apart = [float(np.linalg.norm(one(t)[1] - other(t)[1])) > 0.1 for t in instants.tolist()]
    return float(instants[int(np.argmax(apart))])


def part(options: argparse.Namespace, number: int) -> list[Row]:
    """Run one worker's share of all cells."""
    f = learn(load_arm("wam", limits=options.limits)).map
    source = source_for(f, seed=options.seed, count=options.throws, drag=Scene().ball.drag)
    plain, clean = make_clairvoyant(f), Bench(f.arm, Direct(f), Scene()).world
    rows: list[Row] = []
    for kick, share in product(KICKS, SHARES):
        faults = [{"kind": "kick", "magnitude": kick, "share": share}]
        scene = Scene.model_validate({"faults": faults})
        cell = Cell(plain, clean, Bench(f.arm, Direct(f), scene), scene)
        by_map = partial(thrown, source, cell.kicked)
        for k in range(number, options.throws, options.workers):
            sampled = is_sampled(options.seed, k, SAMPLE)
            row = judged(by_map, partial(cell.surprised, source), k, sampled=sampled)
            rows.append({"kick": kick, "share": share, **row})
    return rows


def main() -> None:
    """Measure and print one JSON object."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n", 1)[0])
    parser.add_argument("--throws", type=int, default=200)
    parser.add_argument("--seed", type=int, default=44000)
    parser.add_argument("--limits", default="paper", choices=("paper", "wam-48v", "wam-80v"))
    parser.add_argument("--workers", type=int, default=1)
    options = parser.parse_args()
    rows, cells = parallel(partial(part, options), options.workers), []
    for kick, share in product(KICKS, SHARES):
        here = [row for row in rows if (row["kick"], row["share"]) == (kick, share)]
        cells.append({"kick": kick, "share": share, **counted(here)})
    print(json.dumps({"limits": options.limits, "seed": options.seed, "cells": cells}, indent=1))


if __name__ == "__main__":
    main()
