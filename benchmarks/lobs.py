r"""When the hand closes around steep lobs, and what becomes of them.

    python benchmarks/lobs.py --lobs 300 --seed 1 --limits paper
    python benchmarks/lobs.py --lobs 300 --seed 1 --limits wam-48v

Balls that are tossed up near the arm and fall into its region at 1.2 to 1.5 rad below the level,
seen as points. Only balls that the verdict does not refuse count. Prints a JSON object: how many
were caught, dropped, missed, stopped and refused, and by how much the fingers began to close off
their lead before the catch [ms].
"""

import argparse
import json
from collections import Counter

import numpy as np

from mitt.arm.hands import HandModel
from mitt.arm.load import build_arm
from mitt.ball.flight import advance
from mitt.catcher.generators import Direct
from mitt.map.mapping import DirectMap
from mitt.trials.learning import learn
from mitt.trials.runner import TrialRunner
from mitt.world.scene import Scene
from mitt.world.throws import Throw

#: Ranges of the catch: angles about the nominal ones [rad], speed [m/s], descent below the level
#: and azimuth [rad]; duration of the flight before it [s].
AROUND, SPEED, DESCENT, AZIMUTH, DURATION = 0.25, (1.5, 6.0), (1.2, 1.5), 0.3, (0.35, 0.8)
#: Step of the way back [s]; distance that it keeps from the waiting hand, over the ground and above
#: it, but in the end [m, s]; least height [m].
STEP, CLEAR, LAST, FLOOR = 0.01, 0.3, 0.1, -0.7


def lob(f: DirectMap, rng: np.random.Generator, drag: float) -> Throw:
    """Return a ball that falls steeply through a random point of a map's region.

    On its way it comes from above the floor, and not through the arm that waits.
    """
    hand = f.arm.position(f.arm.q_ready)
    while True:
        aside = rng.uniform(-AROUND, AROUND, f.arm.n)
        aside[f.design.catch_joint] = 0.0
        speed, down, turn = (
            rng.uniform(*SPEED),
            rng.uniform(*DESCENT),
            rng.uniform(-AZIMUTH, AZIMUTH),
        )
        level = np.array([-np.cos(turn), -np.sin(turn)])
        r = f.arm.position(f.start + aside)
        dr = speed * np.array([*np.cos(down) * level, -np.sin(down)])
        steps, clear = int(rng.uniform(*DURATION) / STEP), True
        for k in range(steps):
            advance(r, dr, drag, -STEP)
            near = np.hypot(*(r - hand)[:2]) < CLEAR and r[2] < hand[2] + CLEAR
            clear &= r[2] > FLOOR and not (near and k * STEP > LAST)
        if clear:
            return Throw(r=r.copy(), dr=dr.copy())


def off_lead(runner: TrialRunner, t_catch: float, lead: float) -> float:
    """Return by how much the fingers of the last trial closed off their lead [s]; NaN if never."""
    s = runner.ticks.scalars
    closing = np.flatnonzero(s["hand"] > 0.0)
    return float(t_catch - lead - s["t"][closing[0]]) if len(closing) else np.nan


def main() -> None:
    """Throw and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--lobs", type=int, default=300)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--limits", default="paper")
    options = parser.parse_args()
    scene, arm = Scene(), build_arm("wam", limits=options.limits)
    f = learn(arm).map
    hand = arm.model.hand
    lead = hand.closing_time(scene.ball.radius) if isinstance(hand, HandModel) else 0.0
    runner, rng = (
        TrialRunner(arm, Direct(f), scene, pixels=False),
        np.random.default_rng(options.seed),
    )
    counts, off, drawn = Counter[str](), list[float](), 0
    while counts.total() - counts["unreachable"] < options.lobs:
        trial = runner.run(drawn, lob(f, rng, scene.ball.drag), seed=drawn).trial
        counts[trial.status] += 1
        drawn += 1
        if trial.t_catch_s is not None:
            off.append(off_lead(runner, trial.t_catch_s, lead))
    known = 1e3 * np.array([x for x in off if np.isfinite(x)])
    points = dict(
        zip(("p1", "p50", "p99"), np.percentile(known, [1, 50, 99]).round(2), strict=True)
    )
    largest = {"min": float(known.min().round(2)), "max": float(known.max().round(2))}
    print(json.dumps({"limits": options.limits, **counts, "off_lead_ms": {**points, **largest}}))


if __name__ == "__main__":
    main()
