"""False alarms: throws without any fault, with arms unlike their models; no throw may be stopped.

    python benchmarks/alarms.py                                all arms, 100 throws each
    python benchmarks/alarms.py --throws 2000 --workers 2      10,000 throws
    python benchmarks/alarms.py --arms panda,so101 --seed 9000 --json alarms.json

Balls are seen as points. Every third group of throws follows the map with alpha = 0, which refuses
nothing and asks for more torque than there is, so that arms move that refuse what is thrown, and
drives saturate. Every ``GROUP`` throws have a plant of their own: mass and inertia of the
links up to 20 % off, viscous and dry friction up to 5 and 10 % of the weakest joint's torque (2 N m
at most), 0 to 3 ticks of latency of the eyes and 0 to 2 of the drives, encoders of 1e-6 to 1e-3
rad, one in four of them exact. These widths are choices of this project.
"""

import argparse
import json
from collections import Counter
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
from arms import SETUPS, WAM, named

from mitt.core.arm.arm import Arm
from mitt.core.catcher.generators import Direct, Unoptimised
from mitt.core.map.mapping import DirectMap, unlearned
from mitt.core.map.neighbourhood import learn
from mitt.lab.trials.runner import TrialRunner
from mitt.lab.trials.score import reason_of
from mitt.lab.trials.source import aim_of
from mitt.lab.trials.statistics import wilson
from mitt.lab.world.scene import Scene
from mitt.lab.world.throws import default_throw

SEED = 9000
#: Throws with one plant's widths, and with one process.
GROUP = 20
#: Of so many groups one follows the map with alpha = 0.
PLAIN = 3

Table = dict[str, Any]


def drawn_scene(arm: Arm, rng: np.random.Generator) -> Scene:
    """Draw how far the plants of some throws may be from their model."""
    weakest, fastest = float(arm.tau_max.min()), float(arm.dq_max.max())
    step = 0.0 if rng.random() < 0.25 else float(10.0 ** rng.uniform(-6.0, -3.0))
    mismatch = {
        "mass": rng.uniform(0.0, 0.2),
        "drag": 0.1,
        "ball_mass": rng.uniform(0.0, 0.2),
        "viscous": rng.uniform(0.0, 0.05 * weakest / fastest),
        "coulomb": rng.uniform(0.0, min(0.1 * weakest, 2.0)),
    }
    sensing = {"latency": int(rng.integers(0, 4)), "encoder_step": step}
    actuation = {"delay": int(rng.integers(0, 3)), "bandwidth": float(rng.choice([0.0, 500.0]))}
    return Scene.model_validate({"mismatch": mismatch, "sensing": sensing, "actuation": actuation})


def group(name: str, f: DirectMap, number: int, count: int, seed: int) -> Table:
    """Throw with one scene; return what became of the throws."""
    seed += 1000 * number
    rng = np.random.default_rng(seed)
    scene, aim = drawn_scene(f.arm, rng), aim_of(f.arm)
    plain = number % PLAIN == PLAIN - 1
    generator = Unoptimised(unlearned(f.arm, f.design)) if plain else Direct(f)
    runner = TrialRunner(f.arm, generator, scene, pixels=False)
    out: Table = {"arm": name, "status": [], "alarms": [], "violations": []}
    for k in range(count):
        trial = runner.run(k, default_throw(rng, aim), seed=seed + k).trial
        out["status"].append(trial.status)
        out["violations"].append(trial.limit_violations)
        if trial.stopped_by is not None:
            where = {"seed": seed, "throw": k, "scene": scene.model_dump(mode="json")}
            out["alarms"].append((reason_of(trial.stopped_by), where))
    return out


def summed(name: str, parts: list[Table]) -> Table:
    """Print and return the row of an arm."""
    status = Counter(x for part in parts for x in part["status"])
    alarms = [x for part in parts for x in part["alarms"]]
    bad = [x for part in parts for x in part["violations"]]
    throws = len(bad)
    low, high = wilson(len(alarms), throws)
    print(
        f"{name:10s}{throws:6d} throws   {len(alarms)} alarms [{low:.5f}, {high:.5f}]"
        f" {dict(Counter(reason for reason, _ in alarms))}   {sum(bad)} ticks beyond a limit in"
        f" {sum(x > 0 for x in bad)}   {dict(status)}",
        flush=True,
    )
    return {"throws": throws, "alarms": alarms, "ticks": sum(bad), "status": dict(status)}


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n", 1)[0])
    parser.add_argument("--throws", type=int, default=100, metavar="N", help="of each arm")
    parser.add_argument("--arms", default=",".join((*WAM, *SETUPS)), metavar="A,B,...")
    parser.add_argument("--seed", type=int, default=SEED, metavar="S")
    parser.add_argument("--workers", type=int, default=1, metavar="N")
    parser.add_argument("--json", type=Path, metavar="FILE")
    options = parser.parse_args()
    tables, begun = {}, perf_counter()
    with ProcessPoolExecutor(options.workers, mp_context=get_context("spawn")) as pool:
        for name in options.arms.split(","):
            arm, design = named(name)
            f = learn(arm, design=design).map
            sizes = [min(GROUP, options.throws - k) for k in range(0, options.throws, GROUP)]
            jobs = [
                pool.submit(group, name, f, number, size, options.seed)
                for number, size in enumerate(sizes)
            ]
            tables[name] = summed(name, [job.result() for job in jobs])
    print(f"{perf_counter() - begun:.0f} s")
    if options.json:
        options.json.write_text(json.dumps(tables))


if __name__ == "__main__":
    main()
