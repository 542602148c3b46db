"""Which map for which limits: every design of a grid learned and held against the limits.

    python benchmarks/designs.py --limits wam-80v             the grid, and the design it gives
    python benchmarks/designs.py --limits wam-80v --verify 60 and so many throws with that design

Designs are learned on one set of flights and judged on another, with the belief at t_0 as wrong
as it is in a throw. Of those that keep every limit with margin and let the ball in near the palm's
normal, the gentlest is chosen (mitt.generator.select). Seeds below 1000 are for tuning.
"""

import argparse
from itertools import product

import numpy as np

from mitt.errors import InputError
from mitt.generator.design import MapDesign
from mitt.generator.mapping import unlearned
from mitt.generator.select import Assessment, Choice, assess, choose
from mitt.robot.arm import Arm
from mitt.robot.hands import HandModel
from mitt.robot.load import load_arm
from mitt.trials.learning import learn
from mitt.trials.neighbourhood import Neighbourhood, neighbourhood
from mitt.trials.simulate import simulate
from mitt.trials.statistics import wilson

#: The grid: catch joint, q_alpha [rad], inward, kappa.
ELBOW = tuple(
    product(
        (2,), (0.3, 0.6, 0.9, 1.2, np.pi / 2), (0.0, 0.3, 0.75, 1.0, 1.5, 2.0, 3.0, 4.0), (1.0,)
    )
)
CROSSING = ((2, np.pi / 2, 0.0, 1.5), (2, np.pi / 2, 0.0, 3.0), (2, np.pi / 2, 0.0, 5.0))
SHOULDER = tuple(product((1,), (1.0, 1.3), (0.0, 1.0, 3.0), (1.0,)))
#: Flights to learn from and to judge by, and the seed of the latter.
LEARN = Neighbourhood()
JUDGE = Neighbourhood(flights=100, kicked=0.0, bounced=0.0)
SEED = 7


def assessed(arm: Arm, design: MapDesign) -> Assessment | None:
    """Learn a design and judge it; None where no flight lies in its domain."""
    flights = neighbourhood(unlearned(arm, design), np.random.default_rng(SEED), JUDGE)
    try:
        learned = learn(arm, design=design, around=LEARN)
    except InputError:
        return None
    return assess(learned.map, flights) if len(flights) == JUDGE.flights else None


def row(a: Assessment) -> str:
    """Return one line of the table."""
    d, able = a.design, a.able(Choice())
    shares = [min(x, 99.0) for x in np.percentile(a.share, [50, 95], method="lower")]
    return (
        f"{d.catch_joint:>2} {d.q_catch:5.2f} {d.inward:6.2f} {d.kappa:5.1f} {able:6.2f}"
        f" {shares[0]:7.2f} {shares[1]:6.2f} {a.speed.mean():6.2f}"
        f" {np.rad2deg(a.angle.mean()):6.0f}  {a.binds}"
    )


def main() -> None:
    """Learn the grid, print it, choose."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--limits", default="wam-80v")
    parser.add_argument("--verify", type=int, default=0, metavar="N")
    parser.add_argument("--seed", type=int, default=400)
    options = parser.parse_args()
    arm = load_arm("wam", limits=options.limits, hand=HandModel())
    print(" i q_alpha inward kappa  able  share50    95  m/s  deg  binds")
    found = []
    for i, q_catch, inward, kappa in (*ELBOW, *CROSSING, *SHOULDER):
        a = assessed(arm, MapDesign(catch_joint=i, q_catch=q_catch, inward=inward, kappa=kappa))
        if a is not None:
            found.append(a)
            print(row(a), flush=True)
    best = choose(found).design
    print(f"chosen: {best}")
    if options.verify:
        f = learn(arm, design=best).map
        trials = simulate(f, throws=options.verify, seed=options.seed, pixels=False)
        caught = sum(trial.status == "caught" for trial in trials)
        low, high = wilson(caught, len(trials))
        print(f"caught {caught} of {len(trials)} (95 % {100 * low:.1f} to {100 * high:.1f} %)")


if __name__ == "__main__":
    main()
