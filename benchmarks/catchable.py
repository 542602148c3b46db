r"""What the direct map catches of what can be caught, and whether its verdict is right.

    python benchmarks/catchable.py --throws 1000 --seed 40000 --limits paper --workers 2
    python benchmarks/catchable.py --conditions all --limits all --throws 100 --seed 80000 \
        --vision points --oracle 10 --sample 0
    python benchmarks/catchable.py --arm DESIGN.toml --throws 200 --seed 82000 --vision points

Each throw is given to the direct map. What the map does not catch, and a random share of what it
catches, is given to the clairvoyant optimum as well: same ball, plant, hand and noise. A throw
counts as catchable where the clairvoyant's plan, run, catches it within all limits; of the throws
that the map catches that share is estimated from the sample. ``--oracle`` bounds how many throws
of a condition go to the clairvoyant, which takes seconds for each; balls that the hand let go are
then not among them. Conditions are ``default`` and
those of the study show-throws; an arm file, as ``mitt design`` writes it, has its own limits and
throws. Prints a JSON object a line, one for each condition, and with
several a last one of all together.
"""

import argparse
import json
import sys
from collections.abc import Callable, Iterator
from functools import lru_cache, partial
from pathlib import Path

from oracle import Row, counted, is_sampled, judged, parallel

from mitt.core.catcher.generators import Generator
from mitt.core.map.learn import Learned
from mitt.core.map.neighbourhood import learn, neighbourhood_of_ball
from mitt.io.arm_file import ArmSpec, ThrowSettings
from mitt.lab.rivals.clairvoyant import make_clairvoyant
from mitt.lab.trials.catch_study import CatchCondition, read_catch_study
from mitt.lab.trials.registry import make_generator
from mitt.lab.trials.runner import TrialRunner
from mitt.lab.trials.score import Trial
from mitt.lab.trials.source import source_of, widened
from mitt.lab.world.scene import read_scene

#: Share of the throws that the map catches which are given to the clairvoyant as well.
SAMPLE = 0.05
LIMITS = ("paper", "wam-80v", "wam-48v")
STUDY = "show-throws"


def of_arm_file(path: str, scene: str) -> CatchCondition:
    """Return the throws that an arm file asks for, at its arm and map."""
    arm = ArmSpec(arm=path)
    throws = arm.read().throws or ThrowSettings()
    return CatchCondition(
        name=path,
        disturbance="default",
        counts={},
        arm=arm,
        scene=read_scene(scene),
        vision="pixels",
        throws=throws,
    )


def conditions(limits: str, names: str, scene: str) -> Iterator[CatchCondition]:
    """Return the conditions of a limit set that are wanted; names of the study without the set."""
    wanted = names.split(",")
    if "default" in wanted:
        arm = ArmSpec.model_validate({"limits": limits})
        yield CatchCondition(
            name="default",
            disturbance="default",
            counts={},
            arm=arm,
            scene=read_scene(scene),
            vision="pixels",
        )
    for condition in read_catch_study(Path(STUDY), generators=("direct",)).conditions:
        name = " ".join(condition.name.replace(limits, "").split())
        if condition.arm.limits == limits and (names == "all" or name in wanted):
            yield condition.model_copy(update={"name": name})


@lru_cache(maxsize=len(LIMITS))
def learned(settings: ArmSpec, drag: float) -> Learned:
    """Return the map of an arm for a ball, as ``mitt catch`` learns it; once in a process."""
    chosen = settings.read()
    return learn(chosen.arm, design=chosen.design, around=neighbourhood_of_ball(drag))


def part(options: argparse.Namespace, condition: CatchCondition, number: int) -> list[Row]:
    """Run one worker's share of the throws of a condition."""
    scene, pixels = condition.scene, options.vision == "pixels"
    f = learned(condition.arm, scene.ball.drag).map
    source = source_of(f.arm, seed=options.seed, count=options.throws, drag=scene.ball.drag)
    source = widened(source, condition.throws)
    made = make_generator(options.generator, f)

    def thrower(generator: Generator) -> Callable[[int], Trial]:
        runner = TrialRunner(f.arm, generator, scene, pixels=pixels)
        return lambda index: runner.throw(source, index).trial

    by_map, by_optimum = thrower(made), thrower(make_clairvoyant(f))
    rows: list[Row] = []
    left = options.oracle // options.workers
    for k in range(number, options.throws, options.workers):
        sampled = is_sampled(options.seed, k, options.sample)
        thrifty = options.oracle < sys.maxsize
        row = judged(by_map, by_optimum, k, sampled=sampled, oracle=left > 0, thrifty=thrifty)
        rows.append(row | {"condition": f"{f.arm.limits.name} {condition.name}"})
        left -= rows[-1]["clairvoyant"] is not None
    return rows


def run(options: argparse.Namespace, condition: CatchCondition) -> list[Row]:
    """Run all throws of a condition."""
    return parallel(partial(part, options, condition), options.workers)


def say(options: argparse.Namespace, limits: str, name: str, rows: list[Row]) -> None:
    """Print what some throws come to."""
    head = {
        "limits": limits,
        "condition": name,
        "seed": options.seed,
        "generator": options.generator,
        "vision": options.vision,
    }
    print(json.dumps({**head, **counted(rows)}), flush=True)


def main() -> None:
    """Measure and print a JSON object a line."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n", 1)[0])
    parser.add_argument("--throws", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=40000)
    parser.add_argument("--limits", default="paper", choices=(*LIMITS, "all"))
    parser.add_argument("--conditions", default="default", help="names with commas, or all")
    parser.add_argument("--scene", default="lab", help="of the condition default")
    parser.add_argument("--vision", default="pixels", choices=("pixels", "points"))
    parser.add_argument("--generator", default="direct", choices=("direct", "single"))
    parser.add_argument("--sample", type=float, default=SAMPLE)
    parser.add_argument("--oracle", type=int, default=sys.maxsize)
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--arm", help="an arm file, instead of limits and conditions of the WAM")
    options = parser.parse_args()
    if options.arm:
        condition = of_arm_file(options.arm, options.scene)
        limits = learned(condition.arm, condition.scene.ball.drag).map.arm.limits.name
        say(options, limits, condition.name, run(options, condition))
        return
    total: list[Row] = []
    for limits in LIMITS if options.limits == "all" else (options.limits,):
        for condition in conditions(limits, options.conditions, options.scene):
            rows = run(options, condition)
            say(options, limits, condition.name, rows)
            total += rows
    if options.conditions != "default":
        say(options, options.limits, "all together", total)


if __name__ == "__main__":
    main()
