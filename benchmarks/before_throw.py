"""A ball that is seen in the thrower's hand before the throw: caught as if it had just appeared.

    python benchmarks/before_throw.py                          10 throws of each kind and rate
    python benchmarks/before_throw.py --throws 100 --rates 120,240,500,1000

The WAM with ``paper``, points with 1 mm of noise; what the hand does before is in
tests/thrower_hands.py. ``none`` is the same throws without the hand. The arm does exactly what its
model says; caught is a ball that comes within 20 mm of the hand, which brakes for it.
"""

import argparse
import sys
from pathlib import Path
from time import process_time

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
from exact_plant import SETTINGS
from thrower_hands import KINDS, thrown

from mitt.core.catcher.catcher import Catcher
from mitt.core.catcher.generators import Direct
from mitt.core.map.neighbourhood import learn
from mitt.io.arm_file import load_arm
from mitt.lab.trials.source import source_of
from mitt.lab.trials.statistics import wilson
from mitt.lab.world.throws import Throw


def main() -> None:
    """Throw and print."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n", 1)[0])
    parser.add_argument("--throws", type=int, default=10, metavar="N", help="of each")
    parser.add_argument("--rates", default="120,1000", metavar="HZ,...")
    parser.add_argument("--kinds", default=",".join(KINDS), metavar="A,B,...")
    parser.add_argument("--seed", type=int, default=77, metavar="S")
    options = parser.parse_args()
    arm = load_arm("wam", limits="paper")
    generator = Direct(learn(arm).map)
    first = Catcher(arm, generator, settings=SETTINGS)
    source = source_of(arm, seed=options.seed, count=options.throws, drag=0.0)
    for rate in (float(x) for x in options.rates.split(",")):
        for kind in options.kinds.split(","):
            caught, begun = 0, process_time()
            for k in range(options.throws):
                ball = source.ball(k)
                assert isinstance(ball, Throw)
                caught += thrown(first.again(generator), arm, ball, kind=kind, rate=rate, seed=k)[0]
            low, high = wilson(caught, options.throws)
            took = process_time() - begun
            print(
                f"{rate:6.0f} Hz {kind:7s} caught {caught} of {options.throws}"
                f" [{low:.3f}, {high:.3f}]  {took:.0f} s",
                flush=True,
            )


if __name__ == "__main__":
    main()
